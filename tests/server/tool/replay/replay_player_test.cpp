// SPDX-License-Identifier: Apache-2.0
#include "tool/replay/replay_player.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "emit/v1/control.pb.h"

namespace emit::tool {
namespace {

using Kind = ReplayPlayer::Order::Kind;
using ::testing::HasSubstr;

constexpr std::int64_t kTickNs = 10'000'000;  ///< between the frames of the recording
constexpr std::size_t kFrames = 20;

/// Recording of 20 frames, 10 ms apart, at simulation times from 5 s on.
RecordingTimeline recording() {
  RecordingTimeline out;
  v1::JournalEntry entry;
  entry.set_sequence(1);
  entry.set_wall_time_ns(77'000 * kTickNs);
  entry.mutable_run_start()->set_run_id(9);
  out.add(entry);
  for (std::size_t i = 0; i < kFrames; ++i) {
    entry.Clear();
    entry.set_sequence(i + 2);
    entry.set_wall_time_ns((77'001 + static_cast<std::int64_t>(i)) * kTickNs);
    entry.mutable_frame()->set_frame_number(i + 1);
    entry.mutable_frame()->set_sim_time_ns(5'000'000'000 + static_cast<std::int64_t>(i) * kTickNs);
    out.add(entry);
  }
  return out;
}

/// Plays until a word is waited for, or `most` frames are shown. The clock jumps to what is waited
/// for.
class PlayerRig {
 public:
  explicit PlayerRig(double rate, bool playing) : player(timeline, rate, playing) {}

  std::vector<std::size_t> play(std::size_t most = 1000) {
    std::vector<std::size_t> shown;
    while (shown.size() < most) {
      const ReplayPlayer::Order order = player.next(next, now_ns);
      if (order.kind == Kind::wait) {
        if (!order.at_ns) return shown;
        now_ns = *order.at_ns;
      } else if (order.kind == Kind::anew) {
        next = 0;
        ++begun;
      } else {
        if (order.kind == Kind::show) {
          player.shown(next);
          shown.push_back(next);
        } else {
          ++passed;
        }
        ++next;
      }
    }
    return shown;
  }

  RecordingTimeline timeline = recording();
  ReplayPlayer player;
  std::size_t next = 0;
  std::int64_t now_ns = 1'000;
  int begun = 0;   ///< passes that began anew
  int passed = 0;  ///< frames rendered without being shown
};

std::vector<std::size_t> range(std::size_t first, std::size_t last) {
  std::vector<std::size_t> out;
  for (std::size_t i = first; i <= last; ++i) out.push_back(i);
  return out;
}

TEST(ReplayPlayer, PlaysEveryFrameAtTheRecordedPaceOverTheRate) {
  for (const double rate : {1.0, 4.0, 0.5}) {
    PlayerRig rig(rate, true);
    EXPECT_EQ(rig.play(), range(0, kFrames - 1));
    EXPECT_EQ(rig.now_ns - 1'000, static_cast<std::int64_t>((kFrames - 1) * kTickNs / rate));
    EXPECT_FALSE(rig.player.playing()) << "the end holds it";
  }
  PlayerRig rig(0.0, true);
  EXPECT_EQ(rig.play().size(), kFrames);
  EXPECT_EQ(rig.now_ns, 1'000) << "max waits for nothing";
}

TEST(ReplayPlayer, SeeksForwardsThroughTheFramesBetweenAndBackwardsFromTheBegin) {
  PlayerRig rig(0.0, false);
  EXPECT_EQ(rig.play(), range(0, 0)) << "the first frame is shown all the same";
  EXPECT_TRUE(rig.player.take("seek 0.12").ok);
  EXPECT_EQ(rig.play(), range(12, 12));
  EXPECT_EQ(rig.passed, 11);
  EXPECT_EQ(rig.begun, 0);
  EXPECT_TRUE(rig.player.take("seek 0.031").ok);
  EXPECT_EQ(rig.play(), range(4, 4)) << "the first frame at the position or behind it";
  EXPECT_EQ(rig.begun, 1);
  EXPECT_EQ(rig.passed, 11 + 4);
  EXPECT_TRUE(rig.player.take("move -1").ok);
  EXPECT_EQ(rig.play(), range(3, 3));
  EXPECT_TRUE(rig.player.take("move 5").ok);
  EXPECT_TRUE(rig.player.take("move 5").ok);
  EXPECT_EQ(rig.play(), range(13, 13)) << "two moves add up, also on the way";
  EXPECT_TRUE(rig.player.take("seek 99").ok);
  EXPECT_EQ(rig.play(), range(kFrames - 1, kFrames - 1));
  EXPECT_TRUE(rig.player.take("begin").ok);
  EXPECT_EQ(rig.play(), range(0, 0));
}

TEST(ReplayPlayer, GoesOnPlayingBehindASeek) {
  PlayerRig rig(1.0, true);
  EXPECT_EQ(rig.play(3), range(0, 2));
  EXPECT_TRUE(rig.player.take("seek 0.15").ok);
  const std::int64_t before_ns = rig.now_ns;
  EXPECT_EQ(rig.play(), range(15, kFrames - 1));
  EXPECT_EQ(rig.now_ns - before_ns, static_cast<std::int64_t>(kFrames - 16) * kTickNs)
      << "the pace counts from the frame that was sought";
  EXPECT_TRUE(rig.player.take("play").ok);
  EXPECT_EQ(rig.play(2), range(0, 1)) << "behind the last frame it begins again";
}

TEST(ReplayPlayer, StepsWhileItHoldsAlone) {
  PlayerRig rig(1.0, true);
  EXPECT_EQ(rig.play(2), range(0, 1));
  const ReplayPlayer::Answer refused = rig.player.take("step");
  EXPECT_FALSE(refused.ok);
  EXPECT_THAT(refused.text, HasSubstr("hold or stop before it")) << "as emitd says it";
  EXPECT_TRUE(rig.player.take("hold").ok);
  EXPECT_TRUE(rig.play().empty());
  EXPECT_TRUE(rig.player.take("step").ok);
  EXPECT_TRUE(rig.player.take("step").ok);
  EXPECT_EQ(rig.play(), range(2, 3));
}

TEST(ReplayPlayer, LoopsBetweenTwoPositions) {
  PlayerRig rig(0.0, true);
  EXPECT_TRUE(rig.player.take("loop 0.05 0.07").ok);
  std::vector<std::size_t> wanted = range(0, 7);
  for (int i = 0; i < 2; ++i) wanted.insert(wanted.end(), {5, 6, 7});
  EXPECT_EQ(rig.play(wanted.size()), wanted);
  EXPECT_TRUE(rig.player.take("loop off").ok);
  EXPECT_EQ(rig.play(), range(8, kFrames - 1));
  EXPECT_FALSE(rig.player.take("loop 0.07 0.05").ok);
}

TEST(ReplayPlayer, RefusesWordsThatItDoesNotKnowAndChangesNothing) {
  PlayerRig rig(2.0, false);
  rig.play();
  const std::string before = rig.player.json(0);
  for (const char* words :
       {"", "jump", "seek", "seek x", "seek -1", "seek nan", "seek 1e300", "move", "move 1.5",
        "rate 0", "rate -2", "rate fast", "loop", "loop 1", "loop 1 x", "play now", "step 3"}) {
    EXPECT_FALSE(rig.player.take(words).ok) << words;
  }
  EXPECT_EQ(rig.player.json(0), before);
  EXPECT_TRUE(rig.player.take("rate max").ok);
  EXPECT_THAT(rig.player.json(0), HasSubstr("\"rate\":0,"));
}

TEST(RecordingTimeline, AnotherDaemonFollowsAtOnceAndEventsStandAtTheirFrames) {
  RecordingTimeline timeline = recording();
  v1::JournalEntry entry;
  entry.set_sequence(kFrames + 2);
  entry.set_wall_time_ns(78'000 * kTickNs);
  entry.mutable_command()->set_kind(v1::Command::KIND_HOLD);
  timeline.add(entry);
  entry.Clear();
  entry.set_sequence(1);  // years later
  entry.set_wall_time_ns(99'000'000'000 * kTickNs);
  entry.mutable_run_start()->set_run_id(10);
  timeline.add(entry);
  for (std::uint64_t i = 0; i < 3; ++i) {
    entry.Clear();
    entry.set_sequence(i + 2);
    entry.set_wall_time_ns((99'000'000'000 + static_cast<std::int64_t>(i)) * kTickNs);
    entry.mutable_frame()->set_frame_number(i + 1);
    entry.mutable_frame()->set_flags(i == 1 ? protocol::kFlagLate : 0U);
    timeline.add(entry);
  }
  ASSERT_EQ(timeline.frames().size(), kFrames + 3);
  EXPECT_EQ(timeline.frames()[kFrames].position_ns, timeline.frames()[kFrames - 1].position_ns);
  EXPECT_EQ(timeline.frames().back().position_ns, static_cast<std::int64_t>(kFrames + 1) * kTickNs);
  EXPECT_EQ(timeline.frames().back().run, 1U);
  std::vector<std::string> marks;
  for (const RecordingTimeline::Mark& mark : timeline.marks()) {
    marks.push_back(std::string(mark.kind) + "@" + std::to_string(mark.frame));
  }
  EXPECT_THAT(marks, ::testing::ElementsAre("run@0", "command@20", "run@20", "late@21"));
  EXPECT_THAT(timeline.json(), HasSubstr("\"length_s\":0.21"));
}

}  // namespace
}  // namespace emit::tool
