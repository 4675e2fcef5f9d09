// SPDX-License-Identifier: Apache-2.0
// Journals of real daemons: disks without room, recorders that connect late, ends in order and not.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <string>
#include <thread>

#include "app/daemon.hpp"
#include "client/http_get.hpp"
#include "emit/client/client.hpp"
#include "emit/v1/control.pb.h"
#include "support/daemon_process.hpp"
#include "support/exposition.hpp"
#include "support/scripted_source.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::Exposition;
using test::ScratchFolder;
using test::ToolProcess;

using emit::test::kLongNs;

TEST(Journal, AStartOnAFullDiskServesWithoutAJournalUnlessItIsRequired) {
  constexpr rlim_t kDiskBytes = 4000;  // the log of the daemon has room, the schemas have not
  ScratchFolder folder;
  const std::string journal = folder.file("journal.mcap");
  const std::string config = folder.write(
      "emitd.toml",
      canned_config(64, 48, "mode = \"host-step\"", "[journal]\nfile = \"" + journal + "\"\n"));
  {
    DaemonProcess daemon(folder, {"--config", config}, kDiskBytes);
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    auto client = client::FrameClient::connect("tcp://" + daemon.control());
    auto host = client::HostClient::connect("tcp://" + daemon.control());
    ASSERT_TRUE(client.has_value() && host.has_value());
    ASSERT_TRUE((*client)->subscribe({}).has_value());
    protocol::HostFrameData frame;
    frame.frame_number = 1;
    ASSERT_TRUE((*host)->send(frame).has_value());
    const auto received = (*client)->receive(kLongNs);
    EXPECT_TRUE(received.has_value() && *received != nullptr);
    const std::string log = folder.read("stderr");
    EXPECT_NE(log.find("event=journal_off"), std::string::npos) << log;
    EXPECT_NE(log.find("journal.mcap: offset"), std::string::npos) << log;
    EXPECT_NE(log.find("File too large"), std::string::npos) << log;
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait(), 0);
  }
  EXPECT_FALSE(std::filesystem::exists(journal)) << "an empty log stayed behind";
  {
    DaemonProcess daemon(folder, {"--config", config, "--set", "journal.required=true"},
                         kDiskBytes);
    EXPECT_EQ(daemon.wait(), 78) << "systemd must not start it again each second";
    EXPECT_NE(folder.read("stderr").find("journal.required"), std::string::npos)
        << folder.read("stderr");
  }
  EXPECT_FALSE(std::filesystem::exists(journal));
}

TEST(Journal, ARecorderTellsAnEndInOrderFromAKilledDaemon) {
  for (const bool in_order : {true, false}) {
    SCOPED_TRACE(in_order);
    ScratchFolder folder;
    DaemonProcess daemon(
        folder, {"--config", folder.write("emitd.toml", canned_config(64, 48,
                                                                      "mode = \"ig-clock\"\n"
                                                                      "rate_hz = 100"))});
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    auto recorder = client::RecorderClient::connect("tcp://" + daemon.control());
    ASSERT_TRUE(recorder.has_value()) << recorder.error().text;
    v1::JournalEntry entry;
    for (int i = 0; i < 20; ++i) {
      const auto received = (*recorder)->receive(entry, kLongNs);
      ASSERT_TRUE(received.has_value() && *received);
    }
    EXPECT_EQ((*recorder)->gap().entries(), 0U);
    daemon.signal(in_order ? SIGTERM : SIGKILL);
    std::string error;
    while (error.empty()) {
      const auto received = (*recorder)->receive(entry, kLongNs);
      if (!received) error = received.error().text;
    }
    EXPECT_EQ((*recorder)->closed(), in_order) << error;
    EXPECT_EQ(error.find("killed") != std::string::npos, !in_order) << error;
  }
}

/// A daemon in this process with a source of the test's.
class InProcess : public ::testing::Test {
 protected:
  void start(config::DaemonConfig config = {}) {
    config.host.udp = "127.0.0.1:0";
    config.control.tcp = "127.0.0.1:0";
    config.metrics.listen = "127.0.0.1:0";
    DaemonOptions options;
    options.source_factory = [this] {
      return physics::Result<std::unique_ptr<FrameSource>>(
          std::make_unique<test::ScriptedSource>(script_, 32, 16, 7));
    };
    options.on_log = [](const std::string&) {};
    auto created = Daemon::create(config, std::nullopt, options);
    ASSERT_TRUE(created.has_value()) << created.error().text;
    daemon_ = std::move(*created);
    thread_ = std::thread([this] { code_ = daemon_->run(); });
    url_ = "tcp://127.0.0.1:" + std::to_string(daemon_->control_port());
    auto client = client::FrameClient::connect(url_);
    auto host = client::HostClient::connect(url_);
    ASSERT_TRUE(client.has_value() && host.has_value());
    client_ = std::move(*client);
    host_ = std::move(*host);
    ASSERT_TRUE(client_->subscribe({}).has_value());
  }
  void TearDown() override {
    if (thread_.joinable()) {
      daemon_->request_stop();
      thread_.join();
    }
  }
  void send(protocol::HostFrameData& frame) {
    frame.run_id = 1;
    frame.frame_number = ++number_;
    ASSERT_TRUE(host_->send(frame).has_value());
  }
  void take_frame() {
    const auto received = client_->receive(kLongNs);
    ASSERT_TRUE(received.has_value() && *received != nullptr);
  }
  [[nodiscard]] client::HttpAnswer get(const std::string& path) const {
    const auto answer = client::http_get(
        "http://127.0.0.1:" + std::to_string(daemon_->metrics_port()) + path, kLongNs);
    EXPECT_TRUE(answer.has_value());
    return answer.value_or(client::HttpAnswer{});
  }

  test::SourceScript script_;
  std::unique_ptr<Daemon> daemon_;
  std::thread thread_;
  std::string url_;
  int code_ = -1;
  std::unique_ptr<client::FrameClient> client_;
  std::unique_ptr<client::HostClient> host_;
  std::uint64_t number_ = 0;
};

TEST(DaemonStart, SaysOverHttpThatItIsThereAndNotReadyWhileTheSourceIsMade) {
  config::DaemonConfig config;
  config.host.udp = "127.0.0.1:0";
  config.control.tcp = "127.0.0.1:0";
  config.metrics.listen = "127.0.0.1:0";
  test::SourceScript script;
  std::string metrics_url;
  std::string ready;
  std::string health;
  std::string metrics;
  const auto body_of = [&](const std::string& path) {
    const auto answer = client::http_get(metrics_url + path, kLongNs);
    return answer ? std::to_string(answer->status) + " " + answer->body : answer.error().text;
  };
  DaemonOptions options;
  options.on_log = [&](const std::string& line) {
    const auto begin = line.find("event=listening");
    if (begin == std::string::npos) return;
    const auto address = line.find(" metrics=", begin) + std::string_view(" metrics=").size();
    metrics_url = "http://" + line.substr(address, line.find_first_of(" \n", address) - address);
  };
  options.source_factory = [&] {
    ready = body_of("/readyz");
    health = body_of("/healthz");
    metrics = body_of("/metrics");
    return physics::Result<std::unique_ptr<FrameSource>>(
        std::make_unique<test::ScriptedSource>(script, 32, 16, 7));
  };
  auto daemon = Daemon::create(config, std::nullopt, options);
  ASSERT_TRUE(daemon.has_value()) << daemon.error().text;
  EXPECT_EQ(ready, "503 no: emitd starts; its surface is warmed up to 0 %\n") << metrics_url;
  EXPECT_EQ(health, "200 yes\n");
  ASSERT_EQ(metrics.substr(0, 4), "200 ") << metrics;
  const Exposition starting(metrics.substr(4));
  EXPECT_EQ(starting.fault(), "");
  EXPECT_EQ(starting.value("emitd_ready"), 0.0);
  EXPECT_EQ(starting.value("emitd_warmed_up_ratio"), 0.0);

  std::thread thread([&] { (*daemon)->run(); });
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (body_of("/readyz") != "200 yes\n" && std::chrono::steady_clock::now() < end) {
    std::this_thread::yield();
  }
  EXPECT_EQ(body_of("/readyz"), "200 yes\n");
  const Exposition serving(body_of("/metrics").substr(4));
  EXPECT_EQ(serving.value("emitd_ready"), 1.0);
  EXPECT_EQ(serving.value("emitd_warmed_up_ratio"), 1.0);
  (*daemon)->request_stop();
  thread.join();
}

TEST_F(InProcess, ALateRecorderLearnsWhichEntriesItLacksAndTheToolSaysSo) {
  config::DaemonConfig config;
  config.journal.memory_mib = 1;
  ASSERT_NO_FATAL_FAILURE(start(config));
  protocol::HostFrameData frame;
  frame.entity_count = protocol::kMaxEntitiesPerFrame;  // so that an entry takes 10 kB
  for (std::uint32_t i = 0; i < frame.entity_count; ++i) {
    frame.entities[i].entity_id = i;
    frame.entities[i].has_pose = true;
  }
  while (daemon_->counter(Counter::journal_forgotten) == 0) {
    ASSERT_NO_FATAL_FAILURE(send(frame));
    ASSERT_NO_FATAL_FAILURE(take_frame());
    ASSERT_LT(number_, 2000U);
  }
  auto recorder = client::RecorderClient::connect(url_);
  ASSERT_TRUE(recorder.has_value());
  v1::JournalEntry entry;
  const auto received = (*recorder)->receive(entry, kLongNs);
  ASSERT_TRUE(received.has_value() && *received);
  EXPECT_EQ((*recorder)->gap().first_sequence, 1U);
  EXPECT_EQ((*recorder)->gap().last_sequence, entry.sequence() - 1);
  EXPECT_GT((*recorder)->gap().entries(), 0U);

  const Exposition metrics(get("/metrics").body);
  EXPECT_EQ(metrics.fault(), "");
  EXPECT_GT(metrics.value("emitd_journal_memory_bytes"), 100'000.0);
  EXPECT_LE(metrics.value("emitd_journal_memory_bytes"), 1048576.0);
  EXPECT_GT(metrics.value("emitd_journal_forgotten_total"), 0.0);

  ScratchFolder folder;
  ToolProcess tool(folder, "record",
                   {"record", "--from", url_, "--out", folder.file("late.mcap"), "--frames", "1"});
  EXPECT_EQ(tool.wait(), 1);
  EXPECT_NE(tool.err().find("sequence 1 to "), std::string::npos) << tool.err();
}

TEST_F(InProcess, IsNotReadyWhileTheSurfaceWarmsUpAgain) {
  std::atomic<bool> jumps{false};
  std::atomic<bool> seen{false};
  script_.on_submit = [&](const renderer::FrameRequest&) {
    while (jumps.load() && !seen.load()) std::this_thread::yield();
  };
  ASSERT_NO_FATAL_FAILURE(start());
  protocol::HostFrameData frame;
  ASSERT_NO_FATAL_FAILURE(send(frame));
  ASSERT_NO_FATAL_FAILURE(take_frame());
  EXPECT_EQ(get("/readyz").status, 200);
  jumps.store(true);
  frame.sim_time_ns = 7'200'000'000'000;
  ASSERT_NO_FATAL_FAILURE(send(frame));
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
  while (get("/readyz").status == 200 && std::chrono::steady_clock::now() < end) {
    std::this_thread::yield();
  }
  EXPECT_EQ(get("/readyz").status, 503);
  seen.store(true);
  const auto received = client_->receive(kLongNs);
  ASSERT_TRUE(received.has_value() && *received != nullptr);
  EXPECT_NE((*received)->header.flags & protocol::kFlagDegraded, 0U);
  EXPECT_EQ(daemon_->counter(Counter::frames_warmed_up), 1U);
  EXPECT_EQ(get("/readyz").status, 200);
}

}  // namespace
}  // namespace emit::server
