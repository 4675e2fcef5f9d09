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

/// Visibility passes of a frame on geometry in memory: geometry buffer, volumetric obscurance,
/// shadow map and soft shadow, with the programs, light fit and taps of the renderer. `emit
/// evaluate` checks them by it. Thread: one thread owns a probe and its GL context. Real time:
/// setup only.
class VisibilityProbe {
 public:
  /// Result at one pixel. Without a surface only `surface` and `depth_m` have a meaning.
  struct Answer {
    bool surface = false;          ///< the middle pixel of the image shows geometry
    double depth_m = 0.0;          ///< distance along the boresight
    double sun_frac = 0.0;         ///< visible share of the sun's disc, 0..1
    double obscurance_frac = 0.0;  ///< open share of the ball, 0..1; 0.5 on flat ground
  };

  /// Creates the context and compiles the passes. `sensor` gives the size of the image (odd numbers
  /// put a pixel on the boresight) and the field of view. `thermal` gives size and number of shadow
  /// maps and the numbers of taps. Errors: gpu.
  /// @pre The numbers keep to the limits of Renderer::create().
  [[nodiscard]] static physics::Result<std::unique_ptr<VisibilityProbe>> create(
      const scene::SensorDesc& sensor, const scene::ThermalOptions& thermal,
      const DeviceOptions& device);
  virtual ~VisibilityProbe() = default;

  /// Runs the passes on `geometry` and returns the result at the middle pixel. The sun stands still
  /// in the direction `to_sun` (world axes). `near_m` and `obscurance_radius_m` should fit the size
  /// of the geometry. Errors: gpu.
  /// @pre `to_sun` is of unit length, near_m > 0.
  [[nodiscard]] virtual physics::Result<Answer> at_middle(scene::SceneGeometry geometry,
                                                          const physics::Pose& sensor_pose,
                                                          const glm::dvec3& to_sun, double near_m,
                                                          double obscurance_radius_m) = 0;
};

}  // namespace emit::renderer
