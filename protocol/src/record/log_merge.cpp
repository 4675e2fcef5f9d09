// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

#include "emit/protocol/record/log_edit.hpp"
#include "record/log_copy.hpp"
#include "record/log_message.hpp"

namespace emit::protocol {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// One input of a merge.
struct Part {
  fs::path path;
  LogOutline outline;

  [[nodiscard]] bool has_journal() const noexcept { return outline.journal_entries > 0; }
  /// Returns the time of the first message, ns; a file without messages comes last.
  [[nodiscard]] std::int64_t first_ns() const noexcept {
    std::optional<LogSpan> span;
    for (const LogTopicOutline& topic : outline.topics) {
      if (topic.log_time) LogSpan::extend(span, topic.log_time->first_ns);
    }
    return span ? span->first_ns : std::numeric_limits<std::int64_t>::max();
  }
  [[nodiscard]] std::uint64_t first_sequence() const noexcept {
    return has_journal() ? outline.runs.front().first_sequence : 0;
  }
  /// Returns the times of the journal's entries, ns TAI.
  [[nodiscard]] LogSpan journal_span() const noexcept {
    std::optional<LogSpan> span;
    for (const LogRunOutline& run : outline.runs) {
      LogSpan::extend(span, run.log_time->first_ns);
      LogSpan::extend(span, run.log_time->last_ns);
    }
    return span.value_or(LogSpan{});
  }
};

tl::unexpected<physics::Error> cannot_join(const Part& a, const Part& b, std::string_view reason) {
  return make_error(ErrorCode::unsupported, fmt::format("{} and {} cannot be merged: {}",
                                                        a.path.string(), b.path.string(), reason));
}

/// Facts about the journals that were seen so far, and where they were seen.
struct SeenJournals {
  const Part* previous = nullptr;
  std::uint64_t last_sequence = 0;
  std::map<std::uint64_t, const Part*> runs;
  const Part* scenario_part = nullptr;
  std::string scenario_sha256;
};

/// Checks that a journal follows the one before it. @pre both hold entries
Result<void> check_follows(const SeenJournals& seen, const Part& part) {
  const LogRunOutline& first = part.outline.runs.front();
  const Part& before = *seen.previous;
  // Only a run start begins anew, and a replay knows it by its sequence number.
  if (first.first_sequence == seen.last_sequence + 1) return {};
  if (!first.has_start) {
    return cannot_join(before, part,
                       fmt::format("the second begins in the middle of a run, at entry {}, and the "
                                   "first ends with entry {}",
                                   first.first_sequence, seen.last_sequence));
  }
  if (first.first_sequence <= seen.last_sequence) return {};
  return cannot_join(before, part,
                     fmt::format("entries {} to {} are missing between them, so that a replay "
                                 "stops there",
                                 seen.last_sequence + 1, first.first_sequence - 1));
}

Result<void> check_journal(SeenJournals& seen, const Part& part) {
  for (const LogRunOutline& run : part.outline.runs) {
    if (!run.has_start) continue;
    const auto [place, fresh] = seen.runs.try_emplace(run.run_id, &part);
    if (!fresh && place->second != &part) {
      return cannot_join(*place->second, part, fmt::format("both hold run {}", run.run_id));
    }
    if (seen.scenario_part == nullptr) {
      seen.scenario_part = &part;
      seen.scenario_sha256 = run.scenario_sha256;
    } else if (seen.scenario_sha256 != run.scenario_sha256) {
      return cannot_join(*seen.scenario_part, part,
                         fmt::format("they were recorded with different scenarios (SHA-256 {} "
                                     "and {})",
                                     seen.scenario_sha256, run.scenario_sha256));
    }
  }
  if (seen.previous != nullptr) {
    const LogSpan a = seen.previous->journal_span();
    const LogSpan b = part.journal_span();
    if (a.last_ns > b.first_ns) {
      return cannot_join(*seen.previous, part,
                         fmt::format("their runs overlap: the first ends at {} ns TAI, the second "
                                     "begins at {} ns TAI",
                                     a.last_ns, b.first_ns));
    }
    if (auto follows = check_follows(seen, part); !follows) return follows;
  }
  seen.previous = &part;
  seen.last_sequence = part.outline.runs.back().last_sequence;
  return {};
}

/// Checks that two pose logs can be sent one behind the other.
Result<void> check_poses(const Part& a, const Part& b) {
  for (const LogHostRunOutline& first : a.outline.host_runs) {
    for (const LogHostRunOutline& second : b.outline.host_runs) {
      if (first.run_id != second.run_id) continue;
      if (second.sim_time->first_ns < first.sim_time->last_ns) {
        return cannot_join(a, b,
                           fmt::format("both hold host frames of run {} for the same simulation "
                                       "time",
                                       first.run_id));
      }
      if (second.first_frame <= first.last_frame) {
        return cannot_join(
            a, b,
            fmt::format("both hold host frame {} of run {}", second.first_frame, first.run_id));
      }
    }
  }
  return {};
}

/// Checks that the parts, by time, make one log.
Result<void> check_parts(const std::vector<Part>& parts) {
  SeenJournals seen;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    if (parts[i].has_journal()) {
      if (auto fits = check_journal(seen, parts[i]); !fits) return fits;
    }
    for (std::size_t before = 0; before < i; ++before) {
      if (auto fits = check_poses(parts[before], parts[i]); !fits) return fits;
    }
  }
  return {};
}

Result<void> check_inputs(std::span<const fs::path> inputs) {
  if (inputs.size() < 2) {
    return make_error(ErrorCode::invalid_argument, "a merge needs two logs or more");
  }
  for (std::size_t i = 0; i < inputs.size(); ++i) {
    for (std::size_t before = 0; before < i; ++before) {
      std::error_code none;
      if (fs::equivalent(inputs[i], inputs[before], none)) {
        return make_error(ErrorCode::invalid_argument,
                          inputs[i].string() + ": is given more than once");
      }
    }
  }
  return {};
}

/// Reads the outlines of all inputs and sorts them by time.
Result<std::vector<Part>> read_parts(std::span<const fs::path> inputs, const LogProgress& progress,
                                     std::uint64_t& done_bytes) {
  std::vector<Part> parts;
  for (const fs::path& input : inputs) {
    auto outline = outline_log(
        input, !progress ? LogProgress()
                         : [&](std::uint64_t bytes) { return progress(done_bytes + bytes); });
    if (!outline) return tl::unexpected(outline.error());
    if (outline->damage) return tl::unexpected(*outline->damage);
    done_bytes += outline->facts.file_bytes;
    parts.push_back({input, std::move(*outline)});
  }
  std::ranges::stable_sort(parts, {}, [](const Part& part) {
    return std::pair(part.first_ns(), part.first_sequence());
  });
  return parts;
}

/// One input while messages are merged.
struct OpenPart {
  McapReader reader;
  bool has_message = false;
};

/// Writes the messages of all parts by time.
Result<void> write_merged(const std::vector<Part>& parts, LogCopier& copier,
                          const LogProgress& progress, std::uint64_t done_bytes) {
  std::vector<OpenPart> open;
  const auto advance = [](OpenPart& part) -> Result<void> {
    const auto more = part.reader.next();
    if (!more) return tl::unexpected(more.error());
    part.has_message = *more;
    return {};
  };
  for (const Part& part : parts) {
    auto reader = McapReader::open(part.path);
    if (!reader) return tl::unexpected(reader.error());
    open.push_back({std::move(*reader)});
    if (auto moved = advance(open.back()); !moved) return moved;
  }
  for (std::uint64_t count = 0;; ++count) {
    std::size_t next = open.size();
    for (std::size_t i = 0; i < open.size(); ++i) {
      if (!open[i].has_message) continue;
      if (next == open.size() ||
          open[i].reader.message().log_time_ns < open[next].reader.message().log_time_ns) {
        next = i;
      }
    }
    if (next == open.size()) return {};
    if (auto copied = copier.copy(next, open[next].reader); !copied) return copied;
    if (auto moved = advance(open[next]); !moved) return moved;
    constexpr std::uint64_t kReportEach = 256;
    if (!progress || count % kReportEach != 0) continue;
    const std::uint64_t read_bytes = std::transform_reduce(
        open.begin(), open.end(), std::uint64_t{0}, std::plus<>(), [](const OpenPart& part) {
          return part.has_message ? part.reader.message().file_offset
                                  : part.reader.facts().file_bytes;
        });
    if (!progress(done_bytes + read_bytes)) {
      return make_error(ErrorCode::internal, "stopped while merging");
    }
  }
}

}  // namespace

Result<LogMergeSummary> merge_logs(std::span<const fs::path> inputs, const fs::path& out,
                                   const LogMergeOptions& options) {
  if (auto fit = check_inputs(inputs); !fit) return tl::unexpected(fit.error());
  // Refuse a bad output before the inputs are read.
  if (auto place = PartFile::begin(out, inputs); !place) return tl::unexpected(place.error());
  std::uint64_t done_bytes = 0;
  auto parts = read_parts(inputs, options.progress, done_bytes);
  if (!parts) return tl::unexpected(parts.error());
  if (auto fit = check_parts(*parts); !fit) return tl::unexpected(fit.error());

  McapWriterOptions writing;
  writing.library = options.software;
  const std::string& profile = parts->front().outline.facts.profile;
  const bool same_profile = std::ranges::all_of(
      *parts, [&](const Part& part) { return part.outline.facts.profile == profile; });
  if (same_profile) writing.profile = profile;
  auto copier = LogCopier::create(out, inputs, writing);
  if (!copier) return tl::unexpected(copier.error());
  auto written = write_merged(*parts, *copier, options.progress, done_bytes);
  if (written) written = copier->finish();
  if (!written) return tl::unexpected(written.error());

  LogMergeSummary summary;
  summary.messages = copier->messages();
  for (const Part& part : *parts) {
    summary.order.push_back(part.path);
    summary.runs += part.outline.runs.size();
    summary.frames += part.outline.frames;
    if (part.outline.truncation) summary.notes.push_back(*part.outline.truncation);
    if (part.outline.gap_count > 0) {
      summary.notes.push_back(
          fmt::format("{}: entries were lost {} times, and a replay stops at the first one",
                      part.path.string(), part.outline.gap_count));
    }
    const McapFacts& facts = part.outline.facts;
    if (facts.attachments + facts.metadata > 0) {
      summary.notes.push_back(fmt::format("{}: {} attachments and {} metadata records are left out",
                                          part.path.string(), facts.attachments, facts.metadata));
    }
  }
  return summary;
}

}  // namespace emit::protocol
