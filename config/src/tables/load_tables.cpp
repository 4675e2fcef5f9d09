// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/limits.hpp"
#include "tables.hpp"
#include "typed_table.hpp"

namespace emit::config {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

std::int64_t nanoseconds_of(double seconds) {
  return std::llround(seconds * 1e9);
}

std::string at_line(const std::filesystem::path& file, const TableRow& row, std::string_view text) {
  return fmt::format("{}:{}: {}", file.string(), row.line, text);
}

const Range kTime = between(-limits::kMaxSimTimeS, limits::kMaxSimTimeS);

}  // namespace

double wind_of_film_m_s(double film_w_m2_k) {
  double lo_m_s = limits::kWindMS.lo;
  double hi_m_s = limits::kWindMS.hi;
  for (int i = 0; i < 60; ++i) {
    const double middle_m_s = 0.5 * (lo_m_s + hi_m_s);
    const bool below = physics::film_coefficient_w_m2_k(middle_m_s) < film_w_m2_k;
    (below ? lo_m_s : hi_m_s) = middle_m_s;
  }
  return 0.5 * (lo_m_s + hi_m_s);
}

Result<std::vector<scene::WeatherSample>> load_weather_csv(const std::filesystem::path& file) {
  const Result<std::vector<TableRow>> rows =
      read_typed_table(file, {{"time_s", true, kTime},
                              {"dni_w_m2", true, between(limits::kDirectNormalWM2)},
                              {"dhi_w_m2", true, between(limits::kDiffuseHorizontalWM2)},
                              {"longwave_down_w_m2", true, between(limits::kLongwaveDownWM2)},
                              {"air_k", true, between(limits::kAirK)},
                              {"wind_m_s", false, between(limits::kWindMS)},
                              {"cloud_frac", false, between(limits::kCloudFrac)},
                              {"environment_k", false, between(limits::kEnvironmentK)},
                              {"film_w_m2_k", false, between(limits::kFilmWM2K)},
                              {"wind_from_deg", false, between(limits::kWindFromDeg)},
                              {"relative_humidity_frac", false, between(limits::kHumidityFrac)},
                              {"rain_mm_h", false, between(limits::kRainMmH)}});
  if (!rows) {
    return tl::unexpected<physics::Error>(rows.error());
  }
  std::vector<scene::WeatherSample> out;
  for (const TableRow& row : *rows) {
    scene::WeatherSample sample;
    sample.sim_time_ns = nanoseconds_of(*row.numbers[0]);
    sample.direct_normal_w_m2 = *row.numbers[1];
    sample.diffuse_horizontal_w_m2 = *row.numbers[2];
    sample.longwave_down_w_m2 = *row.numbers[3];
    sample.air_k = *row.numbers[4];
    sample.cloud_frac = row.numbers[6].value_or(0.0);
    sample.environment_k = row.numbers[7];
    sample.film_w_m2_k = row.numbers[8];
    if (row.numbers[9]) sample.wind_from_rad = *row.numbers[9] * physics::kDegree;
    sample.relative_humidity_frac = row.numbers[10];
    sample.rain_mm_h = row.numbers[11].value_or(0.0);
    if (!row.numbers[5] && !sample.film_w_m2_k) {
      return make_error(
          ErrorCode::config,
          at_line(file, row, "'wind_m_s' is needed where 'film_w_m2_k' is not given"));
    }
    sample.wind_m_s = row.numbers[5] ? *row.numbers[5] : wind_of_film_m_s(*sample.film_w_m2_k);
    if (!out.empty() && sample.sim_time_ns <= out.back().sim_time_ns) {
      return make_error(ErrorCode::config,
                        at_line(file, row, "'time_s' is not later than in the row before"));
    }
    out.push_back(sample);
  }
  return out;
}

Result<scene::Trajectory> load_trajectory_csv(const std::filesystem::path& file) {
  const Result<std::vector<TableRow>> rows =
      read_typed_table(file, {{"time_s", true, kTime},
                              {"x_m", true, any_number()},
                              {"y_m", true, any_number()},
                              {"z_m", true, any_number()},
                              {"heading_deg", true, between(-360, 360)},
                              {"pitch_deg", true, between(-90, 90)},
                              {"roll_deg", true, between(-360, 360)},
                              {"on", false, between(0, 1)}});
  if (!rows) {
    return tl::unexpected<physics::Error>(rows.error());
  }
  scene::Trajectory out;
  for (const TableRow& row : *rows) {
    scene::Keyframe keyframe;
    keyframe.sim_time_ns = nanoseconds_of(*row.numbers[0]);
    keyframe.pose.position_world_m = glm::dvec3(*row.numbers[1], *row.numbers[2], *row.numbers[3]);
    keyframe.pose.world_from_body = physics::world_from_body_heading_pitch_roll(
        *row.numbers[4] * physics::kDegree, *row.numbers[5] * physics::kDegree,
        *row.numbers[6] * physics::kDegree);
    const double on = row.numbers[7].value_or(1.0);
    if (on != 0.0 && on != 1.0) {
      return make_error(ErrorCode::config, at_line(file, row, "'on' must be 0 or 1"));
    }
    keyframe.on = on == 1.0;
    if (!out.empty() && keyframe.sim_time_ns <= out.back().sim_time_ns) {
      return make_error(ErrorCode::config,
                        at_line(file, row, "'time_s' is not later than in the row before"));
    }
    out.push_back(keyframe);
  }
  return out;
}

namespace {

/// Reads a table over wavelength, which ascends.
Result<std::vector<TableRow>> read_curve_csv(const std::filesystem::path& file,
                                             std::vector<TableColumn> shares) {
  shares.insert(shares.begin(), {"wavelength_um", true, kWavelengthUm});
  Result<std::vector<TableRow>> rows = read_typed_table(file, shares);
  if (!rows) return rows;
  for (std::size_t i = 1; i < rows->size(); ++i) {
    if (*(*rows)[i].numbers[0] <= *(*rows)[i - 1].numbers[0]) {
      return make_error(ErrorCode::config,
                        at_line(file, (*rows)[i], "'wavelength_um' is not above the row before"));
    }
  }
  return rows;
}

}  // namespace

Result<std::vector<scene::ResponseSample>> load_response_csv(const std::filesystem::path& file) {
  const auto rows = read_curve_csv(file, {{"response_frac", true, between(0, 1)}});
  if (!rows) return tl::unexpected<physics::Error>(rows.error());
  std::vector<scene::ResponseSample> out;
  for (const TableRow& row : *rows) out.push_back({*row.numbers[0], *row.numbers[1]});
  return out;
}

Result<std::vector<scene::EmissivitySample>> load_emissivity_csv(
    const std::filesystem::path& file) {
  const auto rows = read_curve_csv(file, {{"emissivity_frac", false, between(0, 1)},
                                          {"reflectance_frac", false, between(0, 1)}});
  if (!rows) return tl::unexpected<physics::Error>(rows.error());
  const bool emitted = rows->front().numbers[1].has_value();
  std::vector<scene::EmissivitySample> out;
  for (const TableRow& row : *rows) {
    const auto fail = [&](std::string_view text) {
      return make_error(ErrorCode::config, at_line(file, row, text));
    };
    if (row.numbers[1] && row.numbers[2]) {
      return fail("use only one of 'emissivity_frac' and 'reflectance_frac'");
    }
    if (!row.numbers[1] && !row.numbers[2]) {
      return fail("neither 'emissivity_frac' nor 'reflectance_frac' is given");
    }
    if (row.numbers[1].has_value() != emitted) {
      return fail("'emissivity_frac' and 'reflectance_frac' change places");
    }
    out.push_back({*row.numbers[0], emitted ? *row.numbers[1] : 1.0 - *row.numbers[2]});
  }
  return out;
}

std::string wavelength_hint(double wavelength_um) {
  if (!(wavelength_um > kWavelengthUm.hi)) return {};
  return "; this looks like nanometres or wavenumbers, wanted are micrometres";
}

}  // namespace emit::config
