// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "pcap_file.hpp"

namespace emit::protocol {

/// UDP datagram within a captured packet.
struct CapturedDatagram {
  enum class Kind : std::uint8_t {
    none,                ///< something else: other protocol, later fragment
    datagram,            ///< whole
    fragment,            ///< the first part of one that IP took apart
    cut,                 ///< the capture did not keep all of it
    unknown_link_layer,  ///< see CapturedPacket::link_type
  };
  Kind kind = Kind::none;
  std::uint16_t destination_port = 0;  ///< not for none and unknown_link_layer
  std::span<const std::byte> payload;  ///< datagram only
};

/// Takes link layer (Ethernet with VLAN tags, Linux cooked 1 and 2, BSD loopback, raw IP), IPv4 or
/// IPv6 with extension headers, and UDP apart. Checksums are not looked at: captures of the sending
/// machine hold them unfinished.
[[nodiscard]] CapturedDatagram find_datagram(const CapturedPacket& packet) noexcept;

}  // namespace emit::protocol
