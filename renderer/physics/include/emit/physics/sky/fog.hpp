// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"

/// Fog, mist or humid haze near the ground: a level layer of water droplets as warm as the air at
/// the ground (physics.md section 17). Any thread.
namespace emit::physics {

/// Spectra of droplets: fogs of Shettle and Fenn (1979), haze M of Deirmendjian (1969).
enum class FogKind : std::uint8_t {
  heavy_advection,     ///< largest droplets, most of them 10 um in radius
  moderate_advection,  ///< 8 um
  heavy_radiation,     ///< 4 um
  moderate_radiation,  ///< 2 um, also for mist
  maritime_haze,       ///< 0.05 um
};
/// Names of all kinds, as the enumerators are spelled.
inline constexpr std::array<std::pair<std::string_view, FogKind>, 5> kFogKinds{
    {{"heavy_advection", FogKind::heavy_advection},
     {"moderate_advection", FogKind::moderate_advection},
     {"heavy_radiation", FogKind::heavy_radiation},
     {"moderate_radiation", FogKind::moderate_radiation},
     {"maritime_haze", FogKind::maritime_haze}}};
/// Returns the kind of that name; empty if there is none.
[[nodiscard]] std::optional<FogKind> fog_kind(std::string_view name) noexcept;

/// Layer of fog, from its top downwards without end.
struct Fog {
  FogKind kind = FogKind::moderate_radiation;
  double visibility_m = 500.0;  ///< at which 2 % of a contrast are left at 0.55 um, above 0
  double top_m = 50.0;          ///< above the world's origin

  [[nodiscard]] bool operator==(const Fog&) const = default;
};

/// Optical depth of a path at which 2 % of a contrast are left (Koschmieder 1924): ln 50.
inline constexpr double kKoschmieder = 3.912023005428146;

/// Extinction and scattering by droplets, as means over a band.
struct FogOptics {
  double extinction_per_m = 0.0;
  double albedo_frac = 0.0;  ///< share of the extinction that is scattering
  double asymmetry = 0.0;    ///< mean cosine of the scattered light

  /// Extinction of light that comes from everywhere: what goes on about as before counts as not
  /// scattered (similarity, physics.md eq. 91).
  [[nodiscard]] double wide_extinction_per_m() const noexcept {
    return extinction_per_m * (1.0 - albedo_frac * asymmetry);
  }
};
/// Returns the optics of a fog at one wavelength, 0.2 to 50 um. Setup only: some milliseconds.
[[nodiscard]] FogOptics fog_optics_at(const Fog& fog, double wavelength_um);
/// Returns the optics of a fog in a band, with the spectrum of a blackbody of 285 K as weight.
/// Setup only: some tens of milliseconds. @pre the band is valid
[[nodiscard]] FogOptics fog_optics(const Fog& fog, const Band& band);

/// Part of a line of sight that lies in the fog.
template <class Number>
struct FogStretch {
  Number begin_m;   ///< from the sensor; 0 where it stands in the fog
  Number length_m;  ///< 0: the line does not meet the fog
};
/// Returns the part of a line of sight of `range_m` in the fog, whose top lies `above_m` above the
/// sensor, for a sine of the elevation (physics.md eq. 91). Fog and ground are level. The twin in
/// GLSL is lib/fog.glsl. RT-safe.
template <class Number>
[[nodiscard]] FogStretch<Number> fog_stretch(Number above_m, Number sin_elevation,
                                             Number range_m) noexcept {
  const Number rise_m = sin_elevation * range_m;
  if (above_m > Number{0}) {
    return {Number{0}, rise_m > above_m ? above_m / sin_elevation : range_m};
  }
  if (!(rise_m < above_m)) return {Number{0}, Number{0}};
  const Number begin_m = above_m / sin_elevation;
  return {begin_m, range_m - begin_m};
}
/// Light that arrives at a layer of fog in a band.
struct FogArrivals {
  double black_w_m2_sr = 0.0;   ///< radiance of a blackbody as warm as the fog
  double sky_w_m2_sr = 0.0;     ///< mean of the sky above it, by the cosine
  double ground_w_m2_sr = 0.0;  ///< of the ground below it
  double sun_w_m2 = 0.0;        ///< above it, normal to the sun
  double sin_sun = 0.0;         ///< of the sun's elevation
};
/// Light within the layer (physics.md eq. 92): what a short piece of it sends, by its opacity, is
/// that of a blackbody, and three parts that are exponential in the distance below the top: of the
/// sky's light, of the ground's, and of the sun's.
template <class Number>
struct FogLight {
  Number extinction_per_m = 0;  ///< FogOptics
  Number wide_per_m = 0;        ///< FogOptics::wide_extinction_per_m()
  Number black_w_m2_sr = 0;
  Number sky_w_m2_sr = 0;     ///< at the top
  Number ground_w_m2_sr = 0;  ///< at the ground
  Number sun_w_m2_sr = 0;     ///< at the top
  Number rate_per_m = 0;      ///< of the first two parts, by height
  Number sun_rate_per_m = 0;
  Number depth_m = 0;  ///< of the layer over the ground
};
/// Returns the light of a layer of a depth by two streams. RT-safe.
[[nodiscard]] FogLight<double> fog_light(const FogOptics& optics, double depth_m,
                                         const FogArrivals& arrivals) noexcept;
/// Returns what a stretch of fog sends to the end at which it begins, W m-2 sr-1, for one of the
/// two extinctions (physics.md eq. 93). The stretch begins `below_top_m` below the top and rises
/// with the sine of the elevation. The twin in GLSL is lib/fog.glsl. RT-safe.
template <class Number>
[[nodiscard]] Number fog_glow_w_m2_sr(const FogLight<Number>& light, Number extinction_per_m,
                                      Number below_top_m, Number sin_elevation,
                                      Number length_m) noexcept {
  const Number depth = extinction_per_m * length_m;
  const Number through = std::exp(-depth);
  const Number end_m = below_top_m - sin_elevation * length_m;
  // Add up a part that has two values at the ends and changes exponentially in between.
  const auto part = [&](Number begin_log, Number end_log) {
    const Number x = depth + begin_log - end_log;
    const Number size = std::abs(x);
    const Number mean =
        size < Number(1e-3) ? Number(1) - Number(0.5) * size : (Number(1) - std::exp(-size)) / size;
    return depth * mean * (x < Number(0) ? through * std::exp(end_log) : std::exp(begin_log));
  };
  const auto from_top = [&](Number rate_per_m) {
    return part(-rate_per_m * std::max(below_top_m, Number(0)),
                -rate_per_m * std::max(end_m, Number(0)));
  };
  const auto above = [&](Number below_m) { return std::max(light.depth_m - below_m, Number(0)); };
  return light.black_w_m2_sr * (Number(1) - through) +
         light.sky_w_m2_sr * from_top(light.rate_per_m) +
         light.ground_w_m2_sr *
             part(-light.rate_per_m * above(below_top_m), -light.rate_per_m * above(end_m)) +
         light.sun_w_m2_sr * from_top(light.sun_rate_per_m);
}
/// Range of a line of sight that meets no surface, m: what of it lies in fog is as good as endless.
inline constexpr double kFogFarM = 1e8;

/// Effect of a layer of fog on sun and sky at the ground below it.
struct FogShade {
  double sun_depth = 0.0;              ///< optical depth of the layer, straight down, at 0.55 um
  double sun_asymmetry = 0.0;          ///< mean cosine of the sunlight that it scatters
  double longwave_through_frac = 1.0;  ///< share of the sky's long-wave irradiance that passes

  [[nodiscard]] bool operator==(const FogShade&) const = default;
};
/// Returns the shade of a fog on the world's origin. Setup only: some tens of milliseconds.
[[nodiscard]] FogShade fog_shade(const Fog& fog);
/// Returns the share of the direct sun that passes the fog, for a sine of its elevation. RT-safe.
[[nodiscard]] double fog_beam_frac(const FogShade& shade, double sin_elevation) noexcept;
/// Returns the share of the sunlight on level ground that arrives below the fog, directly or
/// scattered, of the direct sun at a sine of its elevation. RT-safe. @pre sin_elevation > 0
[[nodiscard]] double fog_sunlight_frac(const FogShade& shade, double sin_elevation) noexcept;
/// Returns the same for the light of an even sky. RT-safe.
[[nodiscard]] double fog_skylight_frac(const FogShade& shade) noexcept;
/// Returns the share of a clear sky's direct sun that shines on the fog, where `ground_frac` of it
/// is left at the ground. Where the fog lets less than 3 % through, it is `unknown_frac`, and it
/// goes over to the weather's up to 10 %. RT-safe.
[[nodiscard]] double beam_above_fog_frac(const FogShade& shade, double ground_frac,
                                         double sin_elevation, double unknown_frac) noexcept;
/// Returns the sky's long-wave irradiance on the fog, W m-2, where `ground_w_m2` arrives below it
/// and the air at the ground has `air_k`. It is not below `clear_w_m2`, that of a clear sky, unless
/// the irradiance at the ground already is, and not above that of a blackbody as warm as the air,
/// unless the irradiance at the ground is. Where the fog lets less than 3 % through, it is
/// `clear_w_m2`, and it goes over to the weather's up to 10 %. RT-safe.
[[nodiscard]] double longwave_above_fog_w_m2(const FogShade& shade, double ground_w_m2,
                                             double air_k, double clear_w_m2) noexcept;

}  // namespace emit::physics
