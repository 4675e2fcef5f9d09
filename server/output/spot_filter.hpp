// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/protocol/output_geometry.hpp"
#include "emit/scene/scene_desc.hpp"
#include "output/spot.hpp"

namespace emit::server {

/// Convolves a part of an image with a spot, in radiance (docs/optics.md eq. 4). The spot is a sum
/// of products of a row and a column, found by its singular values: a Gaussian is one product, an
/// Airy pattern a few. What lies beyond the borders of the image repeats its outermost pixels.
///
/// Thread: one at a time. Real time: apply() is RT-safe.
class SpotFilter {
 public:
  /// @param part   part of the image that is convolved
  /// @param image  size of the image
  SpotFilter(const Spot& spot, const scene::PixelRect& part, const protocol::ImageSize& image);

  /// Returns the part of the image that apply() reads: the part that it writes, and a margin as
  /// wide as the spot, as far as the image has it.
  [[nodiscard]] const scene::PixelRect& reads_px() const noexcept { return reads_px_; }
  /// Returns the number of products.
  [[nodiscard]] std::size_t products() const noexcept { return products_.size(); }

  /// Returns an image of the size of `image` of which the part is convolved. The rest is not set.
  [[nodiscard]] std::span<const float> apply(std::span<const float> image) noexcept;

 private:
  struct Product {
    std::vector<float> across;  ///< along a row
    std::vector<float> down;
  };

  /// Copies what is read, with repeated borders, into padded_.
  void pad(std::span<const float> image) noexcept;
  /// Adds the veil: the mean of a wide square around each pixel.
  void add_veil() noexcept;

  scene::PixelRect part_px_;
  scene::PixelRect reads_px_;
  protocol::ImageSize image_;
  std::uint32_t radius_px_ = 0;
  float veil_frac_ = 0.0F;
  std::vector<Product> products_;
  std::vector<float> padded_;  ///< part with a margin of radius_px_, by row
  std::vector<float> across_;  ///< one product's rows of padded_, convolved along them
  std::vector<float> out_;     ///< of the image's size
  std::vector<double> column_sums_;
};

}  // namespace emit::server
