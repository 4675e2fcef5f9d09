// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/climate/rain.hpp"

#include <algorithm>
#include <cmath>

namespace emit::physics {
namespace {

constexpr double kNsPerH = 3.6e12;

}  // namespace

double rain_rate_mm_h(std::span<const WeatherSample> rows, std::int64_t sim_time_ns) noexcept {
  if (rows.size() == 1) return rows.front().rain_mm_h;
  const auto row = std::ranges::lower_bound(rows, sim_time_ns, {}, &WeatherSample::sim_time_ns);
  return row == rows.begin() || row == rows.end() ? 0.0 : row->rain_mm_h;
}

RainDepth::RainDepth(std::span<const WeatherSample> rows) {
  if (std::ranges::none_of(rows, [](const WeatherSample& row) { return row.rain_mm_h > 0.0; })) {
    return;
  }
  if (rows.size() == 1) single_mm_h_ = rows.front().rain_mm_h;
  times_ns_.reserve(rows.size());
  depth_mm_.reserve(rows.size());
  double depth_mm = 0.0;
  for (const WeatherSample& row : rows) {
    if (!times_ns_.empty()) {
      depth_mm += row.rain_mm_h * static_cast<double>(row.sim_time_ns - times_ns_.back()) / kNsPerH;
    }
    times_ns_.push_back(row.sim_time_ns);
    depth_mm_.push_back(depth_mm);
  }
}

double RainDepth::at_mm(std::int64_t sim_time_ns) const noexcept {
  if (times_ns_.empty()) return 0.0;
  if (times_ns_.size() == 1) return single_mm_h_ * static_cast<double>(sim_time_ns) / kNsPerH;
  const auto after = std::ranges::upper_bound(times_ns_, sim_time_ns);
  if (after == times_ns_.begin()) return 0.0;
  if (after == times_ns_.end()) return depth_mm_.back();
  const auto i = static_cast<std::size_t>(after - times_ns_.begin());
  const double share = static_cast<double>(sim_time_ns - times_ns_[i - 1]) /
                       static_cast<double>(times_ns_[i] - times_ns_[i - 1]);
  return std::lerp(depth_mm_[i - 1], depth_mm_[i], share);
}

}  // namespace emit::physics
