// SPDX-License-Identifier: Apache-2.0
// Both families of addresses, and groups, on the loopback interface.
#include <gtest/gtest.h>
#include <ifaddrs.h>
#include <netdb.h>
#include <netinet/in.h>
#include <poll.h>

#include <array>
#include <csignal>
#include <optional>
#include <string>
#include <vector>

#include "emit/client/client.hpp"
#include "net/socket.hpp"
#include "rt/error_text.hpp"
#include "support/daemon_process.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;

using emit::test::kLongNs;
constexpr std::uint64_t kNetworkFrames = 40;

std::string config_at(const std::string& host, const std::string& pacing) {
  std::string text = canned_config(320, 256, pacing);
  const std::string v4 = "127.0.0.1:";
  const std::string at_host = host + ":";
  for (std::size_t at = text.find(v4); at != std::string::npos;
       at = text.find(v4, at + at_host.size())) {
    text.replace(at, v4.size(), at_host);
  }
  return text;
}

/// Returns the reason why this machine cannot do it. It sends itself a datagram, by the group if
/// one is given.
std::optional<std::string> obstacle(const std::string& host, const std::string& group) {
  const SocketContext context;
  const SocketAddress local = numeric_address(host, 0);
  const bool multicast = !group.empty();
  const SocketAddress target = multicast ? numeric_address(group, 0) : local;
  auto receiver = UdpSocket::open(context, target);
  if (!receiver) {
    return receiver.error().text;
  }
  if (auto bound = receiver->bind(target); !bound) {
    return bound.error().text;
  }
  auto sender = UdpSocket::open(context, target);
  if (!sender) {
    return sender.error().text;
  }
  if (multicast) {
    const unsigned interface = interface_of(local);
    if (const int error = receiver->join_group(target, interface); error != 0) {
      return "joining " + group + ": " + error_text(error);
    }
    if (const int error = sender->set_multicast_interface(target, interface); error != 0) {
      return "sending to " + group + ": " + error_text(error);
    }
    sender->set_multicast_hops(0);
  }
  const std::array<std::byte, 4> bytes{};
  if (const IoResult sent = sender->send_to(bytes, receiver->local_address());
      sent.status != IoStatus::done) {
    return "sending to " + to_string(receiver->local_address()) + ": " + error_text(sent.error);
  }
  pollfd wait{receiver->fd(), POLLIN, 0};
  if (::poll(&wait, 1, 2000) != 1) {
    return "what is sent to " + to_string(receiver->local_address()) + " does not arrive";
  }
  return std::nullopt;
}

/// Returns this machine's addresses of a family, the loopback interface's first. A route for groups
/// is often missing there in IPv6. With a hop limit of 0 nothing leaves the machine by the others
/// either.
std::vector<std::string> own_addresses(bool v6) {
  std::vector<std::string> out{v6 ? "::1" : "127.0.0.1"};
  ifaddrs* all = nullptr;
  if (::getifaddrs(&all) != 0) {
    return out;
  }
  for (const ifaddrs* each = all; each != nullptr; each = each->ifa_next) {
    std::array<char, NI_MAXHOST> text{};
    const int family = v6 ? AF_INET6 : AF_INET;
    if (each->ifa_addr == nullptr || each->ifa_addr->sa_family != family ||
        ::getnameinfo(each->ifa_addr, v6 ? sizeof(sockaddr_in6) : sizeof(sockaddr_in), text.data(),
                      text.size(), nullptr, 0, NI_NUMERICHOST) != 0) {
      continue;
    }
    // Link-local addresses need their interface's name wherever they are written.
    if (const std::string address = text.data();
        address != out[0] && address.find('%') == std::string::npos) {
      out.push_back(address);
    }
  }
  ::freeifaddrs(all);
  return out;
}

/// Returns the configuration that lets a program on this machine connect by an address that is not
/// loopback's.
std::string allowed(std::string host) {
  std::erase_if(host, [](char c) { return c == '[' || c == ']'; });
  return "[access]\nallow = [\"" + host + "\"]\n";
}

/// Returns ":7000" of "address:7000".
std::string port_of(const std::string& address) {
  return address.substr(address.rfind(':'));
}

/// Takes frames until kNetworkFrames came, and checks that all are complete and none is lost.
void expect_frames(client::FrameClient& client) {
  std::uint64_t newest = 0;
  for (std::uint64_t i = 0; i < kNetworkFrames; ++i) {
    const auto frame = client.receive(kLongNs);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_NE(*frame, nullptr) << "no frame";
    EXPECT_EQ((*frame)->header.flags & protocol::kFlagPartial, 0U);
    EXPECT_GT((*frame)->header.frame_number, newest);
    newest = (*frame)->header.frame_number;
  }
  EXPECT_EQ(client.counters().crc_errors, 0U);
  EXPECT_EQ(client.counters().bad_datagrams, 0U);
  EXPECT_EQ(client.counters().foreign_datagrams, 0U);
}

TEST(DaemonNetwork, HostAndClientsReachItOverIpv6) {
  if (const auto why = obstacle("::1", "")) {
    GTEST_SKIP() << "no IPv6 loopback here: " << *why;
  }
  ScratchFolder folder;
  DaemonProcess daemon(
      folder, {"--config", folder.write("emitd.toml", config_at("[::1]", "mode = \"host-step\""))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  EXPECT_EQ(daemon.control().substr(0, 6), "[::1]:");
  for (const std::string scheme : {"tcp://", "udp://"}) {
    auto client = client::FrameClient::connect(scheme + daemon.control());
    ASSERT_TRUE(client.has_value()) << client.error().text;
    ASSERT_TRUE((*client)->subscribe({}).has_value());
    auto host = client::HostClient::connect("udp://" + daemon.host_udp());
    ASSERT_TRUE(host.has_value()) << host.error().text;
    protocol::HostFrameData pose;
    pose.run_id = scheme == "tcp://" ? 1 : 2;
    for (std::uint64_t k = 1; k <= 5; ++k) {
      pose.frame_number = k;
      pose.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
      ASSERT_TRUE((*host)->send(pose).has_value());
      const auto frame = (*client)->receive(kLongNs);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      ASSERT_NE(*frame, nullptr) << scheme << " frame " << k;
      EXPECT_EQ((*frame)->header.host_frame_number, k);
    }
    // A refusal finds its way back to an IPv6 sender.
    ASSERT_TRUE((*host)->send(pose).has_value());
    const auto status = (*host)->receive_status(kLongNs);
    ASSERT_TRUE(status.has_value()) << status.error().text;
    ASSERT_TRUE(status->has_value());
    EXPECT_EQ((*status)->host_frame_number, 5U);
    EXPECT_EQ((*client)->counters().crc_errors, 0U);
  }
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

TEST(DaemonNetwork, FramesByUdpFromAnyAddressAreThoseOfTheAddressItLedTo) {
  for (const std::string any : {"0.0.0.0", "[::]"}) {
    SCOPED_TRACE(any);
    if (const auto why = any == "[::]" ? obstacle("::1", "") : std::nullopt) {
      GTEST_SKIP() << "no IPv6 loopback here: " << *why;
    }
    ScratchFolder folder;
    DaemonProcess daemon(
        folder, {"--config",
                 folder.write("emitd.toml", config_at(any, "mode = \"ig-clock\"\nrate_hz = 50.0") +
                                                "[access]\nallow = [\"127.0.0.1\", \"::1\"]\n")});
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    auto client = client::FrameClient::connect("udp://" + any + port_of(daemon.control()));
    ASSERT_TRUE(client.has_value()) << client.error().text;
    ASSERT_TRUE((*client)->subscribe({}).has_value());
    expect_frames(**client);
  }
}

struct GroupCase {
  const char* name;
  bool v6_control;
  const char* group;
  const char* listens = nullptr;  ///< elsewhere than where it is reached
};
constexpr GroupCase kGroups[] = {
    {"V4", false, "239.255.77.41"},
    {"V6", true, "ff15::4d49:5445"},
    {"V6GroupByV4Control", false, "ff15::4d49:5446"},
    {"V4GroupByV6Control", true, "239.255.77.42"},
    {"V6GroupByV4ControlOnBothFamilies", false, "ff15::4d49:5447", "[::]"},
    {"V4GroupByV4ControlOnBothFamilies", false, "239.255.77.43", "[::]"},
};

class DaemonMulticast : public ::testing::TestWithParam<GroupCase> {};

TEST_P(DaemonMulticast, FramesArriveByTheGroupOfTheSubscription) {
  const GroupCase& test = GetParam();
  std::string host;
  std::string obstacles;
  for (const std::string& address : own_addresses(test.v6_control)) {
    const auto why = obstacle(address, test.group);
    if (!why) {
      host = test.v6_control ? "[" + address + "]" : address;
      break;
    }
    obstacles += (obstacles.empty() ? "" : "; ") + address + ": " + *why;
  }
  if (host.empty()) {
    GTEST_SKIP() << "no multicast on this machine: " << obstacles;
  }
  ScratchFolder folder;
  DaemonProcess daemon(
      folder, {"--config",
               folder.write("emitd.toml", config_at(test.listens != nullptr ? test.listens : host,
                                                    "mode = \"ig-clock\"\nrate_hz = 50.0") +
                                              "[stream]\nmulticast_ttl = 0\n" + allowed(host))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  auto client = client::FrameClient::connect("udp://" + host + port_of(daemon.control()));
  ASSERT_TRUE(client.has_value()) << client.error().text;
  client::SubscribeOptions options;
  options.multicast_group = test.group;
  const auto channel = (*client)->subscribe(options);
  ASSERT_TRUE(channel.has_value()) << channel.error().text;
  expect_frames(**client);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

INSTANTIATE_TEST_SUITE_P(Groups, DaemonMulticast, ::testing::ValuesIn(kGroups),
                         [](const auto& each) { return std::string(each.param.name); });

TEST(DaemonNetwork, AnAddressThatIsNoGroupIsRefused) {
  ScratchFolder folder;
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", config_at("127.0.0.1", "mode = \"host-step\""))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  auto client = client::FrameClient::connect("udp://" + daemon.control());
  ASSERT_TRUE(client.has_value()) << client.error().text;
  client::SubscribeOptions options;
  options.multicast_group = "192.0.2.7";
  const auto channel = (*client)->subscribe(options);
  ASSERT_FALSE(channel.has_value());
  EXPECT_NE(channel.error().text.find("'192.0.2.7' is not a multicast group"), std::string::npos);
}

TEST(DaemonNetwork, AGroupThatIsNotListedIsRefused) {
  ScratchFolder folder;
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", config_at("127.0.0.1", "mode = \"host-step\""))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  for (const char* group : {"239.1.2.3", "224.0.0.251", "ff02::1", "::ffff:239.1.2.3"}) {
    auto client = client::FrameClient::connect("udp://" + daemon.control());
    ASSERT_TRUE(client.has_value()) << client.error().text;
    client::SubscribeOptions options;
    options.multicast_group = group;
    const auto channel = (*client)->subscribe(options);
    ASSERT_FALSE(channel.has_value()) << group;
  }
}

}  // namespace
}  // namespace emit::server
