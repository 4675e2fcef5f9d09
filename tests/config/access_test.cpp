// SPDX-License-Identifier: Apache-2.0
#include "config/config_support.hpp"

namespace emit::config::testing {
namespace {

const std::string kCanned = "[source]\nkind = \"canned\"\n";

bool holds(std::string_view network, std::string_view address) {
  return protocol::parse_network(network)->contains(*protocol::parse_ip(address));
}

TEST(Network, HoldsTheAddressesThatBeginAlike) {
  EXPECT_TRUE(holds("10.0.0.0/8", "10.255.0.1"));
  EXPECT_FALSE(holds("10.0.0.0/8", "11.0.0.1"));
  EXPECT_TRUE(holds("192.0.2.64/26", "192.0.2.127"));
  EXPECT_FALSE(holds("192.0.2.64/26", "192.0.2.128"));
  EXPECT_FALSE(holds("192.0.2.64/26", "192.0.2.63"));
  EXPECT_TRUE(holds("192.0.2.7", "192.0.2.7"));
  EXPECT_FALSE(holds("192.0.2.7", "192.0.2.6"));
  EXPECT_TRUE(holds("fd00::/8", "fdff::1"));
  EXPECT_FALSE(holds("fd00::/8", "fe80::1"));
  EXPECT_TRUE(holds("2001:db8::/33", "2001:db8:7fff::1"));
  EXPECT_FALSE(holds("2001:db8::/33", "2001:db8:8000::1"));
  EXPECT_TRUE(holds("0.0.0.0/0", "203.0.113.9"));
  EXPECT_TRUE(holds("::/0", "2001:db8::1"));
}

// A socket for both families shows IPv4 peers as IPv6 addresses.
TEST(Network, MappedAddressesAreIpv4) {
  EXPECT_TRUE(holds("10.0.0.0/8", "::ffff:10.1.2.3"));
  EXPECT_TRUE(holds("::ffff:10.0.0.0/104", "10.1.2.3"));
  EXPECT_FALSE(holds("::/0", "::ffff:10.1.2.3"));
  EXPECT_FALSE(holds("0.0.0.0/0", "::1"));
}

// The result is compared with arithmetic on the whole address.
TEST(Network, EveryPrefixLengthCutsAtItsBit) {
  const protocol::IpAddress address = *protocol::parse_ip("170.170.170.170");
  for (unsigned bits = 1; bits <= 32; ++bits) {
    protocol::Network network;
    network.prefix_bits = static_cast<std::uint8_t>(bits);
    const std::uint32_t mask = ~std::uint32_t{0} << (32 - bits);
    for (unsigned byte = 0; byte < 4; ++byte) {
      network.first.bytes[byte] =
          static_cast<std::uint8_t>((0xAAAAAAAAU & mask) >> (24 - 8 * byte));
    }
    for (unsigned flipped = 0; flipped < 32; ++flipped) {
      protocol::IpAddress other = address;
      other.bytes[flipped / 8] ^= static_cast<std::uint8_t>(0x80U >> (flipped % 8));
      EXPECT_EQ(network.contains(other), flipped >= bits) << bits << " " << flipped;
    }
  }
}

TEST(Network, LoopbackIsRecognised) {
  for (const char* text : {"127.0.0.1", "127.9.9.9", "::1", "::ffff:127.0.0.1"}) {
    EXPECT_TRUE(protocol::parse_ip(text)->is_loopback()) << text;
  }
  for (const char* text : {"0.0.0.0", "10.0.0.1", "::", "::2", "::ffff:10.0.0.1", "fe80::1"}) {
    EXPECT_FALSE(protocol::parse_ip(text)->is_loopback()) << text;
  }
}

TEST(Network, WhatIsNoneIsRefusedByName) {
  for (const char* text : {"", "/8", "10.0.0.0/", "10.0.0.0/33", "10.0.0/8", "10.0.0.0/-1",
                           "10.0.0.0/8 ", "fd00::/129", "::ffff:10.0.0.0/95", "rig", "10.0.0.0/8/8",
                           "1111:2222:3333:4444:5555:6666:7777:8888:9999"}) {
    const auto network = protocol::parse_network(text);
    ASSERT_FALSE(network.has_value()) << text;
    EXPECT_EQ(network.error().text.find(std::string("'").append(text).append("'")), 0U);
  }
  EXPECT_EQ(protocol::parse_network("10.0.0.5/8").error().text,
            "'10.0.0.5/8' is not a network: bits are set behind the prefix; did you mean "
            "10.0.0.0/8?");
}

TEST_F(ConfigTest, a_port_for_other_hosts_needs_a_protection) {
  EXPECT_EQ(daemon_error(kCanned + "[control]\ntcp = \"0.0.0.0:7000\"\n"),
            "d.toml:4:7: 'control.tcp' is '0.0.0.0:7000', which other hosts may reach: that "
            "needs 'access.allow' or '[tls]'");
  EXPECT_EQ(daemon_error(kCanned + "[host]\nudp = \"[::]:7001\"\n"),
            "d.toml:4:7: 'host.udp' is '[::]:7001', which other hosts may reach: that needs "
            "'access.allow', 'host.key_file' or '[tls]'");
  EXPECT_EQ(daemon_error(kCanned + "[metrics]\nlisten = \"rig:7002\"\n"),
            "d.toml:4:10: 'metrics.listen' is 'rig:7002', which other hosts may reach: that "
            "needs 'access.allow'");
  EXPECT_EQ(daemon_error(kCanned + "[console]\nlisten = \"0.0.0.0:7003\"\n"),
            "d.toml:4:10: 'console.listen' is '0.0.0.0:7003', which other hosts may reach: that "
            "needs 'access.allow'");
}

TEST_F(ConfigTest, each_protection_covers_its_ports) {
  const std::string tcp = "[control]\ntcp = \"192.0.2.1:7000\"\n";
  const std::string udp = "[host]\nudp = \"192.0.2.1:7001\"\n";
  const std::string metrics = "[metrics]\nlisten = \"192.0.2.1:7002\"\n";
  const std::string allow = "[access]\nallow = [\"192.0.2.0/24\"]\n";
  const std::string tls =
      "[tls]\ncertificate = \"a.pem\"\nkey = \"b.pem\"\nclient_ca = \"c.pem\"\n";
  const auto takes = [this](const std::string& text) { return daemon(kCanned + text).has_value(); };
  EXPECT_TRUE(takes(tcp + udp + metrics + allow));
  EXPECT_TRUE(takes(tcp + udp + tls));
  EXPECT_FALSE(takes(metrics + tls));
  EXPECT_TRUE(takes(udp + "key_file = \"k\"\n"));
  EXPECT_FALSE(takes(tcp + udp + "key_file = \"k\"\n"));
  EXPECT_TRUE(takes("[control]\ntcp = \"localhost:7000\"\n"));
  EXPECT_TRUE(takes("[control]\ntcp = \"[::1]:7000\"\n[host]\nudp = \"127.1.2.3:7001\"\n"));
}

TEST_F(ConfigTest, half_a_tls_section_and_wrong_networks_are_reported) {
  EXPECT_EQ(daemon_error(kCanned + "[tls]\ncertificate = \"a.pem\"\nkey = \"b.pem\"\n"),
            "d.toml:3:1: 'tls.client_ca' is missing: mutual TLS needs 'certificate', 'key' and "
            "'client_ca'");
  EXPECT_EQ(daemon_error(kCanned + "[access]\nallow = \"10.0.0.0/8\"\n"),
            "d.toml:4:9: 'allow' must be an array of strings, not a string");
  EXPECT_EQ(daemon_error(kCanned + "[access]\nallow = [\"10.0.0.0/8\", \"ten\"]\n"),
            "d.toml:4:24: 'allow': 'ten' is not a network: wanted such as 10.0.0.0/8, fd00::/8 "
            "or one address");
}

}  // namespace
}  // namespace emit::config::testing
