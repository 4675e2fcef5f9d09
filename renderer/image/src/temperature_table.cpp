// SPDX-License-Identifier: Apache-2.0
#include "emit/image/temperature_table.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::image {

TemperatureTable::TemperatureTable(double lo_um, double hi_um)
    : TemperatureTable(physics::Band{lo_um, hi_um, {}}) {}

TemperatureTable::TemperatureTable(const physics::Band& band) {
  EMIT_CHECK(validate(band).has_value());
  // The table is exact every 2 K. In between ln L is linear in 1/T, with an error below 1 mK in the
  // thermal bands.
  constexpr double kAnchorK = 2.0;
  const auto count = static_cast<std::size_t>((kToK - kFromK) / kStepK) + 1;
  radiance_.reserve(count);
  double anchor_k = kFromK;
  double log_low = physics::band_radiance(band, physics::Kelvin{anchor_k}).log_radiance;
  double log_high = physics::band_radiance(band, physics::Kelvin{anchor_k + kAnchorK}).log_radiance;
  for (std::size_t i = 0; i < count; ++i) {
    const double t_k = kFromK + kStepK * static_cast<double>(i);
    while (t_k > anchor_k + kAnchorK) {
      anchor_k += kAnchorK;
      log_low = log_high;
      log_high = physics::band_radiance(band, physics::Kelvin{anchor_k + kAnchorK}).log_radiance;
    }
    const double fraction =
        (1.0 / anchor_k - 1.0 / t_k) / (1.0 / anchor_k - 1.0 / (anchor_k + kAnchorK));
    radiance_.push_back(std::exp(log_low + (log_high - log_low) * fraction));
  }
}

std::size_t TemperatureTable::interval(double radiance_w_m2_sr) const noexcept {
  const auto above = std::upper_bound(radiance_.begin(), radiance_.end(), radiance_w_m2_sr);
  const auto index = above - radiance_.begin();
  return static_cast<std::size_t>(
      std::clamp<std::ptrdiff_t>(index, 1, static_cast<std::ptrdiff_t>(radiance_.size()) - 1) - 1);
}

double TemperatureTable::kelvin(double radiance_w_m2_sr) const noexcept {
  if (std::isnan(radiance_w_m2_sr)) return std::numeric_limits<double>::quiet_NaN();
  const std::size_t i = interval(radiance_w_m2_sr);
  const double fraction = (radiance_w_m2_sr - radiance_[i]) / (radiance_[i + 1] - radiance_[i]);
  return kFromK + kStepK * (static_cast<double>(i) + std::clamp(fraction, 0.0, 1.0));
}

double TemperatureTable::kelvin_per_radiance(double radiance_w_m2_sr) const noexcept {
  const std::size_t i = interval(radiance_w_m2_sr);
  return kStepK / (radiance_[i + 1] - radiance_[i]);
}

std::vector<float> TemperatureTable::kelvin(std::span<const float> radiance_w_m2_sr) const {
  std::vector<float> out(radiance_w_m2_sr.size());
  std::transform(
      radiance_w_m2_sr.begin(), radiance_w_m2_sr.end(), out.begin(),
      [this](float value) { return static_cast<float>(kelvin(static_cast<double>(value))); });
  return out;
}

}  // namespace emit::image
