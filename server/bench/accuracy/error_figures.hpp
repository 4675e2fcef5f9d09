// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/solve.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// Figures that show where a model errs: temperatures of the reference and of each model side by
/// side, their differences, and temperature profiles along one row and one column of the image.
/// Setup only. The caller keeps the reference alive.
class ErrorFigures {
 public:
  ErrorFigures(std::string scene, const reference::SolveView& view,
               const reference::SolvedImage& truth)
      : scene_(std::move(scene)), view_(view), truth_(truth) {}

  void add(std::string model, std::span<const float> temperature_k);

  /// Writes SCENE_images.png (reference, models; below them the differences on a scale of +-3 K)
  /// and SCENE_profiles.svg. Errors: io.
  [[nodiscard]] physics::Result<void> write(const std::filesystem::path& directory,
                                            const scene::DisplayOptions& display) const;

 private:
  struct ModelImage {
    std::string model;
    std::vector<float> temperature_k;
  };
  /// Finds the row and column with the largest spread of reference temperatures.
  void choose_lines(std::uint32_t& row, std::uint32_t& column) const;

  std::string scene_;
  reference::SolveView view_;
  const reference::SolvedImage& truth_;
  std::vector<ModelImage> models_;
};

}  // namespace emit::tool
