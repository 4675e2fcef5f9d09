// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/step_nodes.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"

namespace emit::physics {
namespace {

/// Returns the sum of r^i for i < n, which is (r^n - 1)/(r - 1), without the cancellation near
/// r = 1.
double geometric_sum(double log_ratio, double n) noexcept {
  return log_ratio == 0.0 ? n : std::expm1(n * log_ratio) / std::expm1(log_ratio);
}

/// Returns ln r of physics.md eq. 9 for a window of `window_in_steps` first steps and n intervals.
double log_step_ratio(double window_in_steps, double n) noexcept {
  if (!(window_in_steps > n) || n < 2.0) {
    return 0.0;
  }
  // The largest term alone is less than the sum, so r^(n-1) < window bounds r from above. Bisect.
  double low = 0.0;
  double high = std::log(window_in_steps) / (n - 1.0);
  for (int i = 0; i < 100 && high - low > 1e-16 * high; ++i) {
    const double middle = 0.5 * (low + high);
    (geometric_sum(middle, n) < window_in_steps ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

}  // namespace

double geometric_step_ratio(double window_s, double first_step_s, std::uint32_t steps) noexcept {
  EMIT_CHECK_OP(first_step_s, >, 0.0);
  return std::exp(log_step_ratio(window_s / first_step_s, static_cast<double>(steps)));
}

void uniform_step_nodes(std::int64_t start_ns, std::int64_t now_ns,
                        std::span<std::int64_t> nodes) noexcept {
  EMIT_CHECK_OP(nodes.size(), >=, 2U);
  const std::int64_t window_ns = now_ns - start_ns;
  if (window_ns <= 0) {
    std::fill(nodes.begin(), nodes.end(), now_ns);
    return;
  }
  const auto steps = static_cast<std::int64_t>(nodes.size()) - 1;
  const std::int64_t whole = window_ns / steps;
  const std::int64_t rest = window_ns % steps;
  for (std::int64_t i = 0; i <= steps; ++i) {
    // Divide in integers: both ends are exact and no interval differs by more than 1 ns.
    nodes[static_cast<std::size_t>(i)] = start_ns + whole * i + rest * i / steps;
  }
}

void geometric_step_nodes(std::int64_t start_ns, std::int64_t now_ns, double first_step_s,
                          std::span<std::int64_t> nodes) noexcept {
  EMIT_CHECK_OP(nodes.size(), >=, 2U);
  EMIT_CHECK_OP(first_step_s, >, 0.0);
  const std::int64_t window_ns = now_ns - start_ns;
  const std::size_t steps = nodes.size() - 1;
  const double first_ns = first_step_s * 1e9;
  const double in_steps = static_cast<double>(window_ns) / first_ns;
  const double log_ratio = log_step_ratio(in_steps, static_cast<double>(steps));
  if (window_ns <= 0 || log_ratio == 0.0) {
    uniform_step_nodes(start_ns, now_ns, nodes);
    return;
  }
  // Fix both ends exactly and place the nodes between them by their lag, physics.md eq. 9.
  nodes[0] = start_ns;
  nodes[steps] = now_ns;
  for (std::size_t j = 1; j < steps; ++j) {
    const double lag_ns = first_ns * geometric_sum(log_ratio, static_cast<double>(j));
    nodes[steps - j] = std::max(start_ns, now_ns - static_cast<std::int64_t>(std::llround(lag_ns)));
  }
}

}  // namespace emit::physics
