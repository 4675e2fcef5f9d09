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

/// How long a ray tracer (Embree, float32, packets of 16, all cores) takes for what the per-frame
/// method does with one shadow map: whether the sun is seen, one ray for every surface pixel.
/// Neither the pixels' points nor the thermal model are in that time. Owner: the caller.
class EmbreeYardstick {
 public:
  /// Loads the scene and finds the points that the picture shows. Errors: those of
  /// scene::load_scene().
  [[nodiscard]] static physics::Result<EmbreeYardstick> create(const scene::ScenarioDesc& scenario,
                                                               const reference::SolveView& view);

  /// One sample per daylight step of a history cut into `steps` equal intervals up to the picture's
  /// instant, ms; empty where the sun never shines. The casters stand where they stood.
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
