// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/reference/solve.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/scene_desc.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {

/// Time of a ray tracer (Embree, float32, packets of 16, all cores) for the work that the per-frame
/// method does with one shadow map: visibility of the sun, with one ray for every surface pixel.
/// The time covers neither the pixels' points nor the thermal model. Owner: the caller.
class EmbreeYardstick {
 public:
  /// Loads the scene and finds the points that the image shows. Errors: those of
  /// scene::load_scene().
  [[nodiscard]] static physics::Result<EmbreeYardstick> create(const scene::ScenarioDesc& scenario,
                                                               const reference::SolveView& view);

  /// Returns one sample per daylight step of a history cut into `steps` equal intervals up to the
  /// image's instant, ms; empty where the sun never shines. Entities stand where they stood at each
  /// step.
  [[nodiscard]] Samples step_ms(std::uint32_t steps) const;

 private:
  EmbreeYardstick(scene::ScenarioDesc scenario, reference::RayScene rays, std::int64_t now_ns,
                  std::vector<reference::SurfacePoint> points);

  scene::ScenarioDesc scenario_;
  reference::RayScene rays_;
  std::int64_t now_ns_ = 0;
  std::vector<reference::SurfacePoint> points_;
};

}  // namespace emit::tool
