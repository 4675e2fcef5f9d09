// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/cigi/message.hpp"

namespace emit::protocol::cigi {

/// Result of Reader::next().
enum class Step : std::uint8_t {
  packet,   ///< the argument holds the next packet
  refused,  ///< fault() names a packet that is left out; the next ones are sound
  end,      ///< every byte of the message was read
  broken,   ///< fault() says why nothing more of the message can be read
};

/// Reads the packets of one message (a datagram) in their order. The version and the byte order of
/// the sender are found by the first packet.
///
/// Packets with ids that the codec does not know, user-defined ids among them, are skipped by their
/// size and counted. A fault of the message ends it (`broken`): a wrong first packet, another
/// version than 3.3 and 4.0, a size that is 0, not a multiple of 8, beyond the end or not that of
/// its packet, and any fault in the first packet. Packets that came before stay good. A fault
/// inside another packet leaves out that one alone (`refused`): a number that is not finite or out
/// of range, a text without an end, a second first packet, a packet of the other side. Reserved
/// bits and bytes are ignored. Thread: one owner.  Real time: nothing allocates; a message of n
/// bytes takes n / 8 steps at most.
class Reader {
 public:
  /// Begins with a message from this side. The bytes must outlive the reader.
  Reader(std::span<const std::byte> message, Sender sender) noexcept;

  /// Reads the next known packet; the first is IgControl or StartOfFrame. `packet` is written only
  /// when the result is `packet`. After `end` or `broken` the result stays the same.
  [[nodiscard]] Step next(Packet& packet) noexcept;

  /// Returns the fault of the latest `refused` or `broken`.
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }
  /// Returns the sender's byte order, from the construction on. It means nothing if the first step
  /// is `broken`.
  [[nodiscard]] ByteOrder byte_order() const noexcept { return order_; }
  /// Returns the version of the message, from the construction on. It means nothing if the first
  /// step is `broken`.
  [[nodiscard]] Version version() const noexcept { return version_; }
  /// Returns the bytes of the packet that the latest step gave or refused. They are a part of the
  /// message.
  [[nodiscard]] std::span<const std::byte> packet_bytes() const noexcept { return bytes_; }
  /// Returns how many packets were skipped so far because the codec does not know their id.
  [[nodiscard]] std::size_t skipped_packets() const noexcept { return skipped_; }
  /// Returns how many of the skipped packets have a user-defined id: 201 to 255, in 4.0 from 0x8000
  /// to 0xFFFE.
  [[nodiscard]] std::size_t user_defined_packets() const noexcept { return user_defined_; }
  /// Returns how many packets were refused so far.
  [[nodiscard]] std::size_t refused_packets() const noexcept { return refused_; }

 private:
  [[nodiscard]] bool open() noexcept;
  [[nodiscard]] bool open_v3() noexcept;
  [[nodiscard]] bool open_v4() noexcept;
  [[nodiscard]] std::size_t stated_bytes() const noexcept;
  [[nodiscard]] std::uint16_t stated_id() const noexcept;
  [[nodiscard]] bool check_size() noexcept;
  [[nodiscard]] Step read_known(Packet& packet) noexcept;
  [[nodiscard]] Step refuse(Fault::Kind kind) noexcept;
  [[nodiscard]] bool fail(Fault::Kind kind, double value = 0.0, double lowest = 0.0,
                          double highest = 0.0) noexcept;

  std::span<const std::byte> message_;
  std::span<const std::byte> bytes_;  ///< of the latest packet
  Sender sender_;
  Version version_ = Version::v3_3;
  ByteOrder order_ = ByteOrder::little;
  bool broken_ = false;
  std::size_t offset_ = 0;  ///< of the next packet
  std::size_t number_ = 0;  ///< of the next packet
  std::size_t skipped_ = 0;
  std::size_t user_defined_ = 0;
  std::size_t refused_ = 0;
  Fault fault_;
};

}  // namespace emit::protocol::cigi
