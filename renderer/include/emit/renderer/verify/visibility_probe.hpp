// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>
#include <memory>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {

/// Runs the visibility passes of a frame, and only those, on geometry in memory: geometry buffer,
/// volumetric obscurance, shadow map and soft shadow, with the same programs, light fit and taps.
/// For checking them by themselves (`emit evaluate`). One thread owns it, with its own GL context.
class VisibilityProbe {
 public:
  struct Answer {
    bool surface = false;          ///< the image's middle pixel shows geometry
    double depth_m = 0.0;          ///< along the boresight
    double sun_frac = 0.0;         ///< visible share of the disc
    double obscurance_frac = 0.0;  ///< open share of the ball: 0.5 on flat ground
  };

  /// `sensor`: format (odd numbers put a pixel on the boresight), field of view and near plane.
  /// `thermal`: map size, cascades and taps. Setup only. Errors: gpu.
  [[nodiscard]] static physics::Result<std::unique_ptr<VisibilityProbe>> create(
      const scene::SensorDesc& sensor, const scene::ThermalOptions& thermal,
      const DeviceOptions& device);
  virtual ~VisibilityProbe() = default;

  /// What the frame finds at the middle pixel. `near_m` and `obscurance_radius_m` fit the size of
  /// the geometry. The sun stands still. Errors: gpu.
  [[nodiscard]] virtual physics::Result<Answer> at_middle(scene::SceneGeometry geometry,
                                                          const physics::Pose& sensor_pose,
                                                          const glm::dvec3& to_sun, double near_m,
                                                          double obscurance_radius_m) = 0;
};

}  // namespace emit::renderer
