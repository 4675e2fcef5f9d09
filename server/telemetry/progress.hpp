// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

#include "rt/clock.hpp"

namespace emit::server {

/// Meter of a long work: it estimates the time that is left, and says when a report is due for
/// somebody who reads a log. Reports begin after 3 s, so that short work makes none. They are 3 s
/// apart, and after 150 s apart by 2 % of the time that passed, so that a work of hours does not
/// fill the log. Thread: one owner.
class ProgressMeter {
 public:
  struct Report {
    int done_percent = 0;
    double elapsed_s = 0.0;
    /// Time that the rest takes when it goes on at the mean speed so far; absent: nothing is done.
    std::optional<double> left_s;
  };

  /// Work begins now. `clock` outlives the meter.
  explicit ProgressMeter(const Clock& clock)
      : clock_(&clock), start_ns_(clock.monotonic_ns()), reported_ns_(start_ns_) {}

  /// State of the work now. `done_frac` is 0..1, other values count as the nearer end.
  [[nodiscard]] Report report(double done_frac) const noexcept;
  /// The same where a report is due, else nothing.
  [[nodiscard]] std::optional<Report> due(double done_frac) noexcept;

 private:
  const Clock* clock_;
  std::int64_t start_ns_;
  std::int64_t reported_ns_;
};

/// Time for people: "21 s", "4 min" above 90 s, "1.8 h" above 90 min.
[[nodiscard]] std::string duration_text(double seconds);
/// Report as a sentence: "warm-up 34 %, about 21 s left".
[[nodiscard]] std::string progress_text(std::string_view label,
                                        const ProgressMeter::Report& report);

/// Bar of a long work on standard error: share done and time left, up to ten times a second. It is
/// cleared at the end. Where standard error is no terminal nothing is written. Thread: one owner.
class Progress {
 public:
  using Write = std::function<void(std::string_view text)>;

  /// Writes to standard error by the system's clock. The work has `total` parts; 0 counts as 1.
  Progress(std::string label, std::uint64_t total);
  /// `write` gets what the terminal shall show; empty: no terminal. `clock` outlives the object.
  Progress(std::string label, std::uint64_t total, const Clock& clock, Write write);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void advance_to(std::uint64_t done);
  /// Takes the bar away, so that the caller can write lines. The next advance_to() draws it again.
  void clear();
  /// Clears the bar; called by the destructor too. Later calls do nothing.
  void finish();

 private:
  void draw_bar(const ProgressMeter::Report& report);

  std::string label_;
  std::uint64_t total_;
  const Clock* clock_;
  Write write_;  ///< empty: nothing is shown
  ProgressMeter meter_;
  std::optional<std::int64_t> drawn_ns_;  ///< none: no bar is on the terminal
  bool finished_ = false;
};

}  // namespace emit::server
