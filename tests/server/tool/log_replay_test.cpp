// SPDX-License-Identifier: Apache-2.0
// Journals of a rendered scene replay bit for bit after they were cut and merged.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/small_world.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

constexpr std::chrono::seconds kReplayLimit{280};

class LogReplay : public testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    folder_.write("world.toml", small_world(GetParam()));
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

  // Every way to play the second run, against the CRCs of the live run.
  const std::vector<std::vector<std::string>> ways{
      {"--run-id", run_id, "--from-s", "1", "--to-s", "2"},
      {"--run-id", run_id, "--from-s", "1.5", "--to-s", "1.5"},
      {"--run-id", run_id, "--to-s", "2", "--loop", "2"},
      {"--run-id", run_id, "--from-s", "3", "--speed", "20"},
  };
  for (const std::vector<std::string>& way : ways) {
    std::vector<std::string> command{"replay", first, "--scenario", folder_.file("world.toml")};
    command.insert(command.end(), way.begin(), way.end());
    EXPECT_THAT(expect_success(command).out, HasSubstr("bit-identical"));
  }
  const ProcessResult steps = run_process(
      {"sh", "-c", "printf '\\n\\nq\\n' | \"$0\" replay \"$1\" --scenario \"$2\" --step",
       EMIT_TEST_BIN_DIR "/emit", first, folder_.file("world.toml")},
      kReplayLimit);
  EXPECT_EQ(steps.exit_code, 0) << steps.err;
  for (const std::uint64_t number : {1U, 2U}) {
    EXPECT_THAT(steps.out, HasSubstr(fmt::format("frame {} of run {} at", number, whole.runs[0])));
    EXPECT_THAT(steps.out,
                HasSubstr(fmt::format("CRC {:08x}", whole.crcs.at({whole.runs[0], number}))));
  }
  EXPECT_THAT(steps.out, HasSubstr("2 frames replayed"));

  ASSERT_NO_FATAL_FAILURE(record({"fast.mcap"}));
  const std::string all = folder_.file("all.mcap");
  expect_success({"log", "merge", folder_.file("journal.mcap"), cut, "--out", all});
  const Journal merged(all);
  EXPECT_EQ(merged.runs.size(), 3U);
  expect_same_pixels(all, 13 + 5 + 9);
}

TEST_P(LogReplay, another_scenario_is_refused_by_its_keys_and_files) {
  std::filesystem::copy_file(EMIT_TEST_BIN_DIR "/../share/emit/scenes/box.glb",
                             folder_.file("box.glb"));
  const auto write_world = [&](const std::string& more) {
    std::string text = small_world(GetParam());
    const std::string shipped = "share:scenes/box.glb";
    text.replace(text.find(shipped), shipped.size(), "box.glb");
    folder_.write("world.toml", text + more);
  };
  write_world("");
  ASSERT_NO_FATAL_FAILURE(record({"fast.mcap"}));
  const auto replay = [&](std::vector<std::string> more) {
    std::vector<std::string> command{"replay", folder_.file("journal.mcap"), "--scenario",
                                     folder_.file("world.toml")};
    command.insert(command.end(), more.begin(), more.end());
    return run_emit(command, kReplayLimit);
  };
  EXPECT_EQ(replay({}).exit_code, 0);
  const ProcessResult info =
      expect_success({"log", "info", folder_.file("journal.mcap"), "--json", "-"});
  EXPECT_EQ(json_value(info.out, "thermal.max_samples"), "\"4000\"");
  EXPECT_THAT(json_value(info.out, "pacing.mode"), HasSubstr("host-step"));
  EXPECT_THAT(info.out, HasSubstr("\"name\": \"box.glb\""));

  write_world("tolerance_k = 2.5\n");
  const ProcessResult refused = replay({});
  EXPECT_EQ(refused.exit_code, 78) << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("thermal.tolerance_k: recorded "));
  EXPECT_THAT(refused.err, HasSubstr(", here 2.5"));
  EXPECT_THAT(refused.err, HasSubstr("--anyway"));
  EXPECT_THAT(refused.out, Not(HasSubstr("replayed")));

  // The bytes behind the content of a .glb file are read by nobody, but they are another file.
  write_world("");
  std::ofstream(folder_.file("box.glb"), std::ios::app | std::ios::binary) << "\n";
  const ProcessResult other_file = replay({});
  EXPECT_EQ(other_file.exit_code, 78) << other_file.err;
  EXPECT_THAT(other_file.err, HasSubstr("file box.glb: recorded "));
  EXPECT_THAT(other_file.err, Not(HasSubstr("thermal.")));
}

INSTANTIATE_TEST_SUITE_P(Method, LogReplay, testing::Values("per-frame", "cached"),
                         [](const auto& parameter) {
                           return std::string(parameter.param) == "cached" ? "Cached" : "PerFrame";
                         });

}  // namespace
}  // namespace emit::test
