// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/dis/pdu.hpp"

namespace emit::protocol::dis {

/// Fills a datagram with PDUs, for tests and tools. Version 7 begins each PDU at a multiple of 8
/// bytes; version 6 puts one behind the other.
/// Thread: one owner.  Real time: nothing allocates.
class Writer {
 public:
  /// Begins an empty datagram. The memory must outlive the writer.
  /// @pre version is 6 or 7
  Writer(std::span<std::byte> memory, std::uint8_t version, std::uint8_t exercise_id) noexcept;

  /// Appends a PDU with its articulated parts and returns a fault of kind none. Otherwise the
  /// datagram stays as it was and the fault says why. The number of parameters in the PDU is
  /// ignored: that of `parameters` is written. Numbers have the limits of the reader.
  /// @pre at most 255 parameters, and none for types without such
  [[nodiscard]] Fault add(const Pdu& pdu, std::uint32_t timestamp,
                          std::span<const VariableParameter> parameters = {}) noexcept;

  /// Returns the datagram so far.
  [[nodiscard]] std::span<const std::byte> datagram() const noexcept {
    return memory_.first(used_);
  }

 private:
  std::span<std::byte> memory_;
  std::uint8_t version_;
  std::uint8_t exercise_id_;
  std::size_t used_ = 0;
  std::size_t pdus_ = 0;
};

}  // namespace emit::protocol::dis
