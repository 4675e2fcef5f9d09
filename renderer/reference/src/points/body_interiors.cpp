// SPDX-License-Identifier: Apache-2.0
#include "points/body_interiors.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <numeric>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::reference {
namespace {

/// Rounds end when no interior changes by more than this at any instant.
constexpr double kSettledK = 0.005;
constexpr int kMostRounds = 40;
/// Film of convection and radiation for the estimate of the faces' answer. It changes how fast the
/// rounds converge, not what they converge to.
constexpr double kFilmW_m2_k = 15.0;

/// Triangle of a face, in the frame of its entity or of the world.
struct Face {
  std::array<glm::dvec3, 3> corners_m;
  std::uint32_t material = 0;
  std::uint32_t instance = 0;
  double area_m2 = 0.0;
};

/// Returns a point of a triangle for two numbers of the unit square, evenly by area.
glm::dvec3 point_of(const Face& face, double u, double v) {
  if (u + v > 1.0) {
    u = 1.0 - u;
    v = 1.0 - v;
  }
  const auto& [a, b, c] = face.corners_m;
  return a + u * (b - a) + v * (c - a);
}

/// Estimates the heat that faces take from an interior that is a kelvin warmer, between the first
/// moment, which feels the innermost layer alone, and the steady state.
double answer_of(const scene::Material& material) {
  double resistance = 1.0 / kFilmW_m2_k;
  for (const scene::Layer& layer : material.layers) {
    resistance += layer.thickness_m / layer.conductivity_w_m_k;
  }
  const scene::Layer& inner = material.layers.back();
  return 0.5 * (inner.conductivity_w_m_k / inner.thickness_m + 1.0 / resistance);
}

}  // namespace

BodyInteriors::BodyInteriors(const scene::ScenarioDesc& scenario,
                             const scene::SceneGeometry& geometry, const RayScene& scene,
                             const SurfaceClimate& climate, std::span<const std::int64_t> nodes_ns,
                             const SceneInstant& now)
    : scenario_(scenario), geometry_(geometry), scene_(scene), nodes_ns_(nodes_ns), now_(now) {
  for (const std::int64_t t : nodes_ns) air_k_.push_back(climate.at(t).air_k);
}

BodyInteriors::Key BodyInteriors::key_of(const SolvePoint& point) const {
  const scene::Instance& instance = geometry_.instances[point.instance];
  return {instance.object, instance.placement};
}

void BodyInteriors::add(std::span<const SolvePoint> points, std::size_t points_per_body) {
  for (const SolvePoint& point : points) {
    const scene::Material& material = geometry_.materials[point.material];
    if (!material.rests_on_body()) continue;
    const auto [found, added] = index_.try_emplace(key_of(point), bodies_.size());
    if (!added) continue;
    Body& body = bodies_.emplace_back();
    spread_points(found->first, points_per_body, body);
    for (const std::int64_t t : nodes_ns_) body.course.push_back({t, material.base_k});
  }
}

/// Spreads points over the faces of a body, each of which stands for the same area.
void BodyInteriors::spread_points(const Key& key, std::size_t count, Body& body) {
  // Collect the triangles that rest on the interior.
  std::vector<Face> faces;
  for (std::uint32_t i = 0; i < geometry_.instances.size(); ++i) {
    const scene::Instance& instance = geometry_.instances[i];
    if (Key{instance.object, instance.placement} != key) continue;
    const RayMesh& mesh = scene_.desc().meshes[i];
    for (std::size_t t = 0; t < mesh.materials.size(); ++t) {
      if (!geometry_.materials[mesh.materials[t]].rests_on_body()) continue;
      Face face{{mesh.positions_m[mesh.indices[3 * t]], mesh.positions_m[mesh.indices[3 * t + 1]],
                 mesh.positions_m[mesh.indices[3 * t + 2]]},
                mesh.materials[t],
                i};
      const auto& [a, b, c] = face.corners_m;
      face.area_m2 = 0.5 * glm::length(glm::cross(b - a, c - a));
      if (face.area_m2 > 0.0) faces.push_back(face);
    }
  }
  EMIT_CHECK(!faces.empty());
  std::vector<double> up_to_m2(faces.size());
  std::transform_inclusive_scan(faces.begin(), faces.end(), up_to_m2.begin(), std::plus{},
                                [](const Face& face) { return face.area_m2; });
  // Take equal steps along the sum of the areas. Places within the triangles follow a sequence that
  // fills the square evenly (Roberts, 2018: powers of the plastic number).
  body.first = points_.size();
  body.count = count;
  for (std::size_t k = 0; k < body.count; ++k) {
    const double step = (static_cast<double>(k) + 0.5) / static_cast<double>(body.count);
    const auto at = std::ranges::upper_bound(up_to_m2, step * up_to_m2.back()) - up_to_m2.begin();
    const Face& face = faces[std::min(static_cast<std::size_t>(at), faces.size() - 1)];
    const double turn = static_cast<double>(k) + 1.0;
    const auto fraction = [](double x) { return x - std::floor(x); };
    SolvePoint point;
    point.position_world_m =
        point_of(face, fraction(0.7548776662466927 * turn), fraction(0.5698402909980532 * turn));
    const auto& [a, b, c] = face.corners_m;
    point.normal = glm::normalize(glm::cross(b - a, c - a));
    point.material = face.material;
    point.entity = scene_.desc().meshes[face.instance].entity;
    point.instance = face.instance;
    if (point.entity != kNoEntity) {
      const physics::Pose& pose = now_.entity_pose(point.entity);
      point.position_world_m =
          pose.position_world_m + pose.world_from_body * point.position_world_m;
      point.normal = pose.world_from_body * point.normal;
    }
    body.answer_w_m2_k += answer_of(geometry_.materials[point.material]);
    points_.push_back(point);
  }
  body.answer_w_m2_k /= static_cast<double>(body.count);
  const scene::BodyInterior interior = key.first < geometry_.interiors.size()
                                           ? geometry_.interiors[key.first]
                                           : scene::BodyInterior{};
  body.heat_j_m2_k = interior.heat_j_m2_k;
  body.ventilation_w_m2_k = interior.ventilation_w_m2_k;
}

std::span<const BaseSample> BodyInteriors::course(const SolvePoint& point) const {
  if (!geometry_.materials[point.material].rests_on_body()) return {};
  const auto found = index_.find(key_of(point));
  EMIT_CHECK(found != index_.end());
  return bodies_[found->second].course;
}

/// Finds the course that follows from the heat of the points under the course before, by the
/// trapezium between nodes. Returns its largest change.
double BodyInteriors::follow(Body& body, std::span<const double> heat_j_m2) const {
  double change_k = 0.0;
  double old_from_k = body.course.front().kelvin;
  double from_k = old_from_k;
  for (std::size_t n = 0; n + 1 < nodes_ns_.size(); ++n) {
    const double half_s = 0.5e-9 * static_cast<double>(nodes_ns_[n + 1] - nodes_ns_[n]);
    const double old_to_k = body.course[n + 1].kelvin;
    // The points answer to the change from the course before, half at each end.
    const double gain_j_m2 =
        heat_j_m2[n + 1] - heat_j_m2[n] +
        half_s * (body.answer_w_m2_k * (old_from_k + old_to_k - from_k) +
                  body.ventilation_w_m2_k * (air_k_[n] + air_k_[n + 1] - from_k));
    const double losses_j_m2_k = half_s * (body.answer_w_m2_k + body.ventilation_w_m2_k);
    const double to_k =
        (body.heat_j_m2_k * from_k + gain_j_m2) / (body.heat_j_m2_k + losses_j_m2_k);
    change_k = std::max(change_k, std::abs(to_k - old_to_k));
    body.course[n + 1].kelvin = to_k;
    from_k = to_k;
    old_from_k = old_to_k;
  }
  return change_k;
}

bool BodyInteriors::balance(std::size_t bodies, const Carry& carry,
                            const std::function<bool(double)>& done) {
  bodies = std::min(bodies, bodies_.size());
  std::vector<std::size_t> body_of;
  for (std::size_t b = 0; b < bodies; ++b) body_of.insert(body_of.end(), bodies_[b].count, b);
  std::vector<std::vector<double>> out_j_m2(body_of.size());
  for (auto& row : out_j_m2) row.resize(nodes_ns_.size());
  double first_change_k = 0.0;
  double change_k = 0.0;
  // A body whose interior has settled is left as it is: no other one depends on it.
  std::vector<double> body_change_k(bodies, std::numeric_limits<double>::infinity());
  for (int round = 0; round < kMostRounds && !body_of.empty(); ++round) {
    threads::parallel_indices(std::size_t{0}, body_of.size(), [&](std::size_t p) {
      const std::size_t b = body_of[p];
      if (body_change_k[b] > kSettledK) carry(p, bodies_[b].course, out_j_m2[p]);
    });
    change_k = 0.0;
    for (std::size_t b = 0; b < bodies; ++b) {
      if (!(body_change_k[b] > kSettledK)) continue;
      Body& body = bodies_[b];
      std::vector<double> mean_j_m2(nodes_ns_.size(), 0.0);
      for (std::size_t p = body.first; p < body.first + body.count; ++p) {
        for (std::size_t n = 0; n < mean_j_m2.size(); ++n) {
          mean_j_m2[n] += out_j_m2[p][n] / static_cast<double>(body.count);
        }
      }
      body_change_k[b] = follow(body, mean_j_m2);
      change_k = std::max(change_k, body_change_k[b]);
    }
    if (change_k <= kSettledK) break;
    // Changes fall by a constant factor from round to round.
    if (round == 0) first_change_k = change_k;
    const double share =
        round == 0 ? 0.1
                   : std::log(first_change_k / change_k) / std::log(first_change_k / kSettledK);
    if (done && !done(std::clamp(share, 0.0, 1.0))) return false;
  }
  left_k_ = std::max(left_k_, change_k);
  return !done || done(1.0);
}

}  // namespace emit::reference
