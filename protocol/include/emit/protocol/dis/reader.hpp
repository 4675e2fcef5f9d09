// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/dis/pdu.hpp"

namespace emit::protocol::dis {

/// Result of Reader::next().
enum class Step : std::uint8_t {
  pdu,      ///< the argument holds the next PDU
  other,    ///< a PDU of a type that the codec does not know, which header() names
  refused,  ///< fault() names a PDU that is left out; the next ones are sound
  end,      ///< every byte of the datagram was read
  broken,   ///< fault() says why nothing more of the datagram can be read
};

/// Reads the PDUs of one datagram in their order. A PDU begins where the one in front ends, or
/// after bytes of zero up to the next multiple of 8, by which version 7 aligns bundled PDUs.
///
/// A length that cannot be ends the datagram (`broken`), and PDUs that came before stay good. A
/// fault inside a PDU leaves out that one alone (`refused`): another version, fewer bytes than its
/// type and its number of parameters need, a number that is not finite or out of range. Bytes
/// behind a PDU's fields are ignored up to its length, and so are reserved bits.
/// Thread: one owner.  Real time: nothing allocates; a datagram of n bytes takes n / 12 steps at
/// most.
class Reader {
 public:
  /// Begins with a datagram. The bytes must outlive the reader.
  explicit Reader(std::span<const std::byte> datagram) noexcept : datagram_(datagram) {}

  /// Reads the next PDU. `pdu` is written only when the result is `pdu`. After `end` or `broken`
  /// the result stays the same. A datagram without bytes is at its end.
  [[nodiscard]] Step next(Pdu& pdu) noexcept;

  /// Returns the header of the PDU of the latest `pdu`, `other` or `refused`.
  [[nodiscard]] const Header& header() const noexcept { return header_; }
  /// Returns the variable parameters of the PDU that the latest step gave; none for types without
  /// such. They are a view of the datagram.
  [[nodiscard]] const VariableParameters& parameters() const noexcept { return parameters_; }
  /// Returns the bytes of the PDU of the latest `pdu`, `other` or `refused`.
  [[nodiscard]] std::span<const std::byte> pdu_bytes() const noexcept { return bytes_; }
  /// Returns the fault of the latest `refused` or `broken`.
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }

 private:
  [[nodiscard]] bool take_header() noexcept;
  [[nodiscard]] Step read_body(Pdu& pdu) noexcept;
  void skip_padding() noexcept;
  [[nodiscard]] Step refuse(Fault fault) noexcept;

  std::span<const std::byte> datagram_;
  std::span<const std::byte> bytes_;  ///< of the latest PDU
  Header header_;
  VariableParameters parameters_;
  bool broken_ = false;
  std::size_t offset_ = 0;  ///< of the next PDU
  std::size_t number_ = 0;  ///< of the next PDU
  Fault fault_;
};

}  // namespace emit::protocol::dis
