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
    none,                ///< something else: another protocol, or a later fragment
    datagram,            ///< a whole datagram
    fragment,            ///< the first IP fragment of a datagram
    cut,                 ///< a datagram that the capture holds only in part
    unknown_link_layer,  ///< an unknown link layer, see CapturedPacket::link_type
  };
  Kind kind = Kind::none;
  std::uint16_t destination_port = 0;  ///< valid except for none and unknown_link_layer
  std::span<const std::byte> payload;  ///< payload of a whole datagram
};

/// Finds the UDP datagram in a packet. It understands Ethernet with VLAN tags, Linux cooked 1 and
/// 2, BSD loopback and raw IP; IPv4, and IPv6 with extension headers. Checksums are not checked,
/// because captures on the sending machine hold them unfinished.
[[nodiscard]] CapturedDatagram find_datagram(const CapturedPacket& packet) noexcept;

}  // namespace emit::protocol
