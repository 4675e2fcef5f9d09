// SPDX-License-Identifier: Apache-2.0
// A peer on another host that proves nothing: no frame, no change of state, no crash. The other
// host is a network namespace behind a virtual cable.
#include <gtest/gtest.h>
#include <linux/if_ether.h>
#include <linux/if_packet.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <algorithm>
#include <csignal>
#include <optional>
#include <ostream>
#include <random>

#include "client/http_get.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/host_session.hpp"
#include "emit/v1/control.pb.h"
#include "net/socket_address.hpp"
#include "rt/fd.hpp"
#include "support/certificates.hpp"
#include "support/daemon_process.hpp"
#include "support/exposition.hpp"
#include "support/times.hpp"
#include "support/two_networks.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;
using test::TwoNetworks;
using Bytes = std::vector<std::byte>;

using emit::test::kLongNs;

protocol::HostFrameData host_frame(std::uint64_t number, std::uint64_t run_id = 1) {
  protocol::HostFrameData frame;
  frame.frame_number = number;
  frame.sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
  frame.run_id = run_id;
  return frame;
}

Bytes bare_datagram(std::uint64_t number, std::uint64_t run_id) {
  protocol::HostFrameEncoder encoder;
  const auto bytes = encoder.encode(host_frame(number, run_id));
  return {bytes.begin(), bytes.end()};
}

Bytes record(const v1::ControlRecord& message) {
  Bytes out;
  protocol::append_control_record(message, out);
  return out;
}

Bytes hello(v1::Hello::Role role) {
  v1::ControlRecord out;
  out.mutable_hello()->set_protocol_version(1);
  out.mutable_hello()->set_role(role);
  return record(out);
}

Bytes subscribe(std::uint32_t udp_port, const char* group) {
  v1::ControlRecord out;
  out.mutable_subscribe()->set_udp_port(udp_port);
  out.mutable_subscribe()->set_multicast_group(group);
  return record(out);
}

Bytes garbage(std::size_t length) {
  std::mt19937 random(7);
  Bytes out(length);
  for (std::byte& byte : out) byte = static_cast<std::byte>(random());
  return out;
}

/// The configuration of a daemon that other hosts reach by both families.
std::string config(const std::string& address, const std::string& protections,
                   const std::string& host_more = {}) {
  return "[source]\nkind = \"canned\"\ncanned_width_px = 64\ncanned_height_px = 48\n"
         "[pacing]\nmode = \"host-step\"\n[metrics]\nlisten = \"127.0.0.1:0\"\n[journal]\nfile = "
         "\"run.mcap\"\n"
         "[control]\ntcp = \"" +
         address + ":0\"\n[host]\nudp = \"" + address + ":0\"\n" + host_more + protections;
}

std::uint16_t port_of(const std::string& endpoint) {
  return parse_host_port(endpoint)->port;
}

/// A peer at the other end of the cable.
class Stranger {
 public:
  Stranger(TwoNetworks& networks, const DaemonProcess& daemon, std::string address)
      : networks_(networks),
        control_(numeric_address(address, port_of(daemon.control()))),
        host_(numeric_address(address, port_of(daemon.host_udp()))) {
    frames_ = socket_there(SOCK_DGRAM);
    SocketAddress any =
        numeric_address(control_.storage.ss_family == AF_INET6 ? "::" : "0.0.0.0", 0);
    ::bind(frames_.get(), any.get(), any.length);
    socklen_t length = sizeof any.storage;
    ::getsockname(frames_.get(), any.get(), &length);
    any.length = length;
    frames_port_ = any.port();
  }

  Fd connect() {
    Fd fd = socket_there(SOCK_STREAM);
    const timeval limit{30, 0};
    ::setsockopt(fd.get(), SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    if (::connect(fd.get(), control_.get(), control_.length) != 0) fd.reset();
    return fd;
  }
  /// Connects, sends these bytes and returns the daemon's until it closes. The result is empty
  /// without a connection.
  std::optional<Bytes> say(const std::vector<Bytes>& pieces) {
    const Fd fd = connect();
    if (!fd) return std::nullopt;
    for (const Bytes& piece : pieces) {
      if (::send(fd.get(), piece.data(), piece.size(), MSG_NOSIGNAL) < 0) break;
    }
    ::shutdown(fd.get(), SHUT_WR);
    Bytes heard;
    std::array<std::byte, 4096> space;
    for (ssize_t got = 0; (got = ::recv(fd.get(), space.data(), space.size(), 0)) > 0;) {
      heard.insert(heard.end(), space.begin(), space.begin() + got);
    }
    return heard;
  }

  void datagram(const Bytes& bytes) {
    ::sendto(frames_.get(), bytes.data(), bytes.size(), 0, host_.get(), host_.length);
  }
  /// Returns the datagrams that came back: answers or frames.
  std::size_t datagrams_heard() {
    std::size_t count = 0;
    std::array<std::byte, 65536> space;
    while (::recv(frames_.get(), space.data(), space.size(), MSG_DONTWAIT) >= 0) ++count;
    return count;
  }

  /// Tries everything without a certificate, a key or an allowed address.
  void try_everything(const std::vector<Bytes>& recorded) {
    const Bytes client = hello(v1::Hello::ROLE_CLIENT);
    const Bytes host = hello(v1::Hello::ROLE_HOST);
    v1::ControlRecord reset;
    reset.mutable_command()->set_kind(v1::Command::KIND_RESET);
    v1::ControlRecord pose;
    protocol::to_proto(host_frame(1000, 99), *pose.mutable_host_frame());
    const std::vector<std::vector<Bytes>> speeches = {
        {},
        {garbage(1)},
        {garbage(100'000)},
        {client},
        {client, subscribe(0, "")},
        {client, subscribe(frames_port_, "")},
        {client, subscribe(frames_port_, "239.255.1.2")},
        {client, subscribe(frames_port_, "192.0.2.1")},
        {host, record(pose)},
        {host, record(reset)},
        {hello(v1::Hello::ROLE_RECORDER)}};
    for (const auto& speech : speeches) {
      const auto heard = say(speech);
      if (heard) longest_heard_ = std::max(longest_heard_, heard->size());
    }
    datagram({});
    datagram(garbage(1));
    datagram(garbage(1400));
    datagram(bare_datagram(1000, 99));
    datagram(bare_datagram(1000, 1));
    for (const Bytes& genuine : recorded) {
      datagram(genuine);
      Bytes forged = genuine;
      forged.back() ^= std::byte{1};
      datagram(forged);
      forged = genuine;
      forged[24] ^= std::byte{0x40};  // the counter, as if it were a later one
      datagram(forged);
      forged = genuine;
      forged[8] ^= std::byte{1};  // another key
      datagram(forged);
    }
  }
  [[nodiscard]] std::size_t longest_heard() const { return longest_heard_; }

 private:
  Fd socket_there(int type) {
    networks_.enter_there();
    Fd out(::socket(control_.storage.ss_family, type | SOCK_CLOEXEC, 0));
    networks_.enter_here();
    return out;
  }

  TwoNetworks& networks_;
  SocketAddress control_;
  SocketAddress host_;
  Fd frames_;
  std::uint16_t frames_port_ = 0;
  std::size_t longest_heard_ = 0;
};

/// Records copies of the datagrams that a program on this host sends to the host port.
class Recording {
 public:
  explicit Recording(std::uint16_t port)
      : port_(port), fd_(::socket(AF_PACKET, SOCK_DGRAM | SOCK_CLOEXEC, htons(ETH_P_IP))) {}

  std::vector<Bytes> take() {
    std::array<std::byte, 65536> space;
    std::vector<Bytes> out;
    for (;;) {
      sockaddr_ll from{};
      socklen_t length = sizeof from;
      const ssize_t got = ::recvfrom(fd_.get(), space.data(), space.size(), MSG_DONTWAIT,
                                     reinterpret_cast<sockaddr*>(&from), &length);
      if (got < 0) return out;
      const auto byte = [&](std::size_t at) { return std::to_integer<unsigned>(space[at]); };
      const std::size_t head = (byte(0) & 15U) * 4;
      const bool udp = byte(9) == IPPROTO_UDP;
      if (from.sll_pkttype == PACKET_OUTGOING || !udp ||
          (byte(head + 2) << 8U | byte(head + 3)) != port_) {
        continue;
      }
      out.emplace_back(space.begin() + static_cast<std::ptrdiff_t>(head + 8), space.begin() + got);
    }
  }

 private:
  std::uint16_t port_;
  Fd fd_;
};

/// The rightful host and client, which connect by this host's own address.
class Rightful {
 public:
  Rightful(const DaemonProcess& daemon, const client::Security& security) {
    auto client = client::FrameClient::connect("tcp://" + daemon.control(), kLongNs, security);
    EXPECT_TRUE(client.has_value()) << client.error().text;
    client_ = std::move(*client);
    EXPECT_TRUE(client_->subscribe({}).has_value());
    auto host = client::HostClient::connect("udp://" + daemon.host_udp(), kLongNs, security);
    EXPECT_TRUE(host.has_value()) << host.error().text;
    host_ = std::move(*host);
  }
  /// Checks one frame per pose, of consecutive numbers and one run.
  void expect_frames(std::uint64_t count) {
    for (std::uint64_t i = 0; i < count; ++i) {
      ASSERT_TRUE(host_->send(host_frame(++number_)).has_value());
      const auto frame = client_->receive(kLongNs);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      ASSERT_NE(*frame, nullptr);
      EXPECT_EQ((*frame)->header.host_frame_number, number_);
      EXPECT_EQ((*frame)->header.frame_number, number_);
      if (run_id_ == 0) run_id_ = (*frame)->header.run_id;
      EXPECT_EQ((*frame)->header.run_id, run_id_);
    }
  }
  client::HostClient& host() { return *host_; }

 private:
  std::unique_ptr<client::FrameClient> client_;
  std::unique_ptr<client::HostClient> host_;
  std::uint64_t number_ = 0;
  std::uint64_t run_id_ = 0;
};

bool is_host_frame(const Bytes& datagram) {
  const auto read = protocol::parse_session_datagram(datagram);
  return read && read->header.kind == protocol::SessionKind::host_frame;
}

/// Waits until the daemon has counted that many, because it has then handled them.
bool wait_counted(const DaemonProcess& daemon, const std::string& name, std::uint64_t at_least) {
  for (int i = 0; i < 3000; ++i, ::usleep(10'000)) {
    const auto page = client::http_get("http://" + daemon.metrics() + "/metrics", kLongNs);
    if (page && test::Exposition(page->body).value("emitd_" + name + "_total") >=
                    static_cast<double>(at_least)) {
      return true;
    }
  }
  return false;
}

/// Returns the value of a counter in the summary that a daemon logs at its end.
std::uint64_t counted(const ScratchFolder& folder, const std::string& name) {
  const std::string log = folder.read("stderr");
  const std::size_t at = log.find(" " + name + "=");
  return at == std::string::npos ? 0 : std::stoull(log.substr(at + name.size() + 2));
}

void expect_end(DaemonProcess& daemon, const ScratchFolder& folder) {
  EXPECT_FALSE(daemon.ended()) << folder.read("stderr");
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

TEST(DaemonAccess, AStrangerGetsNothingFromADaemonWithTlsAndKeys) {
  test::in_two_networks([](TwoNetworks& networks) {
    ScratchFolder folder;
    const test::Authority rig("rig authority");
    rig.write(folder.file("ca.pem"));
    rig.issue("emitd", "IP:192.0.2.1", folder.file("d.pem"), folder.file("d.key"));
    rig.issue("viewer", "DNS:viewer", folder.file("c.pem"), folder.file("c.key"));
    folder.write("host.keys", std::string(64, '7') + "\n");
    ::chmod(folder.file("host.keys").c_str(), 0600);
    const std::string text = config(
        "192.0.2.1", "[tls]\ncertificate = \"d.pem\"\nkey = \"d.key\"\nclient_ca = \"ca.pem\"\n",
        "key_file = \"host.keys\"\n");
    client::Security security;
    security.tls_ca = folder.file("ca.pem");
    security.tls_certificate = folder.file("c.pem");
    security.tls_key = folder.file("c.key");
    security.key_file = folder.file("host.keys");

    std::vector<Bytes> recorded;
    std::uint64_t frames = 0;
    {
      DaemonProcess daemon(folder, {"--config", folder.write("emitd.toml", text)});
      ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
      Recording recording(port_of(daemon.host_udp()));
      Rightful rightful(daemon, security);
      rightful.expect_frames(10);
      recorded = recording.take();
      frames = static_cast<std::uint64_t>(std::ranges::count_if(recorded, is_host_frame));
      ASSERT_EQ(frames, 10U);
      ASSERT_GT(recorded.size(), frames) << "no opening";
      Stranger stranger(networks, daemon, "192.0.2.1");
      stranger.try_everything(recorded);
      rightful.expect_frames(10);
      EXPECT_TRUE(wait_counted(daemon, "host_datagrams", 10 + 5 + 5 * recorded.size()));
      expect_end(daemon, folder);
      // A stranger gets a TLS alert at most. A peer that repeats the opening gets the nonce.
      EXPECT_LT(stranger.longest_heard(), 64U);
      EXPECT_LE(stranger.datagrams_heard(), recorded.size() - frames);
    }
    EXPECT_EQ(counted(folder, "host_frames_accepted"), 20U);
    EXPECT_EQ(counted(folder, "frames_sent"), 20U);
    EXPECT_EQ(counted(folder, "commands"), 0U);
    EXPECT_EQ(counted(folder, "host_replayed"), frames);
    EXPECT_EQ(counted(folder, "host_bad_mac"), 2 * recorded.size());
    EXPECT_EQ(counted(folder, "host_unknown_key"), recorded.size());
    EXPECT_EQ(counted(folder, "host_unauthenticated"), 5U);
    EXPECT_EQ(counted(folder, "handshakes_failed"), 11U);
    EXPECT_EQ(counted(folder, "handshakes_done"), 1U);
    EXPECT_EQ(counted(folder, "host_sessions"), 1U);

    // A daemon that has seen nothing yet does not accept recorded datagrams either.
    folder.write("stdout", "");
    DaemonProcess daemon(folder, {"--config", folder.write("emitd.toml", text)});
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    Stranger stranger(networks, daemon, "192.0.2.1");
    stranger.try_everything(recorded);
    EXPECT_TRUE(wait_counted(daemon, "host_datagrams", 5 + 4 * recorded.size()));
    Rightful rightful(daemon, security);
    rightful.expect_frames(5);
    expect_end(daemon, folder);
    EXPECT_EQ(counted(folder, "host_frames_accepted"), 5U);
    EXPECT_EQ(counted(folder, "host_replayed"), 0U);
    EXPECT_EQ(counted(folder, "host_bad_mac"), 2 * recorded.size() + frames);
    EXPECT_EQ(counted(folder, "host_sessions"), 1U);
  });
}

TEST(DaemonLimits, WhatIsBeyondARateIsRefusedByCode) {
  ScratchFolder folder;
  DaemonProcess daemon(
      folder, {"--config",
               folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\"",
                                                        "[access]\nmax_host_frames_hz = 1\n"))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  constexpr std::uint32_t kOverloaded = 11;
  const auto tcp = client::HostClient::connect("tcp://" + daemon.control(), kLongNs);
  const auto udp = client::HostClient::connect("udp://" + daemon.host_udp(), kLongNs);
  ASSERT_TRUE(tcp.has_value() && udp.has_value());
  // Twenty at once, whoever sends them, are more than one a second however slow this machine is.
  std::uint64_t number = 0;
  for (client::HostClient* host : {tcp->get(), udp->get()}) {
    for (int i = 0; i < 20; ++i) {
      ASSERT_TRUE(host->send(host_frame(++number)).has_value());
    }
    const auto status = host->receive_status(kLongNs);
    ASSERT_TRUE(status.has_value() && status->has_value());
    EXPECT_EQ((*status)->code, kOverloaded) << (*status)->text;
    EXPECT_NE((*status)->text.find("access.max_host_frames_hz"), std::string::npos);
  }
  expect_end(daemon, folder);
  EXPECT_GE(counted(folder, "host_frames_over_rate"), 2U);
}

struct ListCase {
  const char* name;
  const char* address;     ///< in the configuration
  const char* reached_by;  ///< by the stranger
  const char* other;       ///< a network without the stranger
  const char* own;         ///< one with it
};
constexpr ListCase kLists[] = {
    {"V4", "192.0.2.1", "192.0.2.1", "\"10.0.0.0/8\", \"192.0.2.1\"", "\"192.0.2.0/24\""},
    {"V6", "[fd00:77::1]", "fd00:77::1", "\"fd00:78::/32\", \"fd00:77::1\"", "\"fd00:77::/64\""},
    {"V4OnBothFamilies", "[::]", "192.0.2.1", "\"::/0\", \"192.0.2.1\"", "\"192.0.2.2\""},
};
void PrintTo(const ListCase& list, std::ostream* out) {
  *out << list.name;
}
class DaemonAllowList : public ::testing::TestWithParam<ListCase> {};

TEST_P(DaemonAllowList, WhoIsNotListedIsClosedUnread) {
  const ListCase& test = GetParam();
  test::in_two_networks([&test](TwoNetworks& networks) {
    ScratchFolder folder;
    {
      DaemonProcess daemon(
          folder,
          {"--config",
           folder.write("emitd.toml", config(test.address, "[access]\nallow = [" +
                                                               std::string(test.other) + "]\n"))});
      ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
      Stranger stranger(networks, daemon, test.reached_by);
      stranger.try_everything({});
      EXPECT_TRUE(wait_counted(daemon, "host_datagrams", 5));
      expect_end(daemon, folder);
      EXPECT_EQ(stranger.longest_heard(), 0U);
      EXPECT_EQ(stranger.datagrams_heard(), 0U);
    }
    EXPECT_EQ(counted(folder, "peers_refused"), 11U);
    EXPECT_EQ(counted(folder, "host_peers_refused"), 5U);
    EXPECT_EQ(counted(folder, "connections_accepted"), 0U);
    EXPECT_EQ(counted(folder, "host_frames_accepted"), 0U);
    EXPECT_NE(folder.read("stderr").find("not in access.allow"), std::string::npos);

    // The same bytes from a listed address are accepted, so it was the list that kept the peer out.
    ScratchFolder second;
    DaemonProcess daemon(
        second,
        {"--config",
         second.write("emitd.toml",
                      config(test.address, "[access]\nmax_connections_per_peer = 1\nallow = [" +
                                               std::string(test.own) + "]\n"))});
    ASSERT_TRUE(daemon.wait_ready()) << second.read("stderr");
    Stranger neighbour(networks, daemon, test.reached_by);
    const auto welcome = neighbour.say({hello(v1::Hello::ROLE_CLIENT)});
    ASSERT_TRUE(welcome.has_value());
    EXPECT_GT(welcome->size(), 64U);
    // The second connection is refused with an answer.
    neighbour.datagram(bare_datagram(1, 5));
    neighbour.datagram(bare_datagram(1, 5));
    std::size_t answers = 0;
    for (int i = 0; i < 5000 && answers == 0; ++i, ::usleep(1000)) {
      answers = neighbour.datagrams_heard();
    }
    EXPECT_EQ(answers, 1U);
    // One connection at a time is allowed from there. The second one gets an answer.
    const Fd first = neighbour.connect();
    const auto refusal = neighbour.say({});
    ASSERT_TRUE(refusal.has_value());
    EXPECT_GT(refusal->size(), protocol::kRecordHeaderBytes);
    expect_end(daemon, second);
    EXPECT_EQ(counted(second, "peer_limit_refused"), 1U);
    EXPECT_EQ(counted(second, "host_frames_accepted"), 1U);
    EXPECT_EQ(counted(second, "peers_refused"), 0U);
  });
}

INSTANTIATE_TEST_SUITE_P(Families, DaemonAllowList, ::testing::ValuesIn(kLists),
                         [](const auto& each) { return std::string(each.param.name); });

}  // namespace
}  // namespace emit::server
