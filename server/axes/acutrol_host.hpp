// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include "axes/acutrol_answer.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/axes.hpp"
#include "motion/axis_profile.hpp"
#include "rt/counters.hpp"
#include "telemetry/event_log.hpp"

namespace emit::server {

/// Speaks the ACUTROL command language with the controller of a motion simulator (docs/motion.md).
/// It makes lines of the commands and messages of the answers. A round of lines is made only when
/// the answers of the round before have come; lines that switch the motors off do not wait.
///
/// The controller has no command to park: this class moves the axes to their park positions. It
/// also keeps the state of the axes: motors off until they were switched on, parking, parked,
/// capturing, following; fault when the controller answers an error or has opened an interlock.
/// A command with AxesMode::off ends a fault.
///
/// Pure: the caller moves bytes and gives all instants. Thread: one owner. RT-safe after create().
class AcutrolHost {
 public:
  struct Axis {
    AxisLimits limits;
    double park_rad = 0.0;
  };

  /// Errors: invalid_argument (no axis or more than protocol::kMaxAxes, or limits that AxisProfile
  /// refuses).
  [[nodiscard]] static physics::Result<AcutrolHost> create(const std::vector<Axis>& axes,
                                                           Counters& counters, EventLog& events);

  /// Begins a connection. Nothing is known of the axes; a fault stays.
  void start() noexcept;
  /// Returns the lines for a command. They are valid until the next call. They are empty while
  /// answers of earlier ones are missing, which is counted (axes_rounds_left_out).
  [[nodiscard]] std::string_view lines(const protocol::AxesCommand& command,
                                       std::int64_t now_ns) noexcept;
  /// Takes bytes of the controller that arrived at `now_ns`. Answers of a wrong kind and answers to
  /// nothing are counted (axes_reports_refused).
  void take(std::string_view bytes, std::int64_t now_ns) noexcept;
  /// Returns the message that the latest answers complete, once. Its instant is that of the arrival
  /// less half of the round trip.
  [[nodiscard]] std::optional<protocol::AxesMonitor> monitor() noexcept {
    return std::exchange(ready_, std::nullopt);
  }

  /// Returns true if answers no longer belong to their lines: the connection has to begin anew.
  [[nodiscard]] bool order_lost() const noexcept { return order_lost_; }
  /// Returns true while answers are missing to lines that were sent before `instant_ns`.
  [[nodiscard]] bool waits_since(std::int64_t instant_ns) const noexcept {
    return expected_count_ > 0 && sent_ns_ < instant_ns;
  }

 private:
  static constexpr std::size_t kMaxAxes = protocol::kMaxAxes;
  static constexpr std::size_t kMostExpected = 64;
  static constexpr std::size_t kMostChars = 2048;

  /// Line that waits for its answer.
  struct Expected {
    enum class What : std::uint8_t { demand, start, off, position, rate, interlock };
    What what = What::demand;
    std::size_t axis = 0;
  };

  AcutrolHost(const std::vector<Axis>& axes, std::vector<AxisProfile> profiles, Counters& counters,
              EventLog& events);

  /// Adds a line, with the number of the axis and an angle behind it.
  void add(Expected::What what, std::string_view verb, std::size_t axis) noexcept;
  void add_demand(Expected::What what, std::size_t axis) noexcept;
  void add_off() noexcept;
  void add_start() noexcept;
  void add_reads(bool with_demands) noexcept;
  void expect(Expected::What what, std::size_t axis) noexcept;
  void write(std::string_view text) noexcept;
  /// Chooses what the axes are asked for, by the mode of a command.
  void plan(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept;

  void answer(std::string_view line, std::int64_t now_ns) noexcept;
  void answer_to_command(const Expected& to, AcutrolAnswer::Kind kind,
                         std::string_view line) noexcept;
  void answer_to_read(const Expected& to, const AcutrolAnswer& answer, std::string_view line,
                      std::int64_t now_ns) noexcept;
  void answer_to_interlock(std::size_t axis, AcutrolAnswer::Kind kind,
                           std::string_view line) noexcept;
  void refuse() noexcept;
  void lose_order() noexcept;
  /// Begins a fault of an axis because of an answer.
  void fail(std::size_t axis, std::string_view line) noexcept;
  /// Ends lines that switch the motors off, when all of them are answered.
  void end_off() noexcept;
  /// Ends a round when all of its lines are answered.
  void end_round(std::int64_t now_ns) noexcept;
  /// Looks whether the interlocks have closed after a start.
  void power_on(unsigned all, std::int64_t now_ns) noexcept;
  void note_arrival() noexcept;

  std::vector<Axis> axes_;
  std::vector<AxisProfile> profiles_;  ///< ways to the park positions
  Counters& counters_;
  EventLog& events_;

  std::array<char, kMostChars> text_{};
  std::size_t text_size_ = 0;
  std::array<Expected, kMostExpected> expected_{};  ///< ring, the oldest at expected_first_
  std::size_t expected_first_ = 0;
  std::size_t expected_count_ = 0;
  LineSplitter splitter_;
  bool order_lost_ = false;

  // The round that waits for its answers
  std::int64_t sent_ns_ = 0;
  std::int64_t read_ns_ = 0;  ///< when the latest measured number arrived
  std::uint64_t command_counter_ = 0;
  bool round_is_bad_ = false;  ///< an answer was refused
  bool starting_ = false;      ///< it asks the motors to be switched on
  unsigned positions_ = 0;     ///< bit i: the angle of axis i was read
  unsigned rates_ = 0;
  std::array<AxisMotion, kMaxAxes> fresh_{};

  // Switching the motors off
  bool off_wanted_ = false;   ///< a command asks for it
  bool off_done_ = false;     ///< they are off
  bool off_bad_ = false;      ///< a line that waits, or waited, was refused
  bool off_by_host_ = false;  ///< lines that wait end a fault
  std::size_t off_left_ = 0;  ///< lines that wait

  protocol::AxesState state_ = protocol::AxesState::motors_off;
  bool started_ = false;         ///< the motors were asked to be on; interlocks may still be open
  std::int64_t started_ns_ = 0;  ///< when that was answered
  bool powered_ = false;         ///< all interlocks are closed since then
  unsigned closed_interlocks_ = 0;  ///< bit i: the interlock of axis i was closed when it was read
  bool measured_once_ = false;      ///< measured_ are of this connection
  unsigned known_interlocks_ = 0;   ///< bit i: the interlock of axis i was read
  std::size_t next_interlock_ = 0;  ///< axis whose interlock is read next
  std::uint32_t faulty_axes_ = 0;
  std::array<AxisMotion, kMaxAxes> measured_{};
  std::array<AxisMotion, kMaxAxes> demanded_{};
  std::int64_t planned_ns_ = 0;  ///< instant of the latest demands
  std::uint64_t counter_ = 0;
  std::optional<protocol::AxesMonitor> ready_;
};

}  // namespace emit::server
