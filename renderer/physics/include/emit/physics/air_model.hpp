// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"

/// Air of the model atmospheres in a band: transmittance and thermal path radiance between two
/// heights, the clear sky by elevation, and the sun at a height (physics.md eq. 37 and 38).
/// Absorbers are added up along the path, and a band is a sum of exponential terms in their
/// amounts. The flat bands 3-5, 3.4-4.1, 8-12 and 7.7-9.3 um have ten terms of their own. All
/// others are made of narrow pieces of the spectrum with four terms each. Clouds and rain are not
/// part of it; sunlight that the air scatters has its own model (sky/sun_scatter.hpp). Any thread
/// after construction.
namespace emit::physics {

/// Model atmospheres (Anderson et al. 1986).
enum class AirClimate : std::uint8_t {
  tropical,
  midlatitude_summer,
  midlatitude_winter,
  subarctic_summer,
  subarctic_winter,
  us_standard
};
/// Returns the climate of that name, as the enumerator is spelled.
[[nodiscard]] std::optional<AirClimate> air_climate(std::string_view name) noexcept;

/// Returns the name of a climate, as the enumerator is spelled.
[[nodiscard]] std::string_view air_climate_name(AirClimate climate) noexcept;
/// Returns the climate of a latitude at a date (POSIX ns UTC): tropical within 23.5 deg of the
/// equator, mid-latitude to 55 deg, else subarctic; summer is April to September in the north and
/// the other half of the year in the south.
[[nodiscard]] AirClimate air_climate_of(double lat_rad, std::int64_t posix_utc_ns) noexcept;

/// Water vapour at saturation over water, g/m3, by Magnus' formula with the constants of Bolton
/// (1980). The temperature should lie in 180..330 K.
[[nodiscard]] double saturated_vapour_g_m3(double kelvin) noexcept;

inline constexpr std::size_t kAirAbsorbers = 10;
/// Wavelengths that the model knows, um.
inline constexpr double kAirShortestUm = 2.0;
inline constexpr double kAirLongestUm = 100.0 / 7.0;
/// Heights that the model knows, from sea level to the end of the air, m.
inline constexpr double kAirTopM = 100000.0;

/// Description of the atmosphere of an AirColumn.
struct AirSpec {
  AirClimate climate = AirClimate::midlatitude_summer;
  double visibility_km = 23.0;  ///< of the rural haze below 2 km, 2..50
  double water_ratio = 1.0;     ///< water vapour by that of the climate, 0..5

  [[nodiscard]] bool operator==(const AirSpec&) const = default;
};

/// Profile of a model atmosphere: how much of each absorber a kilometre of path has by height.
class AirColumn {
 public:
  /// Errors: invalid_argument, naming the member that is out of its range.
  [[nodiscard]] static Result<AirColumn> build(const AirSpec& spec);

  /// Air at one height.
  struct Point {
    std::array<double, kAirAbsorbers> density_per_km{};
    double kelvin = 0.0;
    double standard_air_frac = 0.0;  ///< density by that at 0 deg C and one atmosphere
  };
  /// Returns the air at a height, m. Heights outside 0..kAirTopM count as the nearest end. RT-safe.
  [[nodiscard]] Point at(double height_m) const noexcept;
  /// Returns the refractive index of the air at a height. RT-safe.
  [[nodiscard]] double refractive_index(double height_m) const noexcept;
  /// Air temperature and water vapour of the climate itself at sea level.
  [[nodiscard]] double ground_k() const noexcept { return levels_.front().kelvin; }
  [[nodiscard]] double ground_vapour_g_m3() const noexcept { return ground_vapour_g_m3_; }

 private:
  struct Level {
    double height_km = 0.0;
    double kelvin = 0.0;
    double log_pressure_hpa = 0.0;
    std::array<double, kAirAbsorbers> density_per_km{};
    std::array<double, kAirAbsorbers> log_density{};
  };
  [[nodiscard]] std::size_t level_below(double height_km) const noexcept;
  std::vector<Level> levels_;
  double ground_vapour_g_m3_ = 0.0;
};

/// Path through the air, from the sensor on, cut into the layers that emit at one temperature each.
class AirPath {
 public:
  static constexpr std::size_t kMaxStretches = 112;
  struct Stretch {
    std::array<double, kAirAbsorbers> amount{};
    double kelvin = 0.0;           ///< air temperature
    double height_m = 0.0;         ///< above sea level
    double standard_air_km = 0.0;  ///< length of air at 0 deg C and one atmosphere
  };

  /// Returns the straight path between two points at heights above sea level, `range_m` apart. A
  /// range below the difference of the heights is taken as a path of that length all the same.
  /// RT-safe.
  [[nodiscard]] static AirPath between(const AirColumn& column, double sensor_m, double target_m,
                                       double range_m) noexcept;
  /// Returns the refracted path out of the atmosphere from a height, at an apparent elevation in
  /// rad. A path that would meet the ground is taken at the elevation that just passes it. RT-safe.
  [[nodiscard]] static AirPath to_space(const AirColumn& column, double sensor_m,
                                        double elevation_rad) noexcept;

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  /// @pre index < size()
  [[nodiscard]] const Stretch& operator[](std::size_t index) const noexcept {
    return stretches_[index];
  }

 private:
  void add_step(const AirColumn& column, const std::array<double, 2>& height_m,
                const std::array<double, 2>& length_km) noexcept;
  void add_leg(const AirColumn& column, double invariant_km, double low_km, double from_km,
               double to_km, std::size_t steps) noexcept;
  void close_stretch() noexcept;
  std::array<Stretch, kMaxStretches> stretches_;
  std::size_t size_ = 0;
  std::size_t layer_ = 0;     ///< of the last stretch
  double open_weight_ = 0.0;  ///< sum of the weights of its temperatures
};

/// Spectrum that weights the mean of a transmittance over the band.
enum class AirSource : std::uint8_t { black_300k, black_800k, sun_5772k, flat, sun_lowtran };
inline constexpr std::size_t kAirSources = 5;

/// Air in one band.
class BandAir {
 public:
  /// True if the response of a band is zero wherever the model knows no air.
  [[nodiscard]] static bool covers(const Band& band) noexcept;
  /// Makes the air of a band with a response of any shape. Setup only: some milliseconds.
  /// Errors: invalid_argument if the band does not pass validate() or is not covered.
  [[nodiscard]] static Result<BandAir> build(const Band& band);

  /// Returns the transmittance of a path for radiation with the spectrum of `source`. RT-safe.
  [[nodiscard]] double transmittance(const AirPath& path, AirSource source) const noexcept {
    return evaluate<1, 0>(path, {source}, {}).transmittance_frac[0];
  }
  /// Returns the thermal radiance of a path at the sensor, W m-2 sr-1 in band. The air is
  /// `warmer_k` warmer than the column at the ground; the difference fades with a scale height of
  /// kWarmthScaleM. RT-safe.
  [[nodiscard]] double path_radiance_w_m2_sr(const AirPath& path,
                                             double warmer_k = 0.0) const noexcept {
    return evaluate<0, 1>(path, {}, {warmer_k}).path_radiance_w_m2_sr[0];
  }
  /// Result of evaluate(), by source and by temperature of the air.
  template <std::size_t Sources, std::size_t Airs>
  struct Sight {
    std::array<double, Sources> transmittance_frac{};
    std::array<double, Airs> path_radiance_w_m2_sr{};
  };
  /// Returns transmittances and path radiances of one path at once, as the two functions above.
  template <std::size_t Sources, std::size_t Airs>
  [[nodiscard]] Sight<Sources, Airs> evaluate(
      const AirPath& path, const std::array<AirSource, Sources>& sources,
      const std::array<double, Airs>& warmer_k) const noexcept {
    std::array<std::array<Warmth, Airs>, AirPath::kMaxStretches> warmths;
    for (std::size_t i = 0; i < path.size(); ++i) {
      for (std::size_t a = 0; a < Airs; ++a) warmths[i][a] = warmth_of(path[i], warmer_k[a]);
    }
    // Follow the path term by term, until nothing more of it is seen.
    Sight<Sources, Airs> out;
    for (std::size_t t = 0; t < terms_.size(); ++t) {
      const Term& term = terms_[t];
      double before = 1.0;
      for (std::size_t i = 0; i < path.size() && before > kUnseenFrac; ++i) {
        const double after = before * through(term, path[i]);
        for (std::size_t a = 0; a < Airs; ++a) {
          out.path_radiance_w_m2_sr[a] += emission_w_m2_sr(t, warmths[i][a]) * (before - after);
        }
        before = after;
      }
      for (std::size_t s = 0; s < Sources; ++s) {
        out.transmittance_frac[s] += term.share_frac[static_cast<std::size_t>(sources[s])] * before;
      }
    }
    return out;
  }
  /// Returns the direct sunlight on a surface normal to the sun, W m-2 in band, at a distance of
  /// one astronomical unit. RT-safe.
  [[nodiscard]] double sun_w_m2(const AirPath& to_sun) const noexcept;

  /// Returns the same outside the atmosphere. RT-safe.
  [[nodiscard]] double sun_outside_w_m2() const noexcept { return sun_w_m2_; }

  static constexpr double kWarmthScaleM = 2000.0;

 private:
  static constexpr double kUnseenFrac = 1e-9;
  static constexpr std::size_t kEmissionNodes = 111;
  struct Term {
    std::array<double, kAirAbsorbers> extinction{};
    std::array<double, kAirSources> share_frac{};  ///< of the term in the band, by source
  };
  /// Place of a temperature in the table of emission.
  struct Warmth {
    std::size_t node;
    double fraction;
  };
  /// Adds a term; `emission` returns what its air emits at a temperature.
  template <class Emission>
  void add_term(const Term& term, Emission emission);
  void add_spectrum(const Band& band);
  /// Returns the transmittance of a stretch.
  [[nodiscard]] static double through(const Term& term, const AirPath::Stretch& stretch) noexcept;
  [[nodiscard]] static Warmth warmth_of(const AirPath::Stretch& stretch, double warmer_k) noexcept;
  /// Returns the radiance of opaque air in the share of a term.
  [[nodiscard]] double emission_w_m2_sr(std::size_t term, const Warmth& warmth) const noexcept {
    const double* node = &emission_[term * kEmissionNodes + warmth.node];
    return node[0] + warmth.fraction * (node[1] - node[0]);
  }
  std::vector<Term> terms_;
  std::vector<double> emission_;  ///< by term and temperature, W m-2 sr-1
  double sun_w_m2_ = 0.0;
};

}  // namespace emit::physics
