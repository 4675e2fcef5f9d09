// SPDX-License-Identifier: Apache-2.0
#include "captured_datagram.hpp"

#include <algorithm>

namespace emit::protocol {
namespace {

using Kind = CapturedDatagram::Kind;
using Bytes = std::span<const std::byte>;

// Link types of the tcpdump group's registry (LINKTYPE_).
enum LinkType : std::uint32_t {
  kBsdLoopback = 0,
  kEthernet = 1,
  kRawOld = 12,
  kRawOpenBsd = 14,
  kRaw = 101,
  kOpenBsdLoopback = 108,
  kLinuxCooked = 113,
  kIpv4 = 228,
  kIpv6 = 229,
  kLinuxCooked2 = 276,
};

constexpr std::uint16_t kEtherIpv4 = 0x0800;
constexpr std::uint16_t kEtherIpv6 = 0x86DD;
constexpr std::uint16_t kEtherArp = 0x0806;
constexpr std::uint8_t kUdp = 17;
constexpr std::size_t kUdpHeaderBytes = 8;

std::uint8_t u8(Bytes in, std::size_t at) noexcept {
  return std::to_integer<std::uint8_t>(in[at]);
}
/// Reads a number in network byte order.
std::uint16_t u16(Bytes in, std::size_t at) noexcept {
  return static_cast<std::uint16_t>(u8(in, at) << 8 | u8(in, at + 1));
}

CapturedDatagram later_fragment() noexcept {
  CapturedDatagram out;
  out.kind = Kind::later_fragment;
  return out;
}

/// Reads the UDP datagram at the begin of `ip`. IP announces `length` bytes; `ip` may hold fewer.
CapturedDatagram udp(Bytes ip, std::size_t length, bool fragment) noexcept {
  if (ip.size() < kUdpHeaderBytes) return {};
  CapturedDatagram out;
  out.destination_port = u16(ip, 2);
  if (fragment) {
    out.kind = Kind::fragment;
    return out;
  }
  // A length of 0 means a jumbo datagram, or one that the sender's network card had yet to fill in.
  const std::size_t announced = u16(ip, 4);
  const std::size_t bytes = announced == 0 ? length : announced;
  if (bytes < kUdpHeaderBytes || bytes > length) return {};
  if (bytes > ip.size()) {
    out.kind = Kind::cut;
    return out;
  }
  out.kind = Kind::datagram;
  out.payload = ip.subspan(kUdpHeaderBytes, bytes - kUdpHeaderBytes);
  return out;
}

CapturedDatagram ipv4(Bytes ip, std::uint64_t wire_bytes) noexcept {
  if (ip.size() < 20 || u8(ip, 0) >> 4 != 4) return {};
  const std::size_t header = std::size_t{4} * (u8(ip, 0) & 0xFu);
  // Segmentation offload leaves the length at 0. The length of the packet then decides.
  const std::size_t announced = u16(ip, 2);
  const std::size_t total = announced == 0 ? static_cast<std::size_t>(wire_bytes) : announced;
  if (header < 20 || total < header || ip.size() < header || u8(ip, 9) != kUdp) return {};
  const std::uint16_t fragment = u16(ip, 6);
  const bool more = (fragment & 0x2000u) != 0;
  if ((fragment & 0x1FFFu) != 0) return later_fragment();
  return udp(ip.first(std::min(ip.size(), total)).subspan(header), total - header, more);
}

CapturedDatagram ipv6(Bytes ip, std::uint64_t wire_bytes) noexcept {
  constexpr std::size_t kHeader = 40;
  if (ip.size() < kHeader || u8(ip, 0) >> 4 != 6) return {};
  const std::size_t announced = u16(ip, 4);
  std::size_t length =
      announced == 0
          ? static_cast<std::size_t>(std::max<std::uint64_t>(wire_bytes, kHeader) - kHeader)
          : announced;
  Bytes rest = ip.subspan(kHeader);
  rest = rest.first(std::min(rest.size(), length));
  std::uint8_t next = u8(ip, 6);
  bool fragment = false;
  // Skip the extension headers: hop-by-hop, routing, fragment, authentication, destination options.
  while (next == 0 || next == 43 || next == 44 || next == 51 || next == 60) {
    if (rest.size() < 8) return {};
    std::size_t bytes = 8 + std::size_t{8} * u8(rest, 1);
    if (next == 44) {
      bytes = 8;
      const std::uint16_t place = u16(rest, 2);
      if ((place & 0xFFF8u) != 0)
        return u8(rest, 0) == kUdp ? later_fragment() : CapturedDatagram();
      fragment = fragment || (place & 1u) != 0;
    } else if (next == 51) {
      bytes = 8 + std::size_t{4} * u8(rest, 1);
    }
    if (rest.size() < bytes || length < bytes) return {};
    next = u8(rest, 0);
    rest = rest.subspan(bytes);
    length -= bytes;
  }
  return next == kUdp ? udp(rest, length, fragment) : CapturedDatagram{};
}

CapturedDatagram by_version(Bytes ip, std::uint64_t wire_bytes) noexcept {
  if (ip.empty()) return {};
  return u8(ip, 0) >> 4 == 6 ? ipv6(ip, wire_bytes) : ipv4(ip, wire_bytes);
}

bool is_vlan_tag(std::uint16_t type) noexcept {
  return type == 0x8100 || type == 0x88A8 || type == 0x9100;
}

/// Reads what lies behind the type of the link layer. `rest` begins behind that type.
CapturedDatagram by_ether_type(std::uint16_t type, Bytes rest, std::uint64_t wire_bytes) noexcept {
  constexpr std::size_t kTagBytes = 4;
  while (is_vlan_tag(type)) {
    if (rest.size() < kTagBytes || wire_bytes < kTagBytes) return {};
    type = u16(rest, 2);
    rest = rest.subspan(kTagBytes);
    wire_bytes -= kTagBytes;
  }
  if (type == kEtherIpv4) return ipv4(rest, wire_bytes);
  if (type == kEtherIpv6) return ipv6(rest, wire_bytes);
  // Smaller numbers are lengths of frames that bridges send to each other.
  constexpr std::uint16_t kFirstType = 0x0600;
  if (type == kEtherArp || type < kFirstType) return {};
  CapturedDatagram out;
  out.kind = Kind::unknown_network;
  out.ether_type = type;
  return out;
}

CapturedDatagram ethernet(Bytes frame, std::uint64_t wire_bytes) noexcept {
  constexpr std::size_t kTypeAt = 12;
  if (frame.size() < kTypeAt + 2 || wire_bytes < kTypeAt + 2) return {};
  return by_ether_type(u16(frame, kTypeAt), frame.subspan(kTypeAt + 2), wire_bytes - kTypeAt - 2);
}

CapturedDatagram loopback(const CapturedPacket& packet) noexcept {
  if (packet.data.size() < 4 || packet.wire_bytes < 4) return {};
  // The first four bytes are the address family in the byte order of the capturing machine. It
  // differs between systems (IPv6 is 10, 24, 28 or 30), so the version in the IP header decides.
  return by_version(packet.data.subspan(4), packet.wire_bytes - 4);
}

}  // namespace

CapturedDatagram find_datagram(const CapturedPacket& packet) noexcept {
  const Bytes data = packet.data;
  const std::uint64_t wire_bytes = packet.wire_bytes;
  switch (packet.link_type) {
    case kEthernet:
      return ethernet(data, wire_bytes);
    case kLinuxCooked:
      if (data.size() < 16 || wire_bytes < 16) return {};
      return by_ether_type(u16(data, 14), data.subspan(16), wire_bytes - 16);
    case kLinuxCooked2:
      if (data.size() < 20 || wire_bytes < 20) return {};
      return by_ether_type(u16(data, 0), data.subspan(20), wire_bytes - 20);
    case kBsdLoopback:
    case kOpenBsdLoopback:
      return loopback(packet);
    case kRawOld:
    case kRawOpenBsd:
    case kRaw:
    case kIpv4:
    case kIpv6:
      return by_version(data, wire_bytes);
    default:
      return {Kind::unknown_link_layer, 0, {}, 0};
  }
}

}  // namespace emit::protocol
