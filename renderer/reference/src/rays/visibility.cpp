// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/visibility.hpp"

#include <tbb/blocked_range.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <array>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/reference/sampling.hpp"
#include "emit/reference/sun_disc.hpp"
#include "emit/threads/parallel.hpp"
#include "ray_scene_impl.hpp"

namespace emit::reference {
namespace {

constexpr std::size_t kPacket = 16;
constexpr std::uint32_t kBlocks = 8;

/// Weighted mean of values in the order of the sequence, with an error from the spread of its
/// blocks.
class BlockMean {
 public:
  explicit BlockMean(std::uint32_t rays)
      : rays_(rays), blocks_(rays >= 2 * kBlocks ? kBlocks : 1) {}

  void add(std::uint32_t index, double value, double weight = 1.0) noexcept {
    const auto block = static_cast<std::size_t>(std::uint64_t{index} * blocks_ / rays_);
    sum_[block] += value * weight;
    weight_[block] += weight;
  }

  /// Returns the mean and its standard error.
  [[nodiscard]] Share share() const noexcept {
    double sum = 0.0;
    double weight = 0.0;
    for (std::size_t i = 0; i < blocks_; ++i) {
      sum += sum_[i];
      weight += weight_[i];
    }
    const double mean = weight > 0.0 ? sum / weight : 0.0;
    // Too few rays for blocks: take the error of independent samples.
    if (blocks_ == 1) return {mean, std::sqrt(std::max(mean * (1.0 - mean), 0.0) / rays_)};
    // Estimate the error by the spread between the blocks.
    double spread2 = 0.0;
    for (std::size_t i = 0; i < blocks_; ++i) {
      const double off = sum_[i] / weight_[i] - mean;
      spread2 += off * off;
    }
    return {mean, std::sqrt(spread2 / (blocks_ * (blocks_ - 1.0)))};
  }

 private:
  std::uint32_t rays_;
  std::uint32_t blocks_;
  std::array<double, kBlocks> sum_{};
  std::array<double, kBlocks> weight_{};
};

/// Returns a share scaled by a factor.
Share scaled(const Share& share, double factor) noexcept {
  return {share.value_frac * factor, share.error_frac * factor};
}

/// Traces the rays of one point in packets. `direction(i)` gives ray i < rays; `take(i, seen,
/// direction)` gets each answer.
template <class Direction, class Take>
void trace(const SceneInstant::Impl& instant, const SurfacePoint& point, std::uint32_t rays,
           const Direction& direction, const Take& take) {
  const glm::dvec3 start_m = instant.start_m(point);
  const bool has_normal = glm::dot(point.normal, point.normal) > 0.0;
  std::array<Ray, kPacket> packet;
  for (std::uint32_t first = 0; first < rays; first += kPacket) {
    const std::size_t count = std::min<std::size_t>(kPacket, rays - first);
    std::uint32_t behind = 0;
    // Fill the packet. Rays behind the tangent plane count as blocked.
    for (std::size_t i = 0; i < count; ++i) {
      const glm::dvec3 towards = direction(first + static_cast<std::uint32_t>(i));
      packet[i] = {start_m, towards, point.tolerance_m};
      if (has_normal && glm::dot(towards, point.normal) <= 0.0) behind |= 1U << i;
    }
    // Trace only if any ray remains.
    std::uint32_t blocked = (1U << count) - 1U;
    if (behind != blocked) blocked = behind | instant.blocked_16({packet.data(), count});
    for (std::size_t i = 0; i < count; ++i) {
      take(first + static_cast<std::uint32_t>(i), ((blocked >> i) & 1U) == 0U, packet[i].direction);
    }
  }
}

}  // namespace

void SceneInstant::occluded(std::span<const SurfacePoint> points, const glm::dvec3& direction,
                            std::span<std::uint8_t> out) const {
  EMIT_CHECK_OP(points.size(), ==, out.size());
  // Trace packets of points in parallel.
  const std::size_t packets = (points.size() + kPacket - 1) / kPacket;
  threads::parallel_ranges(tbb::blocked_range<std::size_t>(0, packets, 64), [&](const auto& range) {
    std::array<Ray, kPacket> packet;
    for (std::size_t p = range.begin(); p < range.end(); ++p) {
      const std::size_t first = p * kPacket;
      const std::size_t count = std::min(kPacket, points.size() - first);
      std::uint32_t behind = 0;
      for (std::size_t i = 0; i < count; ++i) {
        const SurfacePoint& point = points[first + i];
        packet[i] = {impl_->start_m(point), direction, point.tolerance_m};
        if (glm::dot(point.normal, point.normal) > 0.0 &&
            glm::dot(point.normal, direction) <= 0.0) {
          behind |= 1U << i;
        }
      }
      const std::uint32_t all = (1U << count) - 1U;
      const std::uint32_t blocked =
          behind == all ? all : behind | impl_->blocked_16({packet.data(), count});
      for (std::size_t i = 0; i < count; ++i) {
        out[first + i] = static_cast<std::uint8_t>((blocked >> i) & 1U);
      }
    }
  });
}

Share SceneInstant::sun_visible_frac(const SurfacePoint& point, const glm::dvec3& to_sun,
                                     const SunQuery& query) const {
  const SunDisc disc{to_sun, query.semi_angle_rad, query.limb_darkening_frac};
  const Tangents tangents = tangents_of(to_sun);
  const std::uint32_t rays = std::max(query.rays, 1U);
  // Spread the rays over the disc by equal solid angles, weighted by the limb darkening.
  BlockMean mean(rays);
  trace(
      *impl_, point, rays,
      [&](std::uint32_t i) {
        return cap_direction(disc_from_square(sobol_owen_2d(i, query.seed)), to_sun, tangents,
                             query.semi_angle_rad);
      },
      [&](std::uint32_t i, bool seen, const glm::dvec3& towards) {
        double weight = 1.0;
        if (query.limb_darkening_frac != 0.0) {
          const double across = glm::length(glm::cross(towards, to_sun));
          weight = disc_brightness_frac(disc, std::asin(std::min(across, 1.0)));
        }
        mean.add(i, seen ? 1.0 : 0.0, weight);
      });
  return mean.share();
}

Share SceneInstant::sun_visible_frac_clipped(const SurfacePoint& point, const glm::dvec3& to_sun,
                                             const SunQuery& query) const {
  const SunDisc disc{to_sun, query.semi_angle_rad, query.limb_darkening_frac};
  thread_local std::vector<std::array<glm::dvec3, 3>> triangles;
  triangles.clear();
  // Answer at once if the whole disc lies behind the tangent plane.
  const double sine = std::sin(query.semi_angle_rad);
  if (glm::dot(point.normal, to_sun) < -sine * glm::length(point.normal)) return {0.0, 0.0};
  // Collect the triangles before the disc and integrate.
  impl_->gather(point, to_sun, query.semi_angle_rad, triangles);
  const DiscShare share = visible_disc_share(triangles, point.normal, disc);
  return {share.visible_frac, share.error_frac};
}

void SceneInstant::sun_visible_frac(std::span<const SurfacePoint> points, const glm::dvec3& to_sun,
                                    const SunQuery& query, bool clipped,
                                    std::span<double> out_frac) const {
  EMIT_CHECK_OP(points.size(), ==, out_frac.size());
  threads::parallel_ranges(
      tbb::blocked_range<std::size_t>(0, points.size(), 32), [&](const auto& range) {
        for (std::size_t i = range.begin(); i < range.end(); ++i) {
          out_frac[i] = (clipped ? sun_visible_frac_clipped(points[i], to_sun, query)
                                 : sun_visible_frac(points[i], to_sun, query))
                            .value_frac;
        }
      });
}

SkyView SceneInstant::sky_view(const SurfacePoint& point, std::uint32_t rays,
                               std::uint32_t seed) const {
  SkyView view;
  rays = std::max(rays, 1U);
  const bool has_normal = glm::dot(point.normal, point.normal) > 0.0;
  const glm::dvec3 axis = has_normal ? glm::normalize(point.normal) : glm::dvec3(0.0, 0.0, 1.0);
  const Tangents tangents = tangents_of(axis);
  // Define one measure: shares of sky and of ground along a sequence of directions.
  const auto measure = [&](const auto& direction, Share& sky, Share& ground) {
    BlockMean above(rays);
    BlockMean below(rays);
    // A ray that leaves the scene shows sky above the horizon and surroundings below it.
    trace(*impl_, point, rays, direction,
          [&](std::uint32_t i, bool seen, const glm::dvec3& towards) {
            above.add(i, seen && towards.z >= 0.0 ? 1.0 : 0.0);
            below.add(i, seen && towards.z < 0.0 ? 1.0 : 0.0);
          });
    sky = above.share();
    ground = below.share();
  };
  // Measure the cosine-weighted hemisphere.
  if (has_normal) {
    measure(
        [&](std::uint32_t i) {
          return cosine_direction(disc_from_square(sobol_owen_2d(i, seed)), axis, tangents);
        },
        view.sky_cosine, view.ground_cosine);
  }
  // Measure by solid angle: the hemisphere above a surface, or the full sphere.
  const double semi_angle_rad = has_normal ? 0.5 * physics::kPi : physics::kPi;
  measure(
      [&](std::uint32_t i) {
        return cap_direction(disc_from_square(sobol_owen_2d(i, seed)), axis, tangents,
                             semi_angle_rad);
      },
      view.sky_uniform, view.ground_uniform);
  // Refer the hemisphere to the full sphere.
  if (has_normal) {
    view.sky_uniform = scaled(view.sky_uniform, 0.5);
    view.ground_uniform = scaled(view.ground_uniform, 0.5);
  }
  return view;
}

void SceneInstant::hemisphere(const SurfacePoint& point, std::span<HemisphereRay> out,
                              std::uint32_t seed) const {
  EMIT_CHECK(glm::dot(point.normal, point.normal) > 0.0);
  // Trace cosine-distributed directions one by one, because the caller needs the hits.
  const glm::dvec3 axis = glm::normalize(point.normal);
  const Tangents tangents = tangents_of(axis);
  const glm::dvec3 start_m = impl_->start_m(point);
  for (std::size_t i = 0; i < out.size(); ++i) {
    HemisphereRay& ray = out[i];
    ray.direction = cosine_direction(
        disc_from_square(sobol_owen_2d(static_cast<std::uint32_t>(i), seed)), axis, tangents);
    const auto hit = first_hit({start_m, ray.direction, point.tolerance_m});
    ray.hit_surface = hit.has_value();
    if (hit) ray.hit = *hit;
  }
}

}  // namespace emit::reference
