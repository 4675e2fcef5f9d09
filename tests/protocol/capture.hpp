// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "support/emit_process.hpp"

/// Capture files of datagrams, for tshark.
namespace emit::test {

/// Appends the low `bytes` bytes of a number.
inline void add_number(std::string& out, std::uint64_t value, std::size_t bytes, bool big) {
  for (std::size_t i = 0; i < bytes; ++i) {
    const std::size_t shift = 8 * (big ? bytes - 1 - i : i);
    out += static_cast<char>((value >> shift) & 0xFFu);
  }
}

/// Returns a record of a capture file: an IPv4 packet with a datagram between two ports.
inline std::string capture_record(std::span<const std::byte> message, std::uint16_t from,
                                  std::uint16_t to) {
  std::string packet("\x45\0", 2);
  add_number(packet, 28 + message.size(), 2, true);
  packet += std::string("\0\0\0\0\x40\x11\0\0", 8);  // no fragment, UDP, checksum not computed
  packet += std::string("\x7F\0\0\1\x7F\0\0\1", 8);
  add_number(packet, from, 2, true);
  add_number(packet, to, 2, true);
  add_number(packet, 8 + message.size(), 2, true);
  add_number(packet, 0, 2, true);
  for (const std::byte each : message) packet += static_cast<char>(each);
  std::string record(8, '\0');
  add_number(record, packet.size(), 4, false);
  add_number(record, packet.size(), 4, false);
  return record + packet;
}

/// Returns the head of a capture file whose packets begin with the IP header.
inline std::string capture_head() {
  std::string head;
  add_number(head, 0xA1B2C3D4, 4, false);
  add_number(head, 2, 2, false);
  add_number(head, 4, 2, false);
  add_number(head, 0, 8, false);
  add_number(head, 65535, 4, false);
  add_number(head, 101, 4, false);  // packets begin with the IP header
  return head;
}

/// Returns whether tshark can be run.
inline bool tshark_is_here() {
  const auto result = run_process({"tshark", "--version"});
  return result.exit_code == 0 && result.out.find("TShark") != std::string::npos;
}

}  // namespace emit::test
