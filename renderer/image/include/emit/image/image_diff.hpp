// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "emit/physics/error.hpp"

namespace emit::image {

/// Statistics of |a - b| over the pixels where both are finite.
struct DiffStats {
  std::uint64_t pixels_compared = 0;
  std::uint64_t one_sided_nan = 0;  ///< one not finite, the other finite or another non-finite kind
  double max_abs = 0.0;
  double rms = 0.0;
  double mean = 0.0;  ///< signed, a - b
  double mean_abs = 0.0;
  double p50 = 0.0;
  double p95 = 0.0;
  double p99 = 0.0;
  double p999 = 0.0;
  std::uint32_t max_x_px = 0;
  std::uint32_t max_y_px = 0;
};

/// Precondition of all: equal sizes, width_px > 0 and a divisor of the size.
[[nodiscard]] DiffStats diff_values(std::span<const float> a, std::span<const float> b,
                                    std::uint32_t width_px);

struct ChannelDiff {
  std::string channel;
  std::string unit;    ///< "K" for temperature, else "" (the channel's own)
  DiffStats absolute;  ///< in `unit`
  /// Per cent of |b|; radiance channels only, pixels_compared 0 otherwise and where b is 0.
  DiffStats percent;
  /// Radiance turned into kelvin; filled when a conversion was given.
  DiffStats kelvin_equivalent;
};
struct ImageDiff {
  std::vector<ChannelDiff> channels;
  std::vector<std::string> only_in_a;
  std::vector<std::string> only_in_b;
  [[nodiscard]] bool identical() const noexcept;  ///< same channels, no pixel differs
};

/// Kelvin per W m-2 sr-1 (1 / (dL/dT)) at a radiance of the reference, for the band of the image.
using KelvinPerRadiance = std::function<double(double radiance_w_m2_sr)>;

/// Compares each channel that both images have; `b` is the reference. "radiance" and names that
/// begin with "radiance." count as radiance.
/// Errors: invalid_argument (sizes differ, no common channel).
[[nodiscard]] physics::Result<ImageDiff> compare_images(const ExrImage& a, const ExrImage& b,
                                                        const KelvinPerRadiance& conversion = {});

}  // namespace emit::image
