// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/quaternion_double.hpp>
#include <glm/ext/vector_double3.hpp>
#include <vector>

#include "emit/reference/surface_forcing.hpp"
#include "emit/scene/mesh.hpp"
#include "points/point_histories.hpp"
#include "points/point_views.hpp"

namespace emit::reference {

/// Ways of the entities through the air over the nodes of a solution. Between two samples that are
/// close enough an entity moves at their mean velocity; while it is switched off it stands. Made
/// once, read by any thread. Owner: the solution.
class EntityCourses {
 public:
  EntityCourses(const scene::ScenarioDesc& scenario, const scene::SceneGeometry& geometry,
                const SceneNodes& nodes);

  /// Returns the motion of a point of an entity, whose normal is that of the last node; empty for
  /// a point of the scenery.
  [[nodiscard]] std::vector<MotionSample> motion(const SolvePoint& point) const;
  /// Returns shape and length of the flow past a point.
  [[nodiscard]] physics::AirFilmBody film_body(const SolvePoint& point) const;

 private:
  /// Stretch of even motion.
  struct Stretch {
    std::int64_t from_ns = 0;
    std::int64_t to_ns = 0;
    glm::dvec3 velocity_m_s{0.0};
    double from_up_m = 0.0;
    double to_up_m = 0.0;
    glm::dquat from_attitude{1.0, 0.0, 0.0, 0.0};
    glm::dquat to_attitude{1.0, 0.0, 0.0, 0.0};
  };
  struct Course {
    std::vector<Stretch> stretches;
    physics::AirFilmBody film_body;
    glm::dquat last_attitude{1.0, 0.0, 0.0, 0.0};
  };
  static void add_stretch(const RayScene& scene, std::uint32_t entity, std::int64_t from_ns,
                          const SceneInstant& from, std::int64_t to_ns, const SceneInstant& to,
                          std::vector<Stretch>& out);

  std::vector<Course> courses_;  ///< by entity
};

}  // namespace emit::reference
