// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/log_range.hpp"

#include <fmt/format.h>

#include <vector>

namespace emit::protocol {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Divides, so that whole decimals stay short.
double seconds(std::int64_t ns) noexcept {
  constexpr double kNsPerS = 1e9;
  return static_cast<double>(ns) / kNsPerS;
}

std::string list_of(std::span<const LogRunChoice> runs, const std::vector<std::size_t>& chosen) {
  constexpr std::size_t kMaxListed = 8;
  std::string text;
  for (std::size_t i = 0; i < chosen.size() && i < kMaxListed; ++i) {
    const LogRunChoice& run = runs[chosen[i]];
    text += fmt::format("{}{}", i == 0 ? "" : ", ", run.run_id);
    if (run.sim_time) {
      text += fmt::format(" ({} s to {} s)", seconds(run.sim_time->first_ns),
                          seconds(run.sim_time->last_ns));
    }
  }
  if (chosen.size() > kMaxListed) text += fmt::format(" and {} more", chosen.size() - kMaxListed);
  return text;
}

}  // namespace

Result<LogRange> LogRange::make(std::optional<std::int64_t> from, std::optional<std::int64_t> to) {
  LogRange range;
  if (from) range.from_ns = *from;
  if (to) range.to_ns = *to;
  if (range.from_ns > range.to_ns) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("the range {} is empty", range.text()));
  }
  return range;
}

std::string LogRange::text() const {
  const bool begins = from_ns != std::numeric_limits<std::int64_t>::min();
  const bool ends = to_ns != std::numeric_limits<std::int64_t>::max();
  if (begins && ends) return fmt::format("from {} s to {} s", seconds(from_ns), seconds(to_ns));
  if (begins) return fmt::format("from {} s on", seconds(from_ns));
  return ends ? fmt::format("up to {} s", seconds(to_ns)) : "at any time";
}

Result<std::size_t> choose_run(const fs::path& file, std::span<const LogRunChoice> runs,
                               const LogRange& range, std::optional<std::uint64_t> run_id) {
  std::vector<std::size_t> chosen;
  std::vector<std::size_t> with_frames;
  for (std::size_t i = 0; i < runs.size(); ++i) {
    if (!runs[i].sim_time) continue;
    with_frames.push_back(i);
    if (run_id && (!runs[i].known || runs[i].run_id != *run_id)) continue;
    if (range.meets(runs[i].sim_time)) chosen.push_back(i);
  }
  if (chosen.size() == 1) return chosen.front();
  if (chosen.empty()) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("{}: no frame {}{}; runs: {}", file.string(), range.text(),
                    run_id ? fmt::format(" in run {}", *run_id) : "",
                    with_frames.empty() ? "none has a frame" : list_of(runs, with_frames)));
  }
  return make_error(ErrorCode::invalid_argument,
                    fmt::format("{}: {} runs have frames {}, choose one by its id: {}",
                                file.string(), chosen.size(), range.text(), list_of(runs, chosen)));
}

Result<JournalPlan> plan_journal(const fs::path& file, const LogOutline& outline,
                                 const LogRange& range, std::optional<std::uint64_t> run_id) {
  std::vector<LogRunChoice> runs;
  for (const LogRunOutline& run : outline.runs) {
    runs.push_back({run.run_id, run.sim_time, run.has_start});
  }
  const auto chosen = choose_run(file, runs, range, run_id);
  if (!chosen) return tl::unexpected(chosen.error());
  std::size_t first = *chosen;
  while (first > 0 && !outline.runs[first].begins_process) --first;
  return JournalPlan{first, *chosen};
}

}  // namespace emit::protocol
