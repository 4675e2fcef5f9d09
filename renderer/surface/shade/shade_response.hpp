// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

#include "surface/heat/sample_heat.hpp"

namespace emit::renderer {

/// How the temperature of open ground follows the sun, as a sum of exponentials of the same four
/// time constants for all materials: sum w_k (1 - exp(-t / tau_k)).
/// Immutable after construction; any thread.
class ShadeResponse {
 public:
  static constexpr std::size_t kModes = 4;
  static constexpr std::array<double, kModes> kTauS{1.0, 10.0, 100.0, 1000.0};
  /// Direct normal flux that weights are given for: more than the sun ever sends.
  static constexpr double kFullSunWM2 = 1280.0;
  /// The sum of exponentials follows the response between these times.
  static constexpr double kFirstS = 0.2;
  static constexpr double kLastS = 3600.0;

  ShadeResponse() = default;
  ShadeResponse(const SampleHeat& heat, std::size_t materials, const ResponseConditions& around);

  /// By material: w_k in K under kFullSunWM2, none negative.
  [[nodiscard]] std::span<const glm::vec4> weights_k() const noexcept { return weights_k_; }

 private:
  std::vector<glm::vec4> weights_k_;
};

}  // namespace emit::renderer
