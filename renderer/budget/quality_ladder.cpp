// SPDX-License-Identifier: Apache-2.0
#include "budget/quality_ladder.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Unit vector along the boresight of a camera, world axes.
glm::dvec3 boresight(const physics::Pose& camera) noexcept {
  return camera.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
}

}  // namespace

glm::uvec2 rendered_px(const QualityLevel& level, const glm::uvec2& output_px) noexcept {
  const auto scaled = [&](std::uint32_t px) {
    return std::max(1U, static_cast<std::uint32_t>(std::lround(level.scale_frac * px)));
  };
  return {scaled(output_px.x), scaled(output_px.y)};
}

void LadderMap::add(const physics::Pose& camera, const PerLevel& levels) {
  places_.push_back({camera, levels});
  // Compute the medians over all positions anew.
  std::vector<double> values(places_.size());
  const auto median = [&](std::size_t level, double QualityLevelStats::*member) {
    for (std::size_t p = 0; p < places_.size(); ++p) values[p] = places_[p].levels[level].*member;
    std::ranges::sort(values);
    return values[values.size() / 2];
  };
  for (std::size_t r = 0; r < medians_.size(); ++r) {
    medians_[r] = {median(r, &QualityLevelStats::frame_ms), median(r, &QualityLevelStats::error_k)};
  }
}

bool LadderMap::at(const physics::Pose& camera, double fov_rad, PerLevel& levels) const noexcept {
  EMIT_CHECK_OP(fov_rad, >, 0.0);
  levels = medians_;
  if (places_.empty()) return false;
  // Find the nearest measured position and compare directions.
  const glm::dvec3& eye_m = camera.position_world_m;
  const auto distance_m = [&](const Place& place) {
    return glm::distance(place.camera.position_world_m, eye_m);
  };
  const auto nearest =
      static_cast<std::size_t>(std::ranges::min_element(places_, {}, distance_m) - places_.begin());
  const Place& here = places_[nearest];
  if (glm::dot(boresight(here.camera), boresight(camera)) < std::cos(0.5 * fov_rad)) return false;
  // Choose its neighbour on the trajectory that is nearer to the camera. The number before the
  // first wraps around and does not exist.
  const Place* other = nullptr;
  for (const std::size_t i : {nearest - 1, nearest + 1}) {
    if (i >= places_.size()) continue;
    if (other == nullptr || distance_m(places_[i]) < distance_m(*other)) other = &places_[i];
  }
  if (other == nullptr) return distance_m(here) == 0.0;
  // Refuse a camera that is farther away than the two positions are from each other.
  const glm::dvec3 way_m = other->camera.position_world_m - here.camera.position_world_m;
  const double length_m = glm::length(way_m);
  if (distance_m(here) > length_m) return false;
  // Interpolate at the foot of the camera on the line between them.
  const double offset_m = glm::dot(eye_m - here.camera.position_world_m, way_m);
  const double along =
      length_m > 0.0 ? std::clamp(offset_m / (length_m * length_m), 0.0, 1.0) : 0.0;
  for (std::size_t r = 0; r < levels.size(); ++r) {
    levels[r].frame_ms = std::lerp(here.levels[r].frame_ms, other->levels[r].frame_ms, along);
    levels[r].error_k = std::lerp(here.levels[r].error_k, other->levels[r].error_k, along);
  }
  return true;
}

}  // namespace emit::renderer
