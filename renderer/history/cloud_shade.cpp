// SPDX-License-Identifier: Apache-2.0
#include "history/cloud_shade.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "history/step_plan.hpp"

namespace emit::renderer {
namespace {

/// Height over which the change of the crossing with height is taken.
constexpr double kRiseM = 10.0;
/// Parts in which the way of the clouds over an interval is measured.
constexpr std::int64_t kParts = 8;
/// Width of the mean at a place by the distance to the next. The mean is as wide across the way as
/// along it: a wider one takes in clouds that pass beside the point, a narrower one misses clouds
/// between the places. Over an hour half of the distance leaves the least error.
constexpr double kWidthFrac = 0.5;

}  // namespace

void CloudShade::update(std::int64_t begin_ns, std::int64_t end_ns, const Environment& environment,
                        const glm::dvec3& origin_world_m) noexcept {
  count_ = 0;
  field_ = environment.clouds();
  if (field_ == nullptr) return;
  base_m_ = field_->clouds().base_m - origin_world_m.z;
  if (!(base_m_ > kRiseM)) return;
  const glm::dvec2 origin_m(origin_world_m);
  const glm::dvec2 drift_m_s = field_->clouds().velocity_m_s();
  const auto counts = [](const physics::SunPosition& sun) {
    return sun.elevation.value() > StepPlan::kMinSunElevationRad;
  };
  // Measure the way of the field over the place, by drift and by the turn of the sun.
  const double length_s = 1e-9 * static_cast<double>(end_ns - begin_ns);
  double way_m = 0.0;
  bool known = false;
  glm::dvec2 last_m(0.0);
  for (std::int64_t part = 0; part <= kParts; ++part) {
    const std::int64_t at_ns = begin_ns + (end_ns - begin_ns) / kParts * part;
    const physics::SunPosition sun = environment.sun_at(at_ns);
    if (!counts(sun)) {
      known = false;
      continue;
    }
    const double passed_s = length_s * static_cast<double>(part) / kParts;
    const glm::dvec2 now_m =
        physics::cloud_crossing_m(base_m_, sun.direction_enu) - passed_s * drift_m_s;
    if (known) way_m += glm::distance(last_m, now_m);
    last_m = now_m;
    known = true;
  }
  const double way_tiles = way_m / field_->clouds().period_m();
  const double texels = std::ceil(way_tiles * static_cast<double>(physics::CloudField::kSide));
  const auto taps =
      static_cast<std::size_t>(std::clamp(texels, 1.0, static_cast<double>(kMostTaps)));
  width_tiles_ = kWidthFrac * way_tiles / static_cast<double>(taps);
  // Take an instant in the middle of each part.
  for (std::size_t k = 0; k < taps; ++k) {
    const double share = (static_cast<double>(k) + 0.5) / static_cast<double>(taps);
    const std::int64_t at_ns =
        begin_ns + std::llround(share * static_cast<double>(end_ns - begin_ns));
    const physics::SunPosition sun = environment.sun_at(at_ns);
    if (!counts(sun)) continue;
    const glm::dvec2 crossing_m = physics::cloud_crossing_m(base_m_, sun.direction_enu);
    const glm::dvec2 higher_m = physics::cloud_crossing_m(base_m_ - kRiseM, sun.direction_enu);
    taps_[count_++] = {field_->tile_at(origin_m + crossing_m, at_ns),
                       field_->tiles_of(higher_m - crossing_m) / kRiseM,
                       environment.cloud_light(environment.forcing_at(at_ns, sun), sun)};
  }
}

float CloudShade::by_mean(const glm::vec3& place_m) const noexcept {
  if (count_ == 0) return 1.0F;
  const glm::dvec3 place(place_m);
  const glm::dvec2 aside = field_->tiles_of(glm::dvec2(place));
  const bool above = place.z >= base_m_;
  double sum = 0.0;
  for (std::size_t k = 0; k < count_; ++k) {
    const Tap& tap = taps_[k];
    const double opacity_frac =
        above ? 0.0
              : field_->opacity_frac(tap.tile + aside + place.z * tap.tiles_per_m_up, width_tiles_);
    sum += tap.light.by_mean(opacity_frac);
  }
  return static_cast<float>(sum / static_cast<double>(count_));
}

}  // namespace emit::renderer
