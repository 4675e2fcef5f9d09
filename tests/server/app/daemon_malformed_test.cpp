// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <limits>
#include <random>

#include "emit/client/client.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/framing.hpp"
#include "net/socket.hpp"
#include "rt/fd.hpp"
#include "support/daemon_process.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;

using emit::test::kLongNs;

class MalformedTraffic : public ::testing::Test {
 protected:
  void SetUp() override {
    const std::string config =
        folder_.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\""));
    daemon_ =
        std::make_unique<DaemonProcess>(folder_, std::vector<std::string>{"--config", config});
    ASSERT_TRUE(daemon_->wait_ready()) << folder_.read("stderr");
  }
  void TearDown() override {
    if (daemon_) {
      expect_serving();
      daemon_->signal(SIGTERM);
      EXPECT_EQ(daemon_->wait(), 0) << folder_.read("stderr");
    }
  }

  /// Checks that a well-behaved client gets its frame.
  void expect_serving() {
    ASSERT_FALSE(daemon_->ended()) << folder_.read("stderr");
    auto client = client::FrameClient::connect("tcp://" + daemon_->control());
    ASSERT_TRUE(client.has_value()) << client.error().text;
    ASSERT_TRUE((*client)->subscribe({}).has_value());
    auto host = client::HostClient::connect("tcp://" + daemon_->control());
    ASSERT_TRUE(host.has_value()) << host.error().text;
    protocol::HostFrameData frame;
    frame.frame_number = 1;
    frame.run_id = ++run_id_;
    ASSERT_TRUE((*host)->send(frame).has_value());
    const auto received = (*client)->receive(kLongNs);
    ASSERT_TRUE(received.has_value()) << received.error().text;
    ASSERT_NE(*received, nullptr);
  }
  [[nodiscard]] SocketAddress address(const std::string& text) const {
    const auto where = parse_host_port(text);
    return numeric_address(where->host, where->port);
  }
  [[nodiscard]] TcpSocket raw_tcp() const {
    auto socket = TcpSocket::connect(SocketContext(), address(daemon_->control()), kLongNs);
    EXPECT_TRUE(socket.has_value()) << socket.error().text;
    return socket ? std::move(*socket) : TcpSocket();
  }

  ScratchFolder folder_;
  std::unique_ptr<DaemonProcess> daemon_;
  std::uint64_t run_id_ = 1'000'000;
};

std::vector<std::byte> random_bytes(std::mt19937& random, std::size_t most) {
  std::vector<std::byte> bytes(std::uniform_int_distribution<std::size_t>(0, most)(random));
  std::generate(bytes.begin(), bytes.end(),
                [&] { return static_cast<std::byte>(random() & 0xFF); });
  return bytes;
}

TEST_F(MalformedTraffic, RandomDatagramsAreCountedAndAnswered) {
  std::mt19937 random(1);
  const auto target = address(daemon_->host_udp());
  Fd fd(::socket(AF_INET, SOCK_DGRAM, 0));
  ASSERT_EQ(::connect(fd.get(), target.get(), target.length), 0);
  protocol::HostFrameEncoder encoder;
  protocol::HostFrameData frame;
  frame.frame_number = 3;
  frame.entity_count = 4;
  for (std::uint32_t i = 0; i < 4; ++i) {
    frame.entities[i].entity_id = i + 1;
    frame.entities[i].has_pose = true;
  }
  const auto good = encoder.encode(frame);
  for (int i = 0; i < 2000; ++i) {
    auto bytes = random_bytes(random, 1500);
    if (i % 2 == 0) {
      // The bytes are a valid message with a few of them changed.
      bytes.assign(good.begin(), good.end());
      for (int k = 0; k < 3; ++k) {
        bytes[random() % bytes.size()] = static_cast<std::byte>(random() & 0xFF);
      }
    }
    ASSERT_GE(::send(fd.get(), bytes.data(), bytes.size(), 0), 0);
  }
}

TEST_F(MalformedTraffic, ANanPoseIsRefusedWithItsStatus) {
  auto host = client::HostClient::connect("udp://" + daemon_->host_udp());
  ASSERT_TRUE(host.has_value());
  protocol::HostFrameData frame;
  frame.frame_number = 77;
  frame.seeker.position_world_m.y = std::numeric_limits<double>::quiet_NaN();
  ASSERT_TRUE((*host)->send(frame).has_value());
  const auto status = (*host)->receive_status(kLongNs);
  ASSERT_TRUE(status.has_value()) << status.error().text;
  ASSERT_TRUE(status->has_value());
  EXPECT_EQ((*status)->code, 6U);
  EXPECT_EQ((*status)->host_frame_number, 77U);
  EXPECT_GE((*status)->count, 1U);
  EXPECT_NE((*status)->text.find("seeker: position_m.y is nan, must be"), std::string::npos)
      << (*status)->text;
}

TEST_F(MalformedTraffic, AnEntitysPoseOutOfRangeIsNamedOverTcpAsWell) {
  auto host = client::HostClient::connect("tcp://" + daemon_->control());
  ASSERT_TRUE(host.has_value());
  protocol::HostFrameData frame;
  frame.frame_number = 1;
  frame.entity_count = 1;
  frame.entities[0].entity_id = 12;
  frame.entities[0].has_pose = true;
  frame.entities[0].pose.position_world_m.x = 1e9;
  ASSERT_TRUE((*host)->send(frame).has_value());
  const auto status = (*host)->receive_status(kLongNs);
  ASSERT_TRUE(status.has_value() && status->has_value());
  EXPECT_NE((*status)->text.find("entity 12: position_m.x is 1000000000, must be"),
            std::string::npos)
      << (*status)->text;
}

/// Returns everything that comes on a connection until the daemon closes it. The test fails when it
/// does not.
void read_to_end(const TcpSocket& socket, std::string& answer) {
  std::array<char, 1024> buffer;
  for (;;) {
    pollfd wait{socket.fd(), POLLIN, 0};
    ASSERT_GT(::poll(&wait, 1, 20'000), 0) << "no end of the connection";
    const ssize_t got = ::recv(socket.fd(), buffer.data(), buffer.size(), 0);
    if (got <= 0) {
      return;
    }
    answer.append(buffer.data(), static_cast<std::size_t>(got));
  }
}

TEST_F(MalformedTraffic, AnyFirstRecordButAHelloIsAnsweredAndClosed) {
  // The records are a frame, a host frame, a resend request, and an unknown kind.
  for (const int kind : {2, 3, 4, 77}) {
    SCOPED_TRACE(kind);
    const TcpSocket socket = raw_tcp();
    std::array<std::byte, protocol::kRecordHeaderBytes> record{};
    protocol::encode_record_header(static_cast<protocol::RecordKind>(kind), 0, record);
    ASSERT_GT(::send(socket.fd(), record.data(), record.size(), MSG_NOSIGNAL), 0);
    std::string answer;
    ASSERT_NO_FATAL_FAILURE(read_to_end(socket, answer));
    EXPECT_NE(answer.find("hello comes first"), std::string::npos);
  }
}

TEST_F(MalformedTraffic, RandomBytesOnTheControlPortEndOnlyTheirConnection) {
  std::mt19937 random(2);
  for (int i = 0; i < 60; ++i) {
    const TcpSocket socket = raw_tcp();
    auto bytes = random_bytes(random, 4000);
    if (i % 3 == 0 && bytes.size() >= protocol::kRecordHeaderBytes) {
      // A record with right framing and a random body reaches the parser of control records.
      protocol::encode_record_header(
          protocol::RecordKind::control,
          static_cast<std::uint32_t>(bytes.size() - protocol::kRecordHeaderBytes),
          std::span(bytes).first<protocol::kRecordHeaderBytes>());
    }
    static_cast<void>(::send(socket.fd(), bytes.data(), bytes.size(), MSG_NOSIGNAL));
  }
}

TEST_F(MalformedTraffic, AnOversizeRecordIsAnsweredAndClosed) {
  const TcpSocket socket = raw_tcp();
  std::array<std::byte, protocol::kRecordHeaderBytes> header{};
  protocol::encode_record_header(protocol::RecordKind::control, 0xFFFFFFF0U, header);
  ASSERT_GT(::send(socket.fd(), header.data(), header.size(), MSG_NOSIGNAL), 0);
  std::string answer;
  ASSERT_NO_FATAL_FAILURE(read_to_end(socket, answer));
  EXPECT_NE(answer.find("record:"), std::string::npos) << "a status comes before the end";
}

TEST_F(MalformedTraffic, AnUnknownChannelIsNamedTogetherWithTheKnownOnes) {
  auto client = client::FrameClient::connect("tcp://" + daemon_->control());
  ASSERT_TRUE(client.has_value());
  client::SubscribeOptions options;
  options.band = "x-rays";
  const auto channel = (*client)->subscribe(options);
  ASSERT_FALSE(channel.has_value());
  EXPECT_NE(channel.error().text.find("x-rays"), std::string::npos);
  EXPECT_NE(channel.error().text.find("injection/canned/canned"), std::string::npos);
}

TEST_F(MalformedTraffic, MoreConnectionsThanAllowedAreRefusedWithAReason) {
  std::vector<std::unique_ptr<client::HostClient>> hosts;
  std::string refusal;
  for (int i = 0; i < 20; ++i) {
    auto host = client::HostClient::connect("tcp://" + daemon_->control());
    if (!host) {
      refusal = host.error().text;
      break;
    }
    hosts.push_back(std::move(*host));
  }
  EXPECT_EQ(hosts.size(), 16U);
  EXPECT_NE(refusal.find("max_clients"), std::string::npos) << refusal;
  hosts.clear();
  // The daemon notices the ends in its own time.
  for (int attempt = 0; attempt < 200; ++attempt) {
    if (client::FrameClient::connect("tcp://" + daemon_->control())) {
      return;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  FAIL() << "places do not come free";
}

}  // namespace
}  // namespace emit::server
