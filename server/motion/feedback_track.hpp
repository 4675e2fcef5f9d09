// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "motion/motion_table.hpp"

namespace emit::server {

/// Measured axes of an instant.
struct AxisFeedback {
  std::int64_t time_ns = 0;  ///< instant of the measurement
  TableAngles angles;
  glm::dvec3 unit_rates_rad_s{0.0};
  glm::dvec2 target_rates_rad_s{0.0};
};

/// The latest measurements of the axes, from which they are interpolated to any instant.
///
/// Fixed size. RT-safe.
class FeedbackTrack {
 public:
  static constexpr std::size_t kSamples = 64;
  /// Accelerations are the change of the rates over this time, so that noise matters little. A
  /// controller need not measure them.
  static constexpr std::int64_t kAccelerationNs = 16'000'000;

  /// State of the axes at an instant.
  struct State {
    TableAngles angles;
    bool extrapolated = false;  ///< the instant is after the latest measurement
  };

  /// Adds a measurement. Returns false and drops it if it is not later than the latest one.
  bool add(const AxisFeedback& feedback) noexcept;

  /// Returns the angles at an instant: cubic between two measurements; after the last one by its
  /// rates and the accelerations that the rates of the latest kAccelerationNs show. Returns nothing
  /// if there is no measurement, if the instant is before the oldest one that is kept, or if it is
  /// more than `horizon_ns` after the latest one.
  [[nodiscard]] std::optional<State> at(std::int64_t time_ns,
                                        std::int64_t horizon_ns) const noexcept;

  /// Returns the latest measurement, or null.
  [[nodiscard]] const AxisFeedback* latest() const noexcept {
    return count_ == 0 ? nullptr : &sample(count_ - 1);
  }
  void clear() noexcept { count_ = 0; }

 private:
  /// Returns the state after the latest measurement.
  [[nodiscard]] State predicted(std::int64_t time_ns) const noexcept;
  /// Returns a kept measurement, the oldest first.
  [[nodiscard]] const AxisFeedback& sample(std::size_t i) const noexcept {
    return samples_[(first_ + i) % kSamples];
  }

  std::array<AxisFeedback, kSamples> samples_;
  std::size_t first_ = 0;
  std::size_t count_ = 0;
};

}  // namespace emit::server
