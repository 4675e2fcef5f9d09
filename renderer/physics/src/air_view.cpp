// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/air_view.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>
#include <thread>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/sky/cloud_field.hpp"

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

/// Air is even over this range, m.
constexpr double kEvenRangeM = 40.0;

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

/// Sine of the sun's elevation at a node.
double view_sun_sine(std::size_t i) {
  return std::min(
      1.0, AirView::kElevationScale * std::sinh(view_axis(i, AirView::kSuns, 0.0, kLastElevation)));
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

/// Cell of a range on its axis.
ViewCell range_cell(float range_m) noexcept {
  static const float kPerRange = static_cast<float>(
      (AirView::kRanges - 1) / std::log(AirView::kFarthestM / AirView::kNearestM));
  return view_cell(
      std::log(std::max(range_m, 1e-3F) / static_cast<float>(AirView::kNearestM)) * kPerRange,
      AirView::kRanges);
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
SkyShares make_sky_shares() {
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
const SkyShares& sky_shares() {
  static const SkyShares kShares = make_sky_shares();
  return kShares;
}

AirView::Node mix_nodes(const AirView::Node& a, const AirView::Node& b, float f) noexcept {
  AirView::Node out;
  for (std::size_t k = 0; k < out.size(); ++k) out[k] = a[k] + f * (b[k] - a[k]);
  return out;
}

/// Phase functions at the cosine of a scattering angle, from their nodes.
AirView::Node phase_between(std::span<const AirView::Node> phases, float cosine) noexcept {
  const float half_sine = std::sqrt(std::max(0.5F - 0.5F * cosine, 0.0F));
  const ViewCell cell = view_cell(half_sine * static_cast<float>(SunScatter::kPhaseNodes - 1),
                                  SunScatter::kPhaseNodes);
  return mix_nodes(phases[cell.index], phases[cell.index + 1], cell.fraction);
}

/// Returns 1 - exp(-x) for x >= 0 without cancellation, as the shader does.
float view_opacity(float x) noexcept {
  return x < 0.01F ? x * (1.0F - x * (0.5F - x / 6.0F)) : 1.0F - std::exp(-x);
}

}  // namespace

std::vector<AirView> AirView::build(const AirColumn& column, std::span<const Subject> subjects) {
  constexpr double kLeast = 1e-30;
  std::vector<AirView> views(subjects.size());
  // The sun stands at even steps of the sky's axis.
  std::array<double, kSuns> suns_rad{};
  for (std::size_t s = 0; s < kSuns; ++s) suns_rad[s] = std::asin(view_sun_sine(s));
  std::vector<std::optional<SunScatter::Beams>> beams(subjects.size());
  for (std::size_t v = 0; v < subjects.size(); ++v) {
    views[v].slices_.resize(kHeights * kNodes);
    if (subjects[v].scatter == nullptr) continue;
    const SunScatter& scatter = *subjects[v].scatter;
    beams[v] = scatter.beams(column, suns_rad);
    views[v].scattered_.resize(kSuns * kHeights * kNodes);
    for (std::size_t i = 0; i < SunScatter::kPhaseNodes; ++i) {
      views[v].phases_.push_back(scatter.phase_node_per_sr(i));
    }
  }
  // Light that the last longer path scattered, by subject.
  struct Light {
    std::array<SunScatter::Kinds, kSuns> by_sun{};
    double range_m = 0.0;  ///< 0: none yet
  };
  // Evaluate a path for all subjects. A range of 0 stands for the path to space.
  const auto fill = [&](std::size_t node, const AirPath& path, double range_m,
                        std::span<Light> lights) {
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
      if (!beams[v]) continue;
      // A short path scatters in proportion to its length.
      Light& light = lights[v];
      const bool longer = sky || range_m > kEvenRangeM || light.range_m == 0.0;
      if (longer) {
        subjects[v].scatter->scattered_w_m2(path, *beams[v], light.by_sun);
        light.range_m = range_m;
      }
      const double share = (longer ? 1.0 : range_m / light.range_m) / opaque;
      for (std::size_t s = 0; s < kSuns; ++s) {
        Node& out = views[v].scattered_[s * kHeights * kNodes + node];
        for (std::size_t k = 0; k < out.size(); ++k) {
          out[k] = static_cast<float>(share * light.by_sun[s][k]);
        }
      }
    }
  };
  // Give a node what its neighbour has.
  const auto copy = [&](std::size_t node, std::size_t from) {
    for (AirView& view : views) {
      view.slices_[node] = view.slices_[from];
      for (std::size_t s = 0; s < kSuns && view.scatters(); ++s) {
        const std::size_t first = s * kHeights * kNodes;
        view.scattered_[first + node] = view.scattered_[first + from];
      }
    }
  };
  const auto fill_sensor = [&](std::size_t sensor) {
    std::size_t node = sensor * kNodes;
    for (std::size_t target = 0; target < kHeights; ++target, node += kRanges) {
      std::vector<Light> lights(subjects.size());
      const double nearest_m = nearest_range_m(sensor, target);
      for (std::size_t r = kRanges; r-- > 0;) {
        // No lookup comes between heights that are farther apart than the range.
        if (r + 1 < kRanges && view_range_m(r + 1) < nearest_m) {
          copy(node + r, node + r + 1);
          continue;
        }
        fill(node + r,
             AirPath::between(column, kHeightM[sensor], kHeightM[target], view_range_m(r)),
             view_range_m(r), lights);
      }
    }
    std::vector<Light> lights(subjects.size());
    for (std::size_t e = 0; e < kElevations; ++e) {
      fill(node + e, AirPath::to_space(column, kHeightM[sensor], view_elevation_rad(e)), 0.0,
           lights);
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
  for (std::size_t i = 0; i < kNodes; ++i) out[i] = node_at(place, i < kSky ? place : sky, i);
}

AirView::Node AirView::node_at(const Place& place, const Place& radiance,
                               std::size_t node) noexcept {
  Node out;
  for (std::size_t k = 0; k < 3; ++k) {
    const float low = place.low[node].air[k];
    out[k] = low + place.fraction * (place.high[node].air[k] - low);
  }
  out[3] = radiance_at(radiance, node);
  return out;
}

double AirView::node_sine(std::size_t node) noexcept {
  static const std::array<double, kElevations> kSines = [] {
    std::array<double, kElevations> sines{};
    for (std::size_t e = 0; e < kElevations; ++e) sines[e] = std::sin(view_elevation_rad(e));
    return sines;
  }();
  return kSines[node];
}

AirView::ByElevation AirView::layer_w_m2_sr(double sensor_m, double warmer_k,
                                            const BlackLayer& layer) const noexcept {
  const Place place = place_of(sensor_m, warmer_k);
  const auto above_m = std::max(layer.height_m - sensor_m, 1.0);
  // A ray that would meet the ground is taken at the elevation that just passes it.
  const double eye_m = std::max(sensor_m, 0.0);
  const double horizon_sine =
      -std::sqrt(eye_m * (2.0 * kCloudEarthRadiusM + eye_m)) / (kCloudEarthRadiusM + eye_m);
  const ViewCell target = view_cell(height_place(static_cast<float>(layer.height_m)), kHeights);
  ByElevation out;
  for (std::size_t e = 0; e < kElevations; ++e) {
    const auto range_m =
        static_cast<float>(cloud_range_m(above_m, std::max(node_sine(e), horizon_sine)));
    const ViewCell range = range_cell(range_m);
    const auto row = [&](std::size_t t) {
      const std::size_t i = t * kRanges + range.index;
      return mix_nodes(node_at(place, place, i), node_at(place, place, i + 1), range.fraction);
    };
    const Node sight = mix_nodes(row(target.index), row(target.index + 1), target.fraction);
    const float through =
        std::exp(-std::exp(air_log_extinction(sight, static_cast<float>(layer.kelvin))) * range_m);
    out[e] =
        through * static_cast<float>(layer.radiance_w_m2_sr) + air_path_w_m2_sr(sight, range_m);
  }
  return out;
}

struct AirView::SunPlace {
  std::array<const Node*, 4> corner;  ///< first nodes: low sun, low and high sensor, then high sun
  std::array<float, 4> share;
};

AirView::SunPlace AirView::sun_place_of(double sensor_m, double sin_sun) const noexcept {
  const ViewCell sensor = view_cell(height_place(static_cast<float>(sensor_m)), kHeights);
  const double place = std::asinh(std::max(sin_sun, 0.0) / kElevationScale) / kLastElevation;
  const ViewCell sun = view_cell(static_cast<float>(place * (kSuns - 1)), kSuns);
  SunPlace out;
  for (std::size_t c = 0; c < 4; ++c) {
    const bool high_sun = c >= 2;
    const bool high_sensor = c % 2 == 1;
    out.corner[c] = &scattered_[((sun.index + (high_sun ? 1 : 0)) * kHeights + sensor.index +
                                 (high_sensor ? 1 : 0)) *
                                kNodes];
    out.share[c] = (high_sun ? sun.fraction : 1.0F - sun.fraction) *
                   (high_sensor ? sensor.fraction : 1.0F - sensor.fraction);
  }
  return out;
}

AirView::Node AirView::scattered_at(const SunPlace& place, std::size_t node) noexcept {
  Node out{};
  for (std::size_t c = 0; c < 4; ++c) {
    for (std::size_t k = 0; k < out.size(); ++k)
      out[k] += place.share[c] * place.corner[c][node][k];
  }
  return out;
}

void AirView::sun_at(double sensor_m, const Sunlight& sun, std::span<Node> out) const noexcept {
  EMIT_DCHECK(scatters() && out.size() == kSunNodes);
  const SunPlace place = sun_place_of(sensor_m, sun.sin_elevation);
  const auto share = static_cast<float>(sun.share_frac);
  for (std::size_t i = 0; i < kNodes; ++i) {
    out[i] = scattered_at(place, i);
    for (float& x : out[i]) x *= share;
  }
  std::copy(phases_.begin(), phases_.end(), out.begin() + kNodes);
}

double AirView::scattered_around(const SunPlace& place, double sin_sun, double sin_elevation,
                                 std::size_t node) const noexcept {
  // Take more directions near the sun's azimuth, where the phase functions are steep.
  constexpr int kAzimuths = 16;
  const double across =
      std::sqrt(std::max(0.0, (1.0 - sin_sun * sin_sun) * (1.0 - sin_elevation * sin_elevation)));
  Node phase{};
  for (int i = 0; i < kAzimuths; ++i) {
    const double u = (i + 0.5) / kAzimuths;
    const double cosine = sin_sun * sin_elevation + across * std::cos(kPi * u * u);
    const Node one = phase_between(phases_, static_cast<float>(cosine));
    for (std::size_t k = 0; k < phase.size(); ++k) {
      phase[k] += static_cast<float>(2.0 * u / kAzimuths) * one[k];
    }
  }
  return static_cast<double>(
      air_sun_w_m2_sr(scattered_at(place, kHeights * kRanges + node), phase));
}

double AirView::scattered_sky_w_m2_sr(double height_m, double sin_sun,
                                      double sin_elevation) const noexcept {
  const SunPlace place = sun_place_of(height_m, sin_sun);
  const ViewCell cell = elevation_cell(static_cast<float>(sin_elevation));
  return std::lerp(scattered_around(place, sin_sun, sin_elevation, cell.index),
                   scattered_around(place, sin_sun, sin_elevation, cell.index + 1),
                   static_cast<double>(cell.fraction));
}

SkyByTilt AirView::scattered_sky_by_tilt_w_m2_sr(double height_m, double sin_sun) const noexcept {
  const SkyShares& shares = sky_shares();
  const SunPlace place = sun_place_of(height_m, sin_sun);
  SkyByTilt sum{};
  for (std::size_t e = 0; e < kElevations; ++e) {
    const SkyByTilt& share = shares[e];
    if (share[kSkyTilts - 1] == 0.0 && share[0] == 0.0) continue;
    const double radiance = scattered_around(place, sin_sun, node_sine(e), e);
    for (std::size_t t = 0; t < kSkyTilts; ++t) sum[t] += share[t] * radiance;
  }
  return sum;
}

SkyByTilt AirView::clear_sky_by_tilt_w_m2_sr(double height_m, double warmer_k) const noexcept {
  const SkyShares& shares = sky_shares();
  const Place place = place_of(height_m, warmer_k);
  SkyByTilt sum{};
  for (std::size_t e = 0; e < kElevations; ++e) {
    const SkyByTilt& share = shares[e];
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
  const ViewCell target = view_cell(height_place(target_m), AirView::kHeights);
  const ViewCell range = range_cell(range_m);
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

SkyByTilt sky_by_tilt_of(const AirView::ByElevation& sky) noexcept {
  const SkyShares& shares = sky_shares();
  SkyByTilt sum{};
  for (std::size_t e = 0; e < AirView::kElevations; ++e) {
    for (std::size_t t = 0; t < kSkyTilts; ++t) {
      sum[t] += shares[e][t] * static_cast<double>(sky[e]);
    }
  }
  return sum;
}

float sky_at_elevation(const AirView::ByElevation& sky, float sin_elevation) noexcept {
  const ViewCell place = elevation_cell(sin_elevation);
  return sky[place.index] + place.fraction * (sky[place.index + 1] - sky[place.index]);
}

float air_log_extinction(const AirView::Node& node, float temperature_k) noexcept {
  const float inverse = 1.0F / std::max(temperature_k, 200.0F);
  const float warm = (1.0F / 300.0F - inverse) / (1.0F / 300.0F - 1.0F / 800.0F);
  const float hot = (1.0F / 800.0F - inverse) / (1.0F / 800.0F - 1.0F / 5772.0F);
  return hot > 0.0F ? std::lerp(node[1], node[2], std::min(hot, 1.0F))
                    : std::lerp(node[0], node[1], warm);
}

AirView::Node air_sky_node(std::span<const AirView::Node> table, float sin_elevation) noexcept {
  const ViewCell place = elevation_cell(sin_elevation);
  const std::size_t i = AirView::kHeights * AirView::kRanges + place.index;
  return mix_nodes(table[i], table[i + 1], place.fraction);
}

AirView::Node air_sun_phase(std::span<const AirView::Node> sun_table, float cosine) noexcept {
  return phase_between(sun_table.subspan(AirView::kNodes), cosine);
}

AirSight air_sky(std::span<const AirView::Node> table, float sin_elevation) noexcept {
  const AirView::Node node = air_sky_node(table, sin_elevation);
  AirSight out;
  for (std::size_t k = 0; k < 3; ++k) out.transmittance_frac[k] = std::exp(-node[k]);
  out.path_radiance_w_m2_sr = node[3];
  return out;
}

}  // namespace emit::physics
