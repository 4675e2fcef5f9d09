// SPDX-License-Identifier: Apache-2.0
// Clients and hosts that misbehave, beside one that does not. The test asks for a frame only after
// the last one has come, so whatever is missing was lost by emitd and not by a busy machine.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <array>
#include <atomic>
#include <csignal>
#include <memory>
#include <thread>
#include <vector>

#include "client/client_connection.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/framing.hpp"
#include "net/socket.hpp"
#include "rt/fd.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;
using test::ToolProcess;

using emit::test::kLongNs;

class DaemonFaults : public ::testing::Test {
 protected:
  void start(const std::string& pacing, const std::string& more = {}) {
    const std::string config = folder_.write("emitd.toml", canned_config(320, 256, pacing, more));
    daemon_ =
        std::make_unique<DaemonProcess>(folder_, std::vector<std::string>{"--config", config});
    ASSERT_TRUE(daemon_->wait_ready()) << folder_.read("stderr");
    control_ = "tcp://" + daemon_->control();
    auto host = client::HostClient::connect(control_);
    ASSERT_TRUE(host.has_value()) << host.error().text;
    host_ = std::move(*host);
  }
  void start_host_step(const std::string& more = {}) {
    start("mode = \"host-step\"", more);
    good_ = open();
    ASSERT_NE(good_, nullptr);
  }
  void TearDown() override {
    if (daemon_) {
      ASSERT_FALSE(daemon_->ended()) << folder_.read("stderr");
      daemon_->signal(SIGTERM);
      EXPECT_EQ(daemon_->wait(), 0) << folder_.read("stderr");
    }
  }
  [[nodiscard]] std::unique_ptr<client::FrameClient> open(
      const std::string& url = {}, client::SubscribeOptions options = {}) const {
    auto client = client::FrameClient::connect(url.empty() ? control_ : url);
    EXPECT_TRUE(client.has_value()) << client.error().text;
    if (!client) {
      return nullptr;
    }
    const auto channel = (*client)->subscribe(options);
    EXPECT_TRUE(channel.has_value()) << channel.error().text;
    return std::move(*client);
  }
  void ask(std::uint64_t run_id = 1) {
    protocol::HostFrameData frame;
    frame.frame_number = ++asked_;
    frame.run_id = run_id;
    frame.sim_time_ns = static_cast<std::int64_t>(asked_) * 5'000'000;
    ASSERT_TRUE(host_->send(frame).has_value());
  }
  /// Checks one frame: the well-behaved client has it whole and in order.
  void lock_step() {
    ask();
    const auto frame = good_->receive(kLongNs);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_NE(*frame, nullptr) << "frame " << asked_ << folder_.read("stderr");
    ASSERT_EQ((*frame)->header.host_frame_number, asked_);
    ASSERT_EQ((*frame)->header.flags & protocol::kFlagGapBefore, 0U);
    ASSERT_EQ(good_->counters().lost + good_->counters().crc_errors, 0U);
  }
  [[nodiscard]] SocketAddress address(const std::string& text) const {
    const auto where = parse_host_port(text);
    return numeric_address(where->host, where->port);
  }

  ScratchFolder folder_;
  std::unique_ptr<DaemonProcess> daemon_;
  std::string control_;
  std::unique_ptr<client::HostClient> host_;
  std::unique_ptr<client::FrameClient> good_;
  std::uint64_t asked_ = 0;
};

TEST_F(DaemonFaults, AStoppedReceiverGoesOnWithFlaggedGapsAndCostsNobodyElseAFrame) {
  start_host_step();
  ToolProcess receiver(folder_, "receive",
                       {"receive", control_, "--json", folder_.file("receive.json")});
  ASSERT_TRUE(receiver.says("channel 0")) << receiver.err();
  for (int i = 0; i < 20; ++i) ASSERT_NO_FATAL_FAILURE(lock_step());
  receiver.signal(SIGSTOP);
  for (int i = 0; i < 120; ++i) ASSERT_NO_FATAL_FAILURE(lock_step());
  receiver.signal(SIGCONT);
  for (int i = 0; i < 20; ++i) ASSERT_NO_FATAL_FAILURE(lock_step());
  daemon_->signal(SIGTERM);  // whose end is the receiver's
  EXPECT_EQ(receiver.wait(), 0) << receiver.err();
  const std::string json = folder_.read("receive.json");
  EXPECT_EQ(test::json_value(json, "lost"), "0") << json;
  EXPECT_EQ(test::json_value(json, "unflagged_gaps"), "0");
  EXPECT_EQ(test::json_value(json, "crc_errors"), "0");
  EXPECT_NE(test::json_value(json, "skipped"), "0") << "it was stopped for long enough";
  EXPECT_EQ(daemon_->wait(), 0);
  daemon_.reset();
}

TEST_F(DaemonFaults, KilledReceiversLeaveTheirPlaces) {
  start_host_step("max_clients = 5\n");  // host, the good one and three more
  for (int round = 0; round < 3; ++round) {
    std::vector<std::unique_ptr<ToolProcess>> receivers;
    for (int i = 0; i < 3; ++i) {
      const std::string scheme = i == 1 ? "udp://" : "tcp://";
      receivers.push_back(std::make_unique<ToolProcess>(
          folder_, "receive" + std::to_string(i),
          std::vector<std::string>{"receive", scheme + daemon_->control()}));
      // The daemon notices the ends of the previous round in its own time.
      for (int attempt = 0; attempt < 200 && !receivers.back()->says("channel 0"); ++attempt) {
        ASSERT_NE(receivers.back()->err().find("max_clients"), std::string::npos)
            << receivers.back()->err();
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
        receivers.back() = std::make_unique<ToolProcess>(
            folder_, "receive" + std::to_string(i),
            std::vector<std::string>{"receive", scheme + daemon_->control()});
      }
      ASSERT_TRUE(receivers.back()->says("channel 0")) << "round " << round << ": no place free";
    }
    for (int i = 0; i < 10; ++i) ASSERT_NO_FATAL_FAILURE(lock_step());
    for (auto& receiver : receivers) receiver->signal(SIGKILL);
    for (int i = 0; i < 10; ++i) ASSERT_NO_FATAL_FAILURE(lock_step());
    for (auto& receiver : receivers) EXPECT_EQ(receiver->wait(), 128 + SIGKILL);
  }
}

/// Returns `count` records of one kind and body, one after the other.
std::vector<std::byte> records_of(protocol::RecordKind kind, std::span<const std::byte> body,
                                  std::size_t count) {
  std::vector<std::byte> out;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t at = out.size();
    out.resize(at + protocol::kRecordHeaderBytes);
    protocol::encode_record_header(
        kind, static_cast<std::uint32_t>(body.size()),
        std::span(out).subspan(at).first<protocol::kRecordHeaderBytes>());
    out.insert(out.end(), body.begin(), body.end());
  }
  return out;
}

TEST_F(DaemonFaults, FloodsOfEveryKindCostAWellBehavedClientNoFrame) {
  start_host_step();
  const client::Url url = *client::parse_url(control_);
  std::atomic<bool> over{false};
  std::atomic<std::uint64_t> bytes{0};
  std::atomic<std::uint64_t> connections{0};
  // Sends the same bytes again and again, and reconnects when the daemon closes the connection.
  const auto flood = [&](std::vector<std::byte> records) {
    while (!over.load()) {
      auto connection =
          client::ClientConnection::open(url, protocol::PeerRole::client, 1'000'000'000);
      if (!connection) continue;
      connections.fetch_add(1);
      while (!over.load() &&
             connection->send(records, client::monotonic_now_ns() + 1'000'000'000).has_value()) {
        bytes.fetch_add(records.size());
      }
    }
  };
  constexpr std::array kStatus{std::byte{0x3A}, std::byte{0}};  // of a ControlRecord: no answer
  constexpr std::array kHello{std::byte{0x0A}, std::byte{0}};   // refused: hello comes once
  std::vector<std::thread> bad;
  bad.emplace_back(flood, records_of(protocol::RecordKind::control, kStatus, 1000));
  bad.emplace_back(flood, records_of(protocol::RecordKind::control, kHello, 1000));
  bad.emplace_back(flood, records_of(static_cast<protocol::RecordKind>(77), kStatus, 1000));
  bad.emplace_back([&] {  // comes and goes
    while (!over.load()) {
      const auto socket = TcpSocket::connect(SocketContext(), address(daemon_->control()), kLongNs);
      connections.fetch_add(socket ? 1U : 0U);
    }
  });
  bad.emplace_back([&] {
    const auto target = address(daemon_->host_udp());
    const Fd fd(::socket(AF_INET, SOCK_DGRAM, 0));
    const std::vector<std::byte> junk(1200, std::byte{0xFF});
    while (!over.load()) {
      bytes.fetch_add(::sendto(fd.get(), junk.data(), junk.size(), 0, target.get(), target.length) >
                              0
                          ? junk.size()
                          : 0);
    }
  });
  while (bytes.load() < 1'000'000 || connections.load() < 100) {
    std::this_thread::yield();
  }
  for (int i = 0; i < 100 && !HasFatalFailure(); ++i) lock_step();
  over.store(true);
  for (auto& thread : bad) thread.join();
  ASSERT_FALSE(HasFatalFailure());
  RecordProperty("flood_bytes", std::to_string(bytes.load()));
  RecordProperty("flood_connections", std::to_string(connections.load()));
  // A client that behaves gets a place again.
  for (int attempt = 0; attempt < 200; ++attempt) {
    if (client::FrameClient::connect(control_)) {
      ASSERT_NO_FATAL_FAILURE(lock_step());
      return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  FAIL() << "places do not come free";
}

TEST_F(DaemonFaults, ASlowClientGetsTheNewestAndAnEveryFrameClientIsDisconnected) {
  start_host_step();
  const auto slow = open();
  client::SubscribeOptions options;
  options.every_frame = true;
  const auto strict = open({}, options);
  ASSERT_TRUE(slow && strict);
  for (int i = 0; i < 200; ++i) {
    ASSERT_NO_FATAL_FAILURE(lock_step());
    if (i % 40 == 0) {
      const auto frame = slow->receive(kLongNs);
      ASSERT_TRUE(frame.has_value() && *frame != nullptr);
    }
  }
  std::uint64_t newest = 0;
  while (newest < asked_) {
    const auto frame = slow->receive(kLongNs);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_NE(*frame, nullptr);
    newest = (*frame)->header.host_frame_number;
  }
  EXPECT_EQ(slow->counters().lost, 0U);
  EXPECT_GT(slow->counters().skipped, 0U);
  for (;;) {
    const auto frame = strict->receive(kLongNs);
    if (!frame) {
      break;  // closed, after what was in the socket
    }
    ASSERT_NE(*frame, nullptr) << "never disconnected";
  }
  EXPECT_EQ(strict->counters().lost + strict->counters().gaps, 0U);
  EXPECT_LT(strict->counters().received, asked_);
}

TEST_F(DaemonFaults, ClientsThatWantEveryThirdFrameAllGetTheSameOnesWithoutAGap) {
  const std::string name = "faults-" + std::to_string(::getpid());
  start_host_step("[stream]\nshm = \"" + name + "\"\nshm_slots = 16\n");
  client::SubscribeOptions options;
  options.every_nth = 3;
  std::vector<std::unique_ptr<client::FrameClient>> thirds;
  for (const std::string& url : {control_, "udp://" + daemon_->control(), "shm://" + name}) {
    thirds.push_back(open(url, options));
    ASSERT_NE(thirds.back(), nullptr);
  }
  for (std::uint64_t k = 1; k <= 31; ++k) {
    ASSERT_NO_FATAL_FAILURE(lock_step());
    if (k % 3 != 1) continue;
    for (const auto& client : thirds) {
      const auto frame = client->receive(kLongNs);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      ASSERT_NE(*frame, nullptr);
      EXPECT_EQ((*frame)->header.frame_number, k);
      EXPECT_EQ((*frame)->header.flags & protocol::kFlagGapBefore, 0U);
    }
  }
  for (const auto& client : thirds) {
    EXPECT_EQ(client->counters().received, 11U);
    EXPECT_EQ(client->counters().lost + client->counters().gaps, 0U);
  }
  auto client = client::FrameClient::connect(control_);
  ASSERT_TRUE(client.has_value());
  options.every_nth = 1001;
  EXPECT_FALSE((*client)->subscribe(options).has_value());
}

TEST_F(DaemonFaults, AUdpClientLearnsTheFragmentSizeThatItGets) {
  start_host_step();
  const std::string url = "udp://" + daemon_->control();
  for (const auto& [asked, granted] : std::vector<std::pair<std::uint32_t, std::uint32_t>>{
           {1000, 1000}, {1441, 1440}, {10, 384}, {100'000, 65472}}) {
    client::SubscribeOptions options;
    options.fragment_payload_bytes = asked;
    const auto client = open(url, options);
    ASSERT_NE(client, nullptr);
    EXPECT_EQ(client->terms().fragment_payload_bytes, granted) << asked;
    ASSERT_NO_FATAL_FAILURE(lock_step());
    const auto frame = client->receive(kLongNs);
    EXPECT_TRUE(frame.has_value() && *frame != nullptr) << asked;
  }
  EXPECT_EQ(good_->terms().fragment_payload_bytes, 0U) << "there are no fragments over TCP";
}

TEST_F(DaemonFaults, ASilentHostIsFlaggedStaleUntilItSpeaksAgain) {
  start("mode = \"ig-clock\"\nrate_hz = 100\nhorizon_ms = 30");
  const auto client = open();
  ASSERT_NE(client, nullptr);
  const auto wait_for = [&](bool stale) {
    for (int frames = 0; frames < 3000; ++frames) {
      const auto frame = client->receive(kLongNs);
      ASSERT_TRUE(frame.has_value() && *frame != nullptr);
      if (((*frame)->header.flags & protocol::kFlagStale) != 0) {
        if (stale) return;
        ask();  // speaks with every frame that is still stale
      } else {
        if (!stale) return;
      }
    }
    FAIL() << "never " << (stale ? "stale" : "fresh");
  };
  ask();  // a canned frame is stale only once a host has spoken and fallen silent
  for (int round = 0; round < 3; ++round) {
    ASSERT_NO_FATAL_FAILURE(wait_for(true));
    ASSERT_NO_FATAL_FAILURE(wait_for(false));
  }
  EXPECT_EQ(client->counters().lost, 0U);
}

TEST_F(DaemonFaults, DuplicateReorderedAndLatePosesAreToldApartAndARestartIsANewRun) {
  start_host_step();
  const auto next_status = [&] {
    const auto status = host_->receive_status(kLongNs);
    EXPECT_TRUE(status.has_value() && status->has_value());
    return status && *status ? (*status)->code : 0U;
  };
  const auto send = [&](std::uint64_t run, std::uint64_t number, std::int64_t sim_ns) {
    protocol::HostFrameData frame;
    frame.run_id = run;
    frame.frame_number = number;
    frame.sim_time_ns = sim_ns;
    ASSERT_TRUE(host_->send(frame).has_value());
  };
  for (int i = 0; i < 5; ++i) ASSERT_NO_FATAL_FAILURE(lock_step());
  const auto first = good_->counters().received;
  send(1, 5, 25'000'000);  // the same again
  EXPECT_EQ(next_status(), 8U);
  send(1, 3, 15'000'000);  // overtaken by 4 and 5
  EXPECT_EQ(next_status(), 7U);
  send(1, 9, 20'000'000);  // late: of an instant that is over
  EXPECT_EQ(next_status(), 7U);
  ASSERT_NO_FATAL_FAILURE(lock_step());
  EXPECT_EQ(good_->counters().received, first + 1) << "nothing refused made a frame";

  send(2, 1, 0);  // the host restarted
  const auto frame = good_->receive(kLongNs);
  ASSERT_TRUE(frame.has_value() && *frame != nullptr);
  const std::uint64_t new_run = (*frame)->header.run_id;
  EXPECT_EQ((*frame)->header.frame_number, 1U);
  EXPECT_EQ((*frame)->header.sim_time_ns, 0);
  send(1, 7, 35'000'000);  // a packet of the run before
  EXPECT_EQ(next_status(), 10U);
  send(2, 2, 5'000'000);
  const auto second = good_->receive(kLongNs);
  ASSERT_TRUE(second.has_value() && *second != nullptr);
  EXPECT_EQ((*second)->header.run_id, new_run);
  EXPECT_EQ((*second)->header.frame_number, 2U);
  EXPECT_EQ(good_->counters().lost, 0U);
}

}  // namespace
}  // namespace emit::server
