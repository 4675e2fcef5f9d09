// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <random>

namespace emit::scenegen {

/// Random numbers that are the same with every library: the standard defines the engine, but not
/// the distributions.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  /// Returns a number between two others.
  double between(double lo, double hi) {
    return lo + (hi - lo) * static_cast<double>(engine_()) / 4294967295.0;
  }
  /// Returns a whole number from 0 to count - 1. @pre count > 0
  std::uint32_t below(std::uint32_t count) { return static_cast<std::uint32_t>(engine_()) % count; }

 private:
  std::mt19937 engine_;
};

}  // namespace emit::scenegen
