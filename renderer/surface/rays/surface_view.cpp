// SPDX-License-Identifier: Apache-2.0
#include "surface/rays/surface_view.hpp"

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>
#include <tuple>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "surface/mesh/tangents.hpp"

namespace emit::renderer {
namespace {

constexpr std::size_t kPacket = CasterRays::kMaxRays;

/// Returns the position on Hilbert's curve through a 32 x 32 grid over [-1, 1]^2.
std::uint32_t hilbert_order(double px, double py) noexcept {
  constexpr std::uint32_t kSide = 32;
  const auto cell = [](double p) {
    return std::min(static_cast<std::uint32_t>((p + 1.0) * (0.5 * kSide)), kSide - 1);
  };
  std::uint32_t x = cell(px);
  std::uint32_t y = cell(py);
  std::uint32_t order = 0;
  for (std::uint32_t half = kSide / 2; half != 0; half /= 2) {
    const bool right = (x & half) != 0;
    const bool upper = (y & half) != 0;
    order += half * half * ((right ? 3U : 0U) ^ (upper ? 1U : 0U));
    if (upper) continue;  // the lower quarters run turned
    if (right) {
      x = kSide - 1 - x;
      y = kSide - 1 - y;
    }
    std::swap(x, y);
  }
  return order;
}

/// Returns the number of the axis direction, out of six, that the normal is closest to.
std::uint32_t side_of(const glm::vec3& normal) noexcept {
  const glm::vec3 size = glm::abs(normal);
  const glm::length_t axis =
      size.x >= size.y ? (size.x >= size.z ? 0 : 2) : (size.y >= size.z ? 1 : 2);
  return 2U * static_cast<std::uint32_t>(axis) + (normal[axis] < 0.0F ? 1U : 0U);
}

/// Transforms a direction from the axes (tangent, bitangent, normal) to those in which they are
/// given.
glm::vec3 turned(const glm::vec3& local, const Tangents& tangents,
                 const glm::vec3& normal) noexcept {
  return glm::normalize(local.x * tangents.u + local.y * tangents.v + local.z * normal);
}

constexpr std::uint32_t kNone = ~0U;

/// Group of hits that lie side by side in the sorted list and share one entry of the view.
struct Group {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
  std::uint32_t instance = 0;
  bool front = true;
  glm::vec3 direction{0.0F};  ///< sum over the group
  glm::vec3 normal{0.0F};     ///< sum over the group
  glm::vec3 mean_direction{0.0F};
  glm::vec3 mean_normal{0.0F};
  std::uint32_t before = kNone;  ///< neighbours in the list
  std::uint32_t after = kNone;

  /// Computes the unit means from the sums.
  void take_means() noexcept {
    const auto mean = [](const glm::vec3& sum) { return sum / std::max(glm::length(sum), 1e-6F); };
    mean_direction = mean(direction);
    mean_normal = mean(normal);
  }
};

/// Returns the growth of the spread by joining two groups (Ward's criterion), on the unit spheres
/// of directions and of normals. Other instances and the other side of faces cost more, so that
/// they are joined last.
float join_cost(const Group& a, const Group& b) noexcept {
  const glm::vec3 aside = a.mean_direction - b.mean_direction;
  float spread = glm::dot(aside, aside) + 1.0F - glm::dot(a.mean_normal, b.mean_normal);
  if (a.instance != b.instance) spread += 8.0F;
  if (a.front != b.front) spread += 4.0F;
  const auto na = static_cast<float>(a.count);
  const auto nb = static_cast<float>(b.count);
  return spread * na * nb / (na + nb);
}

/// Costs of joining group i with the one after it. Minima of blocks make it fast to find the
/// smallest cost, and the first of equal ones. A tree of minima would compare less often, but half
/// again as slowly: its comparisons wait for each other.
class JoinCosts {
 public:
  /// Starts with `count` infinite costs.
  explicit JoinCosts(std::size_t count) noexcept : blocks_((count + kBlock - 1) / kBlock) {
    std::fill_n(costs_.begin(), blocks_ * kBlock, kNever);
    std::fill_n(least_.begin(), blocks_, kNever);
  }
  /// Sets a cost and updates the minimum of its block.
  void set(std::size_t i, float cost) noexcept {
    costs_[i] = cost;
    const auto begin = costs_.begin() + static_cast<std::ptrdiff_t>(i / kBlock * kBlock);
    least_[i / kBlock] = *std::min_element(begin, begin + kBlock);
  }
  void remove(std::size_t i) noexcept { set(i, kNever); }
  /// Returns the index of the smallest cost.
  [[nodiscard]] std::size_t least() const noexcept {
    const auto block = static_cast<std::size_t>(
        std::min_element(least_.data(), least_.data() + blocks_) - least_.data());
    const float* begin = costs_.data() + block * kBlock;
    return block * kBlock +
           static_cast<std::size_t>(std::min_element(begin, begin + kBlock) - begin);
  }

 private:
  static constexpr std::size_t kBlock = 16;
  static constexpr float kNever = std::numeric_limits<float>::infinity();
  static_assert(ViewSampler::kMaxRays % kBlock == 0);
  std::array<float, ViewSampler::kMaxRays> costs_;
  std::array<float, ViewSampler::kMaxRays / kBlock> least_;
  std::size_t blocks_;
};

/// Sorted hits of one point and their groups.
struct Hits {
  std::array<SeenFace, ViewSampler::kMaxRays> faces;
  std::array<Group, ViewSampler::kMaxRays> groups;
  std::size_t count = 0;
};

/// Joins hits to at most kMaxSeen groups.
void join_neighbours(Hits& hits) noexcept {
  // Sort the hits by instance, direction of the normal and side. The index keeps the order of the
  // rays, and so neighbours in direction, among equals.
  std::array<std::pair<std::uint32_t, std::uint32_t>, ViewSampler::kMaxRays> order;
  for (std::uint32_t i = 0; i < hits.count; ++i) {
    order[i] = {2U * side_of(hits.faces[i].normal) + (hits.faces[i].front ? 1U : 0U), i};
  }
  const std::span<const SeenFace> unsorted(hits.faces.data(), hits.count);
  std::sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(hits.count),
            [&](const auto& a, const auto& b) {
              return std::tie(unsorted[a.second].instance, a.first, a.second) <
                     std::tie(unsorted[b.second].instance, b.first, b.second);
            });
  std::array<SeenFace, ViewSampler::kMaxRays> sorted;
  for (std::size_t i = 0; i < hits.count; ++i) sorted[i] = hits.faces[order[i].second];
  hits.faces = sorted;

  // Start with one group per hit. A view of few hits needs no joining.
  for (std::uint32_t i = 0; i < hits.count; ++i) {
    const SeenFace& face = hits.faces[i];
    hits.groups[i] = {i, 1, face.instance, face.front, face.direction, face.normal};
  }
  if (hits.count <= SurfaceView::kMaxSeen) return;
  // Link them in the order of the list, and enter the costs of joining neighbours.
  JoinCosts costs(hits.count);
  for (std::uint32_t i = 0; i < hits.count; ++i) {
    hits.groups[i].take_means();
    if (i == 0) continue;
    hits.groups[i].before = i - 1;
    hits.groups[i - 1].after = i;
    costs.set(i - 1, join_cost(hits.groups[i - 1], hits.groups[i]));
  }
  std::size_t left = hits.count;
  for (; left > SurfaceView::kMaxSeen; --left) {
    // Join the two neighbours that cost least. The larger one decides the instance and the side.
    const auto best = static_cast<std::uint32_t>(costs.least());
    Group& group = hits.groups[best];
    const Group& other = hits.groups[group.after];
    if (other.count > group.count) {
      group.instance = other.instance;
      group.front = other.front;
    }
    group.count += other.count;
    group.direction += other.direction;
    group.normal += other.normal;
    group.take_means();
    // Take the second group out of the list and update the costs on both sides of the new one.
    costs.remove(group.after);
    group.after = other.after;
    if (group.before != kNone) costs.set(group.before, join_cost(hits.groups[group.before], group));
    if (group.after == kNone) {
      costs.remove(best);
      continue;
    }
    hits.groups[group.after].before = best;
    costs.set(best, join_cost(group, hits.groups[group.after]));
  }
  // Move the groups that are left to the front. The first of the list is never joined to another.
  std::size_t to = 0;
  for (std::uint32_t from = 0; from != kNone; from = hits.groups[from].after) {
    hits.groups[to++] = hits.groups[from];
  }
  hits.count = left;
}

/// Returns the hit of the instance of the group that is nearest to the middle of the group.
const SeenFace& middle_of(const Group& group, std::span<const SeenFace> faces) noexcept {
  std::uint32_t best = group.first;
  float best_along = -2.0F * static_cast<float>(group.count);
  for (std::uint32_t i = group.first; i < group.first + group.count; ++i) {
    const float along = glm::dot(faces[i].direction, group.direction);
    if (faces[i].instance == group.instance && along > best_along) {
      best = i;
      best_along = along;
    }
  }
  return faces[best];
}

}  // namespace

ViewSampler::ViewSampler(std::uint32_t rays) {
  rays = std::max((rays + 15U) / 16U * 16U, 16U);
  struct Point {
    std::uint32_t order;
    std::uint32_t index;
    glm::dvec2 disc;
  };
  std::vector<Point> points;
  // Turn by the golden angle from point to point: areas are equal, and no two points lie close
  // together (Vogel 1979, "A better way to construct the sunflower head").
  const double turn_rad = physics::kPi * (3.0 - std::sqrt(5.0));
  for (std::uint32_t i = 0; i < rays; ++i) {
    const double radius = std::sqrt((i + 0.5) / rays);
    const glm::dvec2 disc{radius * std::cos(i * turn_rad), radius * std::sin(i * turn_rad)};
    points.push_back({hilbert_order(disc.x, disc.y), i, disc});
  }
  // Sort the points along a curve, so that the rays of a packet are neighbours and trace fast.
  std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) {
    return std::tie(a.order, a.index) < std::tie(b.order, b.index);
  });
  // Lift the disc to the hemisphere.
  for (const Point& point : points) {
    directions_.emplace_back(glm::vec2(point.disc),
                             std::sqrt(1.0 - glm::dot(point.disc, point.disc)));
  }
}

bool ViewSampler::nothing_near(const CasterRays& casters, const ViewPoint& point,
                               const CasterSelection& selection) const noexcept {
  constexpr std::size_t kStride = 4;  // neighbours in the list are neighbours in direction
  if (directions_.size() % (kStride * kPacket) != 0) return false;
  const Tangents tangents = tangents_of(point.normal);
  const glm::vec3 start_m = point.position_m + point.offset_m * (point.normal + point.inward);
  for (std::size_t begin = 0; begin < directions_.size(); begin += kStride * kPacket) {
    std::array<CasterRay, kPacket> rays;
    for (std::size_t i = 0; i < kPacket; ++i) {
      rays[i] = {start_m, turned(directions_[begin + kStride * i], tangents, point.normal)};
    }
    if (casters.blocked(rays, selection) != 0U) return false;
  }
  return true;
}

ViewShares ViewSampler::shares(const CasterRays& casters, const ViewPoint& point,
                               const CasterSelection& selection) const noexcept {
  // Spare most rays on open ground.
  const bool open = nothing_near(casters, point, selection);
  const Tangents tangents = tangents_of(point.normal);
  const glm::vec3 start_m = point.position_m + point.offset_m * (point.normal + point.inward);
  std::uint32_t sky = 0;
  std::uint32_t far = 0;
  glm::vec3 to_sky(0.0F);
  for (std::size_t begin = 0; begin < directions_.size(); begin += kPacket) {
    std::array<CasterRay, kPacket> rays;
    for (std::size_t i = 0; i < kPacket; ++i) {
      rays[i] = {start_m, turned(directions_[begin + i], tangents, point.normal)};
    }
    const std::uint32_t blocked = open ? 0U : casters.blocked(rays, selection);
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (((blocked >> i) & 1U) != 0U) continue;
      // Sum the derivative of the cosine weight with the rays that see sky.
      const bool up = rays[i].direction.z >= 0.0F;
      ++(up ? sky : far);
      if (up) to_sky += rays[i].direction / directions_[begin + i].z;
    }
  }
  const float weight_frac = 1.0F / static_cast<float>(directions_.size());
  // The share of the sky of a free face is known exactly.
  if (sky + far == directions_.size()) {
    const float up_frac = std::clamp(0.5F + 0.5F * point.normal.z, 0.0F, 1.0F);
    return {up_frac, 1.0F - up_frac, weight_frac * to_sky};
  }
  return {static_cast<float>(sky) * weight_frac, static_cast<float>(far) * weight_frac,
          weight_frac * to_sky};
}

ViewOpening ViewSampler::opening(const CasterRays& casters, const ViewPoint& point,
                                 const CasterSelection& selection) const noexcept {
  const Tangents tangents = tangents_of(point.normal);
  // A hemisphere that is open has a vector mean of 2/3 of its normal, and that turns the share of
  // the sky by 1/2 (Funk and Hecke: 3/4 of the first moment).
  constexpr float kTiltOfMoment = 0.75F;
  if (nothing_near(casters, point, selection)) return {1.0F, 0.5F * point.normal};
  const glm::vec3 start_m = point.position_m + point.offset_m * (point.normal + point.inward);
  std::uint32_t open = 0;
  glm::vec3 sum(0.0F);
  for (std::size_t begin = 0; begin < directions_.size(); begin += kPacket) {
    std::array<CasterRay, kPacket> rays;
    for (std::size_t i = 0; i < kPacket; ++i) {
      rays[i] = {start_m, turned(directions_[begin + i], tangents, point.normal)};
    }
    const std::uint32_t blocked = casters.blocked(rays, selection);
    for (std::size_t i = 0; i < kPacket; ++i) {
      if (((blocked >> i) & 1U) != 0U) continue;
      ++open;
      sum += rays[i].direction;
    }
  }
  const float weight_frac = 1.0F / static_cast<float>(directions_.size());
  return {static_cast<float>(open) * weight_frac, kTiltOfMoment * weight_frac * sum};
}

SurfaceView ViewSampler::view(const CasterRays& casters, const ViewPoint& point,
                              const CasterSelection& selection) const noexcept {
  EMIT_DCHECK_OP(directions_.size(), <=, kMaxRays);
  const Tangents tangents = tangents_of(point.normal);
  const glm::vec3 start_m = point.position_m + point.offset_m * (point.normal + point.inward);
  Hits hits;
  std::uint32_t sky = 0;
  std::uint32_t far = 0;
  for (std::size_t begin = 0; begin < directions_.size(); begin += kPacket) {
    std::array<CasterRay, kPacket> rays;
    std::array<CasterHit, kPacket> found;
    for (std::size_t i = 0; i < kPacket; ++i) {
      rays[i] = {start_m, turned(directions_[begin + i], tangents, point.normal)};
    }
    // Sort rays into sky, far surroundings and hits.
    const std::uint32_t hit_lanes = casters.first_hits(rays, selection, found);
    for (std::size_t i = 0; i < kPacket; ++i) {
      const glm::vec3& direction = rays[i].direction;
      if (((hit_lanes >> i) & 1U) == 0U) {
        ++(direction.z >= 0.0F ? sky : far);
        continue;
      }
      const CasterHit& hit = found[i];
      hits.faces[hits.count++] = {hit.instance,   hit.triangle, hit.barycentric, 0.0F,
                                  hit.distance_m, hit.front,    hit.normal,      direction};
    }
  }
  SurfaceView view;
  const float weight_frac = 1.0F / static_cast<float>(directions_.size());
  view.sky_frac = static_cast<float>(sky) * weight_frac;
  view.far_frac = static_cast<float>(far) * weight_frac;
  // Join the hits and give each group the share of its rays.
  join_neighbours(hits);
  view.seen_count = static_cast<std::uint32_t>(hits.count);
  for (std::size_t i = 0; i < hits.count; ++i) {
    view.seen[i] = middle_of(hits.groups[i], hits.faces);
    view.seen[i].weight_frac = static_cast<float>(hits.groups[i].count) * weight_frac;
  }
  return view;
}

}  // namespace emit::renderer
