// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

#include "emit/protocol/cigi/host_packets.hpp"

namespace emit::server {

/// Simulation time of the messages of a CIGI host.
///
/// The first message has the time that the clock was started with. From there time follows the
/// sender's time stamps (ticks of 10 us that wrap), or, where a message has none, the number of the
/// message times the period of the frames. Both say how far the host is, so that lost or delayed
/// messages never shift time.
///
/// Thread: one owner. Real time: RT-safe.
class CigiClock {
 public:
  /// @param period_ns  time between two messages without time stamps; 0: they have no time
  explicit CigiClock(std::int64_t period_ns) noexcept : period_ns_(period_ns) {}

  enum class Verdict : std::uint8_t {
    accept,
    repeated,  ///< the number of the latest message again
    old,       ///< a message that another one has overtaken
    restart,   ///< the host counts from elsewhere: a new run
    timeless,  ///< a message without a time stamp where one is needed
  };
  /// Forgets the host: the next message has the time `first_ns`.
  void start(std::int64_t first_ns) noexcept;
  /// Judges a message, and moves to its time if it is accepted. A clock that was not started
  /// accepts none but as `restart`.
  [[nodiscard]] Verdict take(const protocol::cigi::IgControl& control) noexcept;
  /// Shifts the time of the latest message and those after it.
  void shift(std::int64_t by_ns) noexcept { time_ns_ += by_ns; }

  /// Returns the simulation time of the latest accepted message.
  [[nodiscard]] std::int64_t time_ns() const noexcept { return time_ns_; }
  /// Returns the number of the latest accepted message, counted on beyond 32 bits.
  [[nodiscard]] std::uint64_t number() const noexcept { return number_; }

 private:
  std::int64_t period_ns_;
  bool started_ = false;
  bool first_ = true;
  std::int64_t time_ns_ = 0;
  std::uint64_t number_ = 0;
  std::uint32_t frame_ = 0;  ///< IgControl::host_frame of the latest accepted message
  std::uint32_t ticks_ = 0;  ///< of the latest accepted message with a time stamp
  bool has_ticks_ = false;
  std::uint32_t stray_frame_ = 0;  ///< of the latest message that was `old`
  std::uint32_t strays_ = 0;       ///< such messages in a row that count up by one
};

}  // namespace emit::server
