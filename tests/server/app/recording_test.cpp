// SPDX-License-Identifier: Apache-2.0
#include "app/recording.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "emit/v1/control.pb.h"

namespace emit::server {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

ScenarioIdentity identity(const std::string& printed) {
  return {"aa", printed, {{"box.glb", "0f", 12}, {"box.bin", "1f", 34}}};
}

std::vector<std::string> texts(const std::vector<SetupDifference>& differences) {
  std::vector<std::string> out;
  for (const SetupDifference& one : differences) out.push_back(one.text());
  return out;
}

const RunOrigin kOrigin{"emitd 1.2 (abc)", "card", "box", "aa"};
RunOrigin other_scenario() {
  RunOrigin origin = kOrigin;
  origin.scenario_sha256 = "bb";
  return origin;
}

TEST(Recording, holds_both_configurations_files_and_channels) {
  config::DaemonConfig daemon;
  daemon.pacing.rate_hz = 123.0;
  Channel channel;
  channel.name = "lwir";
  v1::Recording out;
  const ScenarioIdentity scenario = identity("name = \"box\"\n\n[thermal]\nsteps = 6\n");
  fill(&scenario, &daemon, {channel}, out);
  ASSERT_EQ(out.scenario_size(), 2);
  EXPECT_EQ(out.scenario(1).key(), "thermal.steps");
  EXPECT_EQ(out.scenario(1).value(), "6");
  const auto rate = std::ranges::find(out.daemon(), "pacing.rate_hz", &v1::ConfigValue::key);
  ASSERT_NE(rate, out.daemon().end());
  EXPECT_THAT(rate->value(), HasSubstr("123"));
  ASSERT_EQ(out.files_size(), 2);
  EXPECT_EQ(out.files(1).name(), "box.bin");
  EXPECT_EQ(out.files(1).bytes(), 34U);
  ASSERT_EQ(out.channels_size(), 1);
  EXPECT_EQ(out.channels(0).name(), "lwir");
  EXPECT_EQ(out.values_left_out(), 0U);
}

TEST(Recording, a_long_value_is_a_hash) {
  // The hash is that of `printf '"%0300d"' 0 | sha256sum`.
  const ScenarioIdentity scenario =
      identity("table = \"" + std::string(300, '0') + "\"\nshort = 1\n");
  v1::Recording out;
  fill(&scenario, nullptr, {}, out);
  EXPECT_EQ(out.scenario(0).value(),
            "sha256:c29dfc594269876db406fd9cb30bd8ecf558411a840c3b9f6388481d4800da4e (302 bytes)");
  EXPECT_EQ(out.scenario(1).value(), "1");
}

TEST(Recording, stays_below_the_limit_of_a_record) {
  std::string printed;
  for (int i = 0; i < 40'000; ++i) printed += "key_" + std::to_string(i) + " = 123.25\n";
  config::DaemonConfig daemon;
  const ScenarioIdentity scenario = identity(printed);
  v1::Recording out;
  fill(&scenario, &daemon, {}, out);
  EXPECT_LE(out.ByteSizeLong(), kMaxRecordedBytes);
  EXPECT_GT(out.daemon_size(), 0);
  EXPECT_GT(out.values_left_out(), 0U);
  EXPECT_EQ(
      static_cast<std::uint32_t>(out.scenario_size() + out.files_size()) + out.values_left_out(),
      40'000U + 2U);
}

TEST(CompareSetup, like_setups_have_no_difference) {
  v1::Recording same;
  const ScenarioIdentity scenario = identity("name = \"box\"\n");
  fill(&scenario, nullptr, {}, same);
  EXPECT_THAT(compare_setup(kOrigin, &same, {"emit 1.2 (abc)", "card", "box", "aa"}, same),
              IsEmpty())
      << "the name of the program is no difference";
}

TEST(CompareSetup, names_build_and_device) {
  const RunOrigin here{"emit 1.3 (abd)", "llvmpipe", "box", "aa"};
  const auto differences = compare_setup(kOrigin, nullptr, here, {});
  EXPECT_THAT(texts(differences),
              ElementsAre("version: recorded 1.2, here 1.3", "commit: recorded abc, here abd",
                          "device: recorded card, here llvmpipe"));
  EXPECT_TRUE(std::ranges::none_of(differences, &SetupDifference::is_decisive));
}

TEST(CompareSetup, names_keys_and_files_of_another_scenario) {
  v1::Recording theirs;
  v1::Recording ours;
  ScenarioIdentity scenario = identity(
      "[thermal]\nsteps = 6\ngone = 1\n[[object]]\nname = \"truck\"\nscale = 1.0\n"
      "[[object]]\nname = \"jet\"\nscale = 3.0\n");
  fill(&scenario, nullptr, {}, theirs);
  scenario = identity(
      "[thermal]\nsteps = 7\nnew = 2\n[[object]]\nname = \"truck\"\nscale = 2.0\n"
      "[[object]]\nname = \"jet\"\nscale = 3.0\n");
  scenario.files[0].sha256 = "ff";
  scenario.files.pop_back();
  fill(&scenario, nullptr, {}, ours);
  const auto differences = compare_setup(kOrigin, &theirs, other_scenario(), ours);
  EXPECT_THAT(
      texts(differences),
      ElementsAre("scenario: recorded box (SHA-256 aa), here box (SHA-256 bb)",
                  "thermal.steps: recorded 6, here 7", "thermal.gone: recorded 1, here nothing",
                  "object[truck].scale: recorded 1.0, here 2.0",
                  "thermal.new: recorded nothing, here 2",
                  "file box.glb: recorded 12 bytes, SHA-256 0f, here 12 bytes, SHA-256 ff",
                  "file box.bin: recorded 34 bytes, SHA-256 1f, here nothing"));
  EXPECT_EQ(std::ranges::count_if(differences, &SetupDifference::is_decisive), 1);
}

TEST(CompareSetup, canned_frames_are_no_scenario) {
  RunOrigin canned = kOrigin;
  canned.scenario_sha256.clear();
  const auto differences = compare_setup(canned, nullptr, kOrigin, {});
  ASSERT_EQ(differences.size(), 1U);
  EXPECT_TRUE(differences[0].is_decisive());
  EXPECT_EQ(differences[0].text(), "scenario: recorded canned frames, here box (SHA-256 aa)");
}

TEST(CompareSetup, other_channels_are_decisive) {
  Channel channel;
  channel.name = "lwir";
  channel.width_px = 64;
  v1::Recording theirs;
  fill(nullptr, nullptr, {channel}, theirs);
  channel.width_px = 32;
  v1::Recording ours;
  fill(nullptr, nullptr, {channel}, ours);
  const auto differences = compare_setup(kOrigin, &theirs, kOrigin, ours);
  ASSERT_EQ(differences.size(), 1U);
  EXPECT_TRUE(differences[0].is_decisive());
  EXPECT_THAT(differences[0].text(), HasSubstr("channel lwir: recorded "));
}

}  // namespace
}  // namespace emit::server
