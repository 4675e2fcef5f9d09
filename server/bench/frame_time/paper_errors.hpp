// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "bench/accuracy/converged_history.hpp"
#include "bench/accuracy/error_regions.hpp"

namespace emit::tool {

/// Image of a run that is compared with the converged history.
struct JudgedFrame {
  reference::SolveView view;
  std::vector<float> temperature_k;
};

/// Errors over all frames of a run together.
struct PaperErrors {
  ErrorSummary surface;  ///< away from outlines
  ErrorSummary outline;  ///< within a pixel of one
};

/// Converged images of one scene. Each is computed once, however many runs share it.
class PaperReference {
 public:
  /// Creates the reference. Errors: those of ConvergedHistory.
  [[nodiscard]] static physics::Result<PaperReference> create(const scene::ScenarioDesc& scenario,
                                                              std::string label,
                                                              std::uint32_t pixels);

  /// Compares frames with the reference. Errors: those of ConvergedHistory::picture().
  /// @pre every frame has a temperature for every pixel of its view
  [[nodiscard]] physics::Result<PaperErrors> judge(std::span<const JudgedFrame> frames);

  [[nodiscard]] std::string describe() const { return history_.describe(options_); }

 private:
  struct Picture {
    reference::SolveView view;
    std::vector<ConvergedPixel> pixels;
  };

  PaperReference(ConvergedHistory history, std::string label, std::uint32_t pixels);
  /// Returns an index into pictures_.
  [[nodiscard]] physics::Result<std::size_t> picture_of(const reference::SolveView& view);

  ConvergedHistory history_;
  std::string label_;
  ConvergedOptions options_;
  std::vector<Picture> pictures_;
};

}  // namespace emit::tool
