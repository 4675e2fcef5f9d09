// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/solve.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

struct ConvergedOptions {
  /// Surface pixels away from outlines, spread evenly over the image. An image that has fewer is
  /// taken whole.
  std::uint32_t pixels = 20'000;
  /// Number of uniform intervals of the history, 1 or more. Intervals in which an entity moves are
  /// cut finer.
  std::uint32_t steps = 1440;
  std::uint32_t sun_rays = 64;  ///< over the sun's disc
  /// Rays over the hemisphere; 256 would leave 0.05 K RMS on a statue's folds.
  std::uint32_t sky_rays = 4096;
  /// Called now and then with the share done. It returns false to stop. May be empty.
  std::function<bool(double done_frac)> progress;
};

/// One pixel's temperature by the converged model.
struct ConvergedPixel {
  std::uint32_t pixel = 0;  ///< row times width plus column
  float temperature_k = 0.0F;
  bool outline = false;  ///< an outline passes within a pixel
};

/// Temperatures by the scenario's own thermal model with converged time steps, and with sun and sky
/// by rays against every triangle. Errors of the model itself remain. Errors of its steps and of
/// its visibility do not. Owner: the caller; setup class.
class ConvergedHistory {
 public:
  /// Loads the scene. `scenario` gives model, materials and history; steps, spacing and method of
  /// its thermal options do not count. Errors: those of scene::load_scene().
  [[nodiscard]] static physics::Result<ConvergedHistory> create(
      const scene::ScenarioDesc& scenario);

  /// Computes temperatures at the points that the pixels' centres see, in order of pixel. Points of
  /// a moving entity are followed back with it. The result does not depend on the number of
  /// threads. Errors: config (materials), invalid_argument (before the history's start), io
  /// (stopped by `progress`).
  [[nodiscard]] physics::Result<std::vector<ConvergedPixel>> picture(
      const reference::SolveView& view, const ConvergedOptions& options) const;

  /// Returns one line for a report.
  [[nodiscard]] std::string describe(const ConvergedOptions& options) const;

 private:
  ConvergedHistory(scene::ScenarioDesc scenario, std::vector<scene::Material> materials,
                   reference::RayScene rays);

  scene::ScenarioDesc scenario_;
  std::vector<scene::Material> materials_;
  reference::RayScene rays_;
};

}  // namespace emit::tool
