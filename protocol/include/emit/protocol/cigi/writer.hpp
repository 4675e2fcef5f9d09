// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/cigi/message.hpp"

namespace emit::protocol::cigi {

/// Fills a message (a datagram) with packets of either version in either byte order.
/// Thread: one owner.  Real time: nothing allocates.
class Writer {
 public:
  /// Begins an empty message. The memory must outlive the writer; a message gets at most all of it.
  Writer(std::span<std::byte> memory, Version version, ByteOrder order) noexcept;

  /// Appends a packet and returns a fault of kind none. Otherwise the message stays as it was and
  /// the fault says why. The first packet must be StartOfFrame or IgControl, and those that follow
  /// must be of the same side. Numbers have the limits of the reader. A packet or a value that the
  /// version cannot carry is refused. Version and magic number of the first packet are written too,
  /// and all reserved bits are 0.
  [[nodiscard]] Fault add(const Packet& packet) noexcept;

  /// Returns the message so far.
  [[nodiscard]] std::span<const std::byte> message() const noexcept { return memory_.first(used_); }
  /// Begins the next message in the same memory.
  void clear() noexcept;

 private:
  std::span<std::byte> memory_;
  Version version_;
  ByteOrder order_;
  Sender sender_ = Sender::host;
  std::size_t used_ = 0;
  std::size_t packets_ = 0;
};

}  // namespace emit::protocol::cigi
