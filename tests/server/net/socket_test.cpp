// SPDX-License-Identifier: Apache-2.0
#include "net/socket.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <net/if.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sched.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "client/client_connection.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/version.hpp"
#include "emit/v1/control.pb.h"
#include "support/times.hpp"

namespace emit::server {
namespace {

using emit::test::kLongNs;

bool readable(int fd) {
  pollfd wait{fd, POLLIN, 0};
  return ::poll(&wait, 1, 20'000) == 1;
}

std::span<const std::byte> bytes_of(const std::string& text) {
  return std::as_bytes(std::span(text));
}

/// A listener on the loopback interface with one connection.
class TcpPair : public ::testing::Test {
 protected:
  void SetUp() override {
    auto listener = TcpListener::open(context_, numeric_address("127.0.0.1", 0));
    ASSERT_TRUE(listener.has_value()) << listener.error().text;
    listener_ = std::move(*listener);
    auto client = TcpSocket::connect(SocketContext(), listener_.local_address(), kLongNs);
    ASSERT_TRUE(client.has_value()) << client.error().text;
    client_ = std::move(*client);
    ASSERT_TRUE(readable(listener_.fd()));
    int error = 0;
    server_ = listener_.accept(peer_, error);
    ASSERT_TRUE(static_cast<bool>(server_));
  }

  SocketContext context_;
  TcpListener listener_;
  TcpSocket client_;
  TcpSocket server_;
  SocketAddress peer_;
};

std::string congestion_control_of(int fd) {
  std::array<char, 17> name{};
  socklen_t length = 16;
  return ::getsockopt(fd, IPPROTO_TCP, TCP_CONGESTION, name.data(), &length) == 0 ? name.data()
                                                                                  : "?";
}

/// A network of this thread's own, in which it may set the system's choice.
class OwnNetwork {
 public:
  /// Returns the reason why there is none; empty: there is one, with a loopback interface.
  [[nodiscard]] static std::string enter() {
    if (::unshare(CLONE_NEWNET) != 0) {
      return "no right to a network of its own";
    }
    const int fd = ::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    ifreq request{};
    std::strcpy(request.ifr_name, "lo");
    request.ifr_flags = IFF_UP;
    const bool up = ::ioctl(fd, SIOCSIFFLAGS, &request) == 0;
    ::close(fd);
    return up ? "" : "no loopback interface";
  }
  /// Sets the choice. It returns false when this kernel does not have it, or nobody may choose.
  [[nodiscard]] static bool choose(const std::string& system) {
    std::ofstream(kFile) << system << std::flush;
    std::string chosen;
    std::ifstream(kFile) >> chosen;
    return chosen == system;
  }

 private:
  static constexpr const char* kFile = "/proc/sys/net/ipv4/tcp_congestion_control";
};

/// Returns the congestion control of an accepted connection, whose listener was opened under one
/// choice of the system and accepted under another.
std::string accepted_congestion_control(const std::string& at_open, const std::string& at_accept,
                                        CongestionControl& told) {
  const SocketContext context;
  if (!OwnNetwork::choose(at_open)) {
    return "-";
  }
  auto listener = TcpListener::open(context, numeric_address("127.0.0.1", 0));
  EXPECT_TRUE(listener.has_value()) << listener.error().text;
  if (!listener || !OwnNetwork::choose(at_accept)) {
    return "-";
  }
  told = listener->congestion_control();
  auto client = TcpSocket::connect(SocketContext(), listener->local_address(), kLongNs);
  EXPECT_TRUE(client.has_value()) << client.error().text;
  EXPECT_TRUE(readable(listener->fd()));
  SocketAddress peer;
  int accept_error = 0;
  const TcpSocket server = listener->accept(peer, accept_error);
  return server ? congestion_control_of(server.fd()) : "none";
}

TEST(TcpListener, ConnectionsHaveTheSystemsCongestionControlUnlessThatIsBbr) {
  std::string skipped;
  std::thread([&] {
    skipped = OwnNetwork::enter();
    if (!skipped.empty()) {
      return;
    }
    if (!OwnNetwork::choose("bbr") || !OwnNetwork::choose("reno")) {
      skipped = "no bbr and reno to choose from";
      return;
    }
    CongestionControl told;
    EXPECT_THAT(accepted_congestion_control("bbr", "bbr", told), ::testing::AnyOf("cubic", "reno"));
    EXPECT_EQ(told.system, "bbr");
    EXPECT_THAT(told.chosen, ::testing::AnyOf("cubic", "reno"));
    EXPECT_EQ(accepted_congestion_control("reno", "reno", told), "reno");
    EXPECT_EQ(told.chosen + " " + told.system, "reno reno");
    EXPECT_EQ(accepted_congestion_control("reno", "bbr", told), "reno")
        << "also when the system chooses another later";
    EXPECT_EQ(told.chosen, "reno");
  }).join();
  if (!skipped.empty()) {
    GTEST_SKIP() << skipped;
  }
}

TEST(TcpListener, TheSystemsCongestionControlIsThatOfANewSocket) {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  EXPECT_EQ(system_congestion_control(), congestion_control_of(fd));
  ::close(fd);
}

TEST_F(TcpPair, AcceptedAndConnectedSocketsNeitherBlockNorReachChildProcesses) {
  for (const int fd : {listener_.fd(), client_.fd(), server_.fd()}) {
    EXPECT_NE(::fcntl(fd, F_GETFL) & O_NONBLOCK, 0);
    EXPECT_NE(::fcntl(fd, F_GETFD) & FD_CLOEXEC, 0);
  }
  SocketAddress nobody;
  int error = -1;
  EXPECT_FALSE(static_cast<bool>(listener_.accept(nobody, error)));
  EXPECT_EQ(error, 0);
  EXPECT_EQ(to_string(peer_).substr(0, 10), "127.0.0.1:");
}

TEST_F(TcpPair, BothSidesAskWhetherTheOtherIsStillThere) {
  for (const TcpSocket* socket : {&client_, &server_}) {
    const auto option = [&](int level, int name) {
      int value = 0;
      socklen_t length = sizeof value;
      EXPECT_EQ(::getsockopt(socket->fd(), level, name, &value, &length), 0);
      return value;
    };
    EXPECT_EQ(option(SOL_SOCKET, SO_KEEPALIVE), 1);
    EXPECT_EQ(option(IPPROTO_TCP, TCP_KEEPIDLE) +
                  option(IPPROTO_TCP, TCP_KEEPCNT) * option(IPPROTO_TCP, TCP_KEEPINTVL),
              25);
  }
}

TEST_F(TcpPair, PiecesArriveInOrder) {
  const std::string one = "one ";
  const std::string two = "two ";
  const std::string three = "three";
  const std::array<std::span<const std::byte>, 3> pieces{bytes_of(one), bytes_of(two),
                                                         bytes_of(three)};
  const IoResult sent = client_.write_some(pieces);
  ASSERT_EQ(sent.status, IoStatus::done);
  EXPECT_EQ(sent.bytes, 13U);
  ASSERT_TRUE(readable(server_.fd()));
  std::array<std::byte, 64> space{};
  const IoResult got = server_.read_some(space);
  ASSERT_EQ(got.bytes, 13U);
  EXPECT_TRUE(std::ranges::equal(std::span(space).first(13), bytes_of("one two three")));
  EXPECT_EQ(server_.read_some(space).status, IoStatus::would_block);
}

TEST_F(TcpPair, IsReadableOnlyWhenAsMuchWaitsAsWasAskedFor) {
  const auto readable_now = [&] {
    pollfd wait{server_.fd(), POLLIN, 0};
    return ::poll(&wait, 1, 0) == 1;
  };
  const auto waiting_bytes = [&] {
    int bytes = 0;
    return ::ioctl(server_.fd(), FIONREAD, &bytes) == 0 ? bytes : -1;
  };
  server_.set_receive_low_water(10);
  ASSERT_EQ(client_.write_some(bytes_of("123456789")).bytes, 9U);
  std::array<std::byte, 16> space{};
  while (waiting_bytes() < 9) {
  }
  EXPECT_FALSE(readable_now());
  ASSERT_EQ(client_.write_some(bytes_of("0")).bytes, 1U);
  EXPECT_TRUE(readable(server_.fd()));
  ASSERT_EQ(server_.read_some(space).bytes, 10U);
  ASSERT_EQ(client_.write_some(bytes_of("1")).bytes, 1U);
  while (waiting_bytes() < 1) {
  }
  EXPECT_FALSE(readable_now());
  server_.set_receive_low_water(1);
  EXPECT_TRUE(readable(server_.fd()));
  server_.set_receive_low_water(10);
  client_.shutdown_send();
  EXPECT_TRUE(readable(server_.fd())) << "the end comes at once";
}

int low_water_of(int fd) {
  int bytes = 0;
  socklen_t length = sizeof bytes;
  ::getsockopt(fd, SOL_SOCKET, SO_RCVLOWAT, &bytes, &length);
  return bytes;
}

/// The client's end, welcomed by the bytes of `server`.
physics::Result<client::ClientConnection> greeted(TcpSocket& server, TcpSocket client,
                                                  const SocketAddress& peer) {
  std::vector<std::byte> welcome;
  v1::ControlRecord answer;
  answer.mutable_welcome()->set_protocol_version(protocol::kProtocolVersion);
  protocol::append_control_record(answer, welcome);
  EXPECT_EQ(server.write_some(std::span<const std::byte>(welcome)).bytes, welcome.size());
  return client::ClientConnection::greet(SocketContext(), std::move(client), peer,
                                         protocol::PeerRole::client,
                                         client::monotonic_now_ns() + kLongNs);
}

/// Returns a frame record with a body of zeros.
std::vector<std::byte> frame_record(std::uint32_t body_bytes) {
  std::vector<std::byte> out(protocol::kRecordHeaderBytes + body_bytes);
  protocol::encode_record_header(protocol::RecordKind::frame, body_bytes,
                                 std::span(out).first<protocol::kRecordHeaderBytes>());
  return out;
}

TEST_F(TcpPair, AClientIsWokenByPiecesOfARecordAndByTheFirstByteOfTheNext) {
  const int fd = client_.fd();
  auto connection = greeted(server_, std::move(client_), peer_);
  ASSERT_TRUE(connection.has_value()) << connection.error().text;
  constexpr std::uint32_t kBodyBytes = 400'000;
  connection->allow_frames(kBodyBytes);
  const std::vector<std::byte> stream = frame_record(kBodyBytes);
  protocol::Record record;
  std::size_t given = 0;
  /// Sends up to `end` of the stream, until the client waits for `low_water` bytes.
  const auto arrive = [&](std::size_t end, int low_water) {
    const std::int64_t end_ns = client::monotonic_now_ns() + kLongNs;
    do {
      given +=
          server_.write_some(std::span<const std::byte>(stream).subspan(given, end - given)).bytes;
      EXPECT_FALSE(connection->receive(record, client::monotonic_now_ns()).value());
    } while ((given < end || low_water_of(fd) != low_water) && client::monotonic_now_ns() < end_ns);
    EXPECT_EQ(low_water_of(fd), low_water);
  };
  arrive(5, 1);
  arrive(1000, 128 << 10);
  arrive(stream.size() - 900, 900);
  ASSERT_EQ(server_.write_some(std::span<const std::byte>(stream).subspan(given)).bytes, 900U);
  ASSERT_TRUE(connection->receive(record, client::monotonic_now_ns() + kLongNs).value());
  EXPECT_EQ(record.body.size(), kBodyBytes);
  EXPECT_EQ(low_water_of(fd), 1);
}

TEST_F(TcpPair, FramesComeToLieInOnePlaceHoweverManyWait) {
  auto connection = greeted(server_, std::move(client_), peer_);
  ASSERT_TRUE(connection.has_value()) << connection.error().text;
  constexpr std::uint32_t kBodyBytes = 700'000;
  constexpr int kFrames = 5;
  connection->allow_frames(kBodyBytes);
  std::vector<std::byte> stream;
  for (int i = 0; i < kFrames; ++i) {
    const std::vector<std::byte> record = frame_record(kBodyBytes);
    stream.insert(stream.end(), record.begin(), record.end());
  }
  const std::byte* place = nullptr;
  std::span<const std::byte> rest(stream);
  for (int frames = 0; frames < kFrames;) {
    // Write ahead of the client as much as the sockets hold.
    while (!rest.empty()) {
      const IoResult sent = server_.write_some(rest);
      if (sent.status != IoStatus::done) break;
      rest = rest.subspan(sent.bytes);
    }
    protocol::Record record;
    const auto received = connection->receive(record, client::monotonic_now_ns());
    ASSERT_TRUE(received.has_value()) << received.error().text;
    if (!*received) continue;
    ASSERT_EQ(record.body.size(), kBodyBytes);
    if (frames++ == 0) place = record.body.data();
    EXPECT_EQ(record.body.data(), place) << "nothing of it came with the frame before";
  }
}

TEST_F(TcpPair, TheEndOfAStreamIsToldApartFromFailures) {
  client_.shutdown_send();
  ASSERT_TRUE(readable(server_.fd()));
  std::array<std::byte, 8> space{};
  EXPECT_EQ(server_.read_some(space).status, IoStatus::closed);
  EXPECT_EQ(server_.read_some({}).status, IoStatus::failed) << "no space is no end";
  const IoResult sent = client_.write_some(bytes_of("late"));
  EXPECT_EQ(sent.status, IoStatus::failed);
  EXPECT_EQ(sent.error, EPIPE) << "and no signal";
}

TEST_F(TcpPair, AFullSocketTakesPartThenNothing) {
  const std::vector<std::byte> much(64u << 20);
  std::size_t sent = 0;
  IoResult result;
  while ((result = client_.write_some(std::span<const std::byte>(much))).status == IoStatus::done) {
    sent += result.bytes;
  }
  EXPECT_EQ(result.status, IoStatus::would_block);
  EXPECT_GT(sent, 0U);
  EXPECT_LT(sent, much.size());
}

TEST(TcpSocket, NamesAddressAndReasonWhenNobodyListens) {
  SocketContext context;
  SocketAddress address;
  {
    auto listener = TcpListener::open(context, numeric_address("127.0.0.1", 0));
    ASSERT_TRUE(listener.has_value());
    address = listener->local_address();
    const auto taken = TcpListener::open(context, address);
    ASSERT_FALSE(taken.has_value());
    EXPECT_EQ(taken.error().text.find("tcp " + to_string(address) + ": Address already in use"), 0U)
        << taken.error().text;
  }
  const auto refused = TcpSocket::connect(context, address, kLongNs);
  ASSERT_FALSE(refused.has_value());
  EXPECT_EQ(refused.error().text, "tcp " + to_string(address) + ": Connection refused");
}

TEST(TcpSocket, GivesUpOnAConnectionThatNobodyAnswersInTime) {
  SocketContext context;
  auto listener = TcpListener::open(context, numeric_address("127.0.0.1", 0));
  ASSERT_TRUE(listener.has_value());
  // The queue of connections nobody accepts fills up; then the kernel leaves new ones unanswered.
  std::vector<TcpSocket> waiting;
  for (int i = 0; i < 200; ++i) {
    auto socket = TcpSocket::connect(context, listener->local_address(), 50'000'000);
    if (!socket) {
      EXPECT_EQ(socket.error().text,
                "tcp " + to_string(listener->local_address()) + ": no answer within the timeout");
      return;
    }
    waiting.push_back(std::move(*socket));
  }
  FAIL() << "200 connections in a queue of 32";
}

TEST(UdpSocket, SendsToAddressesAndHearsThatNobodyListens) {
  SocketContext context;
  auto here = UdpSocket::open_bound(context, numeric_address("127.0.0.1", 0));
  auto there = UdpSocket::open_bound(context, numeric_address("127.0.0.1", 0));
  ASSERT_TRUE(here.has_value() && there.has_value());
  EXPECT_EQ(here->send_to(bytes_of("hello"), there->local_address()).bytes, 5U);
  ASSERT_TRUE(readable(there->fd()));
  std::array<std::byte, 64> space{};
  EXPECT_EQ(there->receive(space).bytes, 5U);
  EXPECT_EQ(there->receive(space).status, IoStatus::would_block);

  const SocketAddress gone = there->local_address();
  *there = UdpSocket();
  ASSERT_TRUE(here->connect(gone).has_value());
  ASSERT_EQ(here->send(bytes_of("anybody?")).status, IoStatus::done);
  ASSERT_TRUE(readable(here->fd()));
  const IoResult got = here->receive(space);
  EXPECT_EQ(got.status, IoStatus::failed);
  EXPECT_EQ(got.error, ECONNREFUSED);
}

TEST(UdpSocket, SharesThePortOfAGroupOnlyWhenAllowed) {
  SocketContext context;
  const SocketAddress any = numeric_address("239.255.12.34", 0);
  auto first = UdpSocket::open(context, any);
  ASSERT_TRUE(first.has_value());
  first->allow_shared_port();
  ASSERT_TRUE(first->bind(any).has_value());
  const SocketAddress taken = first->local_address();
  auto second = UdpSocket::open(context, taken);
  ASSERT_TRUE(second.has_value());
  const auto refused = second->bind(taken);
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().text.find("Address already in use"), std::string::npos);
  second->allow_shared_port();
  EXPECT_TRUE(second->bind(taken).has_value());
  EXPECT_EQ(first->join_group(numeric_address("10.0.0.1", 0), 0), EINVAL);
}

TEST(SocketAddress, ReadsNumbersOnlyAndKnowsGroups) {
  EXPECT_EQ(numeric_address("localhost", 1).length, 0U);
  EXPECT_EQ(numeric_address("", 1).length, 0U);
  EXPECT_EQ(to_string(SocketAddress{}), "unknown address");
  SocketAddress v6 = numeric_address("::1", 7000);
  EXPECT_EQ(to_string(v6), "[::1]:7000");
  v6.set_port(7001);
  EXPECT_EQ(v6.port(), 7001);
  EXPECT_FALSE(v6.is_multicast());
  EXPECT_TRUE(numeric_address("ff02::1", 1).is_multicast());
  EXPECT_TRUE(numeric_address("239.1.2.3", 1).is_multicast());
  EXPECT_FALSE(numeric_address("127.0.0.1", 1).is_multicast());
  EXPECT_FALSE(SocketAddress{}.is_multicast());
}

TEST(Resolve, TakesNumbersAndNamesWhatItCannotFind) {
  const auto number = resolve({"127.0.0.1", 7000}, Transport::tcp, false);
  ASSERT_TRUE(number.has_value()) << number.error().text;
  EXPECT_EQ(to_string(*number), "127.0.0.1:7000");
  const auto every = resolve({"", 7000}, Transport::udp, true);
  ASSERT_TRUE(every.has_value());
  EXPECT_EQ(every->port(), 7000);
  // This name is reserved and never exists (RFC 6761). Without a name service the reason is
  // another.
  const auto nowhere = resolve({"host.invalid", 7000}, Transport::tcp, false);
  ASSERT_FALSE(nowhere.has_value());
  EXPECT_EQ(nowhere.error().text.substr(0, 19), "host.invalid:7000: ");
}

}  // namespace
}  // namespace emit::server
