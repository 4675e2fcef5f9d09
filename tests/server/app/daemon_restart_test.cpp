// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <memory>
#include <thread>

#include "app/daemon.hpp"
#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/scripted_source.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::ScratchFolder;
using test::ToolProcess;

using emit::test::kLongNs;

/// A daemon in this process, its host and a client that sets the pace.
class OneRun {
 public:
  explicit OneRun(test::SourceScript& script, const std::string& control = "127.0.0.1:0") {
    config::DaemonConfig config;
    config.host.udp = "127.0.0.1:0";
    config.control.tcp = control;
    DaemonOptions options;
    options.source_factory = [&script] {
      return physics::Result<std::unique_ptr<FrameSource>>(
          std::make_unique<test::ScriptedSource>(script, 32, 16, 7));
    };
    auto created = Daemon::create(config, std::nullopt, options);
    EXPECT_TRUE(created.has_value()) << created.error().text;
    daemon_ = std::move(*created);
    thread_ = std::thread([this] { code_ = daemon_->run(); });
    client_ = std::move(*client::FrameClient::connect("tcp://" + address()));
    host_ = std::move(*client::HostClient::connect("tcp://" + address()));
    EXPECT_TRUE(client_->subscribe({}).has_value());
  }
  ~OneRun() {
    daemon_->request_stop();
    static_cast<void>(wait());
  }
  [[nodiscard]] std::string address() const {
    return "127.0.0.1:" + std::to_string(daemon_->control_port());
  }
  void step() {
    protocol::HostFrameData frame;
    frame.run_id = 1;
    frame.frame_number = ++number_;
    frame.sim_time_ns = static_cast<std::int64_t>(number_) * 5'000'000;
    ASSERT_TRUE(host_->send(frame).has_value());
    const auto received = client_->receive(kLongNs);
    ASSERT_TRUE(received.has_value() && *received != nullptr);
  }
  /// Waits until the daemon ends.
  int wait() {
    if (thread_.joinable()) thread_.join();
    return code_;
  }

 private:
  std::unique_ptr<Daemon> daemon_;
  std::thread thread_;
  int code_ = -1;
  std::unique_ptr<client::FrameClient> client_;
  std::unique_ptr<client::HostClient> host_;
  std::uint64_t number_ = 0;
};

TEST(Restart, AReceiverGoesOnByItselfAfterADeviceWasLost) {
  ScratchFolder folder;
  test::SourceScript script;
  std::string control;
  std::unique_ptr<ToolProcess> receiver;
  {
    OneRun first(script);
    control = first.address();
    receiver = std::make_unique<ToolProcess>(
        folder, "receive",
        std::vector<std::string>{"receive", "tcp://" + control, "--reconnect", "--timeout-s", "60",
                                 "--frames", "9", "--json", folder.file("receive.json")});
    ASSERT_TRUE(receiver->says("channel 0")) << receiver->err();
    for (int i = 0; i < 5; ++i) ASSERT_NO_FATAL_FAILURE(first.step());
    script.device_lost.store(true);
    ASSERT_NO_FATAL_FAILURE(first.step());
    EXPECT_EQ(first.wait(), kExitDeviceLost);
  }
  ASSERT_TRUE(receiver->says("connecting again")) << receiver->err();
  test::SourceScript repaired;
  OneRun second(repaired, control);
  ASSERT_TRUE(receiver->says("channel 0", 2)) << receiver->err();
  for (int i = 0; i < 4; ++i) ASSERT_NO_FATAL_FAILURE(second.step());
  EXPECT_EQ(receiver->wait(), 0) << receiver->err();
  const std::string json = folder.read("receive.json");
  EXPECT_EQ(test::json_value(json, "reconnects"), "1") << json;
  EXPECT_EQ(test::json_value(json, "runs"), "2");
  EXPECT_EQ(test::json_value(json, "lost"), "0");
  EXPECT_EQ(test::json_value(json, "unflagged_gaps"), "0");
}

}  // namespace
}  // namespace emit::server
