// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>

/// Where the thermal history is sampled between its start and now (physics.md section 6).
/// Any thread. RT-safe: no allocation, a few microseconds.
namespace emit::physics {

/// Equal intervals. `nodes` gets N+1 instants for N intervals: nodes[0] = start, the last = now,
/// ascending. @pre at least 2 nodes. With now <= start every node is `now`: no history.
void uniform_step_nodes(std::int64_t start_ns, std::int64_t now_ns,
                        std::span<std::int64_t> nodes) noexcept;

/// Intervals that grow into the past: lags s_j = s1 (r^j - 1)/(r - 1), j = 0..N, with s_1 the
/// `first_step_s` next to now and r >= 1 such that s_N is the whole window. A window shorter than
/// N first steps is divided evenly. @pre as above and first_step_s > 0.
void geometric_step_nodes(std::int64_t start_ns, std::int64_t now_ns, double first_step_s,
                          std::span<std::int64_t> nodes) noexcept;

/// The ratio r above: solves (r^steps - 1)/(r - 1) = window / first step; 1 where the window is
/// not longer than `steps` first steps.
[[nodiscard]] double geometric_step_ratio(double window_s, double first_step_s,
                                          std::uint32_t steps) noexcept;

}  // namespace emit::physics
