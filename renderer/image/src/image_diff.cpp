// SPDX-License-Identifier: Apache-2.0
#include "emit/image/image_diff.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "emit/physics/check.hpp"

namespace emit::image {
namespace {

bool is_radiance(const std::string& channel) {
  return channel == kRadianceChannel || channel.rfind("radiance.", 0) == 0;
}

/// Returns true if two values, at least one of them not finite, are not of the same kind.
bool differs_in_kind(float a, float b) {
  if (std::isnan(a) || std::isnan(b)) {
    return std::isnan(a) != std::isnan(b);
  }
  return a != b;
}

/// Returns the value at a percentile by nearest rank. Reorders `values`.
double percentile(std::vector<double>& values, double percent) {
  // The product 99.9 / 100 * 1000 is slightly above 999. The rank must not become 1000 for that.
  const double rank = std::ceil(percent / 100.0 * static_cast<double>(values.size()) - 1e-6);
  const auto index = static_cast<std::ptrdiff_t>(std::max(rank, 1.0)) - 1;
  std::nth_element(values.begin(), values.begin() + index, values.end());
  return values[static_cast<std::size_t>(index)];
}

/// Computes the statistics of (a - b) * scale(a, b). A pixel whose scale is not finite is left out.
template <class Scale>
DiffStats scaled_diff(std::span<const float> a, std::span<const float> b, std::uint32_t width_px,
                      Scale scale) {
  DiffStats stats;
  std::vector<double> magnitudes;
  magnitudes.reserve(a.size());
  double sum = 0.0;
  double sum_squares = 0.0;
  double sum_abs = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!std::isfinite(a[i]) || !std::isfinite(b[i])) {
      stats.one_sided_nan += differs_in_kind(a[i], b[i]) ? 1U : 0U;
      continue;
    }
    const double factor = scale(static_cast<double>(a[i]), static_cast<double>(b[i]));
    if (!std::isfinite(factor)) {
      continue;
    }
    const double difference = (static_cast<double>(a[i]) - static_cast<double>(b[i])) * factor;
    const double magnitude = std::abs(difference);
    if (magnitude > stats.max_abs) {
      stats.max_abs = magnitude;
      stats.max_x_px = static_cast<std::uint32_t>(i % width_px);
      stats.max_y_px = static_cast<std::uint32_t>(i / width_px);
    }
    sum += difference;
    sum_abs += magnitude;
    sum_squares += difference * difference;
    magnitudes.push_back(magnitude);
  }
  stats.pixels_compared = magnitudes.size();
  if (magnitudes.empty()) {
    return stats;
  }
  const auto count = static_cast<double>(magnitudes.size());
  stats.mean = sum / count;
  stats.mean_abs = sum_abs / count;
  stats.rms = std::sqrt(sum_squares / count);
  stats.p50 = percentile(magnitudes, 50.0);
  stats.p95 = percentile(magnitudes, 95.0);
  stats.p99 = percentile(magnitudes, 99.0);
  stats.p999 = percentile(magnitudes, 99.9);
  return stats;
}

}  // namespace

DiffStats diff_values(std::span<const float> a, std::span<const float> b, std::uint32_t width_px) {
  EMIT_CHECK_OP(a.size(), ==, b.size());
  EMIT_CHECK_OP(width_px, >, 0U);
  EMIT_CHECK_OP(a.size() % width_px, ==, 0U);
  return scaled_diff(a, b, width_px, [](double, double) { return 1.0; });
}

bool ImageDiff::identical() const noexcept {
  return only_in_a.empty() && only_in_b.empty() &&
         std::all_of(channels.begin(), channels.end(), [](const ChannelDiff& channel) {
           return channel.absolute.max_abs == 0.0 && channel.absolute.one_sided_nan == 0;
         });
}

physics::Result<ImageDiff> compare_images(const ExrImage& a, const ExrImage& b,
                                          const KelvinPerRadiance& conversion) {
  if (a.width_px != b.width_px || a.height_px != b.height_px || a.width_px == 0) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               fmt::format("sizes differ: {}x{} and {}x{}", a.width_px, a.height_px,
                                           b.width_px, b.height_px));
  }
  ImageDiff result;
  for (const ExrChannel& channel : a.channels) {
    const ExrChannel* reference = b.find(channel.name);
    if (reference == nullptr) {
      result.only_in_a.push_back(channel.name);
      continue;
    }
    if (channel.pixels.size() != reference->pixels.size()) {
      return physics::make_error(physics::ErrorCode::invalid_argument,
                                 fmt::format("channel '{}' differs in size", channel.name));
    }
    ChannelDiff diff;
    diff.channel = channel.name;
    if (channel.name == kTemperatureChannel) {
      diff.unit.assign(1, 'K');
    }
    diff.absolute = diff_values(channel.pixels, reference->pixels, a.width_px);
    if (is_radiance(channel.name)) {
      diff.percent = scaled_diff(channel.pixels, reference->pixels, a.width_px,
                                 [](double, double value) { return 100.0 / std::abs(value); });
      if (conversion) {
        diff.kelvin_equivalent =
            scaled_diff(channel.pixels, reference->pixels, a.width_px,
                        [&](double, double value) { return conversion(value); });
      }
    }
    result.channels.push_back(std::move(diff));
  }
  for (const ExrChannel& channel : b.channels) {
    if (a.find(channel.name) == nullptr) {
      result.only_in_b.push_back(channel.name);
    }
  }
  if (result.channels.empty()) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "the images have no channel in common");
  }
  return result;
}

}  // namespace emit::image
