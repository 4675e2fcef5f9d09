// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string_view>

/// Limits of the formulae for moisture, snow and air (physics.md section 8, "What a frame says of
/// its validity"). Where one was passed, surfaces may be off by kelvins, and nobody sees it in the
/// picture: frames name it instead.
namespace emit::renderer {

/// Limit that was passed.
enum class HeatLimit : std::uint8_t {
  rain_unknown,      ///< rain on a material that does not state what rain does to it
  rain_shelter,      ///< rain, and an entity does not stand where its shelter was found
  snowfall,          ///< rain at an air temperature at which it is snow
  freezing,          ///< moist ground below 0 C
  melting,           ///< snow or ice above 0 C
  humidity_unknown,  ///< moist ground in weather that does not state the humidity
  strong_wind,       ///< wind beyond the measurements of the film
  longwave_low,      ///< less long-wave irradiance than any sky sends: a gap in the weather
  layers_invalid,    ///< a material whose heat moves by more than layers of it can say
};
inline constexpr std::size_t kHeatLimits = 9;
/// Limits that were passed, by number.
using HeatLimits = std::bitset<kHeatLimits>;

[[nodiscard]] inline bool has(const HeatLimits& limits, HeatLimit which) noexcept {
  return limits[static_cast<std::size_t>(which)];
}
inline void add(HeatLimits& limits, HeatLimit which) noexcept {
  limits[static_cast<std::size_t>(which)] = true;
}

/// Returns the name of a limit in outputs, such as "freezing".
[[nodiscard]] constexpr std::string_view name_of(HeatLimit which) noexcept {
  constexpr std::array<std::string_view, kHeatLimits> kNames{
      "rain_unknown",     "rain_shelter", "snowfall",     "freezing",      "melting",
      "humidity_unknown", "strong_wind",  "longwave_low", "layers_invalid"};
  return kNames[static_cast<std::size_t>(which)];
}
/// Returns a sentence about a limit, without a full stop, of at most 85 bytes.
[[nodiscard]] constexpr std::string_view text_of(HeatLimit which) noexcept {
  constexpr std::array<std::string_view, kHeatLimits> kTexts{
      "it rained on materials that state no store of water, and they are shown dry",
      "it rained, and entities have left the places where shelter from rain was found",
      "it rained below 1 C: that is snow, which is not modelled and counts as rain",
      "moist ground is below 0 C: freezing takes no heat here, ice sublimates as water does",
      "snow or ice is above 0 C: melting takes no heat here, so that it is too warm",
      "the weather lacks the humidity that moist ground needs: 60 % at the mean air counts",
      "the wind is above 20 m/s, beyond the measurements of the air film",
      "the weather's long-wave irradiance is below 0.4 of a black sky's: it may be a gap",
      "a material states dry_layers_valid = false: its temperatures are a guide only"};
  return kTexts[static_cast<std::size_t>(which)];
}

/// Air temperature below which rain counts as snow.
inline constexpr double kSnowAirK = 274.15;
/// Wind up to which the film has been measured.
inline constexpr double kMostFilmWindMS = 20.0;
/// Least long-wave irradiance of a sky, by that of a blackbody at the air's temperature: the driest
/// air measured, 5 km up in the Atacama desert and over Antarctica, sends 0.45 to 0.6.
inline constexpr double kLeastSkyFrac = 0.4;
/// Time for which a frame names a limit after it was passed: half a millimetre of water dries
/// within six hours by day, and a surface forgets what it lacked.
inline constexpr std::int64_t kLimitMemoryNs = 6 * 3'600'000'000'000;

/// Latest instant at which each limit was passed. RT-safe.
class HeatLimitTimes {
 public:
  HeatLimitTimes() { last_ns_.fill(std::numeric_limits<std::int64_t>::min()); }
  void pass(HeatLimit which, std::int64_t at_ns) noexcept {
    std::int64_t& last = last_ns_[static_cast<std::size_t>(which)];
    last = std::max(last, at_ns);
  }
  /// Returns the limits that were passed at most kLimitMemoryNs before an instant.
  [[nodiscard]] HeatLimits until(std::int64_t now_ns) const noexcept {
    HeatLimits out;
    for (std::size_t i = 0; i < kHeatLimits; ++i) out[i] = last_ns_[i] >= now_ns - kLimitMemoryNs;
    return out;
  }

 private:
  std::array<std::int64_t, kHeatLimits> last_ns_;
};

}  // namespace emit::renderer
