// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/shade_response.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace emit::renderer {
namespace {

/// Number of times at which the fit reads the response.
constexpr std::size_t kTimes = 48;
constexpr std::size_t kModes = ShadeResponse::kModes;
using Weights = std::array<double, kModes>;
using Normal = std::array<std::array<double, kModes>, kModes>;

/// Solves the normal equations for the unknowns whose bits are set in `chosen`; the others are 0.
/// Gaussian elimination without pivoting, because the matrix is positive definite.
Weights solve(Normal a, Weights b, std::uint32_t chosen) noexcept {
  const auto free = [chosen](std::size_t i) { return ((chosen >> i) & 1U) != 0U; };
  for (std::size_t i = 0; i < kModes; ++i) {
    if (!free(i)) continue;
    for (std::size_t row = i + 1; row < kModes; ++row) {
      if (!free(row)) continue;
      const double factor = a[row][i] / a[i][i];
      for (std::size_t column = i; column < kModes; ++column) {
        a[row][column] -= factor * a[i][column];
      }
      b[row] -= factor * b[i];
    }
  }
  // Substitute from the last unknown back.
  Weights x{};
  for (std::size_t i = kModes; i-- > 0;) {
    if (!free(i)) continue;
    double sum = b[i];
    for (std::size_t column = i + 1; column < kModes; ++column) sum -= a[i][column] * x[column];
    x[i] = sum / a[i][i];
  }
  return x;
}

/// Weights of the least squares of the relative error, none negative. With four modes all 15 sets
/// of modes are tried and the best one is taken. All weights are 0 if the response is 0.
Weights fitted(std::span<const double> times_s, std::span<const double> response) noexcept {
  Normal a{};
  Weights b{};
  const double most = response.back();
  if (!(most > 0.0)) return {};
  // Build the normal equations. The floor of the scale keeps small early values from ruling the
  // fit.
  for (std::size_t j = 0; j < times_s.size(); ++j) {
    const double scale = 1.0 / std::max(response[j], 1e-3 * most);
    Weights term;
    for (std::size_t k = 0; k < kModes; ++k) {
      term[k] = -std::expm1(-times_s[j] / ShadeResponse::kTauS[k]) * scale;
    }
    for (std::size_t k = 0; k < kModes; ++k) {
      b[k] += term[k] * response[j] * scale;
      for (std::size_t l = 0; l < kModes; ++l) a[k][l] += term[k] * term[l];
    }
  }
  // Try every set of modes, and keep the best one without a negative weight.
  Weights best{};
  double least = std::numeric_limits<double>::infinity();
  for (std::uint32_t chosen = 1; chosen < 1U << kModes; ++chosen) {
    const Weights x = solve(a, b, chosen);
    if (std::ranges::any_of(x, [](double value) { return !(value >= 0.0); })) continue;
    // Sum the squared error, but for a part that all sets share.
    double error = 0.0;
    for (std::size_t k = 0; k < kModes; ++k) {
      error -= 2.0 * x[k] * b[k];
      for (std::size_t l = 0; l < kModes; ++l) error += x[k] * a[k][l] * x[l];
    }
    if (error < least) {
      least = error;
      best = x;
    }
  }
  return best;
}

}  // namespace

ShadeResponse::ShadeResponse(const SampleHeat& heat, std::size_t materials,
                             const ResponseConditions& around) {
  std::array<double, kTimes> times_s;
  // Spread the times evenly over the logarithm.
  for (std::size_t j = 0; j < kTimes; ++j) {
    times_s[j] = kFirstS * std::pow(kLastS / kFirstS, static_cast<double>(j) / (kTimes - 1));
  }
  std::array<double, kTimes> response;
  for (std::size_t m = 0; m < materials; ++m) {
    heat.step_response(static_cast<std::uint32_t>(m), around, times_s, response);
    const Weights weights = fitted(times_s, response);
    glm::vec4& out = weights_k_.emplace_back();
    for (std::size_t k = 0; k < kModes; ++k) {
      out[static_cast<glm::length_t>(k)] = static_cast<float>(kFullSunWM2 * weights[k]);
    }
  }
}

glm::vec4 ShadeResponse::left_frac(double seconds) noexcept {
  glm::vec4 left;
  for (std::size_t k = 0; k < kModes; ++k) {
    left[static_cast<glm::length_t>(k)] = static_cast<float>(std::exp(-seconds / kTauS[k]));
  }
  return left;
}

ShadeEffect::ShadeEffect(const ShadeResponse& response, float tolerance_k)
    : tolerance_k_(tolerance_k) {
  for (const glm::vec4& weights : response.weights_k()) {
    most_weight_k_ = glm::max(most_weight_k_, weights);
  }
}

float ShadeEffect::of_shade_k(const glm::vec4& shade) const noexcept {
  return glm::dot(most_weight_k_, shade);
}

float ShadeEffect::passing_k(float seconds) const noexcept {
  float sum_k = 0.0F;
  for (std::size_t k = 0; k < ShadeResponse::kModes; ++k) {
    sum_k -= most_weight_k_[static_cast<glm::length_t>(k)] *
             std::expm1(-seconds / static_cast<float>(ShadeResponse::kTauS[k]));
  }
  return sum_k;
}

}  // namespace emit::renderer
