// SPDX-License-Identifier: Apache-2.0
#include "budget/quality_ladder.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

namespace emit::renderer {
namespace {

glm::dvec3 boresight(const physics::Pose& camera) noexcept {
  return camera.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
}

}  // namespace

glm::uvec2 rendered_px(const QualityRung& rung, const glm::uvec2& picture_px) noexcept {
  const auto scaled = [&](std::uint32_t px) {
    return std::max(1U, static_cast<std::uint32_t>(std::lround(rung.scale_frac * px)));
  };
  return {scaled(picture_px.x), scaled(picture_px.y)};
}

void LadderMap::add(const physics::Pose& camera, const OfRungs& rungs) {
  places_.push_back({camera, rungs});
  std::vector<double> values(places_.size());
  const auto median = [&](std::size_t rung, double RungStats::*member) {
    for (std::size_t p = 0; p < places_.size(); ++p) values[p] = places_[p].rungs[rung].*member;
    std::ranges::sort(values);
    return values[values.size() / 2];
  };
  for (std::size_t r = 0; r < medians_.size(); ++r) {
    medians_[r] = {median(r, &RungStats::frame_ms), median(r, &RungStats::error_k)};
  }
}

bool LadderMap::at(const physics::Pose& camera, double fov_rad, OfRungs& rungs) const noexcept {
  rungs = medians_;
  if (places_.empty()) return false;
  const glm::dvec3& eye_m = camera.position_world_m;
  const auto distance_m = [&](const Place& place) {
    return glm::distance(place.camera.position_world_m, eye_m);
  };
  const auto nearest =
      static_cast<std::size_t>(std::ranges::min_element(places_, {}, distance_m) - places_.begin());
  const Place& here = places_[nearest];
  if (glm::dot(boresight(here.camera), boresight(camera)) < std::cos(0.5 * fov_rad)) return false;
  // Of its neighbours on the way the one on the camera's side.
  const Place* other = nullptr;
  for (const std::size_t i : {nearest - 1, nearest + 1}) {  // before the first: wraps
    if (i >= places_.size()) continue;
    if (other == nullptr || distance_m(places_[i]) < distance_m(*other)) other = &places_[i];
  }
  if (other == nullptr) return distance_m(here) == 0.0;
  const glm::dvec3 way_m = other->camera.position_world_m - here.camera.position_world_m;
  const double length_m = glm::length(way_m);
  if (distance_m(here) > length_m) return false;
  const double offset_m = glm::dot(eye_m - here.camera.position_world_m, way_m);
  const double along =
      length_m > 0.0 ? std::clamp(offset_m / (length_m * length_m), 0.0, 1.0) : 0.0;
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    rungs[r].frame_ms = std::lerp(here.rungs[r].frame_ms, other->rungs[r].frame_ms, along);
    rungs[r].error_k = std::lerp(here.rungs[r].error_k, other->rungs[r].error_k, along);
  }
  return true;
}

}  // namespace emit::renderer
