// SPDX-License-Identifier: Apache-2.0
#include "weather_gaps.hpp"

#include <algorithm>

#include "emit/physics/check.hpp"

namespace emit::config {

using physics::WeatherSample;

namespace {

/// A pause this many times longer than the usual one is a gap, unless it is short.
constexpr double kGapRatio = 2.5;
constexpr std::int64_t kShortestGapNs = 1'800'000'000'000;

bool same_weather(const WeatherSample& a, const WeatherSample& b) {
  return a.direct_normal_w_m2 == b.direct_normal_w_m2 &&
         a.diffuse_horizontal_w_m2 == b.diffuse_horizontal_w_m2 &&
         a.longwave_down_w_m2 == b.longwave_down_w_m2 && a.air_k == b.air_k &&
         a.wind_m_s == b.wind_m_s && a.cloud_frac == b.cloud_frac &&
         a.environment_k == b.environment_k && a.film_w_m2_k == b.film_w_m2_k &&
         a.wind_from_rad == b.wind_from_rad &&
         a.relative_humidity_frac == b.relative_humidity_frac && a.rain_mm_h == b.rain_mm_h;
}

/// Returns the usual pause around row i: the median of up to five pauses, of which the one before
/// row i is the middle. A table may change from rows of a quarter of an hour to hourly rows.
/// @pre 0 < i < rows.size()
std::int64_t local_spacing_ns(std::span<const WeatherSample> rows, std::size_t i) {
  EMIT_CHECK(i > 0 && i < rows.size());
  const std::size_t first = i >= 3 ? i - 3 : 0;
  const std::size_t last = std::min(i + 2, rows.size() - 1);
  return usual_spacing_ns(rows.subspan(first, last - first + 1));
}

}  // namespace

std::int64_t usual_spacing_ns(std::span<const WeatherSample> rows) {
  std::vector<std::int64_t> pauses_ns;
  for (std::size_t i = 1; i < rows.size(); ++i) {
    pauses_ns.push_back(rows[i].sim_time_ns - rows[i - 1].sim_time_ns);
  }
  EMIT_CHECK(!pauses_ns.empty());
  const auto middle = pauses_ns.begin() + static_cast<std::ptrdiff_t>((pauses_ns.size() - 1) / 2);
  std::nth_element(pauses_ns.begin(), middle, pauses_ns.end());
  return *middle;
}

std::vector<std::size_t> weather_gaps(std::span<const WeatherSample> rows, std::int64_t from_ns) {
  std::vector<std::size_t> gaps;
  if (rows.size() < 2) return gaps;
  const auto usual_ns = static_cast<double>(usual_spacing_ns(rows));
  for (std::size_t i = 1; i < rows.size(); ++i) {
    const std::int64_t pause_ns = rows[i].sim_time_ns - rows[i - 1].sim_time_ns;
    const auto pause = static_cast<double>(pause_ns);
    if (rows[i].sim_time_ns <= from_ns || pause_ns < kShortestGapNs ||
        pause <= kGapRatio * usual_ns ||
        pause <= kGapRatio * static_cast<double>(local_spacing_ns(rows, i)) ||
        same_weather(rows[i - 1], rows[i])) {
      continue;
    }
    gaps.push_back(i);
  }
  return gaps;
}

}  // namespace emit::config
