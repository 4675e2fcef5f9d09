// SPDX-License-Identifier: Apache-2.0
#include "emit/image/image_diff.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <string_view>
#include <utility>

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

/// Pixels of a comparison: a mask, and which of its values are meant. An empty mask means all.
struct Selection {
  std::span<const char> mask;
  bool value = false;
  [[nodiscard]] bool holds(std::size_t pixel) const {
    return mask.empty() || (mask[pixel] != 0) == value;
  }
};

/// Returns 1 for each pixel that shows no surface in both images, else 0; empty if no channel
/// tells.
std::vector<char> no_surface_mask(const ExrImage& a, const ExrImage& b) {
  for (const char* name : {kObjectChannel, kDepthChannel, kTemperatureChannel}) {
    const ExrChannel* in_a = a.find(name);
    const ExrChannel* in_b = b.find(name);
    if (in_a == nullptr || in_b == nullptr || in_a->pixels.size() != in_b->pixels.size()) continue;
    const bool by_id = std::string_view(name) == kObjectChannel;
    const auto empty = [by_id](float value) {
      return by_id ? value == 0.0F : !std::isfinite(value);
    };
    std::vector<char> mask(in_a->pixels.size());
    for (std::size_t i = 0; i < mask.size(); ++i) {
      mask[i] = empty(in_a->pixels[i]) && empty(in_b->pixels[i]) ? 1 : 0;
    }
    return mask;
  }
  return {};
}

/// Computes the statistics of (a - b) * scale(a, b) over the selected pixels. A pixel whose scale
/// is not finite is left out.
template <class Scale>
DiffStats scaled_diff(std::span<const float> a, std::span<const float> b, std::uint32_t width_px,
                      const Selection& selection, Scale scale) {
  DiffStats stats;
  std::vector<double> magnitudes;
  magnitudes.reserve(a.size());
  double sum = 0.0;
  double sum_squares = 0.0;
  double sum_abs = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    if (!selection.holds(i)) {
      continue;
    }
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
  return scaled_diff(a, b, width_px, {}, [](double, double) { return 1.0; });
}

bool ImageDiff::identical() const noexcept {
  return only_in_a.empty() && only_in_b.empty() &&
         std::all_of(channels.begin(), channels.end(), [](const ChannelDiff& channel) {
           return std::ranges::all_of(
               std::array{&channel.absolute, &channel.no_surface_absolute},
               [](const DiffStats* all) { return all->max_abs == 0.0 && all->one_sided_nan == 0; });
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
  const std::vector<char> no_surface = no_surface_mask(a, b);
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
    if (!is_radiance(channel.name)) {
      diff.absolute = diff_values(channel.pixels, reference->pixels, a.width_px);
      result.channels.push_back(std::move(diff));
      continue;
    }
    const auto fill = [&](const Selection& selection, DiffStats& absolute, DiffStats& percent,
                          DiffStats& kelvin) {
      const auto stats = [&](const auto& scale) {
        return scaled_diff(channel.pixels, reference->pixels, a.width_px, selection, scale);
      };
      absolute = stats([](double, double) { return 1.0; });
      percent = stats([](double, double value) { return 100.0 / std::abs(value); });
      if (conversion) {
        kelvin = stats([&](double, double value) { return conversion(value); });
      }
    };
    const bool masked = no_surface.size() == channel.pixels.size();
    const std::span<const char> mask = masked ? std::span(no_surface) : std::span<const char>();
    fill({mask, false}, diff.absolute, diff.percent, diff.kelvin_equivalent);
    if (masked) {
      fill({mask, true}, diff.no_surface_absolute, diff.no_surface_percent, diff.no_surface_kelvin);
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
