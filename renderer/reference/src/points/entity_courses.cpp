// SPDX-License-Identifier: Apache-2.0
#include "points/entity_courses.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::reference {
namespace {

/// Stretches are halved until the velocity of both halves is the same within the first two, or the
/// stretch is as short as the last.
constexpr double kEvenWayFrac = 0.02;
constexpr double kEvenWayMPerS = 0.2;
constexpr std::int64_t kShortestWayNs = 125'000'000;
/// The attitude of both ends of a stretch may differ by 3 degrees (cosine of half the angle).
constexpr double kEvenTurn = 0.99966;

/// Returns true if an entity jumps between two instants.
bool jumps(const RayScene& scene, std::uint32_t entity, std::int64_t from_ns, std::int64_t to_ns) {
  return std::ranges::any_of(scene.desc().entities[entity].poses, [&](const scene::Keyframe& key) {
    return key.teleport && key.sim_time_ns > from_ns && key.sim_time_ns <= to_ns;
  });
}

/// Returns the mean velocity between two instants; an entity that is off at one of them stands.
glm::dvec3 velocity_m_s(std::uint32_t entity, std::int64_t from_ns, const SceneInstant& from,
                        std::int64_t to_ns, const SceneInstant& to) {
  if (!from.entity_on(entity) || !to.entity_on(entity)) return glm::dvec3(0.0);
  const double length_s = 1e-9 * static_cast<double>(to_ns - from_ns);
  return (to.entity_pose(entity).position_world_m - from.entity_pose(entity).position_world_m) /
         length_s;
}

}  // namespace

EntityCourses::EntityCourses(const scene::ScenarioDesc& scenario,
                             const scene::SceneGeometry& geometry, const SceneNodes& nodes) {
  courses_.resize(nodes.scene.desc().entities.size());
  for (std::uint32_t i = 0; i < geometry.instances.size(); ++i) {
    const std::uint32_t entity = nodes.scene.desc().meshes[i].entity;
    if (entity == kNoEntity) continue;
    courses_[entity].film_body = scene::film_body(scenario, geometry, geometry.instances[i].object);
  }
  for (std::uint32_t entity = 0; entity < courses_.size(); ++entity) {
    Course& course = courses_[entity];
    course.last_attitude = nodes.instants.back().entity_pose(entity).world_from_body;
    for (std::size_t i = 1; i < nodes.instants.size(); ++i) {
      add_stretch(nodes.scene, entity, nodes.times_ns[i - 1], nodes.instants[i - 1],
                  nodes.times_ns[i], nodes.instants[i], course.stretches);
    }
  }
}

void EntityCourses::add_stretch(const RayScene& scene, std::uint32_t entity, std::int64_t from_ns,
                                const SceneInstant& from, std::int64_t to_ns,
                                const SceneInstant& to, std::vector<Stretch>& out) {
  const physics::Pose& a = from.entity_pose(entity);
  const physics::Pose& b = to.entity_pose(entity);
  const bool jump = jumps(scene, entity, from_ns, to_ns);
  const glm::dvec3 whole = jump ? glm::dvec3(0.0) : velocity_m_s(entity, from_ns, from, to_ns, to);
  if (to_ns - from_ns > kShortestWayNs) {
    const std::int64_t middle_ns = from_ns + (to_ns - from_ns) / 2;
    const SceneInstant middle = scene.at(middle_ns);
    const glm::dvec3 half = velocity_m_s(entity, from_ns, from, middle_ns, middle);
    const glm::dvec3 other_half = velocity_m_s(entity, middle_ns, middle, to_ns, to);
    const bool even = glm::distance(half, other_half) <
                      kEvenWayMPerS + kEvenWayFrac * (glm::length(half) + glm::length(other_half));
    const bool turns = std::abs(glm::dot(a.world_from_body, b.world_from_body)) < kEvenTurn;
    if (!even || turns || jump) {
      add_stretch(scene, entity, from_ns, from, middle_ns, middle, out);
      add_stretch(scene, entity, middle_ns, middle, to_ns, to, out);
      return;
    }
  }
  out.push_back({from_ns, to_ns, whole, a.position_world_m.z, b.position_world_m.z,
                 a.world_from_body, b.world_from_body});
}

std::vector<MotionSample> EntityCourses::motion(const SolvePoint& point) const {
  std::vector<MotionSample> out;
  if (point.entity == kNoEntity) return out;
  const Course& course = courses_[point.entity];
  const glm::dvec3 normal_body = glm::conjugate(course.last_attitude) * point.normal;
  out.reserve(2 * course.stretches.size());
  for (const Stretch& part : course.stretches) {
    out.push_back(
        {part.from_ns, part.velocity_m_s, part.from_up_m, part.from_attitude * normal_body});
    out.push_back({part.to_ns, part.velocity_m_s, part.to_up_m, part.to_attitude * normal_body});
  }
  return out;
}

physics::AirFilmBody EntityCourses::film_body(const SolvePoint& point) const {
  return point.entity == kNoEntity ? physics::AirFilmBody{} : courses_[point.entity].film_body;
}

}  // namespace emit::reference
