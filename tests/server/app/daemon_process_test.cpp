// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <csignal>

#include "emit/client/client.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "support/daemon_process.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;

using emit::test::kSecondNs;

protocol::HostFrameData host_frame(std::uint64_t number) {
  protocol::HostFrameData frame;
  frame.frame_number = number;
  frame.sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
  frame.run_id = 1;
  return frame;
}

TEST(DaemonProcess, SigtermSendsWhatIsInWorkClosesTheJournalAndExitsZero) {
  ScratchFolder folder;
  const std::string config = folder.write(
      "emitd.toml",
      canned_config(64, 48, "mode = \"host-step\"", "[journal]\nfile = \"run.mcap\"\n"));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  auto client = client::FrameClient::connect("tcp://" + daemon.control());
  ASSERT_TRUE(client.has_value()) << client.error().text;
  ASSERT_TRUE((*client)->subscribe({}).has_value());
  auto host = client::HostClient::connect("tcp://" + daemon.control());
  ASSERT_TRUE(host.has_value()) << host.error().text;
  for (std::uint64_t k = 1; k <= 20; ++k) {
    ASSERT_TRUE((*host)->send(host_frame(k)).has_value());
    const auto frame = (*client)->receive(20 * kSecondNs);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_NE(*frame, nullptr);
    EXPECT_EQ((*frame)->header.host_frame_number, k);
  }
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");

  auto log = protocol::LogReader::open(folder.file("run.mcap"));
  ASSERT_TRUE(log.has_value()) << log.error().text;
  int frames = 0;
  int hosts = 0;
  int starts = 0;
  std::uint64_t sequence = 0;
  for (auto more = log->next(); more && *more; more = log->next()) {
    EXPECT_EQ(log->journal().sequence(), ++sequence);
    frames += log->journal().has_frame() ? 1 : 0;
    hosts += log->journal().has_host_frame() ? 1 : 0;
    starts += log->journal().has_run_start() ? 1 : 0;
  }
  EXPECT_FALSE(log->truncation().has_value());
  EXPECT_EQ(frames, 20);
  EXPECT_EQ(hosts, 20);
  EXPECT_EQ(starts, 1);
}

TEST(DaemonProcess, SaysVersionDeviceAndPortsBeforeAnythingElse) {
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  EXPECT_EQ(daemon.control().find("127.0.0.1:"), 0U);
  EXPECT_EQ(daemon.host_udp().find("127.0.0.1:"), 0U);
  daemon.signal(SIGINT);
  EXPECT_EQ(daemon.wait(), 0);
  const std::string log = folder.read("stderr");
  const std::string first = log.substr(0, log.find('\n'));
  EXPECT_NE(first.find("software=\"emitd "), std::string::npos) << log;
  EXPECT_NE(first.find(" control=" + daemon.control()), std::string::npos) << log;
  EXPECT_LT(log.find("device=\"canned: test pattern\""), log.find("ready control=")) << log;
}

TEST(DaemonProcess, BadConfigurationExits78WithItsPosition) {
  ScratchFolder folder;
  const std::string config = folder.write("bad.toml", "[source]\nkind = \"canned\"\nwidht = 3\n");
  DaemonProcess daemon(folder, {"--config", config});
  EXPECT_EQ(daemon.wait(), 78);
  const std::string said = folder.read("stderr");
  EXPECT_EQ(said.find("emitd: error: " + config + ":3:1: unknown key 'widht'"), 0U) << said;
  EXPECT_EQ(said.find('\n'), said.size() - 1) << said;
  EXPECT_EQ(folder.read("stdout"), "");
}

TEST(DaemonProcess, BadSyntaxMissingFileAndMissingScenarioExit78) {
  ScratchFolder folder;
  for (const std::string& config :
       {folder.write("syntax.toml", "[source\n"), folder.file("absent.toml"),
        folder.write("no_scenario.toml", "[source]\nkind = \"renderer\"\n")}) {
    DaemonProcess daemon(folder, {"--config", config});
    EXPECT_EQ(daemon.wait(), 78) << config << folder.read("stderr");
  }
}

TEST(DaemonProcess, UsageErrorsExitTwo) {
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\""));
  for (const std::vector<std::string>& arguments :
       {std::vector<std::string>{},
        {"--nonsense"},
        {"--config"},
        {"--config", config, "--set", "no_equals_sign"}}) {
    DaemonProcess daemon(folder, arguments);
    EXPECT_EQ(daemon.wait(), 2);
    EXPECT_EQ(folder.read("stderr").find("emitd: error: "), 0U) << folder.read("stderr");
    EXPECT_NE(folder.read("stderr").find("`emitd --help`"), std::string::npos);
  }
}

TEST(DaemonProcess, CheckAndVersionExitZeroWithoutServing) {
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\""));
  {
    DaemonProcess daemon(folder, {"--config", config, "--check"});
    EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
  }
  {
    // The files that it names are read as well.
    DaemonProcess daemon(folder, {"--config", config, "--check", "--set",
                                  "host.key_file=" + folder.file("no.keys")});
    EXPECT_EQ(daemon.wait(), 78);
    EXPECT_NE(folder.read("stderr").find("no.keys"), std::string::npos) << folder.read("stderr");
  }
  DaemonProcess daemon(folder, {"--version"});
  EXPECT_EQ(daemon.wait(), 0);
  EXPECT_EQ(folder.read("stdout").find("emitd "), 0U);
}

TEST(DaemonProcess, APortInUseExitsOneAndNamesIt) {
  ScratchFolder first_folder;
  ScratchFolder second_folder;
  const std::string text = canned_config(64, 48, "mode = \"host-step\"");
  DaemonProcess first(first_folder, {"--config", first_folder.write("emitd.toml", text)});
  ASSERT_TRUE(first.wait_ready());
  DaemonProcess second(second_folder, {"--config", second_folder.write("emitd.toml", text), "--set",
                                       "control.tcp=\"" + first.control() + "\""});
  EXPECT_EQ(second.wait(), 1);
  const std::string said = second_folder.read("stderr");
  const std::string last = said.substr(said.rfind('\n', said.size() - 2) + 1);
  EXPECT_EQ(last.find("emitd: error: "), 0U) << said;
  for (const std::string& part :
       {first.control(), std::string("control.tcp"), std::string("ss -ltnup")}) {
    EXPECT_NE(last.find(part), std::string::npos) << said;
  }
}

}  // namespace
}  // namespace emit::server
