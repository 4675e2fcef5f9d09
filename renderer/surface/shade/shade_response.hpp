// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

#include "surface/heat/sample_heat.hpp"

namespace emit::renderer {

/// Response of the temperature of open ground to a step of direct sunlight, as a sum of
/// exponentials: sum w_k (1 - exp(-t / tau_k)). All materials have the same four time constants
/// (physics.md eq. 25).
/// Immutable after construction; any thread.
class ShadeResponse {
 public:
  static constexpr std::size_t kModes = 4;
  /// Time constants tau_k, in s.
  static constexpr std::array<double, kModes> kTauS{1.0, 10.0, 100.0, 1000.0};
  /// Direct normal irradiance E_0 that the weights hold for, W m-2. The sun never sends more.
  static constexpr double kFullSunWM2 = 1280.0;
  /// Times between which the sum of exponentials follows the response, in s.
  static constexpr double kFirstS = 0.2;
  static constexpr double kLastS = 3600.0;

  ShadeResponse() = default;
  /// Fits the weights of materials 0 to `materials` - 1, with the response linearised at `around`.
  ShadeResponse(const SampleHeat& heat, std::size_t materials, const ResponseConditions& around);

  /// Share of older shade that is left after a time, by mode.
  [[nodiscard]] static glm::vec4 left_frac(double seconds) noexcept;
  /// Weights w_k by material, in K at kFullSunWM2. None is negative.
  [[nodiscard]] std::span<const glm::vec4> weights_k() const noexcept { return weights_k_; }

 private:
  std::vector<glm::vec4> weights_k_;
};

/// Upper bounds, in K, of the change of temperature that shade causes, and the tolerance that such
/// a change has to exceed to matter. The bounds hold for all materials of a ShadeResponse.
/// Immutable after construction; any thread.
class ShadeEffect {
 public:
  /// `tolerance_k` is thermal.tolerance_k.
  ShadeEffect(const ShadeResponse& response, float tolerance_k);

  /// Greatest change that the values A_k cause.
  [[nodiscard]] float of_shade_k(const glm::vec4& shade) const noexcept;
  /// Greatest change that full shade of this duration causes.
  [[nodiscard]] float passing_k(float seconds) const noexcept;
  [[nodiscard]] float tolerance_k() const noexcept { return tolerance_k_; }

 private:
  glm::vec4 most_weight_k_{0.0F};  ///< largest weight of any material, by mode
  float tolerance_k_ = 0.0F;
};

}  // namespace emit::renderer
