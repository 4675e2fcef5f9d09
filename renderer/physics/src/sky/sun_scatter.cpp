// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky/sun_scatter.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <utility>

#include "../air_tables.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "sun_scatter_tables.hpp"

namespace emit::physics {
namespace {

namespace tables = sun_scatter_tables;

/// Least sunlight that a white surface sends, by what a blackbody of 300 K does.
constexpr double kLeastSunFrac = 0.1;
/// Place of the haze, of the haze by humidity, and of the aerosol above among the absorbers.
constexpr std::size_t kHaze = 7;
constexpr std::size_t kHumidHaze = 8;
constexpr std::size_t kUpperAerosol = 9;
/// The humid haze has 0.25 / (1 - humidity) of the haze (AirColumn).
constexpr double kHumidShare = 0.25;
/// The aerosol above the haze is the tropospheric one up to here.
constexpr double kTropopauseM = 10500.0;
/// Place of a kind's first scatterer, and the end of the last one.
constexpr std::array<std::size_t, SunScatter::kKinds + 1> kFirstOfKind{0, 4, 5, 6, 7};

/// Heights at which the sun's beams are kept, m.
constexpr std::array<double, 36> kBeamHeightM{
    0,     125,   250,   375,   500,   750,   1000,  1250,  1500,  1750,  2000,  2250,
    2500,  2750,  3000,  3500,  4000,  4500,  5000,  5500,  6000,  7000,  8000,  9000,
    10000, 11000, 12000, 14000, 16000, 18000, 20000, 25000, 30000, 40000, 60000, 100000};

/// Terms are put together where the logarithms of their vertical depths differ less than this.
constexpr double kDepthStep = 0.35;
constexpr double kUnseenFrac = 1e-4;
/// A term counts where at least this share of all sunlight arrives in it.
constexpr double kUnlitFrac = 1e-5;

/// Optical depth of a kilometre of air at 0 deg C and one atmosphere by Rayleigh scattering
/// (LOWTRAN7's formula).
double rayleigh_per_km(double um) noexcept {
  const double per_cm = 1e4 / um;
  return std::pow(per_cm, 4) / (9.26799e18 - 1.07123e9 * per_cm * per_cm);
}
/// Phase function of molecules with a depolarisation of 0.0279, sr-1.
double rayleigh_phase_per_sr(double cosine) noexcept {
  return 0.06050402 + 0.0572197 * cosine * cosine;
}

double depth_of(const std::array<double, kAirAbsorbers>& extinction,
                const std::array<double, kAirAbsorbers>& amount) noexcept {
  return std::inner_product(extinction.begin(), extinction.end(), amount.begin(), 0.0);
}

}  // namespace

std::array<double, SunScatter::kScatterers> SunScatter::amounts_of(
    const AirPath::Stretch& stretch) noexcept {
  std::array<double, kScatterers> out{};
  const double haze = stretch.amount[kHaze];
  if (haze > 0.0) {
    // Split the haze by the logarithm of how dry the air is.
    const double dry_frac = kHumidShare * haze / std::max(stretch.amount[kHumidHaze], 1e-300);
    const auto& humidity = tables::kHazeHumidityFrac;
    std::size_t i = 0;
    while (i + 2 < humidity.size() && dry_frac < 1.0 - humidity[i + 1]) ++i;
    const double low = std::log(1.0 - humidity[i]);
    const double high = std::log(1.0 - humidity[i + 1]);
    const double f = std::clamp((std::log(std::min(dry_frac, 1.0)) - low) / (high - low), 0.0, 1.0);
    out[i] = (1.0 - f) * haze;
    out[i + 1] = f * haze;
  }
  out[stretch.height_m < kTropopauseM ? 4 : 5] = stretch.amount[kUpperAerosol];
  out[6] = stretch.standard_air_km;
  return out;
}

std::optional<SunScatter> SunScatter::build(const AirColumn& column, const Band& band) {
  if (!validate(band) || !BandAir::covers(band)) return std::nullopt;
  // Split the band as BandAir does.
  std::vector<Term> terms;
  std::vector<double> um;
  double sun_w_m2 = 0.0;
  for (const air_tables::Piece& piece : air_tables::pieces()) {
    const auto part = air_tables::part_of(band, piece);
    if (!part) continue;
    const double sun = piece.sun_w_m2_cm * air_tables::integrate_response(*part).over_per_cm;
    const double middle_um = 0.5 * (part->lo_um + part->hi_um);
    const auto aerosols = tables::scattering(middle_um);
    sun_w_m2 += sun;
    const double weights = std::accumulate(piece.weight.begin(), piece.weight.end(), 0.0);
    for (std::size_t t = 0; t < air_tables::kPieceTerms; ++t) {
      Term term{sun * piece.weight[t] / weights, piece.extinction[t], {}};
      std::copy(aerosols.begin(), aerosols.end(), term.scattering.begin());
      term.scattering[6] = rayleigh_per_km(middle_um);
      terms.push_back(term);
      um.push_back(middle_um);
    }
  }
  const double black = band_radiance(band, Kelvin(300.0)).radiance_w_m2_sr;
  if (!(sun_w_m2 / kPi > kLeastSunFrac * black)) return std::nullopt;
  SunScatter out;
  out.sun_w_m2_ = sun_w_m2;
  const AirPath vertical = AirPath::to_space(column, 0.0, kPi / 2.0);
  out.set_phases(terms, um, vertical);
  // Put terms together that are as deep, and whose depth has the same cause.
  AirPath::Stretch whole;
  for (std::size_t i = 0; i < vertical.size(); ++i) {
    for (std::size_t k = 0; k < kAirAbsorbers; ++k) whole.amount[k] += vertical[i].amount[k];
  }
  std::map<std::pair<int, bool>, Term> groups;
  for (const Term& term : terms) {
    const double depth = depth_of(term.extinction, whole.amount);
    double water = 0.0;
    for (std::size_t k = 0; k < 3; ++k) water += term.extinction[k] * whole.amount[k];
    Term& group =
        groups[{static_cast<int>(std::floor(std::log(std::max(depth, 1e-3)) / kDepthStep)),
                water > 0.5 * depth}];
    group.sun_w_m2 += term.sun_w_m2;
    for (std::size_t k = 0; k < kAirAbsorbers; ++k) {
      group.extinction[k] += term.sun_w_m2 * term.extinction[k];
    }
    for (std::size_t k = 0; k < kScatterers; ++k) {
      group.scattering[k] += term.sun_w_m2 * term.scattering[k];
    }
  }
  for (auto& [key, group] : groups) {
    if (!(group.sun_w_m2 > 0.0)) continue;
    for (double& x : group.extinction) x /= group.sun_w_m2;
    for (double& x : group.scattering) x /= group.sun_w_m2;
    out.terms_.push_back(group);
  }
  return out;
}

void SunScatter::set_phases(std::span<const Term> terms, std::span<const double> um,
                            const AirPath& vertical) {
  // Weigh wavelengths and aerosols as they count on the way down and, half as long again, on a
  // slanting way up: with the light that is left.
  constexpr double kAirMass = 2.5;
  constexpr double kDeepest = 30.0;
  std::array<double, kScatterers> amount{};
  std::array<double, kAirAbsorbers> absorbers{};
  for (std::size_t i = 0; i < vertical.size(); ++i) {
    const auto scatterers = amounts_of(vertical[i]);
    for (std::size_t k = 0; k < kScatterers; ++k) amount[k] += scatterers[k];
    for (std::size_t k = 0; k < kAirAbsorbers; ++k) absorbers[k] += vertical[i].amount[k];
  }
  std::map<double, std::array<double, kScatterers>> weight_at_um;
  for (std::size_t t = 0; t < terms.size(); ++t) {
    const double depth = kAirMass * depth_of(terms[t].extinction, absorbers);
    const double light = terms[t].sun_w_m2 * std::exp(-std::min(depth, kDeepest));
    auto& weight = weight_at_um[um[t]];
    for (std::size_t k = 0; k < kScatterers; ++k) {
      weight[k] += light * terms[t].scattering[k] * amount[k];
    }
  }
  for (std::size_t n = 0; n < kPhaseNodes; ++n) {
    const double half_sine = static_cast<double>(n) / (kPhaseNodes - 1);
    const double angle_rad = 2.0 * std::asin(half_sine);
    for (std::size_t kind = 0; kind + 1 < kKinds; ++kind) {
      double sum = 0.0;
      double weights = 0.0;
      for (const auto& [wavelength_um, weight] : weight_at_um) {
        for (std::size_t k = kFirstOfKind[kind]; k < kFirstOfKind[kind + 1]; ++k) {
          if (!(weight[k] > 0.0)) continue;
          sum += weight[k] * tables::phase_per_sr(k, wavelength_um, angle_rad / kDegree);
          weights += weight[k];
        }
      }
      phases_[n][kind] = static_cast<float>(weights > 0.0 ? sum / weights : 0.0);
    }
    phases_[n][kKinds - 1] = static_cast<float>(rayleigh_phase_per_sr(std::cos(angle_rad)));
  }
}

SunScatter::Beams SunScatter::beams(const AirColumn& column,
                                    std::span<const double> elevations_rad) const {
  Beams out;
  out.suns_ = elevations_rad.size();
  for (const double height_m : kBeamHeightM) {
    std::vector<std::array<double, kAirAbsorbers>> amounts(out.suns_);
    for (std::size_t s = 0; s < out.suns_; ++s) {
      const AirPath path = AirPath::to_space(column, height_m, elevations_rad[s]);
      for (std::size_t i = 0; i < path.size(); ++i) {
        for (std::size_t k = 0; k < kAirAbsorbers; ++k) amounts[s][k] += path[i].amount[k];
      }
    }
    for (const Term& term : terms_) {
      for (std::size_t s = 0; s < out.suns_; ++s) {
        out.through_frac_.push_back(
            static_cast<float>(std::exp(-depth_of(term.extinction, amounts[s]))));
      }
    }
  }
  return out;
}

void SunScatter::scattered_w_m2(const AirPath& path, const Beams& beams,
                                std::span<Kinds> out) const noexcept {
  EMIT_DCHECK(out.size() == beams.size());
  std::fill(out.begin(), out.end(), Kinds{});
  const std::size_t row = terms_.size() * beams.suns_;
  // Find what each stretch scatters with, and its place among the heights of the beams.
  struct Lit {
    std::array<double, kScatterers> amount;
    const float* low;
    float fraction;
  };
  std::array<Lit, AirPath::kMaxStretches> lit;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const auto above =
        std::upper_bound(kBeamHeightM.begin() + 1, kBeamHeightM.end() - 1, path[i].height_m);
    const auto h = static_cast<std::size_t>(above - kBeamHeightM.begin()) - 1;
    const double f = (path[i].height_m - kBeamHeightM[h]) / (kBeamHeightM[h + 1] - kBeamHeightM[h]);
    lit[i] = {amounts_of(path[i]), beams.through_frac_.data() + h * row,
              static_cast<float>(std::clamp(f, 0.0, 1.0))};
  }
  if (path.size() == 0 || beams.suns_ == 0) return;
  // The most light is that of the highest sun at the highest place.
  const float* brightest = lit[0].low;
  for (std::size_t i = 1; i < path.size(); ++i) brightest = std::max(brightest, lit[i].low);
  brightest += row + beams.suns_ - 1;
  for (std::size_t t = 0; t < terms_.size(); ++t) {
    const Term& term = terms_[t];
    const auto most = static_cast<double>(brightest[t * beams.suns_]);
    if (term.sun_w_m2 * most < kUnlitFrac * sun_w_m2_) continue;
    double before = 1.0;
    for (std::size_t i = 0; i < path.size() && before > kUnseenFrac; ++i) {
      const double depth = depth_of(term.extinction, path[i].amount);
      const double after = before * std::exp(-depth);
      // The light comes from all of an even stretch.
      const double seen = term.sun_w_m2 * (depth > 1e-6 ? (before - after) / depth : before);
      Kinds sent{};
      for (std::size_t kind = 0; kind < kKinds; ++kind) {
        for (std::size_t k = kFirstOfKind[kind]; k < kFirstOfKind[kind + 1]; ++k) {
          sent[kind] += seen * term.scattering[k] * lit[i].amount[k];
        }
      }
      before = after;
      const float* low = lit[i].low + t * beams.suns_;
      const float* high = low + row;
      for (std::size_t s = 0; s < beams.suns_; ++s) {
        const auto sun = static_cast<double>(low[s] + lit[i].fraction * (high[s] - low[s]));
        for (std::size_t kind = 0; kind < kKinds; ++kind) out[s][kind] += sent[kind] * sun;
      }
    }
  }
}

SunScatter::Kinds SunScatter::phase_per_sr(double cosine) const noexcept {
  const double place = std::sqrt(std::clamp(0.5 - 0.5 * cosine, 0.0, 1.0)) * (kPhaseNodes - 1);
  const std::size_t node = std::min(static_cast<std::size_t>(place), kPhaseNodes - 2);
  const double f = place - static_cast<double>(node);
  Kinds out;
  for (std::size_t kind = 0; kind < kKinds; ++kind) {
    out[kind] = std::lerp(static_cast<double>(phases_[node][kind]),
                          static_cast<double>(phases_[node + 1][kind]), f);
  }
  return out;
}

}  // namespace emit::physics
