// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <span>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/protocol/record/log_outline.hpp"

/// Ranges of simulation time within a log, and what of a journal their frames need.
namespace emit::protocol {

/// Range of simulation time, both ends included, ns.
struct LogRange {
  std::int64_t from_ns = std::numeric_limits<std::int64_t>::min();
  std::int64_t to_ns = std::numeric_limits<std::int64_t>::max();

  /// Makes a range; an absent end is that of the run. Errors (invalid_argument): it is empty.
  [[nodiscard]] static physics::Result<LogRange> make(std::optional<std::int64_t> from_ns,
                                                      std::optional<std::int64_t> to_ns);
  [[nodiscard]] bool meets(const std::optional<LogSpan>& span) const noexcept {
    return span && span->last_ns >= from_ns && span->first_ns <= to_ns;
  }
  /// Returns words for messages, such as "from 1.5 s to 2 s".
  [[nodiscard]] std::string text() const;
};

/// One run as the choice sees it.
struct LogRunChoice {
  std::uint64_t run_id = 0;
  std::optional<LogSpan> sim_time;  ///< of its frames, ns; absent: it has none
  bool known = true;                ///< the run id is known
};

/// Returns the place of the only run with frames in the range. Errors (invalid_argument): none, or
/// several; the message lists the runs.
/// @param run_id  only this run; absent: any
[[nodiscard]] physics::Result<std::size_t> choose_run(const std::filesystem::path& file,
                                                      std::span<const LogRunChoice> runs,
                                                      const LogRange& range,
                                                      std::optional<std::uint64_t> run_id);

/// Runs of a journal that the frames of a range need, as places in LogOutline::runs.
struct JournalPlan {
  std::size_t first = 0;   ///< first run of the daemon that recorded the wanted one
  std::size_t wanted = 0;  ///< run with the frames of the range
};

/// Finds the run with frames in the range and the runs before it that the state of its scene comes
/// from. Errors: those of choose_run().
[[nodiscard]] physics::Result<JournalPlan> plan_journal(const std::filesystem::path& file,
                                                        const LogOutline& outline,
                                                        const LogRange& range,
                                                        std::optional<std::uint64_t> run_id);

}  // namespace emit::protocol
