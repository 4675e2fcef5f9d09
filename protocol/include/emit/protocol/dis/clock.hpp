// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

namespace emit::protocol::dis {

/// Units of a time stamp in an hour. The upper 31 bits of a stamp count them from the full hour, so
/// that a unit is about 1.676 us; the lowest bit says whether the hour is that of UTC.
inline constexpr std::int64_t kUnitsPerHour = 2'147'483'647;

/// Returns whether a stamp counts from the full hour of UTC. Otherwise it counts from the start of
/// the sender's own hour. RT-safe.
[[nodiscard]] constexpr bool is_absolute(std::uint32_t timestamp) noexcept {
  return (timestamp & 1u) != 0;
}
/// Returns the time of a number of units, rounded to 1 ns. RT-safe.
[[nodiscard]] std::int64_t units_to_ns(std::int64_t units) noexcept;
/// Returns the stamp of a time, rounded to a unit; whole hours are left out. RT-safe.
[[nodiscard]] std::uint32_t timestamp_of(std::int64_t time_ns, bool absolute) noexcept;

/// Turns the stamps of one sender into a time that does not wrap. Every reading is computed from
/// the number of units since the first full hour, so that neither rounding nor lost PDUs shift it.
/// Thread: one owner.  Real time: nothing allocates.
class DisClock {
 public:
  enum class Order : std::uint8_t {
    first,      ///< the first stamp; its time is that since the full hour
    next,       ///< later than all before
    duplicate,  ///< the same as the latest
    late,       ///< up to kMaxLate_ns older than the latest: PDUs changed places on the way
    restart,    ///< older than that, or of the other kind: the sender's clock was set
  };
  struct Reading {
    std::int64_t time_ns = 0;
    Order order = Order::first;
  };
  /// Largest age of a stamp that counts as late, ns.
  static constexpr std::int64_t kMaxLate_ns = 5'000'000'000;

  /// Reads the stamp of a PDU that came at `received_ns` of a local clock that does not go back.
  /// The local clock decides how many whole hours a silent sender has let pass, and how far time
  /// went on across a restart; it changes no other reading. A stamp that is more than half an hour
  /// ahead of what the local clock expects is taken as one of the hour before. Times of `first`,
  /// `next` and `restart` increase; that of `late` lies before the latest.
  [[nodiscard]] Reading read(std::uint32_t timestamp, std::int64_t received_ns) noexcept;

 private:
  bool started_ = false;
  bool absolute_ = false;
  std::int64_t units_ = 0;        ///< of the latest stamp, with whole hours
  std::int64_t origin_ns_ = 0;    ///< added to the time of `units_`
  std::int64_t received_ns_ = 0;  ///< of the latest stamp
};

}  // namespace emit::protocol::dis
