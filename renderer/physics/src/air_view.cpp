// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/air_view.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

constexpr std::array<double, 3> kWarmerK{-AirView::kMostWarmerK, 0.0, AirView::kMostWarmerK};

/// Position on a uniform axis of `nodes` nodes from `first` to `last`.
double view_axis(std::size_t i, std::size_t nodes, double first, double last) {
  return first + (last - first) * static_cast<double>(i) / static_cast<double>(nodes - 1);
}

const double kFirstElevation = std::asinh(AirView::kLowestSine / AirView::kElevationScale);
const double kLastElevation = std::asinh(1.0 / AirView::kElevationScale);

constexpr std::array<double, AirView::kHeights> kHeightM{
    0,    250,  500,  750,  1000, 1250, 1500,  1750,  2000,  2500,  3000,
    4000, 5000, 6000, 7000, 8000, 9000, 10000, 11000, 12000, 17000, 22000};

/// Place of a height on its axis, in nodes.
float height_place(float height_m) noexcept {
  const float km = height_m * 1e-3F;
  return 4.0F * std::clamp(km, 0.0F, 2.0F) + 2.0F * std::clamp(km - 2.0F, 0.0F, 1.0F) +
         std::clamp(km - 3.0F, 0.0F, 9.0F) + 0.2F * std::clamp(km - 12.0F, 0.0F, 10.0F);
}

double view_range_m(std::size_t i) {
  return AirView::kNearestM *
         std::pow(AirView::kFarthestM / AirView::kNearestM,
                  static_cast<double>(i) / static_cast<double>(AirView::kRanges - 1));
}

/// Smallest range of a line of sight whose ends lie in the cells around two nodes of height.
double nearest_range_m(std::size_t sensor, std::size_t target) {
  const std::size_t low = std::min(sensor, target);
  const std::size_t high = std::max(sensor, target);
  return high - low <= 2 ? 0.0 : kHeightM[high - 1] - kHeightM[low + 1];
}

double view_elevation_rad(std::size_t i) {
  const double v = view_axis(i, AirView::kElevations, kFirstElevation, kLastElevation);
  return std::asin(std::clamp(AirView::kElevationScale * std::sinh(v), -1.0, 1.0));
}

/// ViewCell of a uniform axis and the fraction of it. NaN counts as the start of the axis.
struct ViewCell {
  std::size_t index;
  float fraction;
};
ViewCell view_cell(float place, std::size_t nodes) noexcept {
  const float last = static_cast<float>(nodes - 1);
  const float held = place > 0.0F ? std::min(place, last) : 0.0F;
  const auto index = std::min(static_cast<std::size_t>(held), nodes - 2);
  return {index, held - static_cast<float>(index)};
}

/// Cell of the sky's axis for a sine of the elevation.
ViewCell elevation_cell(float sin_elevation) noexcept {
  static const float kFirst = static_cast<float>(kFirstElevation);
  static const float kPerNode =
      static_cast<float>((AirView::kElevations - 1) / (kLastElevation - kFirstElevation));
  const float x = sin_elevation / static_cast<float>(AirView::kElevationScale);
  // asinh() of a negative argument would cancel.
  const float root = std::log(std::abs(x) + std::sqrt(x * x + 1.0F));
  return view_cell(((x < 0.0F ? -root : root) - kFirst) * kPerNode, AirView::kElevations);
}

/// Shares of the sky's nodes in the means of sky_by_tilt().
using SkyShares = std::array<SkyByTilt, AirView::kElevations>;
SkyShares sky_shares() {
  SkyShares shares{};
  for (std::size_t e = 0; e < AirView::kElevations; ++e) {
    shares[e] = sky_by_tilt([e](double sine) {
      const ViewCell cell = elevation_cell(static_cast<float>(sine));
      if (e == cell.index) return 1.0 - static_cast<double>(cell.fraction);
      return e == cell.index + 1 ? static_cast<double>(cell.fraction) : 0.0;
    });
  }
  return shares;
}

AirView::Node mix_nodes(const AirView::Node& a, const AirView::Node& b, float f) noexcept {
  AirView::Node out;
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = a[k] + f * (b[k] - a[k]);
  return out;
}

/// Returns 1 - exp(-x) for x >= 0 without cancellation, as the shader does.
float view_opacity(float x) noexcept {
  return x < 0.01F ? x * (1.0F - x * (0.5F - x / 6.0F)) : 1.0F - std::exp(-x);
}

}  // namespace

std::vector<AirView> AirView::build(const AirColumn& column, std::span<const Subject> subjects) {
  constexpr double kLeast = 1e-30;
  std::vector<AirView> views(subjects.size());
  for (AirView& view : views) view.slices_.resize(kHeights * kNodes);
  // Evaluate a path for all subjects. A range of 0 stands for the path to space.
  const auto fill = [&](std::size_t node, const AirPath& path, double range_m) {
    const bool sky = range_m == 0.0;
    for (std::size_t v = 0; v < subjects.size(); ++v) {
      const auto sight = subjects[v].band->evaluate(path, subjects[v].sources, kWarmerK);
      Slice& slice = views[v].slices_[node];
      double opaque = 1.0;
      for (std::size_t k = 0; k < slice.air.size(); ++k) {
        const double tau = std::clamp(sight.transmittance_frac[k], kLeast, 1.0 - 1e-12);
        if (k == 0 && !sky) opaque = 1.0 - tau;
        slice.air[k] =
            static_cast<float>(sky ? -std::log(tau) : std::log(-std::log(tau) / range_m));
      }
      for (std::size_t w = 0; w < kWarmerK.size(); ++w) {
        slice.log_radiance[w] =
            static_cast<float>(std::log(std::max(sight.path_radiance_w_m2_sr[w] / opaque, kLeast)));
      }
    }
  };
  const auto fill_sensor = [&](std::size_t sensor) {
    std::size_t node = sensor * kNodes;
    for (std::size_t target = 0; target < kHeights; ++target, node += kRanges) {
      const double nearest_m = nearest_range_m(sensor, target);
      for (std::size_t r = kRanges; r-- > 0;) {
        // No lookup comes between heights that are farther apart than the range.
        if (r + 1 < kRanges && view_range_m(r + 1) < nearest_m) {
          for (AirView& view : views) view.slices_[node + r] = view.slices_[node + r + 1];
          continue;
        }
        fill(node + r,
             AirPath::between(column, kHeightM[sensor], kHeightM[target], view_range_m(r)),
             view_range_m(r));
      }
    }
    for (std::size_t e = 0; e < kElevations; ++e) {
      fill(node + e, AirPath::to_space(column, kHeightM[sensor], view_elevation_rad(e)), 0.0);
    }
  };
  // Share the sensors' heights among the processors.
  std::atomic<std::size_t> next{0};
  const auto work = [&] {
    for (std::size_t i = next++; i < kHeights; i = next++) fill_sensor(i);
  };
  std::vector<std::jthread> others;
  const std::size_t cores = std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, 8);
  for (std::size_t i = 1; i < cores; ++i) others.emplace_back(work);
  work();
  others.clear();
  return views;
}

struct AirView::Place {
  const Slice* low;
  const Slice* high;
  float fraction;
  std::array<float, 3> share;
};

AirView::Place AirView::place_of(double sensor_m, double warmer_k) const noexcept {
  const ViewCell sensor = view_cell(height_place(static_cast<float>(sensor_m)), kHeights);
  // Interpolate the logarithm of the radiance with the parabola through the three temperatures.
  const float x = static_cast<float>(std::clamp(warmer_k / kMostWarmerK, -1.0, 1.0));
  const Slice* low = &slices_[sensor.index * kNodes];
  return {low,
          low + kNodes,
          sensor.fraction,
          {0.5F * x * (x - 1.0F), 1.0F - x * x, 0.5F * x * (x + 1.0F)}};
}

float AirView::radiance_at(const Place& place, std::size_t node) noexcept {
  const auto logarithm = [&place](const Slice& slice) {
    return place.share[0] * slice.log_radiance[0] + place.share[1] * slice.log_radiance[1] +
           place.share[2] * slice.log_radiance[2];
  };
  const float low = logarithm(place.low[node]);
  return std::exp(low + place.fraction * (logarithm(place.high[node]) - low));
}

void AirView::at(double sensor_m, const Weather& weather, std::span<Node> out) const noexcept {
  EMIT_DCHECK(out.size() == kNodes);
  constexpr std::size_t kSky = kHeights * kRanges;
  const Place place = place_of(sensor_m, weather.warmer_k);
  const Place sky = place_of(sensor_m, weather.sky_warmer_k);
  for (std::size_t i = 0; i < kNodes; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      const float low = place.low[i].air[k];
      out[i][k] = low + place.fraction * (place.high[i].air[k] - low);
    }
    out[i][3] = radiance_at(i < kSky ? place : sky, i);
  }
  // Cover a share of the sky with clouds.
  if (weather.cloud_base_m <= sensor_m) return;
  const auto cover = static_cast<float>(weather.cloud_cover_frac);
  const auto cloud = static_cast<float>(weather.cloud_radiance_w_m2_sr);
  for (std::size_t i = kSky; i < kNodes; ++i) out[i][3] += cover * (cloud - out[i][3]);
}

SkyByTilt AirView::clear_sky_by_tilt_w_m2_sr(double height_m, double warmer_k) const noexcept {
  static const SkyShares kShares = sky_shares();
  const Place place = place_of(height_m, warmer_k);
  SkyByTilt sum{};
  for (std::size_t e = 0; e < kElevations; ++e) {
    const SkyByTilt& share = kShares[e];
    if (share[kSkyTilts - 1] == 0.0 && share[0] == 0.0) continue;
    const double radiance = radiance_at(place, kHeights * kRanges + e);
    for (std::size_t t = 0; t < kSkyTilts; ++t) sum[t] += share[t] * radiance;
  }
  return sum;
}

double AirView::clear_sky_w_m2_sr(double height_m, double warmer_k,
                                  double sin_elevation) const noexcept {
  const Place place = place_of(height_m, warmer_k);
  const ViewCell cell = elevation_cell(static_cast<float>(sin_elevation));
  const std::size_t i = kHeights * kRanges + cell.index;
  return std::lerp(radiance_at(place, i), radiance_at(place, i + 1), cell.fraction);
}

double AirView::sun_transmittance_frac(double height_m, double sin_elevation) const noexcept {
  const Place place = place_of(height_m, 0.0);
  const ViewCell cell = elevation_cell(static_cast<float>(sin_elevation));
  const auto depth = [&](std::size_t e) {
    const std::size_t i = kHeights * kRanges + e;
    return place.low[i].air[2] + place.fraction * (place.high[i].air[2] - place.low[i].air[2]);
  };
  const float low = depth(cell.index);
  return std::exp(-(low + cell.fraction * (depth(cell.index + 1) - low)));
}

AirView::Node air_sight_node(std::span<const AirView::Node> table, float target_m,
                             float range_m) noexcept {
  static const float kPerRange = static_cast<float>(
      (AirView::kRanges - 1) / std::log(AirView::kFarthestM / AirView::kNearestM));
  const ViewCell target = view_cell(height_place(target_m), AirView::kHeights);
  const ViewCell range = view_cell(
      std::log(std::max(range_m, 1e-3F) / static_cast<float>(AirView::kNearestM)) * kPerRange,
      AirView::kRanges);
  const auto row = [&](std::size_t t) {
    const std::size_t i = t * AirView::kRanges + range.index;
    return mix_nodes(table[i], table[i + 1], range.fraction);
  };
  return mix_nodes(row(target.index), row(target.index + 1), target.fraction);
}

float air_path_w_m2_sr(const AirView::Node& node, float range_m) noexcept {
  return view_opacity(std::exp(node[0]) * range_m) * node[3];
}

AirSight air_sight(std::span<const AirView::Node> table, float target_m, float range_m) noexcept {
  const AirView::Node node = air_sight_node(table, target_m, range_m);
  AirSight out;
  for (std::size_t k = 0; k < 3; ++k) {
    out.transmittance_frac[k] = std::exp(-std::exp(node[k]) * range_m);
  }
  out.path_radiance_w_m2_sr = air_path_w_m2_sr(node, range_m);
  return out;
}

AirSight air_sky(std::span<const AirView::Node> table, float sin_elevation) noexcept {
  const ViewCell place = elevation_cell(sin_elevation);
  const std::size_t i = AirView::kHeights * AirView::kRanges + place.index;
  const AirView::Node node = mix_nodes(table[i], table[i + 1], place.fraction);
  AirSight out;
  for (std::size_t k = 0; k < 3; ++k) out.transmittance_frac[k] = std::exp(-node[k]);
  out.path_radiance_w_m2_sr = node[3];
  return out;
}

}  // namespace emit::physics
