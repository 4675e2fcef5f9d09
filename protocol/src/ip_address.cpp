// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/ip_address.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstring>

namespace emit::protocol {

using physics::ErrorCode;
using physics::make_error;

namespace {

constexpr std::array<std::uint8_t, 12> kMappedPrefix{0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0xFF, 0xFF};
constexpr unsigned kMappedBits = 96;

std::size_t length_of(const IpAddress& address) noexcept {
  return address.v4 ? 4 : 16;
}

/// Sets all bits behind the first `bits` to 0.
void cut(std::array<std::uint8_t, 16>& bytes, unsigned bits) noexcept {
  for (unsigned i = 0; i < bytes.size(); ++i) {
    const unsigned kept = bits > i * 8 ? std::min(bits - i * 8, 8U) : 0U;
    bytes[i] = static_cast<std::uint8_t>(bytes[i] & ~(0xFFU >> kept));
  }
}

}  // namespace

bool IpAddress::is_loopback() const noexcept {
  if (v4) return bytes[0] == 127;
  return std::all_of(bytes.begin(), bytes.end() - 1, [](std::uint8_t byte) { return byte == 0; }) &&
         bytes.back() == 1;
}

IpAddress ip_from_bytes(std::span<const std::uint8_t> bytes) noexcept {
  IpAddress out;
  const bool mapped =
      bytes.size() == 16 && std::equal(kMappedPrefix.begin(), kMappedPrefix.end(), bytes.begin());
  if (mapped) bytes = bytes.subspan(kMappedPrefix.size());
  out.v4 = bytes.size() == 4;
  std::copy_n(bytes.begin(), std::min(bytes.size(), out.bytes.size()), out.bytes.begin());
  return out;
}

std::optional<IpAddress> parse_ip(std::string_view text) noexcept {
  std::array<char, INET6_ADDRSTRLEN + 1> terminated{};
  if (text.size() >= terminated.size()) return std::nullopt;
  std::copy(text.begin(), text.end(), terminated.begin());
  std::array<std::uint8_t, 16> bytes{};
  if (::inet_pton(AF_INET, terminated.data(), bytes.data()) == 1) {
    return ip_from_bytes(std::span(bytes).first(4));
  }
  if (::inet_pton(AF_INET6, terminated.data(), bytes.data()) == 1) return ip_from_bytes(bytes);
  return std::nullopt;
}

std::string to_string(const IpAddress& address) {
  std::array<char, INET6_ADDRSTRLEN> text{};
  ::inet_ntop(address.v4 ? AF_INET : AF_INET6, address.bytes.data(), text.data(),
              static_cast<socklen_t>(text.size()));
  return text.data();
}

bool Network::contains(const IpAddress& address) const noexcept {
  if (address.v4 != first.v4) return false;
  const std::size_t whole = prefix_bits / 8;
  if (std::memcmp(address.bytes.data(), first.bytes.data(), whole) != 0) return false;
  const unsigned rest = prefix_bits % 8;
  return rest == 0 || ((address.bytes[whole] ^ first.bytes[whole]) >> (8 - rest)) == 0;
}

physics::Result<Network> parse_network(std::string_view text) {
  const std::size_t slash = text.find('/');
  const std::string_view host = text.substr(0, slash);
  const auto address = parse_ip(host);
  const auto bad = [&](std::string_view why) {
    return make_error(ErrorCode::config, fmt::format("'{}' is not a network: {}", text, why));
  };
  if (!address) return bad("wanted such as 10.0.0.0/8, fd00::/8 or one address");
  Network out;
  out.first = *address;
  const auto most = static_cast<unsigned>(8 * length_of(*address));
  unsigned bits = most;
  if (slash != std::string_view::npos) {
    const std::string_view digits = text.substr(slash + 1);
    const auto parsed = std::from_chars(digits.data(), digits.data() + digits.size(), bits);
    // The prefix of an IPv4 network in IPv6 spelling counts the bits of IPv6.
    const bool mapped = address->v4 && host.find(':') != std::string_view::npos;
    if (parsed.ec != std::errc() || parsed.ptr != digits.data() + digits.size() || digits.empty() ||
        (mapped && bits < kMappedBits)) {
      return bad("the prefix length is no number in range");
    }
    bits -= mapped ? kMappedBits : 0;
  }
  if (bits > most) return bad(fmt::format("the prefix is longer than {} bits", most));
  out.prefix_bits = static_cast<std::uint8_t>(bits);
  cut(out.first.bytes, bits);
  if (out.first != *address) {
    return bad(fmt::format("bits are set behind the prefix; did you mean {}?", to_string(out)));
  }
  return out;
}

std::string to_string(const Network& network) {
  return fmt::format("{}/{}", to_string(network.first), network.prefix_bits);
}

}  // namespace emit::protocol
