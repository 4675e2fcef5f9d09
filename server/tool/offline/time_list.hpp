// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"

/// Instants on the command line, `--times 06:00..20:00/10min`, and in what commands write.
namespace emit::tool {

/// Clock by which a list names times of the day.
struct ClockOfDay {
  std::int64_t epoch_utc_ns = 0;  ///< UTC of simulation time 0
  double utc_offset_h = 0.0;      ///< clock minus UTC
};

/// Largest number of instants of a list.
inline constexpr std::size_t kMaxTimes = 100'000;

/// Reads entries with commas between them. An entry is an instant, or a range FIRST..LAST/STEP with
/// both ends. An instant is seconds since the epoch, or HH:MM[:SS] on the day of the epoch; hours
/// from 24 on are those of later days. A step is a number with s, min, h or d; without a unit it
/// counts seconds. Returns simulation times in s, ascending, each once. Errors: invalid_argument,
/// quoting the entry.
[[nodiscard]] physics::Result<std::vector<double>> parse_times(std::string_view text,
                                                               const ClockOfDay& clock);

/// Returns date and time of a simulation time, ISO 8601. `epoch_utc_ns` is the UTC of time 0.
[[nodiscard]] std::string utc_text(std::int64_t epoch_utc_ns, double time_s);

}  // namespace emit::tool
