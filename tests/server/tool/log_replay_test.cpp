// SPDX-License-Identifier: Apache-2.0
// Journals of a rendered scene replay bit for bit after they were cut and merged.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::seconds kReplayLimit{280};

/// A block that casts a shadow on a road, and a box that drives by.
std::string world(const std::string& method) {
  return R"(epoch_utc = 2020-06-21T10:00:00Z
[place]
lat_deg = 48.0
lon_deg = 11.0
[[object]]
gltf = "share:scenes/block-on-road.glb"
[[object]]
entity_id = 1
gltf = "share:scenes/box.glb"
trajectory = [
  { time_s = -3600, position_m = [5, 5, 0], heading_deg = 90 },
  { time_s = 0, position_m = [5, 5, 0], heading_deg = 90 },
  { time_s = 5, position_m = [4, 2, 0], heading_deg = 180 },
  { time_s = 40, position_m = [-6, 2, 0], heading_deg = 270 },
]
[sensor]
width_px = 48
height_px = 36
trajectory = [
  { time_s = 0, position_m = [-16, -15, 15], look_at_m = [0, 0, 0] },
  { time_s = 40, position_m = [-10, -15, 15], look_at_m = [0, 0, 0] },
]
[thermal]
max_samples = 4000
method = ")" +
         method + "\"\n";
}

/// Key of a frame in a journal: its run and its number.
using FrameKey = std::pair<std::uint64_t, std::uint64_t>;

/// CRCs of a journal's frames, and its runs in their order.
struct Journal {
  std::map<FrameKey, std::uint32_t> crcs;
  std::vector<std::uint64_t> runs;

  explicit Journal(const std::string& file) {
    auto log = protocol::LogReader::open(file);
    EXPECT_TRUE(log.has_value()) << log.error().text;
    std::uint64_t run_id = 0;
    for (auto more = log->next(); more && *more; more = log->next()) {
      const v1::JournalEntry& entry = log->journal();
      if (entry.has_run_start()) run_id = entry.run_start().run_id();
      if (!entry.has_frame()) continue;
      if (runs.empty() || runs.back() != run_id) runs.push_back(run_id);
      crcs[{run_id, entry.frame().frame_number()}] = entry.frame().radiance_crc32c();
    }
  }
};

class LogReplay : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    folder_.write("world.toml", world(GetParam()));
    folder_.write("emitd.toml",
                  "scenario = \"world.toml\"\n[pacing]\nmode = \"host-step\"\n"
                  "[host]\nudp = \"127.0.0.1:0\"\n[control]\ntcp = \"127.0.0.1:0\"\n"
                  "[journal]\nfile = \"journal.mcap\"\n");
    expect_success({"make-log", folder_.file("world.toml"), "--rate-hz", "0.4", "--duration-s",
                    "30", "--start-s", "0", "--out", folder_.file("slow.mcap")});
    expect_success({"make-log", folder_.file("world.toml"), "--rate-hz", "2", "--duration-s", "4",
                    "--start-s", "0", "--out", folder_.file("fast.mcap")});
  }
  static ProcessResult expect_success(const std::vector<std::string>& arguments) {
    ProcessResult result = run_emit(arguments, kReplayLimit);
    EXPECT_EQ(result.exit_code, 0) << result.out << result.err;
    return result;
  }
  /// Starts the daemon and sends it these logs, each as a run of its own.
  void record(const std::vector<std::string>& logs) {
    std::filesystem::remove(folder_.file("stdout"));  // an earlier daemon was ready elsewhere
    DaemonProcess daemon(folder_, {"--config", folder_.file("emitd.toml")});
    ASSERT_TRUE(daemon.wait_ready(kReplayLimit)) << folder_.read("stderr");
    for (const std::string& log : logs) {
      expect_success({"send", folder_.file(log), "--to", "tcp://" + daemon.control(), "--step"});
    }
    daemon.signal(SIGTERM);
    ASSERT_EQ(daemon.wait(), 0);
  }
  /// Replays a journal and expects so many frames, each with the pixels of the live run.
  void expect_same_pixels(const std::string& journal, std::size_t frames) {
    const ProcessResult replay =
        expect_success({"replay", journal, "--scenario", folder_.file("world.toml")});
    EXPECT_THAT(replay.out, HasSubstr(std::to_string(frames) + " frames replayed"));
    EXPECT_THAT(replay.out, HasSubstr("bit-identical"));
  }

  ScratchFolder folder_;
};

TEST_P(LogReplay, a_cut_and_a_merged_journal_give_the_same_pixels) {
  ASSERT_NO_FATAL_FAILURE(record({"slow.mcap", "fast.mcap"}));
  const std::string first = folder_.file("first.mcap");
  std::filesystem::rename(folder_.file("journal.mcap"), first);
  const Journal whole(first);
  ASSERT_EQ(whole.runs.size(), 2U);
  ASSERT_EQ(whole.crcs.size(), 13U + 9U);

  // Frames 3 to 5 of the second run.
  const std::string run_id = std::to_string(whole.runs[1]);
  const std::string cut = folder_.file("cut.mcap");
  const ProcessResult said = expect_success(
      {"log", "cut", first, "--run-id", run_id, "--from-s", "1", "--to-s", "2", "--out", cut});
  EXPECT_THAT(said.out, HasSubstr("3 frames of run " + run_id));
  EXPECT_THAT(said.out, HasSubstr("2 frames before them and 1 earlier run"));
  const Journal kept(cut);
  EXPECT_EQ(kept.crcs.size(), 13U + 5U);
  for (const auto& [key, crc] : kept.crcs) EXPECT_EQ(crc, whole.crcs.at(key));
  expect_same_pixels(cut, 13 + 5);

  const std::string alone = folder_.file("alone.mcap");
  expect_success(
      {"log", "cut", first, "--run-id", run_id, "--to-s", "2", "--only-run", "--out", alone});
  if (std::string(GetParam()) == "per-frame") {
    expect_same_pixels(alone, 5);
  } else {
    const ProcessResult replay =
        run_emit({"replay", alone, "--scenario", folder_.file("world.toml")}, kReplayLimit);
    EXPECT_THAT(replay.err, HasSubstr("the journal lacks earlier runs of its daemon"));
  }

  ASSERT_NO_FATAL_FAILURE(record({"fast.mcap"}));
  const std::string all = folder_.file("all.mcap");
  expect_success({"log", "merge", folder_.file("journal.mcap"), cut, "--out", all});
  const Journal merged(all);
  EXPECT_EQ(merged.runs.size(), 3U);
  expect_same_pixels(all, 13 + 5 + 9);
}

INSTANTIATE_TEST_SUITE_P(Method, LogReplay, testing::Values("per-frame", "cached"),
                         [](const auto& parameter) {
                           return std::string(parameter.param) == "cached" ? "Cached" : "PerFrame";
                         });

}  // namespace
}  // namespace emit::test
