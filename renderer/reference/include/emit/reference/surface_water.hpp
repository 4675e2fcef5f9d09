// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/climate/surface_water.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/visibility.hpp"

/// Rain water of open, level ground over a climate, by small steps of heat and water together. It
/// has the balance of physics.md section 8 and shares no formula with the real-time path.
namespace emit::reference {

/// Water of the ground of a material at the nodes of a climate; empty where it never holds any.
struct WaterCourse {
  std::vector<std::int64_t> time_ns;
  std::vector<double> water_mm;
  std::vector<double> wet_frac;  ///< share of what ground as warm and wet all over would give
  std::vector<double> face_k;    ///< temperature of the ground
  double evaporated_mm = 0.0;    ///< in all, less the dew
  double drained_mm = 0.0;       ///< in all: what the store could not take

  [[nodiscard]] bool empty() const noexcept { return time_ns.empty(); }
  /// Returns the wetness at an instant: linear between nodes, 0 for an empty course.
  [[nodiscard]] double at(std::int64_t at_ns) const noexcept;
};

/// Computes the course from the steady profile between `initial_k` and the base, of ground that
/// gets a share of the rain.
/// @pre nodes is not empty
[[nodiscard]] WaterCourse water_course(std::span<const ClimateNode> nodes,
                                       const scene::Material& material, double initial_k,
                                       double surroundings_reflectance_frac, const LayerMesh& mesh,
                                       const StepOptions& steps = {}, double rain_frac = 1.0);

/// Courses of ground that gets none, a quarter, half, three quarters and all of the rain; empty
/// where it never holds any. Between them the wetness is linear.
class RainCourses {
 public:
  RainCourses() = default;
  /// The arguments are those of water_course().
  RainCourses(std::span<const ClimateNode> nodes, const scene::Material& material, double initial_k,
              double surroundings_reflectance_frac, const LayerMesh& mesh,
              const StepOptions& steps = {});

  [[nodiscard]] bool empty() const noexcept { return courses_.back().empty(); }
  /// Returns the wetness at a node of the climate of a face that gets `rain_frac` of the rain.
  [[nodiscard]] double at_node(std::size_t node, double rain_frac) const noexcept;
  /// Returns the wetness at an instant.
  [[nodiscard]] double at(std::int64_t at_ns, double rain_frac) const noexcept;

 private:
  [[nodiscard]] double between(double rain_frac, const auto& wetness_of) const noexcept;
  std::array<WaterCourse, 5> courses_;
};

/// Returns the share of the rain around the vertical that reaches a point, by 64 rays in a cone of
/// 20 degrees. It is 0 on walls and undersides. The tilt of the face counts: rain that falls
/// straight down meets less of a steep face.
[[nodiscard]] double rain_on_face_frac(const SceneInstant& instant, const SurfacePoint& point);

}  // namespace emit::reference
