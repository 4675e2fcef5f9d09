// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "pcap_file.hpp"

namespace emit::protocol {

/// UDP datagram found in a captured packet.
struct CapturedDatagram {
  enum class Kind : std::uint8_t {
    none,                ///< something else: another protocol
    datagram,            ///< a whole datagram
    fragment,            ///< the first IP fragment of a datagram
    later_fragment,      ///< another one, which does not say its port
    cut,                 ///< a datagram that the capture holds only in part
    unknown_link_layer,  ///< an unknown link layer, see CapturedPacket::link_type
    unknown_network,     ///< neither IP nor ARP behind the link layer, see ether_type
  };
  Kind kind = Kind::none;
  std::uint16_t destination_port = 0;  ///< valid for datagram, fragment and cut
  std::span<const std::byte> payload;  ///< payload of a whole datagram
  std::uint16_t ether_type = 0;        ///< valid for unknown_network
};

/// Finds the UDP datagram in a packet. It understands Ethernet and Linux cooked 1 and 2, each with
/// any number of VLAN tags, BSD loopback and raw IP; IPv4, and IPv6 with extension headers.
/// Checksums are not checked, because captures on the sending machine hold them unfinished.
[[nodiscard]] CapturedDatagram find_datagram(const CapturedPacket& packet) noexcept;

}  // namespace emit::protocol
