// SPDX-License-Identifier: Apache-2.0
#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <filesystem>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

constexpr const char* kHead = R"(
scenario = "box"
set = ["sensor.width_px=32", "sensor.height_px=24", "thermal.steps=5"]
times = "09:30,10:30"
)";

std::vector<std::string> lines_of(const std::string& text) {
  std::istringstream in(text);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The columns of a table that do not depend on the machine: those before warm_up_s.
std::string numbers_of(const std::string& file) {
  std::string out;
  const std::vector<std::string> lines = lines_of(read_text(file));
  const std::string& header = lines.at(0);
  const auto columns = std::count(
      header.begin(), header.begin() + static_cast<std::ptrdiff_t>(header.find("warm_up_s")), ',');
  for (const std::string& line : lines) {
    std::size_t end = 0;
    for (std::ptrdiff_t i = 0; i < columns; ++i) end = line.find(',', end) + 1;
    out += line.substr(0, end) + "\n";
  }
  return out;
}

TEST(CliCampaign, elements_run_in_parallel_give_the_numbers_of_one_after_the_other) {
  const TemporaryFolder folder;
  write_text(folder.file("c.toml"), std::string(kHead) + R"(
[[vary]]
key = "weather.wind_m_s"
values = [1.0, 6.0]
[truth]
kind = "render"
set = ["thermal.steps=40"]
)");
  const ProcessResult two =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("two"), "--jobs", "2"});
  ASSERT_EQ(two.exit_code, 0) << two.out << two.err;
  const ProcessResult one = run_emit(
      {"campaign", folder.file("c.toml"), "--out", folder.file("one"), "--json", folder.file("j")});
  ASSERT_EQ(one.exit_code, 0) << one.out << one.err;
  EXPECT_EQ(numbers_of(folder.file("one/results.csv")), numbers_of(folder.file("two/results.csv")));
  EXPECT_EQ(json_value(read_text(folder.file("j")), "done"), "4");
  const std::vector<std::string> lines = lines_of(read_text(folder.file("one/results.csv")));
  ASSERT_EQ(lines.size(), 5U);
  EXPECT_TRUE(lines[0].starts_with("element,weather.wind_m_s,time_s,sun_elevation_deg,"))
      << lines[0];
  for (const char* column : {"air_k", "surface_mean_k", "error_rms_k", "error_p99_k", "status"}) {
    EXPECT_NE(lines[0].find(column), std::string::npos) << column;
  }
  const std::string html = read_text(folder.file("one/report.html"));
  EXPECT_NE(html.find("4 of 4 elements are done"), std::string::npos);
  EXPECT_NE(html.find("<svg"), std::string::npos);
  // A second run finds everything done. One with another wind does that element alone.
  const ProcessResult again =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("one")});
  ASSERT_EQ(again.exit_code, 0) << again.err;
  EXPECT_NE(again.out.find("4 done (4 of them before)"), std::string::npos) << again.out;
  std::string changed = read_text(folder.file("c.toml"));
  changed.replace(changed.find("6.0"), 3, "5.0");
  write_text(folder.file("c.toml"), changed);
  const ProcessResult other =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("one")});
  ASSERT_EQ(other.exit_code, 0) << other.err;
  EXPECT_NE(other.out.find("4 done (2 of them before)"), std::string::npos) << other.out;
}

TEST(CliCampaign, a_failing_element_is_tried_again_and_reported_and_the_rest_is_done) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_emit({"generate", "box", "--out", folder.path().string()}).exit_code, 0);
  write_text(folder.file("c.toml"), std::string(kHead) +
                                        "[[vary]]\nkey = \"object[0].gltf\"\nvalues = [\"" +
                                        folder.file("box.glb") + "\", \"" +
                                        folder.file("lost.glb") + "\"]\n[run]\nretries = 1\n");
  const ProcessResult result =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("o"), "--jobs", "2"});
  EXPECT_EQ(result.exit_code, 1) << result.out;
  EXPECT_NE(result.out.find("4 elements: 2 done"), std::string::npos) << result.out;
  EXPECT_NE(result.err.find("lost.glb"), std::string::npos) << result.err;
  EXPECT_NE(read_text(folder.file("o/report.html")).find("Elements without result"),
            std::string::npos);
  // Now the file is in place: the same command does what is left.
  std::filesystem::copy_file(folder.file("box.glb"), folder.file("lost.glb"));
  const ProcessResult mended =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("o")});
  EXPECT_EQ(mended.exit_code, 0) << mended.out << mended.err;
  EXPECT_NE(mended.out.find("4 done (2 of them before)"), std::string::npos) << mended.out;
}

TEST(CliCampaign, a_killed_element_is_tried_again) {
  const TemporaryFolder folder;
  write_text(folder.file("c.toml"),
             std::string(kHead) + "[run]\nretries = 2\ntimeout_min = 0.00001\n");
  const ProcessResult result =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("o")});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.out.find("2 elements: 0 done (0 of them before), 2 without result, 3 tries"),
            std::string::npos)
      << result.out;
  EXPECT_NE(result.err.find("ended without a word"), std::string::npos) << result.err;
}

TEST(CliCampaign, a_file_that_changes_meanwhile_is_named_as_the_reason) {
  const ScratchFolder folder;
  const std::string text = std::string(kHead) +
                           "[[vary]]\nkey = \"weather.wind_m_s\"\nvalues = [1.0, 2.0, 3.0]\n"
                           "[truth]\nkind = \"none\"\n[run]\nretries = 0\njobs = 1\n";
  folder.write("c.toml", text);
  ToolProcess campaign(folder, "campaign",
                       {"campaign", folder.file("c.toml"), "--out", folder.file("o")});
  while (!std::filesystem::exists(folder.file("o/elements/000000.csv")) && !campaign.ended()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  std::string changed = text;
  changed.replace(changed.find("steps=5"), 7, "steps=6");
  folder.write("c.toml", changed);
  ASSERT_EQ(campaign.wait(std::chrono::seconds(240)), 1) << campaign.out() << campaign.err();
  EXPECT_NE(campaign.err().find("element 5 "), std::string::npos) << campaign.err();
  EXPECT_NE(campaign.err().find("of other conditions or of another version"), std::string::npos)
      << campaign.err();
  EXPECT_EQ(campaign.err().find("ended without a word"), std::string::npos) << campaign.err();
}

TEST(CliCampaign, two_campaigns_do_not_share_a_folder) {
  const TemporaryFolder folder;
  write_text(folder.file("c.toml"), std::string(kHead) + "[truth]\nkind = \"none\"\n");
  std::filesystem::create_directories(folder.file("o"));
  const int other = ::open(folder.file("o/campaign.lock").c_str(), O_RDWR | O_CREAT, 0644);
  ASSERT_GE(other, 0);
  ASSERT_EQ(::flock(other, LOCK_EX | LOCK_NB), 0);
  const ProcessResult refused =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("o")});
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_NE(refused.err.find("campaign.lock: another campaign runs in this folder"),
            std::string::npos)
      << refused.err;
  EXPECT_TRUE(std::filesystem::is_empty(folder.file("o/elements")));
  ::close(other);
}

TEST(CliCampaign, a_wrong_key_is_found_before_anything_runs) {
  const TemporaryFolder folder;
  write_text(folder.file("c.toml"),
             std::string(kHead) + "[[vary]]\nkey = \"weather.wind\"\nvalues = [1.0]\n");
  const ProcessResult result =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("o")});
  EXPECT_EQ(result.exit_code, 78);
  EXPECT_NE(result.err.find("element 0 (weather.wind=1.0, time_s="), std::string::npos)
      << result.err;
  EXPECT_NE(result.err.find("did you mean 'wind_m_s'"), std::string::npos) << result.err;
}

TEST(CliCampaign, frames_of_a_daemon_are_counted) {
  const TemporaryFolder folder;
  write_text(folder.file("c.toml"), R"(
scenario = "box"
set = ["sensor.width_px=64", "sensor.height_px=48", "thermal.steps=5"]
times = "10:30"
[stream]
frames = 20
rate_hz = 20
budget_ms = 60000
)");
  const ProcessResult result =
      run_emit({"campaign", folder.file("c.toml"), "--out", folder.file("o")});
  ASSERT_EQ(result.exit_code, 0) << result.out << result.err;
  const std::vector<std::string> lines = lines_of(read_text(folder.file("o/results.csv")));
  EXPECT_NE(lines.at(0).find("stream_frames,stream_late,stream_late_frac,stream_lost"),
            std::string::npos);
  EXPECT_NE(lines.at(1).find(",20,0,0,0,"), std::string::npos) << lines.at(1);
}

TEST(CliCampaign, without_slurm_the_option_says_what_is_missing) {
  const TemporaryFolder folder;
  write_text(folder.file("c.toml"), kHead);
  const ProcessResult result =
      run_process({"/usr/bin/env", "PATH=/nonexistent", std::string(EMIT_TEST_BIN_DIR) + "/emit",
                   "campaign", folder.file("c.toml"), "--out", folder.file("o"), "--slurm"});
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_NE(result.err.find("sbatch is not found"), std::string::npos) << result.err;
}

}  // namespace
}  // namespace emit::test
