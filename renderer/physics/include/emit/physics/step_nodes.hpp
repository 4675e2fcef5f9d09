// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>

/// Instants at which the thermal history is sampled between its start and now (physics.md section
/// 6). Any thread. RT-safe: no allocation, a few microseconds.
namespace emit::physics {

/// Fills `nodes` with N+1 ascending instants at equal distances: the first is `start_ns`, the last
/// is `now_ns`. If now <= start there is no history, and every node is `now_ns`.
/// @pre at least 2 nodes.
void uniform_step_nodes(std::int64_t start_ns, std::int64_t now_ns,
                        std::span<std::int64_t> nodes) noexcept;

/// Fills `nodes` with N+1 ascending instants whose distances grow into the past. The lags behind
/// now are s_j = s_1 (r^j - 1)/(r - 1), j = 0..N (physics.md eq. 9). s_1 is `first_step_s`, and r
/// >= 1 makes s_N the whole window. A window shorter than N first steps is divided evenly. If now
/// <= start every node is `now_ns`.
/// @pre at least 2 nodes and first_step_s > 0.
void geometric_step_nodes(std::int64_t start_ns, std::int64_t now_ns, double first_step_s,
                          std::span<std::int64_t> nodes) noexcept;

/// Returns the ratio r of physics.md eq. 9, which solves (r^steps - 1)/(r - 1) = window / first
/// step. It is 1 if the window is not longer than `steps` first steps.
/// @pre first_step_s > 0.
[[nodiscard]] double geometric_step_ratio(double window_s, double first_step_s,
                                          std::uint32_t steps) noexcept;

}  // namespace emit::physics
