// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "emit/protocol/axes.hpp"

namespace emit::server {

/// Controller's side of the ACUTROL command language, for a simulated motion simulator: it answers
/// lines, and makes the commands of a TableSimulator of them. All axes follow when each of them is
/// in position mode and has its interlock closed; else all motors are off. Between two demands an
/// axis goes on with the rate of the latest two. The host may be silent for ever: the axes then
/// stay at the latest demand.
///
/// Understood, in small or capital letters: `:M:P i`, `:mode:position i`, `:mode:off i`, `:D:P
/// i,deg`, `:demand:position i,deg`, `:R:P i`, `:R:R i`, `:read:position i`, `:read:rate i`,
/// `:interlock:open i`, `:interlock:close i`, `:interlock:reset`, `:interlock? i`. A question mark
/// behind a verb that reads is allowed.
///
/// Pure. Thread: one owner. RT-safe.
class AcutrolTable {
 public:
  /// @pre 1 to protocol::kMaxAxes axes
  explicit AcutrolTable(std::size_t axes) noexcept;

  /// Takes what the axes are and do now.
  void update(const protocol::AxesMonitor& monitor) noexcept;
  /// Returns the answer to a line that arrived at `now_ns`, with its end of line. It is valid until
  /// the next call.
  [[nodiscard]] std::string_view answer(std::string_view line, std::int64_t now_ns) noexcept;
  /// Returns what the axes are to do at `now_ns`.
  [[nodiscard]] const protocol::AxesCommand& command(std::int64_t now_ns) noexcept;

  /// Returns how many lines were answered with an error.
  [[nodiscard]] std::uint64_t errors() const noexcept { return errors_; }

 private:
  struct Axis {
    double demand_rad = 0.0;
    double rate_rad_s = 0.0;     ///< difference of the latest two demands
    double gap_s = 0.0;          ///< time between them
    std::int64_t demand_ns = 0;  ///< when the latest one came
    bool demanded = false;       ///< since the axis is in position mode
    bool in_position_mode = false;
    bool closed = false;  ///< interlock
  };

  [[nodiscard]] std::string_view say(std::string_view text) noexcept;
  [[nodiscard]] std::string_view say(double value) noexcept;
  [[nodiscard]] std::string_view say_error(std::string_view text) noexcept;
  [[nodiscard]] std::string_view answer(std::string_view verb, std::size_t axis,
                                        std::string_view value, std::int64_t now_ns) noexcept;
  void demand(Axis& axis, double demand_rad, std::int64_t now_ns) noexcept;

  std::array<Axis, protocol::kMaxAxes> axes_{};
  std::size_t count_;
  protocol::AxesMonitor monitor_;
  protocol::AxesCommand command_;
  bool reset_ = false;  ///< the host asked to free what a fault froze
  std::array<char, 64> text_{};
  std::uint64_t errors_ = 0;
};

}  // namespace emit::server
