// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <poll.h>

#include <chrono>
#include <csignal>
#include <fstream>
#include <regex>
#include <thread>

#include "client/client_connection.hpp"
#include "client/http_get.hpp"
#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"
#include "support/exposition.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::Exposition;
using test::ScratchFolder;

using emit::test::kLongNs;

class DaemonMetrics : public testing::Test {
 protected:
  void SetUp() override {
    const std::string config = folder_.write(
        "emitd.toml",
        canned_config(32, 24, "mode = \"host-step\"", "[metrics]\nlisten = \"127.0.0.1:0\"\n"));
    daemon_ =
        std::make_unique<DaemonProcess>(folder_, std::vector<std::string>{"--config", config});
    ASSERT_TRUE(daemon_->wait_ready()) << folder_.read("stderr");
    ASSERT_FALSE(daemon_->metrics().empty());
  }
  [[nodiscard]] client::HttpAnswer get(const std::string& path) const {
    const auto answer = client::http_get("http://" + daemon_->metrics() + path, kLongNs);
    EXPECT_TRUE(answer.has_value()) << answer.error().text;
    return answer ? *answer : client::HttpAnswer{};
  }
  /// Returns the daemon's answer to raw bytes.
  [[nodiscard]] std::string answer_to(const std::string& request) const {
    const auto where = parse_host_port(daemon_->metrics());
    auto socket =
        TcpSocket::connect(SocketContext(), numeric_address(where->host, where->port), kLongNs);
    EXPECT_TRUE(socket.has_value());
    static_cast<void>(socket->write_some(std::as_bytes(std::span(request))));
    std::string out;
    std::array<std::byte, 4096> piece;
    for (;;) {
      const IoResult got = socket->read_some(piece);
      if (got.status == IoStatus::would_block) {
        if (!client::wait_for(socket->fd(), POLLIN, client::monotonic_now_ns() + kLongNs))
          return "silence";
      } else if (got.status != IoStatus::done) {
        return out;
      } else {
        out.append(reinterpret_cast<const char*>(piece.data()), got.bytes);
      }
    }
  }
  /// Asks for /metrics until the condition holds.
  template <class Condition>
  [[nodiscard]] bool reaches(Condition condition) const {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(30);
    while (std::chrono::steady_clock::now() < end) {
      const Exposition metrics(get("/metrics").body);
      EXPECT_EQ(metrics.fault(), "");
      if (condition(metrics)) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return false;
  }

  ScratchFolder folder_;
  std::unique_ptr<DaemonProcess> daemon_;
};

TEST_F(DaemonMetrics, TellFramesTimesClientsAndWarnings) {
  EXPECT_EQ(get("/metrics").status, 200);
  EXPECT_EQ(get("/metrics?x=1&y=2").status, 200);
  EXPECT_EQ(get("/healthz?").status, 200);
  EXPECT_EQ(get("/metricsx").status, 404);
  EXPECT_EQ(get("/healthz").status, 200);
  auto client = client::FrameClient::connect("tcp://" + daemon_->control());
  ASSERT_TRUE(client.has_value());
  ASSERT_TRUE((*client)->subscribe({}).has_value());
  auto host = client::HostClient::connect("udp://" + daemon_->host_udp());
  ASSERT_TRUE(host.has_value());
  protocol::HostFrameData frame;
  for (frame.frame_number = 1; frame.frame_number <= 5; ++frame.frame_number) {
    frame.sim_time_ns = static_cast<std::int64_t>(frame.frame_number) * 5'000'000;
    ASSERT_TRUE((*host)->send(frame).has_value());
    const auto received = (*client)->receive(kLongNs);
    ASSERT_TRUE(received.has_value() && *received != nullptr);
  }
  ASSERT_TRUE((*host)->send(frame).has_value());
  frame.frame_number = 1;  // seen before: refused
  ASSERT_TRUE((*host)->send(frame).has_value());

  EXPECT_TRUE(reaches([](const Exposition& metrics) {
    const Exposition::Labels row{{"role", "client"}, {"transport", "tcp"}, {"channel", "0"}};
    return metrics.value("emitd_client_frames_total", row) >= 5.0 &&
           metrics.value("emitd_client_delay_seconds", row) > 0.0 &&
           metrics.value("emitd_frames_sent_total") >= 5.0 &&
           metrics.value("emitd_pose_to_last_byte_seconds_count") >= 5.0 &&
           metrics.value("emitd_stage_seconds_count", {{"stage", "render"}}) >= 5.0 &&
           metrics.value("emitd_warnings_total", {{"level", "warn"}}) >= 1.0 &&
           metrics.value("emitd_agent_turns_total", {{"agent", "conductor"}}) > 0.0 &&
           metrics.value("emitd_ready") == 1.0;
  }));
  EXPECT_EQ(get("/readyz").status, 200);
  client->reset();
  EXPECT_TRUE(reaches([](const Exposition& metrics) {
    return std::isnan(metrics.value("emitd_client_frames_total", {{"role", "client"}}));
  }));
}

/// A rule about a metric that nobody exports would never fire.
TEST(DaemonMetricNames, AreThereForEveryAlertingRule) {
  ScratchFolder folder;
  // The clock's metrics are those of a daemon that asks ptp4l, here one that does not answer.
  const std::string config = folder.write(
      "emitd.toml", canned_config(32, 24, "mode = \"host-step\"",
                                  "[metrics]\nlisten = \"127.0.0.1:0\"\n[clock]\nptp_socket = \"" +
                                      folder.file("ptp") + "\"\n"));
  DaemonProcess daemon(folder, std::vector<std::string>{"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const auto answer = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
  ASSERT_TRUE(answer.has_value()) << answer.error().text;
  const std::string& metrics = answer->body;
  std::ifstream file(EMIT_TEST_SOURCE_DIR "/../deploy/monitoring/emitd.rules.yml");
  std::size_t rules = 0;
  for (std::string line; std::getline(file, line);) {
    if (line.find(" expr: ") == std::string::npos) continue;
    ++rules;
    static const std::regex name_of("emitd_[a-z0-9_]+");
    for (std::sregex_iterator at(line.begin(), line.end(), name_of), end; at != end; ++at) {
      // These two come with the first answer of ptp4l (PtpMonitor's tests have them).
      if (at->str() == "emitd_ptp_offset_seconds" || at->str() == "emitd_ptp_grandmaster_present") {
        continue;
      }
      EXPECT_NE(metrics.find("\n# TYPE " + at->str() + " "), std::string::npos) << at->str();
    }
  }
  EXPECT_GT(rules, 40U);
}

TEST_F(DaemonMetrics, AnswerOtherRequestsByTheBook) {
  EXPECT_EQ(get("/nothing").status, 404);
  EXPECT_TRUE(answer_to("POST /metrics HTTP/1.1\r\nHost: x\r\nContent-Length: 0\r\n\r\n")
                  .starts_with("HTTP/1.1 405"));
  EXPECT_TRUE(answer_to("POST /metrics HTTP/1.1\r\nHost: x\r\nContent-Length: 2\r\n\r\nab")
                  .starts_with("HTTP/1.1 405"));
  const std::string head = answer_to("HEAD /healthz HTTP/1.1\r\nHost: x\r\n\r\n");
  EXPECT_TRUE(head.starts_with("HTTP/1.1 200")) << head;
  EXPECT_TRUE(head.ends_with("\r\n\r\n")) << head;
  EXPECT_EQ(answer_to("what is this\r\n\r\n"), "");
  EXPECT_EQ(answer_to("GET /" + std::string(20'000, 'x') + " HTTP/1.1\r\n\r\n"), "");
  EXPECT_EQ(get("/healthz").status, 200);
}

TEST_F(DaemonMetrics, IdleConnectionsAreLimitedAndEnd) {
  const auto where = parse_host_port(daemon_->metrics());
  std::vector<TcpSocket> idle;
  for (int i = 0; i < 16; ++i) {
    auto socket =
        TcpSocket::connect(SocketContext(), numeric_address(where->host, where->port), kLongNs);
    ASSERT_TRUE(socket.has_value());
    idle.push_back(std::move(*socket));
  }
  // One more connection is closed without an answer.
  EXPECT_FALSE(client::http_get("http://" + daemon_->metrics() + "/healthz", kLongNs).has_value());
  // A connection without a request is closed after a while.
  for (TcpSocket& socket : idle) {
    std::array<std::byte, 1> byte;
    EXPECT_TRUE(client::wait_for(socket.fd(), POLLIN, client::monotonic_now_ns() + kLongNs));
    EXPECT_EQ(socket.read_some(byte).status, IoStatus::closed);
  }
  EXPECT_EQ(get("/healthz").status, 200);
  daemon_->signal(SIGTERM);
  EXPECT_EQ(daemon_->wait(), 0);
}

}  // namespace
}  // namespace emit::server
