// SPDX-License-Identifier: Apache-2.0
// Every way to replay a journal, with a source and a clock of the test.
#include "tool/streams/journal_replay.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <string>
#include <tuple>
#include <vector>

#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "support/emit_process.hpp"
#include "support/scripted_source.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr std::int64_t kMsNs = 1'000'000;
constexpr std::uint32_t kWidthPx = 16;
constexpr std::uint32_t kHeightPx = 8;

/// Run, number and CRC of a frame.
using Shown = std::tuple<std::uint64_t, std::uint64_t, std::uint32_t>;

class TestClock final : public ReplayClock {
 public:
  [[nodiscard]] std::int64_t now_ns() override { return now; }
  void wait_until(std::int64_t time_ns) override {
    now = std::max(now, time_ns);
    if (!quiet) waits.push_back(time_ns - first);
  }
  std::int64_t first = 5'000 * kMsNs;
  std::int64_t now = first;
  bool quiet = false;
  std::vector<std::int64_t> waits;  ///< instants that were waited for, after `first`
};

/// Entries of a journal, numbered by sequence and wall time.
class Entries {
 public:
  /// Begins a daemon: the numbers begin anew.
  void daemon(std::int64_t wall_ns) {
    sequence_ = 0;
    wall_ns_ = wall_ns;
  }
  v1::RunStart& run(std::uint64_t run_id, std::int64_t first_time_ns = 0) {
    v1::JournalEntry& entry = add();
    v1::RunStart& start = *entry.mutable_run_start();
    start.set_run_id(run_id);
    start.set_software(server::build_text("emitd"));
    start.set_device("scripted");
    start.set_first_time_ns(first_time_ns);
    test::SourceScript script;
    test::ScriptedSource source(script, kWidthPx, kHeightPx, 2);
    const auto channels = server::make_channels(std::nullopt, source.info());
    server::fill(nullptr, nullptr, channels->channels, *start.mutable_recording());
    return start;
  }
  /// Adds a frame of each number, at number * 10 ms of simulation time and 8 ms after the entry
  /// before it. Every fifth one repeats the image before it.
  void frames(std::uint64_t first, std::uint64_t last) {
    for (std::uint64_t number = first; number <= last; ++number) {
      wall_ns_ += 8 * kMsNs;
      v1::FrameDecision& frame = *add().mutable_frame();
      frame.set_frame_number(number);
      frame.set_sim_time_ns(static_cast<std::int64_t>(number) * 10 * kMsNs);
      frame.set_rendered(number % 5 != 0);
      frame.mutable_sensor_pose()->mutable_position_m()->set_x(0.37 * static_cast<double>(number));
      frame.mutable_sensor_pose()->mutable_world_from_body()->set_w(1.0);
    }
  }
  void pause(std::int64_t by_ns) { wall_ns_ += by_ns; }

  /// Writes the entries with the CRCs that a source gives when it gets all of them.
  void write(const std::string& file) {
    auto log = protocol::LogWriter::create(file, {.chunk_bytes = 400, .software = "test"});
    ASSERT_TRUE(log) << log.error().text;
    test::SourceScript script;
    std::unique_ptr<test::ScriptedSource> source;
    std::unique_ptr<server::JournalPlayer> player;
    for (v1::JournalEntry& entry : all) {
      if (entry.sequence() == 1) {
        player.reset();
        source = std::make_unique<test::ScriptedSource>(script, kWidthPx, kHeightPx, 2);
        player = std::make_unique<server::JournalPlayer>(
            *source, *server::make_channels(std::nullopt, source->info()));
      }
      const auto frame = player->apply(entry);
      ASSERT_TRUE(frame) << frame.error().text;
      if (*frame && entry.frame().radiance_crc32c() == 0) {
        entry.mutable_frame()->set_radiance_crc32c((*frame)->crc32c);
      }
      ASSERT_TRUE(log->write_journal(entry));
    }
    ASSERT_TRUE(log->close());
  }

  std::vector<v1::JournalEntry> all;

 private:
  v1::JournalEntry& add() {
    v1::JournalEntry& entry = all.emplace_back();
    entry.set_sequence(++sequence_);
    entry.set_wall_time_ns(wall_ns_);
    return entry;
  }
  std::uint64_t sequence_ = 0;
  std::int64_t wall_ns_ = 1'800'000'000'000 * kMsNs;
};

class JournalReplayTest : public ::testing::Test {
 protected:
  /// Two runs of one daemon, with a pause between them.
  void SetUp() override {
    entries_.run(11);
    entries_.frames(1, 12);
    entries_.pause(1000 * kMsNs);
    entries_.run(12);
    entries_.frames(1, 6);
    bench_.expected.width_px = kWidthPx;
    bench_.expected.height_px = kHeightPx;
    bench_.expected.planes = 1;
    bench_.clock = &clock_;
    bench_.make_source = [this](std::int64_t first_time_ns) {
      first_times_.push_back(first_time_ns);
      clock_.now += 700 * kMsNs;  // the warm-up
      return physics::Result<std::unique_ptr<server::FrameSource>>(
          std::make_unique<test::ScriptedSource>(script_, kWidthPx, kHeightPx, 2));
    };
    hooks_.on_frame = [this](const server::ReplayedFrame& frame, std::uint64_t) {
      shown_.emplace_back(frame.run_id, frame.frame_number, frame.crc32c);
      return physics::Result<void>();
    };
    options_.log = file_;
  }
  JournalReplaySummary replay() {
    shown_.clear();
    auto summary = replay_journal(bench_, options_, hooks_);
    EXPECT_TRUE(summary) << summary.error().text;
    return summary ? *summary : JournalReplaySummary();
  }
  physics::Error refused() {
    auto summary = replay_journal(bench_, options_, hooks_);
    EXPECT_FALSE(summary);
    return summary ? physics::Error{} : summary.error();
  }
  /// Frames of a replay of everything.
  std::vector<Shown> whole() {
    const JournalReplayOptions kept = std::exchange(options_, {.log = file_});
    EXPECT_EQ(replay().mismatches, 0U);
    options_ = kept;
    return std::exchange(shown_, {});
  }

  test::TemporaryFolder folder_;
  std::string file_ = folder_.file("run.mcap");
  Entries entries_;
  test::SourceScript script_;
  TestClock clock_;
  ReplayBench bench_;
  ReplayHooks hooks_;
  JournalReplayOptions options_;
  std::vector<Shown> shown_;
  std::vector<std::int64_t> first_times_;
};

TEST_F(JournalReplayTest, every_pace_gives_the_same_frames) {
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  ASSERT_EQ(all.size(), 18U);
  for (const double speed : {1.0, 2.5, 0.1, 1000.0}) {
    options_.speed = speed;
    EXPECT_EQ(replay().mismatches, 0U);
    EXPECT_EQ(shown_, all) << speed;
  }
  options_.speed = 0.0;
  hooks_.order = [](std::uint64_t) { return ReplayOrder::show; };
  replay();
  EXPECT_EQ(shown_, all);
}

TEST_F(JournalReplayTest, frames_are_due_as_recorded_over_the_speed) {
  entries_.write(file_);
  for (const double speed : {1.0, 4.0}) {
    clock_.waits.clear();
    clock_.now = clock_.first;
    options_.speed = speed;
    replay();
    // The first frame comes at once, when the warm-up is over.
    std::vector<std::int64_t> due;
    for (std::int64_t i = 1; i < 12; ++i) due.push_back(8 * i);
    for (std::int64_t i = 0; i < 6; ++i) due.push_back(8 * 11 + 1000 + 8 + 8 * i);
    for (std::int64_t& one : due) {
      one = 700 * kMsNs + static_cast<std::int64_t>(static_cast<double>(one * kMsNs) / speed);
    }
    EXPECT_EQ(clock_.waits, due) << speed;
  }
  clock_.waits.clear();
  options_.speed = 0.0;
  replay();
  EXPECT_THAT(clock_.waits, IsEmpty()) << "max waits for nothing";
}

TEST_F(JournalReplayTest, a_late_frame_is_shown_and_its_delay_told) {
  entries_.write(file_);
  script_.on_submit = [this](const auto& request) {
    if (request.frame_number == 4) clock_.now += 50 * kMsNs;
  };
  options_.speed = 1.0;
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(summary.frames, 18U);
  EXPECT_EQ(summary.latest_ns, 42 * kMsNs) << "frame 5 was due 8 ms after frame 4";
}

TEST_F(JournalReplayTest, a_seek_shows_the_frames_of_the_whole) {
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  options_.from_ns = 70 * kMsNs;
  options_.to_ns = 90 * kMsNs;
  options_.speed = 1.0;
  clock_.now = clock_.first;
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(shown_, std::vector<Shown>(all.begin() + 6, all.begin() + 9));
  EXPECT_EQ(summary.frames, 3U);
  EXPECT_EQ(summary.frames_before, 6U);
  EXPECT_EQ(summary.mismatches + summary.mismatches_before, 0U);
  EXPECT_THAT(clock_.waits, ElementsAre(708 * kMsNs, 716 * kMsNs))
      << "frames before the range are not paced";
  script_.submitted.clear();
  replay();
  EXPECT_EQ(script_.submitted.back().sim_time_ns, 90 * kMsNs) << "nothing behind the range";
}

TEST_F(JournalReplayTest, a_range_may_begin_on_a_repeated_frame) {
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  options_.from_ns = 100 * kMsNs;
  replay();
  EXPECT_EQ(shown_, std::vector<Shown>(all.begin() + 9, all.begin() + 12));
}

TEST_F(JournalReplayTest, a_range_of_two_runs_needs_a_choice) {
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  options_.from_ns = 30 * kMsNs;
  options_.to_ns = 40 * kMsNs;
  const physics::Error error = refused();
  EXPECT_EQ(error.code, ErrorCode::invalid_argument);
  EXPECT_THAT(error.text, HasSubstr("2 runs have frames from 0.03 s to 0.04 s"));
  options_.run_id = 12;
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(shown_, std::vector<Shown>(all.begin() + 14, all.begin() + 16));
  EXPECT_EQ(summary.frames_before, 12U + 2U) << "the run before it leaves its mark too";
}

TEST_F(JournalReplayTest, a_range_without_frames_is_refused) {
  entries_.write(file_);
  options_.from_ns = 5'000 * kMsNs;
  EXPECT_EQ(refused().code, ErrorCode::invalid_argument);
  options_.to_ns = 4'000 * kMsNs;
  EXPECT_THAT(refused().text, HasSubstr("is empty"));
}

TEST_F(JournalReplayTest, a_step_renders_no_frame_ahead) {
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  script_.submitted.clear();
  int left = 3;
  hooks_.order = [&](std::uint64_t) { return left-- > 0 ? ReplayOrder::show : ReplayOrder::end; };
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(shown_, std::vector<Shown>(all.begin(), all.begin() + 3));
  EXPECT_EQ(summary.frames, 3U);
  EXPECT_EQ(script_.submitted.size(), 3U);
  hooks_.order = [](std::uint64_t) { return ReplayOrder::end; };
  EXPECT_EQ(replay().frames, 0U) << "ended before the first frame";
}

TEST_F(JournalReplayTest, a_seek_while_it_plays_shows_the_frames_of_the_whole) {
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  first_times_.clear();
  // Frames 0 to 2, then on to frame 15, back to frame 4 and to the end, and once more from there.
  std::vector<std::uint64_t> ways{15, 4};
  std::vector<std::uint64_t> asked;
  hooks_.order = [&](std::uint64_t frame) {
    asked.push_back(frame);
    if (asked.size() > 3 && !ways.empty()) {
      if (frame < ways.front()) return ReplayOrder::pass;
      if (frame > ways.front()) return ReplayOrder::anew;
      ways.erase(ways.begin());
    }
    return ReplayOrder::show;
  };
  int ends = 0;
  hooks_.at_end = [&](std::uint64_t frames) {
    EXPECT_EQ(frames, 18U);
    return ++ends < 2 ? ReplayOrder::anew : ReplayOrder::end;
  };
  const JournalReplaySummary summary = replay();
  std::vector<Shown> wanted(all.begin(), all.begin() + 3);
  wanted.push_back(all[15]);
  wanted.insert(wanted.end(), all.begin() + 4, all.end());
  wanted.insert(wanted.end(), all.begin(), all.end());
  EXPECT_EQ(shown_, wanted);
  EXPECT_EQ(summary.mismatches + summary.mismatches_before, 0U);
  EXPECT_EQ(first_times_.size(), 3U) << "a seek backwards begins with a surface warmed up anew";
}

TEST_F(JournalReplayTest, every_pass_gives_the_same_frames) {
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  first_times_.clear();
  options_.from_ns = 20 * kMsNs;
  options_.run_id = 11;
  options_.passes = 3;
  const JournalReplaySummary summary = replay();
  const std::vector<Shown> part(all.begin() + 1, all.begin() + 12);
  ASSERT_EQ(shown_.size(), 3 * part.size());
  for (std::size_t i = 0; i < shown_.size(); ++i) EXPECT_EQ(shown_[i], part[i % part.size()]);
  EXPECT_EQ(summary.passes, 3U);
  EXPECT_EQ(summary.mismatches, 0U);
  EXPECT_EQ(first_times_.size(), 3U) << "each pass begins with a surface that is warmed up anew";
}

TEST_F(JournalReplayTest, no_number_of_passes_goes_on_until_it_is_ended) {
  entries_.write(file_);
  options_.passes = 0;
  int left = 18 * 4 + 2;
  hooks_.order = [&](std::uint64_t) { return left-- > 0 ? ReplayOrder::show : ReplayOrder::end; };
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(summary.frames, 18U * 4U + 2U);
  EXPECT_EQ(summary.passes, 5U);
}

TEST_F(JournalReplayTest, another_daemon_is_warmed_up_and_paced_anew) {
  entries_.daemon(1'900'000'000'000 * kMsNs);
  entries_.run(13, 2'000 * kMsNs);
  entries_.frames(201, 203);
  entries_.write(file_);
  const std::vector<Shown> all = whole();
  ASSERT_EQ(all.size(), 21U);
  EXPECT_THAT(first_times_, ElementsAre(0, 2'000 * kMsNs));
  options_.speed = 1.0;
  clock_.now = clock_.first;
  replay();
  EXPECT_EQ(shown_, all);
  EXPECT_LT(clock_.now - clock_.first, 5'000 * kMsNs) << "the years between them are left out";

  // The surface of this daemon does not depend on an earlier one.
  first_times_.clear();
  options_.from_ns = 2'020 * kMsNs;
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(shown_, std::vector<Shown>(all.begin() + 19, all.end()));
  EXPECT_THAT(first_times_, ElementsAre(2'000 * kMsNs));
  EXPECT_EQ(summary.frames_before, 1U);
}

TEST_F(JournalReplayTest, a_frame_that_differs_is_named) {
  entries_.write(file_);
  v1::FrameDecision& broken = *entries_.all[8].mutable_frame();
  broken.set_radiance_crc32c(broken.radiance_crc32c() ^ 1U);
  entries_.write(file_);
  const JournalReplaySummary all = replay();
  EXPECT_EQ(all.mismatches, 1U);
  EXPECT_EQ(all.first_mismatch, 8U);
  options_.from_ns = 90 * kMsNs;
  const JournalReplaySummary behind = replay();
  EXPECT_EQ(behind.mismatches, 0U);
  EXPECT_EQ(behind.mismatches_before, 1U) << "the frames of the range stand on it";
}

TEST_F(JournalReplayTest, a_like_setup_has_no_difference) {
  entries_.write(file_);
  EXPECT_THAT(replay().differences, IsEmpty());
}

TEST_F(JournalReplayTest, another_build_and_device_are_told) {
  for (v1::JournalEntry& entry : entries_.all) {
    if (!entry.has_run_start()) continue;
    entry.mutable_run_start()->set_software("emitd 0.0.9 (abcdef)");
    entry.mutable_run_start()->set_device("another device");
  }
  entries_.write(file_);
  const JournalReplaySummary summary = replay();
  ASSERT_EQ(summary.differences.size(), 3U) << "once, although two runs have them";
  EXPECT_THAT(summary.differences[0].text(), HasSubstr("version: recorded 0.0.9, here "));
  EXPECT_THAT(summary.differences[1].text(), HasSubstr("commit: recorded abcdef, here "));
  EXPECT_EQ(summary.differences[2].text(), "device: recorded another device, here scripted");
  EXPECT_EQ(summary.frames, 18U) << "warnings only";
}

TEST_F(JournalReplayTest, other_channels_are_refused_before_the_warm_up) {
  auto* recording = entries_.all.front().mutable_run_start()->mutable_recording();
  recording->mutable_channels(0)->set_width_px(640);
  entries_.write(file_);
  const physics::Error error = refused();
  EXPECT_EQ(error.code, ErrorCode::config);
  EXPECT_THAT(error.text, HasSubstr("--anyway"));
  EXPECT_THAT(first_times_, IsEmpty());
  options_.anyway = true;
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(summary.frames, 18U);
  ASSERT_EQ(summary.differences.size(), 1U);
  EXPECT_THAT(summary.differences[0].text(), HasSubstr("640 x 8 px"));
}

TEST_F(JournalReplayTest, another_scenario_is_refused) {
  entries_.all.front().mutable_run_start()->set_scenario_sha256("12ab");
  entries_.write(file_);
  EXPECT_EQ(refused().code, ErrorCode::config);
  options_.anyway = true;
  EXPECT_EQ(replay().frames, 18U);
}

TEST_F(JournalReplayTest, an_older_journal_replays) {
  for (v1::JournalEntry& entry : entries_.all) {
    if (entry.has_run_start()) entry.mutable_run_start()->clear_recording();
  }
  entries_.write(file_);
  const JournalReplaySummary summary = replay();
  EXPECT_EQ(summary.frames, 18U);
  EXPECT_THAT(summary.differences, IsEmpty());
}

TEST_F(JournalReplayTest, a_log_that_begins_within_a_run_is_refused_before_the_warm_up) {
  entries_.write(file_);
  entries_.all.erase(entries_.all.begin(), entries_.all.begin() + 3);
  auto log = protocol::LogWriter::create(file_, {});
  ASSERT_TRUE(log);
  for (const v1::JournalEntry& entry : entries_.all) ASSERT_TRUE(log->write_journal(entry));
  ASSERT_TRUE(log->close());
  EXPECT_THAT(refused().text, HasSubstr("begins in the middle of a run"));
  options_.run_id = 12;
  EXPECT_THAT(refused().text, HasSubstr("emit log cut --only-run"));
  EXPECT_THAT(first_times_, IsEmpty());
}

}  // namespace
}  // namespace emit::tool
