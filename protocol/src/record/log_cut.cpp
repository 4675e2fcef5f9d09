// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "emit/protocol/convert.hpp"
#include "emit/protocol/record/log_edit.hpp"
#include "emit/protocol/record/log_range.hpp"
#include "record/log_copy.hpp"
#include "record/log_message.hpp"

namespace emit::protocol {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Cuts a journal.
class JournalCut {
 public:
  JournalCut(const LogCutOptions& options, const LogRange& range, const LogOutline& outline)
      : options_(options), range_(range), outline_(outline) {}

  /// Chooses what is kept.
  Result<void> plan(const fs::path& file, LogCutSummary& summary) {
    const auto needed = plan_journal(file, outline_, range_, options_.run_id);
    if (!needed) return tl::unexpected(needed.error());
    wanted_ = needed->wanted;
    first_ = options_.only_run ? wanted_ : needed->first;
    const LogRunOutline& first = outline_.runs[first_];
    if (!first.has_start) {
      return make_error(
          ErrorCode::unsupported,
          fmt::format("{}: the log begins in the middle of a run, at entry {}, and does not "
                      "replay; a later run can be cut out alone",
                      file.string(), first.first_sequence));
    }
    summary.journal = true;
    summary.run_id = outline_.runs[wanted_].run_id;
    summary.earlier_runs = wanted_ - first_;
    summary.left_out_runs = first_ - needed->first;
    return {};
  }

  /// Returns whether the message is kept. After done() none is.
  Result<bool> take(const McapReader& reader, const v1::JournalEntry& entry,
                    LogCutSummary& summary) {
    if (entry.has_run_start() || runs_begun_ == 0) ++runs_begun_;
    const std::size_t run = runs_begun_ - 1;
    if (run < first_) return false;
    if (run > wanted_) {
      done_ = true;
      return false;
    }
    if (started_ && entry.sequence() != last_sequence_ + 1) {
      return make_error(
          ErrorCode::unsupported,
          fmt::format("{}: offset {}: entry {} follows {}: entries in between were lost, so that "
                      "nothing behind them replays; end the range before",
                      reader.path().string(), reader.message().file_offset, entry.sequence(),
                      last_sequence_));
    }
    if (run == wanted_ && entry.has_frame()) {
      const std::int64_t at_ns = entry.frame().sim_time_ns();
      if (at_ns > range_.to_ns) {
        done_ = true;
        return false;
      }
      ++(at_ns < range_.from_ns ? summary.frames_before : summary.frames);
    }
    started_ = true;
    last_sequence_ = entry.sequence();
    return true;
  }
  [[nodiscard]] bool done() const noexcept { return done_; }

 private:
  const LogCutOptions& options_;
  const LogRange& range_;
  const LogOutline& outline_;
  std::size_t first_ = 0;   // place of the first run that is kept
  std::size_t wanted_ = 0;  // place of the run that is cut
  std::size_t runs_begun_ = 0;
  std::uint64_t last_sequence_ = 0;
  bool started_ = false;
  bool done_ = false;
};

/// Cuts a pose log.
class PoseCut {
 public:
  PoseCut(const LogCutOptions& options, const LogRange& range, const LogOutline& outline)
      : options_(options), range_(range), outline_(outline) {}

  Result<void> plan(const fs::path& file, LogCutSummary& summary) {
    std::vector<LogRunChoice> candidates;
    for (const LogHostRunOutline& run : outline_.host_runs) {
      candidates.push_back({run.run_id, run.sim_time});
    }
    const auto chosen = choose_run(file, candidates, range_, options_.run_id);
    if (!chosen) return tl::unexpected(chosen.error());
    wanted_ = *chosen;
    summary.run_id = candidates[wanted_].run_id;
    return {};
  }

  /// Returns whether the frame is kept. Where `replaced` holds something, it takes the place of the
  /// message's bytes.
  Result<bool> take(const McapReader& reader, const HostFrameData& frame, std::string& replaced,
                    LogCutSummary& summary) {
    replaced.clear();
    if (runs_begun_ == 0 || frame.run_id != run_id_) {
      ++runs_begun_;
      run_id_ = frame.run_id;
    }
    const std::size_t run = runs_begun_ - 1;
    if (run != wanted_) {
      done_ = run > wanted_;
      return false;
    }
    if (frame.sim_time_ns > range_.to_ns) {
      done_ = true;
      return false;
    }
    if (frame.sim_time_ns < range_.from_ns) {
      remember(frame);
      return false;
    }
    if (summary.frames++ == 0) {
      const auto carried = carry(reader, frame, replaced, summary);
      if (!carried) return tl::unexpected(carried.error());
    }
    return true;
  }
  [[nodiscard]] bool done() const noexcept { return done_; }

 private:
  void remember(const HostFrameData& frame) {
    if (frame.environment) weather_ = frame.environment;
    if (frame.fov_h_rad) fov_h_rad_ = frame.fov_h_rad;
    if (frame.gimbal_rad) gimbal_rad_ = frame.gimbal_rad;
    for (const PartCommandData& part : frame.part_span()) {
      parts_[{part.entity_id, part.part_id}] = part;
    }
    for (const EntityStateData& state : frame.entity_span()) {
      EntityStateData& kept = entities_[state.entity_id];
      const EntityStateData before = kept;
      kept = state;
      if (!state.has_pose) {
        kept.has_pose = before.has_pose;
        kept.pose = before.pose;
      }
      // The rates are those of an earlier instant, and the motion in between is left out.
      kept.rates.reset();
      kept.teleport = kept.has_pose;
    }
  }

  /// Puts what earlier frames have set into the first frame.
  Result<void> carry(const McapReader& reader, const HostFrameData& frame, std::string& replaced,
                     LogCutSummary& summary) {
    HostFrameData first = frame;
    if (!first.environment && weather_) {
      first.environment = weather_;
      summary.carried_weather = true;
    }
    if (!first.fov_h_rad && fov_h_rad_) {
      first.fov_h_rad = fov_h_rad_;
      summary.carried_view = true;
    }
    if (!first.gimbal_rad && gimbal_rad_) {
      first.gimbal_rad = gimbal_rad_;
      summary.carried_view = true;
    }
    for (std::uint32_t i = 0; i < frame.entity_count; ++i) {
      const auto earlier = entities_.find(frame.entities[i].entity_id);
      if (earlier == entities_.end()) continue;
      if (!first.entities[i].has_pose && earlier->second.has_pose) {
        first.entities[i].has_pose = first.entities[i].teleport = true;
        first.entities[i].pose = earlier->second.pose;
        ++summary.carried_entities;
      }
      entities_.erase(earlier);
    }
    if (first.entity_count + entities_.size() > kMaxEntitiesPerFrame) {
      return make_error(
          ErrorCode::unsupported,
          fmt::format("{}: offset {}: the first frame would have to carry {} entities, at most {} "
                      "fit; begin the range earlier",
                      reader.path().string(), reader.message().file_offset,
                      first.entity_count + entities_.size(), kMaxEntitiesPerFrame));
    }
    for (const auto& [id, state] : entities_) first.entities[first.entity_count++] = state;
    summary.carried_entities += entities_.size();
    for (const PartCommandData& part : frame.part_span()) {
      parts_.erase({part.entity_id, part.part_id});
    }
    if (first.part_count + parts_.size() > kMaxPartsPerFrame) {
      return make_error(
          ErrorCode::unsupported,
          fmt::format("{}: offset {}: the first frame would have to carry commands to {} parts, at "
                      "most {} fit; begin the range earlier",
                      reader.path().string(), reader.message().file_offset,
                      first.part_count + parts_.size(), kMaxPartsPerFrame));
    }
    for (const auto& [id, part] : parts_) first.parts[first.part_count++] = part;
    summary.carried_parts = parts_.size();
    if (!summary.carried_weather && !summary.carried_view && summary.carried_entities == 0 &&
        summary.carried_parts == 0) {
      return {};
    }
    HostFrameEncoder encoder;
    const auto bytes = encoder.encode(first);
    replaced.assign(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    return {};
  }

  const LogCutOptions& options_;
  const LogRange& range_;
  const LogOutline& outline_;
  std::size_t wanted_ = 0;  // place of the run that is cut
  std::size_t runs_begun_ = 0;
  std::uint64_t run_id_ = 0;
  std::optional<EnvironmentData> weather_;
  std::optional<double> fov_h_rad_;
  std::optional<glm::dvec3> gimbal_rad_;
  std::map<std::uint32_t, EntityStateData> entities_;
  std::map<std::pair<std::uint32_t, std::uint32_t>, PartCommandData> parts_;
  bool done_ = false;
};

}  // namespace

Result<LogCutSummary> cut_log(const fs::path& in, const fs::path& out,
                              const LogCutOptions& options) {
  const auto range = LogRange::make(options.from_ns, options.to_ns);
  if (!range) return tl::unexpected(range.error());
  // Refuse a bad output before the input is read.
  if (auto place = PartFile::begin(out, std::span(&in, 1)); !place) {
    return tl::unexpected(place.error());
  }
  auto outline = outline_log(in, options.progress);
  if (!outline) return tl::unexpected(outline.error());
  if (outline->damage) return tl::unexpected(*outline->damage);
  LogCutSummary summary;
  summary.truncation = outline->truncation;
  JournalCut journal(options, *range, *outline);
  PoseCut poses(options, *range, *outline);
  const bool is_journal = outline->journal_entries > 0;
  if (!is_journal && outline->host_runs.empty()) {
    return make_error(ErrorCode::unsupported,
                      in.string() + ": holds neither a journal nor host frames of emitd");
  }
  auto planned = is_journal ? journal.plan(in, summary) : poses.plan(in, summary);
  if (!planned) return tl::unexpected(planned.error());

  auto reader = McapReader::open(in);
  if (!reader) return tl::unexpected(reader.error());
  McapWriterOptions writing;
  writing.profile = outline->facts.profile;
  writing.library = options.software;
  auto copier = LogCopier::create(out, std::span(&in, 1), writing);
  if (!copier) return tl::unexpected(copier.error());
  LogMessageDecoder decoder;
  std::string replaced;
  const LogTopic wanted = is_journal ? LogTopic::journal : LogTopic::host;
  while (!(is_journal ? journal.done() : poses.done())) {
    const auto more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    if (options.progress &&
        !options.progress(outline->facts.file_bytes + reader->message().file_offset)) {
      return make_error(ErrorCode::internal, in.string() + ": stopped while cutting");
    }
    const auto topic = decoder.decode(*reader);
    if (!topic) return tl::unexpected(topic.error());
    if (*topic != wanted) {
      ++summary.other_messages;
      continue;
    }
    const auto kept = is_journal ? journal.take(*reader, decoder.journal(), summary)
                                 : poses.take(*reader, decoder.host(), replaced, summary);
    if (!kept) return tl::unexpected(kept.error());
    if (!*kept) continue;
    auto written = replaced.empty() ? copier->copy(0, *reader)
                                    : copier->copy(0, *reader, std::as_bytes(std::span(replaced)));
    if (!written) return tl::unexpected(written.error());
  }
  if (summary.frames == 0) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("{}: run {} has no frame {}", in.string(), summary.run_id, range->text()));
  }
  if (auto done = copier->finish(); !done) return tl::unexpected(done.error());
  summary.messages = copier->messages();
  return summary;
}

}  // namespace emit::protocol
