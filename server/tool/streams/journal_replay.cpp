// SPDX-License-Identifier: Apache-2.0
#include "tool/streams/journal_replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "emit/protocol/record/log.hpp"
#include "emit/protocol/record/log_range.hpp"
#include "emit/protocol/record/pose_pcap.hpp"
#include "emit/v1/control.pb.h"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

double seconds(std::int64_t ns) noexcept {
  return 1e-9 * static_cast<double>(ns);
}

/// A source in the state in which a daemon starts, and the player that feeds it.
struct ReplayedDaemon {
  std::unique_ptr<server::FrameSource> source;
  std::optional<server::JournalPlayer> player;

  /// Warms a new source up, in place of the former one.
  Result<void> start(const ReplayBench& bench, std::int64_t first_time_ns) {
    player.reset();
    source.reset();
    auto made = bench.make_source(first_time_ns);
    if (!made) return tl::unexpected(made.error());
    auto channels = server::make_channels(bench.scenario, (*made)->info());
    if (!channels) return tl::unexpected(channels.error());
    source = std::move(*made);
    player.emplace(*source, std::move(*channels));
    return {};
  }
};

class JournalReplay {
 public:
  JournalReplay(const ReplayBench& bench, const JournalReplayOptions& options,
                const ReplayHooks& hooks)
      : bench_(bench), options_(options), hooks_(hooks), pace_(*bench.clock, options.speed) {}

  Result<JournalReplaySummary> run() {
    for (const auto step : {&JournalReplay::plan, &JournalReplay::identify}) {
      if (auto done = (this->*step)(); !done) return tl::unexpected(done.error());
    }
    if (hooks_.on_plan) {
      if (auto done = hooks_.on_plan(first_run_, last_run_); !done) {
        return tl::unexpected(done.error());
      }
    }
    begin_ns_ = bench_.clock->now_ns();
    Progress progress("replay", options_.passes * planned_frames_);
    progress_ = &progress;
    while (!ended_) {
      ++summary_.passes;
      anew_ = false;
      if (auto played = play(); !played) return tl::unexpected(played.error());
      ended_ = ended_ || InterruptGuard::interrupted() || (!anew_ && !goes_again());
    }
    progress.finish();
    if (truncation_) warn(*truncation_);
    summary_.latest_ns = pace_.latest_ns();
    summary_.play_s = seconds(bench_.clock->now_ns() - begin_ns_) - summary_.setup_s;
    if (summary_.frames == 0 && !ended_) {
      return make_error(ErrorCode::parse, fmt::format("{}: the log holds no journalled frame",
                                                      options_.log.string()));
    }
    return std::move(summary_);
  }

 private:
  /// Reads what the log holds and chooses its runs.
  Result<void> plan() {
    auto outline =
        protocol::outline_log(options_.log, [](auto) { return !InterruptGuard::interrupted(); });
    if (!outline) return tl::unexpected(outline.error());
    outline_ = std::move(*outline);
    if (outline_.frames == 0) {
      if (outline_.damage) return tl::unexpected(*outline_.damage);
      return make_error(ErrorCode::parse, fmt::format("{}: the log holds no journalled frame",
                                                      options_.log.string()));
    }
    last_run_ = outline_.runs.size() - 1;
    if (options_.is_part()) {
      const auto range = protocol::LogRange::make(options_.from_ns, options_.to_ns);
      if (!range) return tl::unexpected(range.error());
      const auto part = protocol::plan_journal(options_.log, outline_, *range, options_.run_id);
      if (!part) return tl::unexpected(part.error());
      range_ = *range;
      first_run_ = part->first;
      last_run_ = part->wanted;
    }
    const protocol::LogRunOutline& first = outline_.runs[first_run_];
    if (!first.has_start) {
      return make_error(ErrorCode::unsupported,
                        fmt::format("{}: the log begins in the middle of a run, at entry {}, and "
                                    "does not replay; emit log cut --only-run takes a later run",
                                    options_.log.string(), first.first_sequence));
    }
    for (std::size_t i = first_run_; i <= last_run_; ++i)
      planned_frames_ += outline_.runs[i].frames;
    const bool cached =
        bench_.scenario && bench_.scenario->thermal.method == scene::ThermalMethod::cached;
    if (first.first_sequence > 1 && cached) {
      warn(
          "the journal lacks earlier runs of its daemon, and a cached surface remembers them: "
          "frames may differ");
    }
    return {};
  }

  /// Compares the setups of the runs with the own one. The device is known later.
  Result<void> identify() {
    std::optional<server::ScenarioIdentity> identity;
    if (bench_.scenario) {
      auto identified = server::identify_scenario(*bench_.scenario);
      if (!identified) return tl::unexpected(identified.error());
      identity = std::move(*identified);
      own_.scenario_name = bench_.scenario->name;
      own_.scenario_sha256 = identity->sha256;
    }
    own_.software = server::build_text("emit");
    const auto channels = server::make_channels(bench_.scenario, bench_.expected);
    if (!channels) return tl::unexpected(channels.error());
    v1::Recording own;
    server::fill(identity ? &*identity : nullptr, nullptr, channels->channels, own);
    bool silent = false;
    for (std::size_t i = first_run_; i <= last_run_; ++i) {
      const protocol::LogRunOutline& run = outline_.runs[i];
      const server::RunOrigin recorded{run.software, run.device, run.scenario_name,
                                       run.scenario_sha256};
      if (i == first_run_) summary_.recorded = recorded;
      own_.device = recorded.device;
      silent = silent || run.recording == nullptr;
      note(server::compare_setup(recorded, run.recording.get(), own_, own));
      if (run.recording != nullptr && run.recording->values_left_out() > 0) {
        left_out_ = std::max(left_out_, run.recording->values_left_out());
      }
    }
    for (const server::SetupDifference& difference : summary_.differences) {
      warn(difference.text());
    }
    if (left_out_ > 0) {
      warn(
          fmt::format("the journal had no room for {} values, which are compared by the hash of "
                      "the scenario alone",
                      left_out_));
    }
    if (silent) {
      warn(
          fmt::format("the journal of {} does not say its configuration, files and channels: "
                      "they are compared by the hash of the scenario alone",
                      summary_.recorded.software));
    }
    const auto decisive =
        std::ranges::count_if(summary_.differences, &server::SetupDifference::is_decisive);
    if (decisive == 0) return {};
    if (options_.anyway) return {};
    return make_error(
        ErrorCode::config,
        fmt::format("{}: the recording had another scenario or other channels, so that its frames "
                    "cannot come out: give the --scenario and every --set value that the daemon "
                    "had, or --anyway to replay all the same",
                    options_.log.string()));
  }

  /// Adds differences that are not known yet.
  void note(std::vector<server::SetupDifference> differences) {
    for (server::SetupDifference& one : differences) {
      const std::string text = one.text();
      const bool known = std::ranges::any_of(
          summary_.differences, [&](const auto& other) { return other.text() == text; });
      if (!known) summary_.differences.push_back(std::move(one));
    }
  }

  /// Returns whether another pass follows a whole one.
  [[nodiscard]] bool goes_again() {
    if (hooks_.at_end) return hooks_.at_end(next_frame_) == ReplayOrder::anew;
    return options_.passes == 0 || summary_.passes < options_.passes;
  }

  Result<void> start_daemon(std::int64_t first_time_ns) {
    const std::int64_t start_ns = bench_.clock->now_ns();
    if (auto started = daemon_.start(bench_, first_time_ns); !started) return started;
    summary_.setup_s += seconds(bench_.clock->now_ns() - start_ns);
    if (hooks_.on_start) hooks_.on_start(*daemon_.player);
    pace_.restart();
    const server::SourceInfo& info = daemon_.source->info();
    if (!summary_.device.empty()) return {};
    summary_.device = info.device;
    for (const std::string& text : info.scene.warnings) warn(text);
    for (const std::string& text : renderer::warm_up_warnings(info.scene)) warn(text);
    for (std::size_t i = first_run_; i <= last_run_; ++i) {
      const std::string& device = outline_.runs[i].device;
      if (device == info.device) continue;
      const std::size_t before = summary_.differences.size();
      note({{server::SetupDifference::Kind::device, {}, device, info.device}});
      if (summary_.differences.size() > before) warn(summary_.differences.back().text());
    }
    return {};
  }

  /// Plays the chosen runs once.
  Result<void> play() {
    auto log = protocol::LogReader::open(options_.log);
    if (!log) return tl::unexpected(log.error());
    std::size_t runs_begun = 0;
    std::uint64_t last_sequence = 0;
    next_frame_ = 0;
    daemon_.player.reset();
    while (!ended_ && !InterruptGuard::interrupted()) {
      const auto more = log->next();
      if (!more) return tl::unexpected(more.error());
      if (!*more) break;
      if (log->topic() != protocol::LogTopic::journal) continue;
      const v1::JournalEntry& entry = log->journal();
      if (entry.has_run_start() || runs_begun == 0) ++runs_begun;
      const std::size_t run = runs_begun - 1;
      if (run < first_run_) continue;
      if (run > last_run_) break;
      // Another daemon begins where the numbers do, as in a merged log. Its surface was warmed up
      // anew.
      const bool begins = !daemon_.player || entry.sequence() <= last_sequence;
      if (entry.has_run_start() && begins) {
        auto started = start_daemon(entry.run_start().first_time_ns());
        if (!started) return started;
      }
      last_sequence = entry.sequence();
      const bool wanted = !options_.is_part() || run == last_run_;
      bool shown = false;
      if (entry.has_frame()) {
        const std::int64_t at_ns = entry.frame().sim_time_ns();
        if (wanted && at_ns > range_.to_ns) break;
        shown = wanted && at_ns >= range_.from_ns;
        if (shown) {
          const ReplayOrder order = order_of_next(entry);
          if (order == ReplayOrder::end || order == ReplayOrder::anew) break;
          shown = order == ReplayOrder::show;
        }
      }
      if (auto applied = apply(entry, shown); !applied) return applied;
    }
    truncation_ = log->truncation();
    return {};
  }

  /// Waits until the frame may come, and says what becomes of it.
  ReplayOrder order_of_next(const v1::JournalEntry& entry) {
    const ReplayOrder order = hooks_.order ? hooks_.order(next_frame_) : ReplayOrder::show;
    ended_ = ended_ || order == ReplayOrder::end;
    anew_ = order == ReplayOrder::anew;
    if (order == ReplayOrder::end || anew_) return order;
    ++next_frame_;
    if (order == ReplayOrder::pass) return order;
    pace_.wait_for(entry.wall_time_ns());
    return InterruptGuard::interrupted() ? ReplayOrder::end : order;
  }

  Result<void> apply(const v1::JournalEntry& entry, bool shown) {
    const auto applied = daemon_.player->apply(entry);
    if (!applied) return tl::unexpected(applied.error());
    if (!*applied) return {};
    const server::ReplayedFrame& frame = **applied;
    if (frame.view != nullptr && frame.view->device_failed) {
      return make_error(ErrorCode::gpu,
                        fmt::format("frame {}: the device reported an error", frame.frame_number));
    }
    progress_->advance_to(++played_);
    if (!shown) {
      ++summary_.frames_before;
      if (!frame.matches) ++summary_.mismatches_before;
      return {};
    }
    ++summary_.frames;
    if (!frame.repeated) ++summary_.rendered;
    if (!frame.matches && summary_.mismatches++ == 0) {
      summary_.first_mismatch = frame.frame_number;
    }
    return hooks_.on_frame ? hooks_.on_frame(frame, summary_.passes) : Result<void>();
  }

  const ReplayBench& bench_;
  const JournalReplayOptions& options_;
  const ReplayHooks& hooks_;
  ReplayPace pace_;
  protocol::LogOutline outline_;
  protocol::LogRange range_;
  std::size_t first_run_ = 0;
  std::size_t last_run_ = 0;
  std::uint64_t planned_frames_ = 0;  // of one pass
  std::uint64_t played_ = 0;
  server::RunOrigin own_;
  std::uint32_t left_out_ = 0;
  ReplayedDaemon daemon_;
  JournalReplaySummary summary_;
  std::optional<std::string> truncation_;
  Progress* progress_ = nullptr;
  std::int64_t begin_ns_ = 0;
  std::uint64_t next_frame_ = 0;  // of the range, in this pass
  bool ended_ = false;            // the caller wants no further frame
  bool anew_ = false;             // the caller wants the range from its begin
};

}  // namespace

ReplayBench renderer_bench(const scene::ScenarioDesc& scenario, const JournalReplayOptions& options,
                           ReplayClock& clock) {
  ReplayBench bench;
  bench.scenario = scenario;
  bench.expected.width_px = scenario.sensor.width_px;
  bench.expected.height_px = scenario.sensor.height_px;
  bench.expected.planes = scenario.bands.size();
  bench.clock = &clock;
  bench.make_source = [&scenario, gpu_index = options.gpu_index,
                       temperature = options.temperature](std::int64_t first_time_ns) {
    renderer::OutputOptions output;
    output.temperature = output.depth = output.object = temperature;
    // A frame has an image for each camera, all of which are kept for repetitions.
    output.slots = server::kMaxCameras;
    output.ladder = renderer::Ladder::replayed;
    Progress warm_up("warm-up", kShareParts);
    return server::make_renderer_source(scenario, renderer::DeviceOptions{gpu_index, false}, output,
                                        first_time_ns, share_of(warm_up));
  };
  return bench;
}

Result<JournalReplaySummary> replay_journal(const ReplayBench& bench,
                                            const JournalReplayOptions& options,
                                            const ReplayHooks& hooks) {
  if (protocol::PosePcapReader::is_capture(options.log)) {
    return make_error(
        ErrorCode::unsupported,
        fmt::format("{}: a network capture holds the host's poses, not the daemon's decisions: "
                    "play it with emit send and record the journal",
                    options.log.string()));
  }
  return JournalReplay(bench, options, hooks).run();
}

}  // namespace emit::tool
