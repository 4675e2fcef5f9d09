// SPDX-License-Identifier: Apache-2.0
#include "history/opening_states.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "emit/physics/check.hpp"
#include "history/foster_history.hpp"

namespace emit::renderer {
namespace {

using physics::FosterDrive;
using physics::FosterState;

/// The search for the periodic state ends when the temperature that it assumed and the one that
/// follows from it are so close, K, or after so many days.
constexpr double kPeriodicK = 0.01;
constexpr int kMostDays = 12;

/// Returns the drive of a face of a tilt and of shares of sun and sky. The sun on it is a share of
/// that on a face that follows the sun. The film is the mean of those of four azimuths.
FosterDrive<double> face_drive(const SurfaceForcing& f, const FosterMaterial& material, double up,
                               double sun_share, double sky_frac, double reference_k,
                               double offset_k) noexcept {
  // Whatever hides the sky above the horizon is in its own shade: it is as warm as the air, and no
  // sunlight comes from it.
  const double ground_frac = std::min(1.0 - sky_frac, 0.5 * (1.0 - up));
  const double short_wave_w_m2 = sun_share * glm::length(f.sun_w_m2) + sky_frac * f.diffuse_w_m2 +
                                 ground_frac * f.reflected_w_m2;
  const double air2 = f.air_k * f.air_k;
  const double long_wave_w_m2 =
      sky_frac * f.longwave_w_m2 + ground_frac * f.environment_w_m2 +
      (1.0 - sky_frac - ground_frac) * physics::kStefanBoltzmannWPerM2K4 * air2 * air2;
  const double side = std::sqrt(std::max(0.0, 1.0 - up * up));
  const double excess_k = reference_k + offset_k - f.air_k;
  const auto film = [&](double east, double north) {
    return physics::film_w_m2_k(f.film, glm::dvec3(side * east, side * north, up), material.skin,
                                excess_k);
  };
  const double film_w_m2_k =
      side == 0.0 ? film(0.0, 0.0)
                  : 0.25 * (film(1.0, 0.0) + film(-1.0, 0.0) + film(0.0, 1.0) + film(0.0, -1.0));
  FosterDrive<double> drive{.absorbed_w_m2 = material.solar_absorptance_frac * short_wave_w_m2 +
                                             material.emissivity_frac * long_wave_w_m2,
                            .film_w_m2_k = film_w_m2_k,
                            .air_offset_k = f.air_k - reference_k};
  physics::add_moisture(moisture_at(material, f, rain_by_tilt_frac(up)), f.moist, short_wave_w_m2,
                        drive);
  return drive;
}

/// Means over intervals.
struct Means {
  double flux_w_m2 = 0.0;    ///< into the surface
  double loss_w_m2_k = 0.0;  ///< that a warmer surface loses more
};

/// One face, and how it is carried over intervals.
struct Face {
  const FosterMaterial& material;
  physics::FosterSurface<double> surface;
  double up = 1.0;
  double sun_share = 0.0;
  double sky_frac = 1.0;

  /// Carries states over intervals and returns the means.
  Means carry(std::span<const IntervalForcing> intervals, FosterState<double>& x) const noexcept {
    Means sum;
    double length_s = 0.0;
    for (const IntervalForcing& interval : intervals) {
      // The film follows the temperature at the start of the step.
      const double offset_k = physics::foster_offset_k(x, surface);
      const auto drive = [&](const SurfaceForcing& f) {
        return face_drive(f, material, up, sun_share, sky_frac, surface.reference_k, offset_k);
      };
      const FosterDrive<double> begin = drive(interval.begin);
      const FosterDrive<double> end = drive(interval.end);
      const double begin_w_m2 = physics::foster_flux_w_m2(offset_k, begin, surface);
      physics::foster_step(x, begin, end, physics::foster_gains(interval.dt_s, material.network),
                           surface);
      const double end_k = physics::foster_offset_k(x, surface);
      const double t_k = surface.reference_k + end_k;
      sum.flux_w_m2 +=
          0.5 * interval.dt_s * (begin_w_m2 + physics::foster_flux_w_m2(end_k, end, surface));
      sum.loss_w_m2_k +=
          interval.dt_s * (end.film_w_m2_k + 4.0 * surface.emission_w_m2_k4 * t_k * t_k * t_k +
                           physics::latent_flux(t_k, end).slope_w_m2_k);
      length_s += interval.dt_s;
    }
    return {sum.flux_w_m2 / length_s, sum.loss_w_m2_k / length_s};
  }
};

/// Returns the periodic states of a face (physics.md eq. 89).
FosterState<double> periodic_of(const Face& face, std::span<const IntervalForcing> day) noexcept {
  const physics::FosterNetwork& network = face.material.network;
  double day_s = 0.0;
  for (const IntervalForcing& interval : day) day_s += interval.dt_s;
  // Find which share of each mode is gone after a day, and the resistance of those that follow a
  // new flux within it.
  FosterState<double> gone_frac{};
  double follows_m2k_w = 0.0;
  for (std::size_t i = 0; i < network.count; ++i) {
    const double tau_s = network.modes[i].tau_s;
    gone_frac[i] = -std::expm1(-day_s / tau_s);
    follows_m2k_w += network.modes[i].resistance_m2k_w * (1.0 - gone_frac[i] * tau_s / day_s);
  }
  // Begin at the temperature of the base, without a mean flux.
  double flux_w_m2 = 0.0;
  FosterState<double> swing{};  // what the day adds to the steady states at its start
  const auto at_start = [&] {
    FosterState<double> out = physics::foster_steady(flux_w_m2, face.surface);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += swing[i];
    return out;
  };
  for (int round = 0; round < kMostDays; ++round) {
    const FosterState<double> begin = at_start();
    FosterState<double> x = begin;
    const Means mean = face.carry(day, x);
    // Take the part of each mode that comes back after a day under the same flux.
    const FosterState<double> next = physics::foster_steady(mean.flux_w_m2, face.surface);
    double moved_k = 0.0;
    for (std::size_t i = 0; i < network.count; ++i) {
      const double periodic_k = begin[i] + (x[i] - begin[i]) / gone_frac[i];
      moved_k += std::abs(periodic_k - next[i] - swing[i]);
      swing[i] = periodic_k - next[i];
    }
    // Take a step of Newton towards the flux that the day itself has in the mean.
    const double off_w_m2 = mean.flux_w_m2 - flux_w_m2;
    const double step_w_m2 = off_w_m2 * (1.0 + mean.loss_w_m2_k * follows_m2k_w) /
                             (1.0 + mean.loss_w_m2_k * network.resistance_m2k_w());
    flux_w_m2 += step_w_m2;
    const double slow_k = step_w_m2 * network.resistance_m2k_w();
    if (std::abs(slow_k) < kPeriodicK && moved_k < kPeriodicK) break;
  }
  return at_start();
}

/// Returns the place of a value among `count` nodes that go from 0 to 1: the lower node, and the
/// share of the way to the next.
std::pair<std::size_t, double> place_among(std::size_t count, double value) noexcept {
  const double place = std::clamp(value, 0.0, 1.0) * static_cast<double>(count - 1);
  const auto low = std::min(static_cast<std::size_t>(place), count - 2);
  return {low, place - static_cast<double>(low)};
}

}  // namespace

double mean_sun_w_m2(std::span<const IntervalForcing> day, const glm::dvec3& normal) noexcept {
  double sum_j_m2 = 0.0;
  double length_s = 0.0;
  for (const IntervalForcing& interval : day) {
    sum_j_m2 += 0.5 * interval.dt_s *
                (std::max(0.0, glm::dot(normal, interval.begin.sun_w_m2)) +
                 std::max(0.0, glm::dot(normal, interval.end.sun_w_m2)));
    length_s += interval.dt_s;
  }
  return length_s > 0.0 ? sum_j_m2 / length_s : 0.0;
}

void OpeningStates::fill(std::size_t material, const FosterMaterial& properties,
                         std::span<const IntervalForcing> day,
                         std::span<const IntervalForcing> later, double reference_k) noexcept {
  OfMaterial& of = materials_[material];
  double sum_j_m2 = 0.0;
  double length_s = 0.0;
  for (const IntervalForcing& interval : day) {
    sum_j_m2 += 0.5 * interval.dt_s *
                (glm::length(interval.begin.sun_w_m2) + glm::length(interval.end.sun_w_m2));
    length_s += interval.dt_s;
  }
  of.most_sun_w_m2 = sum_j_m2 / length_s;
  Face face{properties, foster_surface_of(properties, reference_k)};
  for (std::size_t tilt = 0; tilt < kTilts; ++tilt) {
    face.up = static_cast<double>(tilt) - 1.0;
    for (std::size_t sun = 0; sun < kSuns; ++sun) {
      face.sun_share = static_cast<double>(sun) / (kSuns - 1);
      for (std::size_t sky = 0; sky < kSkies; ++sky) {
        face.sky_frac = static_cast<double>(sky) / (kSkies - 1);
        const std::size_t node = (tilt * kSuns + sun) * kSkies + sky;
        of.start[node] = periodic_of(face, day);
        of.later[node] = of.start[node];
        if (!later.empty()) face.carry(later, of.later[node]);
      }
    }
  }
}

FosterState<double> OpeningStates::between(const Nodes& nodes, std::size_t material, double up,
                                           double sun_w_m2, double sky_frac) const noexcept {
  EMIT_DCHECK_OP(material, <, materials_.size());
  const double most_w_m2 = materials_[material].most_sun_w_m2;
  const auto [tilt, tilt_way] = place_among(kTilts, 0.5 * (1.0 + up));
  const auto [sun, sun_way] = place_among(kSuns, most_w_m2 > 0.0 ? sun_w_m2 / most_w_m2 : 0.0);
  const auto [sky, sky_way] = place_among(kSkies, sky_frac);
  FosterState<double> out{};
  for (std::size_t corner = 0; corner < 8; ++corner) {
    const std::size_t t = corner & 1U;
    const std::size_t s = (corner >> 1U) & 1U;
    const std::size_t k = (corner >> 2U) & 1U;
    const double weight = (t != 0 ? tilt_way : 1.0 - tilt_way) *
                          (s != 0 ? sun_way : 1.0 - sun_way) * (k != 0 ? sky_way : 1.0 - sky_way);
    const FosterState<double>& node = nodes[((tilt + t) * kSuns + sun + s) * kSkies + sky + k];
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += weight * node[i];
  }
  return out;
}

}  // namespace emit::renderer
