// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/climate/climate.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>

namespace emit::physics {
namespace {

constexpr double kYearDays = 365.2425;
constexpr double kYearRadPerDay = 2.0 * std::numbers::pi / kYearDays;
constexpr double kDayS = 86'400.0;
constexpr double kFreezingK = 273.15;
/// Decrease of the mean with the height of the ground, less than that of free air.
constexpr double kLapseKPerM = 0.0045;
/// Least time that tells mean and amplitude of a year apart.
constexpr double kEnoughDays = 300.0;
/// Land is warmest a month after the solstice.
constexpr double kNorthWarmestDay = 201.0;

/// Rounded means of the air at sea level along parallels from 90 S to 90 N in steps of 10 degrees,
/// degrees Celsius. They are an approximation whose error the header states.
struct Parallel {
  double year_c;
  double january_c;
  double july_c;
};
constexpr std::array<Parallel, 19> kParallels{{{-33.1, -13.5, -47.8},
                                               {-27.0, -10.8, -39.5},
                                               {-13.6, -3.5, -23.0},
                                               {-3.4, 2.1, -9.1},
                                               {5.8, 8.1, 3.4},
                                               {11.9, 15.6, 9.0},
                                               {16.6, 21.9, 14.7},
                                               {22.9, 25.4, 20.0},
                                               {25.3, 26.3, 23.9},
                                               {26.2, 26.4, 25.6},
                                               {26.7, 25.8, 26.9},
                                               {25.3, 21.8, 28.0},
                                               {20.4, 14.5, 27.3},
                                               {14.1, 5.0, 24.0},
                                               {5.8, -7.1, 18.1},
                                               {-1.1, -16.1, 14.1},
                                               {-10.7, -26.3, 7.3},
                                               {-17.2, -32.2, 2.0},
                                               {-22.7, -41.1, -1.1}}};

/// Returns day `day` shifted into 0..365.2425.
double within_year(double day) noexcept {
  return day - kYearDays * std::floor(day / kYearDays);
}

}  // namespace

double AnnualAir::at_k(double day) const noexcept {
  return mean_k + amplitude_k * std::cos(kYearRadPerDay * (day - warmest_day));
}

double day_of_year(std::int64_t posix_utc_ns) noexcept {
  using namespace std::chrono;
  const sys_time<nanoseconds> at{nanoseconds(posix_utc_ns)};
  const year_month_day date{floor<days>(at)};
  const sys_days begin{date.year() / January / 1};
  return duration<double>(at - begin).count() / kDayS;
}

AnnualAir zonal_climate(const GeoPlace& place) noexcept {
  const double latitude_deg =
      std::clamp(place.latitude.value() * 180.0 / std::numbers::pi, -90.0, 90.0);
  const double at = (latitude_deg + 90.0) / 10.0;
  const auto low = std::min(static_cast<std::size_t>(at), kParallels.size() - 2);
  const double way = at - static_cast<double>(low);
  const auto between = [&](double Parallel::*value) {
    return std::lerp(kParallels[low].*value, kParallels[low + 1].*value, way);
  };
  const double swing_k = 0.5 * (between(&Parallel::july_c) - between(&Parallel::january_c));
  const bool north = swing_k >= 0.0;
  return {.mean_k = kFreezingK + between(&Parallel::year_c) - kLapseKPerM * place.height.value(),
          .amplitude_k = std::abs(swing_k),
          .warmest_day = north ? kNorthWarmestDay : kNorthWarmestDay - 0.5 * kYearDays};
}

std::optional<AnnualAir> annual_air_of(std::span<const WeatherSample> rows,
                                       std::int64_t epoch_utc_ns) noexcept {
  if (rows.size() < 3) return std::nullopt;
  const auto days_of = [](std::int64_t ns) { return static_cast<double>(ns) * 1e-9 / kDayS; };
  if (days_of(rows.back().sim_time_ns - rows.front().sim_time_ns) < kEnoughDays) {
    return std::nullopt;
  }
  // Fit 1, cos and sin by least squares; a row stands for half of the time to both neighbours.
  glm::dmat3 normal(0.0);
  glm::dvec3 right(0.0);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const std::int64_t before_ns = rows[i == 0 ? 0 : i - 1].sim_time_ns;
    const std::int64_t after_ns = rows[std::min(i + 1, rows.size() - 1)].sim_time_ns;
    const double weight = 0.5 * days_of(after_ns - before_ns);
    const double angle = kYearRadPerDay * day_of_year(epoch_utc_ns + rows[i].sim_time_ns);
    const glm::dvec3 basis(1.0, std::cos(angle), std::sin(angle));
    normal += weight * glm::outerProduct(basis, basis);
    right += weight * rows[i].air_k * basis;
  }
  const glm::dvec3 fit = glm::inverse(normal) * right;
  return AnnualAir{.mean_k = fit.x,
                   .amplitude_k = std::hypot(fit.y, fit.z),
                   .warmest_day = within_year(std::atan2(fit.z, fit.y) / kYearRadPerDay)};
}

double ground_k(const AnnualAir& air, std::span<const StackLayer> layers, double day) noexcept {
  double depth = 0.0;  // in units of the damping depth of each layer
  for (const StackLayer& layer : layers) {
    const double diffusivity_m2_s = layer.conductivity_w_m_k / layer.volumetric_heat_j_m3_k;
    depth += layer.thickness_m / std::sqrt(2.0 * diffusivity_m2_s / (kYearRadPerDay / kDayS));
  }
  return air.mean_k + std::exp(-depth) * (air.at_k(day - depth / kYearRadPerDay) - air.mean_k);
}

double usual_dew_point_k(double air_k) noexcept {
  constexpr double kA = 17.62;
  constexpr double kBK = 243.12;
  constexpr double kHumidityFrac = 0.6;
  const double c = air_k - kFreezingK;
  const double g = std::log(kHumidityFrac) + kA * c / (kBK + c);
  return kFreezingK + kBK * g / (kA - g);
}

}  // namespace emit::physics
