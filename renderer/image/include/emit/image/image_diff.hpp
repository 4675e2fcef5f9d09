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

/// Statistics of the difference a - b over the pixels at which both values are finite.
struct DiffStats {
  std::uint64_t pixels_compared = 0;
  /// Number of pixels with one value not finite and the other finite or of another non-finite kind.
  std::uint64_t one_sided_nan = 0;
  double max_abs = 0.0;
  double rms = 0.0;
  double mean = 0.0;  ///< mean of a - b with its sign
  double mean_abs = 0.0;
  double p50 = 0.0;
  double p95 = 0.0;
  double p99 = 0.0;
  double p999 = 0.0;
  std::uint32_t max_x_px = 0;
  std::uint32_t max_y_px = 0;
};

/// Compares two images pixel by pixel. `a` and `b` are row-major with rows of `width_px` pixels.
/// @pre the sizes are equal and a multiple of width_px, which is above 0.
[[nodiscard]] DiffStats diff_values(std::span<const float> a, std::span<const float> b,
                                    std::uint32_t width_px);

/// Difference of one channel of two images.
struct ChannelDiff {
  std::string channel;
  std::string unit;    ///< "K" for temperature; empty if the channel has its own unit
  DiffStats absolute;  ///< difference in `unit`
  /// Difference in per cent of |b|, over the pixels with b != 0. Only radiance channels have it;
  /// pixels_compared is 0 otherwise.
  DiffStats percent;
  /// Difference of a radiance channel in kelvin. It is filled if a conversion was given.
  DiffStats kelvin_equivalent;
  /// The same of a radiance channel over the pixels that show no surface in both images, such as
  /// sky. The figures above leave these pixels out, because many equal pixels of the sky would make
  /// an error on the surfaces look small. It is empty if no channel says which pixels these are.
  DiffStats no_surface_absolute;
  DiffStats no_surface_percent;
  DiffStats no_surface_kelvin;
};
/// Difference of two images.
struct ImageDiff {
  std::vector<ChannelDiff> channels;
  std::vector<std::string> only_in_a;
  std::vector<std::string> only_in_b;
  /// Returns true if both images have the same channels and no pixel differs.
  [[nodiscard]] bool identical() const noexcept;
};

/// A function that returns kelvin per W m-2 sr-1, which is 1 / (dL/dT), at a radiance of the
/// reference image, in the band of the images.
using KelvinPerRadiance = std::function<double(double radiance_w_m2_sr)>;

/// Compares each channel that both images have; `b` is the reference. The channel "radiance" and
/// names that begin with "radiance." count as radiance. The channel `object`, else `depth`, else
/// `temperature` of both images says which pixels show no surface.
/// Errors: invalid_argument (sizes differ, no common channel).
[[nodiscard]] physics::Result<ImageDiff> compare_images(const ExrImage& a, const ExrImage& b,
                                                        const KelvinPerRadiance& conversion = {});

}  // namespace emit::image
