// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "emit/protocol/axes.hpp"

namespace emit::server {

/// State of the run, for whoever displays it. The conductor writes, any thread reads. RT-safe.
struct RunBoard {
  std::atomic<bool> running{true};
  std::atomic<bool> held{false};
};

/// The axes of the motion simulator as they were measured and commanded last, for whoever displays
/// them. A reader may see angles of two neighbouring measurements side by side. The motion agent
/// writes, any thread reads. RT-safe.
struct AxesBoard {
  std::atomic<std::int64_t> measured_ns{0};  ///< instant of the measurement, wall; 0: none yet
  std::atomic<std::uint8_t> state{0};        ///< protocol::MotionState
  std::atomic<std::uint8_t> faults{0};       ///< protocol::MotionFaults
  std::atomic<std::size_t> count{0};         ///< axes that are commanded
  std::array<std::atomic<double>, protocol::kMaxAxes> measured_rad{};
  std::array<std::atomic<double>, protocol::kMaxAxes> commanded_rad{};
  /// Set by the console while a page is open. Without it no AxesTick is noted.
  std::atomic<bool> watched{false};
};

/// Measurement of the axes with what was commanded for its instant, for the strips of the console.
struct AxesTick {
  std::int64_t time_ns = 0;  ///< instant of the measurement, wall
  std::uint8_t count = 0;    ///< axes that are measured
  bool driven = false;       ///< emitd commanded them to follow; else demanded_rad is not valid
  std::array<double, protocol::kMaxAxes> measured_rad{};
  std::array<double, protocol::kMaxAxes> demanded_rad{};
};
/// Shortest time between two of them, ns.
inline constexpr std::int64_t kAxesTickNs = 20'000'000;

}  // namespace emit::server
