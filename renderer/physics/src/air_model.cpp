// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/air_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>

#include "air_tables.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"

namespace emit::physics {
namespace {

constexpr double kEarthRadiusKm = 6371.0;
constexpr double kTopKm = kAirTopM * 1e-3;
/// Gauss-Legendre rule of two points on (0, 1).
constexpr std::array<double, 2> kAbscissa{0.21132486540518713, 0.78867513459481287};

/// Aerosol extinction at 0.55 um by height, km-1 (LOWTRAN7, rural haze). Below 3 km it goes with
/// the visibility, linear in its inverse between the columns.
constexpr std::array<double, 5> kHazeVisibilityKm{50.0, 23.0, 10.0, 5.0, 2.0};
constexpr std::array<std::array<double, 5>, 3> kHazePerKm{
    {{0.0662, 0.158, 0.379, 0.770, 1.94},
     {0.0415, 0.0991, 0.379, 0.770, 1.94},
     {0.0260, 0.0621, 0.0621, 0.0621, 0.0621}}};
/// Tropospheric aerosol at 3 and 4 km, for 50 and 23 km of visibility, then at 5 to 10 km, and
/// stratospheric aerosol at 11 to 25 km. Spring and summer come first, then autumn and winter.
constexpr std::array<std::array<double, 2>, 4> kTropospherePerKm{
    {{0.0146, 0.0346}, {0.0102, 0.0185}, {0.0114, 0.0272}, {0.00643, 0.0120}}};
constexpr std::array<std::array<double, 6>, 2> kUpperTropospherePerKm{
    {{0.00931, 0.00771, 0.00623, 0.00337, 0.00182, 0.00114},
     {0.00485, 0.00354, 0.00231, 0.00141, 0.00098, 0.000787}}};
constexpr std::array<std::array<double, 16>, 2> kStratospherePerKm{
    {{7.99e-4, 6.41e-4, 5.17e-4, 4.42e-4, 3.95e-4, 3.82e-4, 4.25e-4, 5.20e-4, 5.81e-4, 5.89e-4,
      5.02e-4, 4.20e-4, 3.00e-4, 1.98e-4, 1.31e-4, 3.32e-5},
     {7.14e-4, 6.64e-4, 6.23e-4, 6.45e-4, 6.43e-4, 6.41e-4, 6.00e-4, 5.62e-4, 4.91e-4, 4.23e-4,
      3.52e-4, 2.95e-4, 2.42e-4, 1.90e-4, 1.50e-4, 3.32e-5}}};

/// Extinction of the haze below 3 km at one of its levels.
double haze_per_km(std::size_t level, double visibility_km) {
  std::size_t j = 1;
  while (j + 1 < kHazeVisibilityKm.size() && visibility_km < kHazeVisibilityKm[j]) ++j;
  const double far = 1.0 / kHazeVisibilityKm[j - 1];
  const double near = 1.0 / kHazeVisibilityKm[j];
  const double share = (1.0 / visibility_km - far) / (near - far);
  return kHazePerKm[level][j - 1] + share * (kHazePerKm[level][j] - kHazePerKm[level][j - 1]);
}

/// Extinction of the aerosol above the haze at level 3 and higher.
double upper_aerosol_per_km(std::size_t level, double visibility_km, bool winter) {
  const std::size_t season = winter ? 1 : 0;
  if (level == 3 || level == 4) {
    const auto& pair = kTropospherePerKm[2 * season + level - 3];
    const double share =
        std::clamp((1.0 / visibility_km - 1.0 / 50.0) / (1.0 / 23.0 - 1.0 / 50.0), 0.0, 1.0);
    return pair[0] + share * (pair[1] - pair[0]);
  }
  if (level <= 10) return kUpperTropospherePerKm[season][level - 5];
  return level - 11 < 16 ? kStratospherePerKm[season][level - 11] : 0.0;
}

/// Heights where the air's layers meet, km. A layer emits at one temperature.
constexpr std::array<double, 46> kLayersKm{
    0.05, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.0, 1.25, 1.5, 1.75, 2.0, 2.5,  3.0, 3.5,  4.0,
    4.5,  5.0, 5.5, 6.0, 6.5,  7.0, 7.5, 8.0, 8.5,  9.0, 9.5,  10., 10.5, 11., 11.5, 12.,
    13.,  14., 15., 16., 17.,  18., 20., 22., 25.,  30., 35.,  45., 60.,  70.};
std::size_t layer_of(double height_m) noexcept {
  return static_cast<std::size_t>(
      std::upper_bound(kLayersKm.begin(), kLayersKm.end(), height_m * 1e-3) - kLayersKm.begin());
}

constexpr std::array<std::string_view, 6> kClimateNames{"tropical",           "midlatitude_summer",
                                                        "midlatitude_winter", "subarctic_summer",
                                                        "subarctic_winter",   "us_standard"};

constexpr double kUmPerCm = 1e4;
/// First of the temperatures at which emission is tabulated, and their distance: up to 370 K.
constexpr double kEmissionFirstK = 150.0;
constexpr double kEmissionStepK = 2.0;

}  // namespace

std::optional<Band> air_tables::part_of(const Band& band, const Piece& piece) {
  Band part = band;
  part.lo_um = std::max(band.lo_um, kUmPerCm / piece.to_per_cm);
  part.hi_um = std::min(band.hi_um, kUmPerCm / piece.from_per_cm);
  if (!validate(part)) return std::nullopt;  // the response is zero here
  return part;
}

air_tables::Response air_tables::integrate_response(const Band& part) {
  // The midpoint rule suffices: a piece of the spectrum is narrow.
  constexpr int kPoints = 200;
  const double step_um = (part.hi_um - part.lo_um) / kPoints;
  Response sum;
  for (int i = 0; i < kPoints; ++i) {
    const double um = part.lo_um + (i + 0.5) * step_um;
    const double response = response_frac(part, um);
    sum.over_um += response * step_um;
    sum.over_per_cm += response * step_um * kUmPerCm / (um * um);
  }
  return sum;
}

std::optional<AirClimate> air_climate(std::string_view name) noexcept {
  const auto found = std::find(kClimateNames.begin(), kClimateNames.end(), name);
  if (found == kClimateNames.end()) return std::nullopt;
  return static_cast<AirClimate>(found - kClimateNames.begin());
}

std::string_view air_climate_name(AirClimate climate) noexcept {
  return kClimateNames[static_cast<std::size_t>(climate)];
}

AirClimate air_climate_of(double lat_rad, std::int64_t posix_utc_ns) noexcept {
  const double lat_deg = lat_rad / kDegree;
  if (std::abs(lat_deg) < 23.5) return AirClimate::tropical;
  const std::chrono::sys_days day = std::chrono::floor<std::chrono::days>(
      std::chrono::sys_time<std::chrono::nanoseconds>(std::chrono::nanoseconds(posix_utc_ns)));
  const unsigned month = static_cast<unsigned>(std::chrono::year_month_day(day).month());
  const bool summer = (month >= 4 && month <= 9) == (lat_deg > 0.0);
  if (std::abs(lat_deg) < 55.0) {
    return summer ? AirClimate::midlatitude_summer : AirClimate::midlatitude_winter;
  }
  return summer ? AirClimate::subarctic_summer : AirClimate::subarctic_winter;
}

double saturated_vapour_g_m3(double kelvin) noexcept {
  const double celsius = kelvin - kZeroCelsiusK;
  return 216.7 * 6.112 * std::exp(17.67 * celsius / (celsius + 243.5)) / kelvin;
}

Result<AirColumn> AirColumn::build(const AirSpec& spec) {
  const auto outside = [](const char* name, double value, double low, double high) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("air: {} is {}, must be {} .. {}", name, value, low, high));
  };
  if (!(spec.visibility_km >= 2.0 && spec.visibility_km <= 50.0)) {
    return outside("visibility_km", spec.visibility_km, 2.0, 50.0);
  }
  if (!(spec.water_ratio >= 0.0 && spec.water_ratio <= 5.0)) {
    return outside("water_ratio", spec.water_ratio, 0.0, 5.0);
  }
  const bool winter = spec.climate == AirClimate::midlatitude_winter ||
                      spec.climate == AirClimate::subarctic_winter;
  AirColumn column;
  const auto rows = air_tables::levels(spec.climate);
  column.ground_vapour_g_m3_ = rows.front().vapour_g_m3;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const air_tables::Level& row = rows[i];
    // Scale the water, but never beyond saturation.
    const double saturated = saturated_vapour_g_m3(row.kelvin);
    const double water =
        spec.water_ratio <= 1.0
            ? row.vapour_g_m3 * spec.water_ratio
            : std::max(row.vapour_g_m3, std::min(row.vapour_g_m3 * spec.water_ratio, saturated));
    const double humidity_frac = std::min(water / saturated, 0.97);
    const double pressure = row.pressure_hpa / 1013.25;
    const double cold = kZeroCelsiusK / row.kelvin;
    const double air = pressure * cold;
    const double haze = i < 3 ? haze_per_km(i, spec.visibility_km) : 0.0;
    Level level;
    level.height_km = row.height_km;
    level.kelvin = row.kelvin;
    level.log_pressure_hpa = std::log(row.pressure_hpa);
    // Each absorber is scaled by pressure and temperature as its lines widen. Water and the mixed
    // gases come twice, with lines from cold and from excited states.
    const double lines = water * std::pow(pressure, 0.95);
    const double mixed = air * std::pow(pressure, 0.72);
    level.density_per_km = {lines * std::pow(cold, -1.5),
                            lines * cold,
                            water * water * std::exp(6.0 * (296.0 / row.kelvin - 1.0)),
                            mixed * std::pow(cold, -1.5),
                            mixed * cold,
                            air * air * std::sqrt(cold),
                            row.ozone_atm_cm_km * std::pow(pressure, 0.42) * std::pow(cold, 0.7),
                            haze,
                            haze * 0.25 / (1.0 - humidity_frac),
                            i < 3 ? 0.0 : upper_aerosol_per_km(i, spec.visibility_km, winter)};
    for (std::size_t k = 0; k < kAirAbsorbers; ++k) {
      level.log_density[k] = std::log(std::max(level.density_per_km[k], 1e-300));
    }
    column.levels_.push_back(level);
  }
  return column;
}

std::size_t AirColumn::level_below(double height_km) const noexcept {
  const auto above =
      std::upper_bound(levels_.begin() + 1, levels_.end() - 1, height_km,
                       [](double height, const Level& level) { return height < level.height_km; });
  return static_cast<std::size_t>(above - levels_.begin()) - 1;
}

AirColumn::Point AirColumn::at(double height_m) const noexcept {
  const double km = std::clamp(height_m * 1e-3, 0.0, kTopKm);
  const std::size_t i = level_below(km);
  const Level& a = levels_[i];
  const Level& b = levels_[i + 1];
  const double f = (km - a.height_km) / (b.height_km - a.height_km);
  Point point;
  point.kelvin = a.kelvin + f * (b.kelvin - a.kelvin);
  point.standard_air_frac =
      std::exp(a.log_pressure_hpa + f * (b.log_pressure_hpa - a.log_pressure_hpa)) / 1013.25 *
      (kZeroCelsiusK / point.kelvin);
  // Densities are exponential between levels, and linear where one of them is zero.
  for (std::size_t k = 0; k < kAirAbsorbers; ++k) {
    const double low = a.density_per_km[k];
    const double high = b.density_per_km[k];
    point.density_per_km[k] =
        low > 0.0 && high > 0.0
            ? std::exp(a.log_density[k] + f * (b.log_density[k] - a.log_density[k]))
            : low + f * (high - low);
  }
  return point;
}

double AirColumn::refractive_index(double height_m) const noexcept {
  const double km = std::clamp(height_m * 1e-3, 0.0, kTopKm);
  const std::size_t i = level_below(km);
  const Level& a = levels_[i];
  const Level& b = levels_[i + 1];
  const double f = (km - a.height_km) / (b.height_km - a.height_km);
  const double kelvin = a.kelvin + f * (b.kelvin - a.kelvin);
  return 1.0 + 77.6e-6 *
                   std::exp(a.log_pressure_hpa + f * (b.log_pressure_hpa - a.log_pressure_hpa)) /
                   kelvin;
}

void AirPath::add_step(const AirColumn& column, const std::array<double, 2>& height_m,
                       const std::array<double, 2>& length_km) noexcept {
  const std::size_t layer = layer_of(0.5 * (height_m[0] + height_m[1]));
  if (size_ == 0 || layer != layer_) {
    close_stretch();
    layer_ = layer;
    stretches_[size_++] = {};
  }
  Stretch& stretch = stretches_[size_ - 1];
  for (std::size_t i = 0; i < 2; ++i) {
    const auto point = column.at(height_m[i]);
    for (std::size_t k = 0; k < kAirAbsorbers; ++k) {
      stretch.amount[k] += point.density_per_km[k] * length_km[i];
    }
    stretch.standard_air_km += point.standard_air_frac * length_km[i];
    stretch.kelvin += point.kelvin * length_km[i];
    stretch.height_m += height_m[i] * length_km[i];
    open_weight_ += length_km[i];
  }
}

void AirPath::close_stretch() noexcept {
  if (size_ == 0 || !(open_weight_ > 0.0)) return;
  stretches_[size_ - 1].kelvin /= open_weight_;
  stretches_[size_ - 1].height_m /= open_weight_;
  open_weight_ = 0.0;
}

AirPath AirPath::between(const AirColumn& column, double sensor_m, double target_m,
                         double range_m) noexcept {
  const double climb_m = target_m - sensor_m;
  const double level_m2 = std::max(0.0, range_m * range_m - climb_m * climb_m);
  const double sag_m = level_m2 / (8.0e3 * kEarthRadiusKm);
  // Take more steps the more the height changes, and shorter ones at both ends.
  const auto steps =
      static_cast<std::size_t>(std::clamp(6.0 + (std::abs(climb_m) + sag_m) / 200.0, 6.0, 48.0));
  AirPath path;
  for (std::size_t i = 0; i < steps; ++i) {
    std::array<double, 2> height_m;
    std::array<double, 2> length_km;
    for (std::size_t g = 0; g < 2; ++g) {
      const double x = (static_cast<double>(i) + kAbscissa[g]) / static_cast<double>(steps);
      const double s = x * x * (3.0 - 2.0 * x);
      // The chord sinks below the line between the heights as the ground bends away.
      height_m[g] = std::max(0.0, sensor_m + climb_m * s - 4.0 * sag_m * s * (1.0 - s));
      length_km[g] = range_m * 6.0 * x * (1.0 - x) * (0.5e-3 / static_cast<double>(steps));
    }
    path.add_step(column, height_m, length_km);
  }
  path.close_stretch();
  return path;
}

void AirPath::add_leg(const AirColumn& column, double invariant_km, double low_km, double from_km,
                      double to_km, std::size_t steps) noexcept {
  // Run in t, the root of the height above the lowest point: there the slant of a level ray
  // cancels.
  const double from = std::sqrt(std::max(0.0, from_km - low_km));
  const double to = std::sqrt(std::max(0.0, to_km - low_km));
  const double step = (to - from) / static_cast<double>(steps);
  for (std::size_t i = 0; i < steps; ++i) {
    std::array<double, 2> height_m;
    std::array<double, 2> length_km;
    for (std::size_t g = 0; g < 2; ++g) {
      const double t = from + step * (static_cast<double>(i) + kAbscissa[g]);
      const double km = low_km + t * t;
      const double cosine =
          invariant_km / (column.refractive_index(km * 1e3) * (kEarthRadiusKm + km));
      const double sine = std::sqrt(std::max(1.0 - cosine * cosine, 1e-14));
      height_m[g] = km * 1e3;
      length_km[g] = std::abs(step) * t / sine;  // half of 2 t dt / sin
    }
    add_step(column, height_m, length_km);
  }
}

AirPath AirPath::to_space(const AirColumn& column, double sensor_m, double elevation_rad) noexcept {
  const double sensor_km = std::clamp(sensor_m * 1e-3, 0.0, kTopKm);
  // Snell's law in spherical layers keeps n r cos(elevation).
  const auto index_radius = [&](double km) {
    return column.refractive_index(km * 1e3) * (kEarthRadiusKm + km);
  };
  double invariant = index_radius(sensor_km) * std::cos(elevation_rad);
  AirPath path;
  if (elevation_rad >= 0.0) {
    path.add_leg(column, invariant, sensor_km, sensor_km, kTopKm, 96);
    path.close_stretch();
    return path;
  }
  // Find the lowest point of a path that first goes down.
  invariant = std::max(invariant, index_radius(0.0));
  double low = 0.0;
  double high = sensor_km;
  for (int i = 0; i < 50; ++i) {
    const double middle = 0.5 * (low + high);
    (index_radius(middle) > invariant ? high : low) = middle;
  }
  path.add_leg(column, invariant, high, sensor_km, high, 48);
  path.add_leg(column, invariant, high, high, kTopKm, 96);
  path.close_stretch();
  return path;
}

bool BandAir::covers(const Band& band) noexcept {
  double lo_um = band.lo_um;
  double hi_um = band.hi_um;
  if (!band.response.empty()) {
    lo_um = std::max(lo_um, band.response.front().wavelength_um);
    hi_um = std::min(hi_um, band.response.back().wavelength_um);
  }
  return lo_um >= kAirShortestUm && hi_um <= kAirLongestUm;
}

Result<BandAir> BandAir::build(const Band& band) {
  if (auto valid = validate(band); !valid) return tl::unexpected(std::move(valid.error()));
  if (!covers(band)) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("the built-in air covers {} to {:.4f} um, the band {} to {} um",
                                  kAirShortestUm, kAirLongestUm, band.lo_um, band.hi_um));
  }
  BandAir out;
  for (const air_tables::BandTerms& own : air_tables::bands()) {
    if (own.lo_um != band.lo_um || own.hi_um != band.hi_um || !band.response.empty()) continue;
    // Take the terms that were fitted to the band.
    out.sun_w_m2_ = own.sun_w_m2;
    for (std::size_t t = 0; t < air_tables::kBandTerms; ++t) {
      Term term{own.extinction[t], {}};
      for (std::size_t s = 0; s < kAirSources; ++s) term.share_frac[s] = own.weight[s][t];
      out.add_term(term, [&](double kelvin) {
        constexpr auto& kNodesK = air_tables::kEmissionK;
        std::size_t j = 0;
        while (j + 2 < kNodesK.size() && kelvin >= kNodesK[j + 1]) ++j;
        const double f =
            std::clamp((kelvin - kNodesK[j]) / (kNodesK[j + 1] - kNodesK[j]), 0.0, 1.0);
        return band_radiance(band, Kelvin(kelvin)).radiance_w_m2_sr *
               std::lerp(own.emission_weight[j][t], own.emission_weight[j + 1][t], f);
      });
    }
    return out;
  }
  out.add_spectrum(band);
  return out;
}

template <class Emission>
void BandAir::add_term(const Term& term, Emission emission) {
  terms_.push_back(term);
  for (std::size_t i = 0; i < kEmissionNodes; ++i) {
    emission_.push_back(emission(kEmissionFirstK + kEmissionStepK * static_cast<double>(i)));
  }
}

/// Makes the terms out of those of the spectrum's pieces in the band.
void BandAir::add_spectrum(const Band& band) {
  std::array<double, kAirSources> sum{};
  for (const air_tables::Piece& piece : air_tables::pieces()) {
    const std::optional<Band> part = air_tables::part_of(band, piece);
    if (!part) continue;
    // Find what each kind of source has in the piece.
    const air_tables::Response response = air_tables::integrate_response(*part);
    const auto black = [&part](double kelvin) {
      return band_radiance(*part, Kelvin(kelvin)).radiance_w_m2_sr;
    };
    const std::array<double, kAirSources> source{black(300.0), black(800.0),
                                                 black(kSunTemperatureK), response.over_um,
                                                 piece.sun_w_m2_cm * response.over_per_cm};
    for (std::size_t s = 0; s < kAirSources; ++s) sum[s] += source[s];
    std::array<double, kEmissionNodes> emitted;
    for (std::size_t i = 0; i < kEmissionNodes; ++i) {
      emitted[i] = black(kEmissionFirstK + kEmissionStepK * static_cast<double>(i));
    }
    // The printed weights add up to 1 but for rounding.
    const double weights = std::accumulate(piece.weight.begin(), piece.weight.end(), 0.0);
    for (std::size_t t = 0; t < air_tables::kPieceTerms; ++t) {
      const double weight = piece.weight[t] / weights;
      Term term{piece.extinction[t], source};
      for (double& share : term.share_frac) share *= weight;
      terms_.push_back(term);
      for (const double radiance : emitted) emission_.push_back(weight * radiance);
    }
  }
  for (Term& term : terms_) {
    for (std::size_t s = 0; s < kAirSources; ++s) term.share_frac[s] /= sum[s];
  }
  sun_w_m2_ = sum[static_cast<std::size_t>(AirSource::sun_lowtran)];
}

double BandAir::through(const Term& term, const AirPath::Stretch& stretch) noexcept {
  double depth = 0.0;
  for (std::size_t k = 0; k < kAirAbsorbers; ++k) depth += term.extinction[k] * stretch.amount[k];
  return std::exp(-depth);
}

BandAir::Warmth BandAir::warmth_of(const AirPath::Stretch& stretch, double warmer_k) noexcept {
  // The difference from the climate fades upwards.
  const double kelvin =
      stretch.kelvin +
      (warmer_k == 0.0 ? 0.0 : warmer_k * std::exp(-stretch.height_m / kWarmthScaleM));
  const double place = std::clamp((kelvin - kEmissionFirstK) / kEmissionStepK, 0.0,
                                  static_cast<double>(kEmissionNodes - 1));
  const std::size_t node = std::min(static_cast<std::size_t>(place), kEmissionNodes - 2);
  return {node, place - static_cast<double>(node)};
}

double BandAir::sun_w_m2(const AirPath& to_sun) const noexcept {
  return sun_w_m2_ * transmittance(to_sun, AirSource::sun_lowtran);
}

}  // namespace emit::physics
