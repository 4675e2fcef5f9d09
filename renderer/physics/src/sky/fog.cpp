// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky/fog.hpp"

#include <cmath>

#include "emit/physics/constants.hpp"
#include "emit/physics/sky/mie.hpp"
#include "emit/physics/surface/optical_constants.hpp"

namespace emit::physics {
namespace {

/// Modified gamma spectrum of droplets: their number by radius r in um goes with r^power exp(-rate
/// r^bend).
struct DropletSpectrum {
  double power;
  double rate;
  double bend;
};

/// E. P. Shettle and R. W. Fenn, Models for the aerosols of the lower atmosphere and the effects of
/// humidity variations on their optical properties, AFGL-TR-79-0214, 1979, table of fog models; D.
/// Deirmendjian, Electromagnetic scattering on spherical polydispersions, 1969, haze M.
DropletSpectrum spectrum_of(FogKind kind) noexcept {
  switch (kind) {
    case FogKind::heavy_advection:
      return {3.0, 0.3, 1.0};
    case FogKind::moderate_advection:
      return {3.0, 0.375, 1.0};
    case FogKind::heavy_radiation:
      return {6.0, 1.5, 1.0};
    case FogKind::moderate_radiation:
      return {6.0, 3.0, 1.0};
    case FogKind::maritime_haze:
      break;
  }
  return {1.0, 8.944, 0.5};
}

/// Wavelength at which the visibility counts.
constexpr double kVisibleUm = 0.55;
constexpr double kWeightK = 285.0;
/// Long-wave radiation, as far as the refractive index of water is known.
constexpr double kLongwaveFirstUm = 4.0;
constexpr double kLongwaveLastUm = 50.0;
/// Mean path of an even sky's radiation through a level layer, by its depth.
constexpr double kDiffusivity = 1.66;
/// Sine of the lowest elevation of the sun in a layer without a horizon.
constexpr double kLowestSun = 0.02;
/// Below the first share of what the fog lets through, the weather at the ground says nothing of
/// the sky above: errors of a few per cent of the measurement would be all of it. From the second
/// one on it is believed.
constexpr double kUnknownFrac = 0.03;
constexpr double kKnownFrac = 0.1;
/// Returns how far the weather at the ground is believed, 0..1.
double known_frac(double through) noexcept {
  return std::clamp((through - kUnknownFrac) / (kKnownFrac - kUnknownFrac), 0.0, 1.0);
}

/// Refractive index of liquid water after Hale and Querry (1973), also where the table of surfaces
/// does not reach.
OpticalConstants water_at(double wavelength_um) noexcept {
  const auto table = optical_constants(IndexTable::water);
  if (wavelength_um >= table.front().wavelength_um) return constants_at(table, wavelength_um);
  constexpr std::array<OpticalConstants, 7> kShort{{{kVisibleUm, 1.333, 1.96e-9},
                                                    {0.8, 1.329, 1.25e-7},
                                                    {1.0, 1.327, 2.89e-6},
                                                    {1.2, 1.324, 9.89e-6},
                                                    {1.4, 1.321, 1.38e-4},
                                                    {1.6, 1.317, 8.55e-5},
                                                    {2.0, 1.306, 1.1e-3}}};
  return constants_at(kShort, wavelength_um);
}

/// Extinction and scattering of droplets by an arbitrary number of them.
struct Sums {
  double extinction = 0.0;
  double scattering = 0.0;
  double forward = 0.0;  ///< scattering times its asymmetry
};
Sums sums_at(FogKind kind, double wavelength_um) {
  const DropletSpectrum of = spectrum_of(kind);
  // Take radii in equal steps of the logarithm, to where the last droplets do not count.
  constexpr int kRadii = 240;
  constexpr double kLastExponent = 45.0;
  const double mode_um = std::pow(of.power / (of.bend * of.rate), 1.0 / of.bend);
  const double last_um = std::pow(kLastExponent / of.rate, 1.0 / of.bend);
  const double first_um = 0.02 * mode_um;
  const OpticalConstants water = water_at(wavelength_um);
  Sums out;
  for (int i = 0; i < kRadii; ++i) {
    const double radius_um = first_um * std::pow(last_um / first_um, (i + 0.5) / kRadii);
    const double weight =
        std::pow(radius_um, of.power + 3.0) * std::exp(-of.rate * std::pow(radius_um, of.bend));
    const MieEfficiencies one = mie_efficiencies(2.0 * kPi * radius_um / wavelength_um,
                                                 water.refractive_index, water.extinction_index);
    out.extinction += weight * one.extinction;
    out.scattering += weight * one.scattering;
    out.forward += weight * one.scattering * one.asymmetry;
  }
  return out;
}

/// Optics of a fog with sums of its droplets, of which those in visible light give their number.
FogOptics optics_of(const Fog& fog, const Sums& sums) {
  const double number = kKoschmieder / fog.visibility_m / sums_at(fog.kind, kVisibleUm).extinction;
  return {number * sums.extinction, sums.scattering / sums.extinction,
          sums.forward / sums.scattering};
}

}  // namespace

std::optional<FogKind> fog_kind(std::string_view name) noexcept {
  const auto found =
      std::ranges::find(kFogKinds, name, [](const auto& entry) { return entry.first; });
  return found == kFogKinds.end() ? std::nullopt : std::optional(found->second);
}

FogOptics fog_optics_at(const Fog& fog, double wavelength_um) {
  return optics_of(fog, sums_at(fog.kind, wavelength_um));
}

FogOptics fog_optics(const Fog& fog, const Band& band) {
  constexpr int kPoints = 48;
  Sums sums;
  double weights = 0.0;
  for (int i = 0; i < kPoints; ++i) {
    const double um = band.lo_um + (band.hi_um - band.lo_um) * (i + 0.5) / kPoints;
    const double weight =
        response_frac(band, um) * spectral_radiance(Micrometres(um), Kelvin(kWeightK)).value();
    if (!(weight > 0.0)) continue;
    const Sums at = sums_at(fog.kind, um);
    sums.extinction += weight * at.extinction;
    sums.scattering += weight * at.scattering;
    sums.forward += weight * at.forward;
    weights += weight;
  }
  // A response that lies between the points has the wavelength in the middle.
  if (!(weights > 0.0)) return fog_optics_at(fog, 0.5 * (band.lo_um + band.hi_um));
  return optics_of(fog,
                   {sums.extinction / weights, sums.scattering / weights, sums.forward / weights});
}

FogLight<double> fog_light(const FogOptics& optics, double depth_m,
                           const FogArrivals& arrivals) noexcept {
  FogLight<double> out;
  out.extinction_per_m = optics.extinction_per_m;
  out.wide_per_m = optics.wide_extinction_per_m();
  out.black_w_m2_sr = arrivals.black_w_m2_sr;
  out.depth_m = std::max(depth_m, 0.0);
  // Similarity makes the scattering even all around: J'' = rate^2 (J - B) - 3 F / (4 pi) by the
  // depth, with the flux F that the direct sun loses to scattering.
  const double albedo =
      optics.albedo_frac * (1.0 - optics.asymmetry) / (1.0 - optics.albedo_frac * optics.asymmetry);
  const double rate = std::sqrt(3.0 * (1.0 - albedo));
  const double depth = out.wide_per_m * out.depth_m;
  double steepness = 1.0 / std::max(arrivals.sin_sun, kLowestSun);
  if (std::abs(steepness - rate) < 1e-3) steepness = rate + 1e-3;  // the two must not be the same
  const double lost_w_m2_sr = albedo * arrivals.sun_w_m2 / (4.0 * kPi);
  const double sun = -3.0 * lost_w_m2_sr / (steepness * steepness - rate * rate);
  // Meet the sky's light at the top, where it goes down, and the ground's at the ground.
  const double sun_at_ground = std::exp(-steepness * depth);
  const double top =
      arrivals.sky_w_m2_sr - arrivals.black_w_m2_sr - (1.0 + 2.0 / 3.0 * steepness) * sun;
  const double ground = arrivals.ground_w_m2_sr - arrivals.black_w_m2_sr -
                        (1.0 - 2.0 / 3.0 * steepness) * sun * sun_at_ground;
  const double near = 1.0 + 2.0 / 3.0 * rate;
  const double far = (1.0 - 2.0 / 3.0 * rate) * std::exp(-rate * depth);
  const double determinant = near * near - far * far;
  out.sky_w_m2_sr = albedo * (near * top - far * ground) / determinant;
  out.ground_w_m2_sr = albedo * (near * ground - far * top) / determinant;
  out.sun_w_m2_sr = albedo * sun + lost_w_m2_sr;
  out.rate_per_m = rate * out.wide_per_m;
  out.sun_rate_per_m = steepness * out.wide_per_m;
  return out;
}

FogShade fog_shade(const Fog& fog) {
  const FogOptics visible = fog_optics_at(fog, kVisibleUm);
  const FogOptics longwave = fog_optics(fog, {kLongwaveFirstUm, kLongwaveLastUm, {}});
  const double depth_m = std::max(fog.top_m, 0.0);
  return {visible.extinction_per_m * depth_m, visible.asymmetry,
          std::exp(-kDiffusivity * longwave.wide_extinction_per_m() * depth_m)};
}

double fog_beam_frac(const FogShade& shade, double sin_elevation) noexcept {
  return sin_elevation > 0.0 ? std::exp(-shade.sun_depth / sin_elevation) : 0.0;
}

double fog_sunlight_frac(const FogShade& shade, double sin_elevation) noexcept {
  // Two streams of Eddington through a layer that absorbs nothing over black ground, with the light
  // that goes on about as before counted as not scattered (delta-Eddington).
  const double g = shade.sun_asymmetry;
  const double depth = (1.0 - g * g) * shade.sun_depth;
  const double below =
      (2.0 / 3.0 + sin_elevation) + (2.0 / 3.0 - sin_elevation) * std::exp(-depth / sin_elevation);
  return below / (4.0 / 3.0 + (1.0 - g) * shade.sun_depth);
}

double fog_skylight_frac(const FogShade& shade) noexcept {
  return 1.0 / (1.0 + 0.75 * (1.0 - shade.sun_asymmetry) * shade.sun_depth);
}

double beam_above_fog_frac(const FogShade& shade, double ground_frac, double sin_elevation,
                           double unknown_frac) noexcept {
  const double through = fog_beam_frac(shade, sin_elevation);
  if (!(through > kUnknownFrac)) return unknown_frac;
  return std::lerp(unknown_frac, std::min(1.2, ground_frac / through), known_frac(through));
}

double longwave_above_fog_w_m2(const FogShade& shade, double ground_w_m2, double air_k,
                               double clear_w_m2) noexcept {
  const double through = shade.longwave_through_frac;
  if (!(through > kUnknownFrac)) return clear_w_m2;
  const double black_w_m2 = kStefanBoltzmannWPerM2K4 * std::pow(air_k, 4.0);
  const double above_w_m2 = (ground_w_m2 - (1.0 - through) * black_w_m2) / through;
  const double bounded_w_m2 = std::clamp(above_w_m2, std::min(ground_w_m2, clear_w_m2),
                                         std::max({black_w_m2, ground_w_m2, clear_w_m2}));
  return std::lerp(clear_w_m2, bounded_w_m2, known_frac(through));
}

}  // namespace emit::physics
