// SPDX-License-Identifier: Apache-2.0
// A real emitd under a service manager that this test plays, and under [realtime].
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "client/http_get.hpp"
#include "renderer/scene/gltf_builder.hpp"
#include "support/daemon_process.hpp"
#include "support/exposition.hpp"
#include "support/notify_socket.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::Exposition;
using test::NotifySocket;
using test::ScratchFolder;

constexpr int kLongMs = 30'000;
using emit::test::kLongNs;
const std::string kMetrics = "[metrics]\nlisten = \"127.0.0.1:0\"\n";

/// Environment for the processes that are started while it exists.
class Variable {
 public:
  Variable(const char* name, const std::string& value) : name_(name) {
    ::setenv(name, value.c_str(), 1);
  }
  ~Variable() { ::unsetenv(name_); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  const char* name_;
};

TEST(DaemonService, TellsTheManagerOfItsLifeFromStartToStop) {
  ScratchFolder folder;
  const NotifySocket manager(folder.file("notify"));
  ASSERT_TRUE(manager.bound());
  const Variable socket("NOTIFY_SOCKET", folder.file("notify"));
  const Variable watchdog("WATCHDOG_USEC", "1200000");
  const std::string config =
      folder.write("emitd.toml", canned_config(32, 24, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  const std::string start = manager.until("READY=1", kLongMs);
  ASSERT_NE(start, "") << folder.read("stderr");
  EXPECT_EQ(start.find("STATUS=loading scene and device\nEXTEND_TIMEOUT_USEC="), 0U) << start;
  EXPECT_NE(start.find("\nSTATUS=ready control=127.0.0.1:"), std::string::npos) << start;
  EXPECT_NE(manager.until("WATCHDOG=1", kLongMs), "");
  EXPECT_NE(manager.until("WATCHDOG=1", kLongMs), "") << "again and again";
  daemon.signal(SIGTERM);
  EXPECT_NE(manager.until("STOPPING=1", kLongMs), "");
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

TEST(DaemonService, AStopDuringTheStartIsNoCrash) {
  for (const int signal : {SIGTERM, SIGINT}) {
    ScratchFolder folder;
    const NotifySocket manager(folder.file("notify"));
    const Variable socket("NOTIFY_SOCKET", folder.file("notify"));
    // The device takes seconds to draw its images.
    DaemonProcess daemon(
        folder, {"--config",
                 folder.write("emitd.toml", canned_config(4096, 4096, "mode = \"host-step\""))});
    ASSERT_NE(manager.until("STATUS=loading", kLongMs), "") << folder.read("stderr");
    daemon.signal(signal);
    EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
    EXPECT_EQ(folder.read("stdout"), "") << "it was not ready";
    EXPECT_NE(folder.read("stderr").find("stopped before it was ready"), std::string::npos);
  }
}

TEST(DaemonService, AJournalHasOneWriter) {
  ScratchFolder folder;
  const std::string config = folder.write(
      "emitd.toml", canned_config(32, 24, "mode = \"ig-clock\"\nrate_hz = 100",
                                  "[journal]\nfile = \"" + folder.file("journal.mcap") + "\"\n"));
  DaemonProcess first(folder, {"--config", config});
  ASSERT_TRUE(first.wait_ready()) << folder.read("stderr");
  const auto bytes = [&] { return std::filesystem::file_size(folder.file("journal.mcap")); };
  for (int i = 0; i < 6000 && bytes() == 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  const auto before = bytes();
  ScratchFolder other;
  DaemonProcess second(other, {"--config", config});
  EXPECT_EQ(second.wait(), 1);
  EXPECT_NE(other.read("stderr").find("journal.mcap: another process writes it"), std::string::npos)
      << other.read("stderr");
  EXPECT_GE(bytes(), before);
  first.signal(SIGTERM);
  EXPECT_EQ(first.wait(), 0);
  EXPECT_GT(bytes(), before) << "it went on in the same file";
}

TEST(DaemonService, AWatchdogOfAnotherProcessIsNotFed) {
  ScratchFolder folder;
  const NotifySocket manager(folder.file("notify"));
  const Variable socket("NOTIFY_SOCKET", folder.file("notify"));
  const Variable watchdog("WATCHDOG_USEC", "400000");
  const Variable pid("WATCHDOG_PID", "1");
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", canned_config(32, 24, "mode = \"host-step\""))});
  ASSERT_NE(manager.until("READY=1", kLongMs), "") << folder.read("stderr");
  daemon.signal(SIGTERM);
  const std::string rest = manager.until("STOPPING=1", kLongMs);
  EXPECT_NE(rest, "");
  EXPECT_EQ(rest.find("WATCHDOG"), std::string::npos) << rest;
  EXPECT_EQ(daemon.wait(), 0);
}

TEST(DaemonService, RealtimeThatIsRefusedIsToldOrEndsTheStart) {
  // This test runs on no machine that has core 1023.
  const std::string realtime = "[realtime]\ncpus = \"sender=1023\"\n";
  {
    ScratchFolder folder;
    DaemonProcess daemon(
        folder,
        {"--config", folder.write("emitd.toml", canned_config(32, 24, "mode = \"host-step\"",
                                                              realtime + kMetrics))});
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    const auto answer = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
    ASSERT_TRUE(answer.has_value()) << answer.error().text;
    const Exposition metrics(answer->body);
    EXPECT_EQ(metrics.fault(), "");
    EXPECT_EQ(metrics.value("emitd_realtime_granted", {{"setting", "cpus"}, {"agent", "sender"}}),
              0.0);
    EXPECT_GE(metrics.value("emitd_agent_heartbeat_age_seconds", {{"agent", "conductor"}}), 0.0);
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait(), 0);
    EXPECT_NE(folder.read("stderr").find("event=realtime_refused what=\"cpus of sender: "),
              std::string::npos)
        << folder.read("stderr");
  }
  ScratchFolder folder;
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", canned_config(32, 24, "mode = \"host-step\"",
                                                            realtime + "required = true\n"))});
  EXPECT_EQ(daemon.wait(), 1);
  EXPECT_NE(folder.read("stderr").find("the host refuses: cpus of sender: "), std::string::npos)
      << folder.read("stderr");
  EXPECT_EQ(folder.read("stdout"), "") << "it was never ready";
}

TEST(DaemonService, WhatASceneLacksIsLoggedAndCounted) {
  ScratchFolder folder;
  test::GltfText plate;
  plate.buffer = test::packed<float>({0, 0, 0, 0, 0, 10, 10, 0, 0}) +
                 test::packed<std::uint16_t>({0, 1, 2}) + std::string(2, '\0');
  plate.primitive = R"({"attributes":{"POSITION":0},"indices":1,"material":0})";
  plate.materials = R"({"name": "unobtainium"})";
  folder.write("plate.gltf", plate.json());
  folder.write("world.toml",
               "[sensor]\nwidth_px = 32\nheight_px = 24\n[atmosphere]\nenabled = false\n"
               "[[object]]\nname = \"plate\"\ngltf = \"plate.gltf\"\n");
  DaemonProcess daemon(folder, {"--config", folder.write("emitd.toml",
                                                         "scenario = \"world.toml\"\n"
                                                         "[pacing]\nmode = \"host-step\"\n"
                                                         "[host]\nudp = \"127.0.0.1:0\"\n"
                                                         "[control]\ntcp = \"127.0.0.1:0\"\n" +
                                                             kMetrics)});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const auto answer = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
  ASSERT_TRUE(answer.has_value()) << answer.error().text;
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
  const std::string log = folder.read("stderr");
  EXPECT_NE(log.find("event=scene triangles=1 instances=1 samples="), std::string::npos) << log;
  const std::string text = "plate.gltf: material 'unobtainium' maps to nothing in the library";
  EXPECT_NE(log.find("event=scene_warning text=\"" + text), std::string::npos) << log;
  EXPECT_NE(answer->body.find(text), std::string::npos) << answer->body;
}

TEST(DaemonService, TheLowLatencyProfileServesWhateverTheHostGrants) {
  ScratchFolder folder;
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", canned_config(32, 24, "mode = \"host-step\"",
                                                            "[realtime]\nscheduler = \"fifo\"\n"
                                                            "lock_memory = true\n"
                                                            "heap_touch_mib = 1\n" +
                                                                kMetrics))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const auto answer = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
  ASSERT_TRUE(answer.has_value()) << answer.error().text;
  const Exposition metrics(answer->body);
  double refused = 0.0;
  double told = 0.0;
  for (const auto& sample : metrics.samples()) {
    if (sample.name != "emitd_realtime_granted") continue;
    told += 1.0;
    refused += sample.value == 0.0 ? 1.0 : 0.0;
  }
  EXPECT_EQ(told, 5.0) << "memory, and four threads";
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
  EXPECT_EQ(folder.read("stderr").find("event=realtime_refused") != std::string::npos,
            refused > 0.0);
}

}  // namespace
}  // namespace emit::server
