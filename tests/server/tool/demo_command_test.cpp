// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

std::size_t count_files(const std::filesystem::path& folder, const std::string& extension) {
  std::size_t count = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == extension) ++count;
  }
  return count;
}

/// Returns the demo's work folder below `out`; "" when there is none.
std::string work_folder(const std::filesystem::path& out) {
  for (const auto& entry : std::filesystem::directory_iterator(out)) {
    if (entry.path().filename().string().starts_with("run-")) return entry.path().string();
  }
  return "";
}

/// The image is small, which keeps llvmpipe quick.
const std::vector<std::string> kSmall{
    "--set", "sensor.width_px=160", "--set", "sensor.height_px=128", "--set", "thermal.steps=9"};

std::vector<std::string> with_small(std::vector<std::string> arguments) {
  for (const std::string& argument : kSmall) arguments.push_back(argument);
  return arguments;
}

TEST(CliDemo, plays_poses_through_the_daemon_and_replays_bit_for_bit) {
  const TemporaryFolder folder;
  std::filesystem::create_directories(folder.file("out/run"));
  write_text(folder.file("out/run/mine.txt"), "precious");
  const ProcessResult result =
      run_emit(with_small({"demo", "--scenario", "box", "--frames", "6", "--out",
                           folder.file("out"), "--json", folder.file("demo.json")}),
               std::chrono::seconds(280));
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
  const std::string json = read_text(folder.file("demo.json"));
  EXPECT_EQ(json_value(json, "poses_played"), "6");
  EXPECT_EQ(json_value(json, "poses_udp"), "3");
  EXPECT_EQ(json_value(json, "poses_tcp"), "3");
  EXPECT_EQ(json_value(json, "bit_identical"), "true");
  EXPECT_EQ(json_value(json, "mismatches"), "0");
  EXPECT_GE(count_files(folder.file("out"), ".exr"), 3U);
  EXPECT_GE(count_files(folder.file("out"), ".png"), 3U);
  EXPECT_NE(result.out.find("pose received -> render start"), std::string::npos) << result.out;
  EXPECT_EQ(work_folder(folder.file("out")), "");
  // A folder of the user's own beside the frames stays.
  EXPECT_TRUE(std::filesystem::exists(folder.file("out/run/mine.txt")));
}

TEST(CliDemo, what_it_recorded_replays_as_a_command) {
  const TemporaryFolder folder;
  const ProcessResult demo = run_emit(with_small({"demo", "--scenario", "box", "--frames", "4",
                                                  "--keep", "--out", folder.file("out")}),
                                      std::chrono::seconds(280));
  ASSERT_EQ(demo.exit_code, 0) << demo.out << demo.err;
  const std::string journal = work_folder(folder.file("out")) + "/journal.mcap";
  const ProcessResult replay =
      run_emit(with_small({"replay", journal, "--scenario", "box", "--out", folder.file("again")}),
               std::chrono::seconds(280));
  EXPECT_EQ(replay.exit_code, 0) << replay.out << replay.err;
  EXPECT_NE(replay.out.find("bit-identical"), std::string::npos) << replay.out;
  EXPECT_EQ(count_files(folder.file("again"), ".exr"), 4U);

  auto other_steps = with_small({"replay", journal, "--scenario", "box"});
  other_steps.back() = "thermal.steps=5";
  const ProcessResult refused = run_emit(other_steps, std::chrono::seconds(280));
  EXPECT_EQ(refused.exit_code, 78) << refused.out << refused.err;
  EXPECT_NE(refused.err.find("thermal.steps: recorded 9, here 5"), std::string::npos)
      << refused.err;
  other_steps.push_back("--anyway");
  const ProcessResult other = run_emit(other_steps, std::chrono::seconds(280));
  EXPECT_EQ(other.exit_code, 1) << other.out;
  EXPECT_NE(other.out.find("NOT identical"), std::string::npos) << other.out;
}

TEST(CliView, shows_a_scenario_in_a_window) {
  if (run_process({"xvfb-run", "--help"}).exit_code != 0) GTEST_SKIP() << "xvfb-run is missing";
  const TemporaryFolder folder;
  const ProcessResult result = run_process(
      {"xvfb-run", "-a", "-s", "-screen 0 1280x1024x24", std::string(EMIT_TEST_BIN_DIR) + "/emit",
       "view", "box", "--frames", "2", "--screenshot", folder.file("view.png"), "--set",
       "sensor.width_px=160", "--set", "sensor.height_px=120", "--set", "thermal.steps=5"},
      std::chrono::seconds(120));
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
  EXPECT_EQ(result.out, "2 frames shown\n");
  // The size is some kilobytes: a window of one colour would compress to less.
  EXPECT_GT(std::filesystem::file_size(folder.file("view.png")), 4000U);
}

TEST(CliView, overlays_show_a_scenario_and_its_error_against_a_reference) {
  if (run_process({"xvfb-run", "--help"}).exit_code != 0) GTEST_SKIP() << "xvfb-run is missing";
  const TemporaryFolder folder;
  const std::vector<std::string> scene{
      "box",   "--set",          "sensor.width_px=160", "--set", "sensor.height_px=120",
      "--set", "thermal.steps=5"};
  std::vector<std::string> render{"render", "--time-s", "1", "--out", folder.file("box.exr")};
  render.insert(render.end(), scene.begin(), scene.end());
  ASSERT_EQ(run_emit(render).exit_code, 0);
  std::set<std::string> pictures;
  for (const std::string overlay : {"picture", "materials", "sun", "sky", "error"}) {
    std::vector<std::string> view{"xvfb-run",
                                  "-a",
                                  "-s",
                                  "-screen 0 1280x1024x24",
                                  std::string(EMIT_TEST_BIN_DIR) + "/emit",
                                  "view",
                                  "--frames",
                                  "2",
                                  "--overlay",
                                  overlay,
                                  "--reference",
                                  folder.file("box.exr"),
                                  "--screenshot",
                                  folder.file("view.png")};
    view.insert(view.end(), scene.begin(), scene.end());
    const ProcessResult result = run_process(view, std::chrono::seconds(120));
    ASSERT_EQ(result.exit_code, 0) << overlay << result.out << result.err;
    pictures.insert(read_text(folder.file("view.png")));
  }
  EXPECT_EQ(pictures.size(), 5U) << "every overlay shows something else";
}

TEST(CliView, overlays_that_cannot_be_shown_are_refused) {
  const ProcessResult stream = run_emit({"view", "tcp://127.0.0.1:1", "--overlay", "materials"});
  EXPECT_EQ(stream.exit_code, 2);
  EXPECT_NE(stream.err.find("a stream has pixels alone"), std::string::npos) << stream.err;
  const ProcessResult error = run_emit({"view", "box", "--overlay", "error"});
  EXPECT_EQ(error.exit_code, 2);
  EXPECT_NE(error.err.find("--reference"), std::string::npos) << error.err;
}

TEST(CliView, without_a_display_it_says_so) {
  const ProcessResult result = run_process({"env", "-u", "DISPLAY", "-u", "WAYLAND_DISPLAY",
                                            std::string(EMIT_TEST_BIN_DIR) + "/emit", "view", "box",
                                            "--frames", "1", "--set", "sensor.width_px=64", "--set",
                                            "sensor.height_px=48", "--set", "thermal.steps=2"});
  EXPECT_EQ(result.exit_code, 1) << result.out;
  EXPECT_NE(result.err.find("window"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace emit::test
