// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/planck.hpp"

namespace emit::physics {

/// In-band radiance of a blackbody as a float32 table of T ln L over T, uniform in T.
/// L = exp(y/T): y is nearly straight, so one linear interpolation is enough (physics.md eq. 8).
/// The table of one band is handed to shaders/lib/planck_lut.glsl as it is.
/// Owner: whoever builds it. Any thread after construction. Real time: lookup() RT-safe; build()
/// setup only. With the default options the relative error is <= 1e-5 at 200..3000 K and <= 1e-3
/// at 20..6000 K; in temperature <= 0.3 mK below 400 K, then float32 rounding (3 mK at 3000 K).
class BandRadianceLut {
 public:
  struct Options {
    double min_k = 10.0;
    double max_k = 6000.0;
    std::uint32_t nodes = 4096;  ///< >= 2; 16 KiB per band
  };
  struct Lookup {
    float radiance_w_m2_sr = 0.0F;
    bool clamped = false;  ///< outside the table (or NaN): its nearest end was used
  };

  /// Errors: invalid_argument for a band that fails validate() or options out of order.
  [[nodiscard]] static Result<BandRadianceLut> build(const Band& band, const Options& options);
  [[nodiscard]] static Result<BandRadianceLut> build(const Band& band) {
    return build(band, Options{});
  }

  /// The same float32 arithmetic as the shader.
  [[nodiscard]] Lookup lookup(float temperature_k) const noexcept;

  /// T ln L at the nodes.
  [[nodiscard]] std::span<const float> nodes() const noexcept { return nodes_; }

  /// (first node K, nodes per K, number of nodes - 1, `first_index`): the `layout_lut` of the
  /// shader, where `first_index` is the place of this table in a buffer shared by bands.
  [[nodiscard]] std::array<float, 4> shader_layout(std::uint32_t first_index) const noexcept {
    return {min_k_, nodes_per_k_, last_node_, static_cast<float>(first_index)};
  }

 private:
  std::vector<float> nodes_;
  float min_k_ = 0.0F;
  float nodes_per_k_ = 0.0F;
  float last_node_ = 0.0F;
};

}  // namespace emit::physics
