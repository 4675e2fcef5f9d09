// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/planck.hpp"

namespace emit::physics {

/// Table of the in-band radiance L of a blackbody: float32 values of y = T ln L, uniform in T.
/// L = exp(y/T), and y is nearly straight, so one linear interpolation is enough (physics.md eq.
/// 8). The shader shaders/lib/planck_lut.glsl reads the same table.
/// Accuracy with the default options: the relative error is <= 1e-5 at 200..3000 K and <= 1e-3 at
/// 20..6000 K. The error in temperature is <= 0.3 mK below 400 K; above, float32 rounding dominates
/// (3 mK at 3000 K).
/// Owner: the caller of build(). Any thread after construction. Real time: lookup() is RT-safe,
/// build() is setup only.
class BandRadianceLut {
 public:
  struct Options {
    double min_k = 10.0;
    double max_k = 6000.0;
    std::uint32_t nodes = 4096;  ///< 2..1048576; 4096 nodes take 16 KiB per band
  };
  struct Lookup {
    float radiance_w_m2_sr = 0.0F;
    bool clamped = false;  ///< outside the table or NaN: the nearest end of the table was used
  };

  /// Builds the table of `band`. Errors: invalid_argument if the band fails validate() or the
  /// options do not satisfy 0 < min_k < max_k.
  [[nodiscard]] static Result<BandRadianceLut> build(const Band& band, const Options& options);
  [[nodiscard]] static Result<BandRadianceLut> build(const Band& band) {
    return build(band, Options{});
  }

  /// Returns the radiance at a temperature with the same float32 arithmetic as the shader.
  [[nodiscard]] Lookup lookup(float temperature_k) const noexcept;

  /// Values of T ln L at the nodes, `Options::nodes` of them.
  [[nodiscard]] std::span<const float> nodes() const noexcept { return nodes_; }

  /// Returns the uniform `layout_lut` of the shader: (first node in K, nodes per K, number of nodes
  /// - 1, `first_index`). `first_index` is the index of this table's first node in a buffer that
  /// several bands share.
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
