// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/time_options.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/physics/limits.hpp"
#include "tool/offline/time_list.hpp"

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;

void add_times(CommandLine& line, const std::string& command, TimeChoice& target,
               const std::string& text) {
  target.command = command;
  line.option("--time-s", target.times_s, "Simulated time since the scenario's epoch, s; " + text)
      .repeatable()
      .type_name("S");
  line.option(
          "--times", target.list,
          "Several times: entries with commas between them, each an instant or a range "
          "FIRST..LAST/STEP such as 06:00..20:00/10min. Instants are seconds since the epoch or "
          "HH:MM[:SS] on the day of the epoch (26:00 is 2 h after the midnight that follows); "
          "steps have s, min, h or d")
      .type_name("LIST");
  line.option("--utc-offset-h", target.utc_offset_h,
              "Clock of HH:MM minus UTC, h; e.g. 2 for summer time in Central Europe")
      .in_range(-14.0, 14.0)
      .show_default();
}

physics::Result<std::vector<double>> resolve_times(const TimeChoice& choice,
                                                   const scene::ScenarioDesc& scenario) {
  std::vector<double> times_s = choice.times_s;
  for (const double time_s : times_s) {
    if (!(std::abs(time_s) <= physics::limits::kMaxSimTimeS)) {
      return make_error(ErrorCode::invalid_argument, "--time-s: not a time");
    }
  }
  if (!choice.list.empty()) {
    auto listed = parse_times(choice.list, {scenario.epoch_utc_ns, choice.utc_offset_h});
    if (!listed) return tl::unexpected(std::move(listed.error()).with_context("--times"));
    times_s.insert(times_s.end(), listed->begin(), listed->end());
  }
  if (times_s.empty()) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("no time is given: --time-s S or --times LIST; see `{} --help`",
                                  choice.command));
  }
  std::ranges::sort(times_s);
  times_s.erase(std::unique(times_s.begin(), times_s.end()), times_s.end());
  return times_s;
}

}  // namespace emit::tool
