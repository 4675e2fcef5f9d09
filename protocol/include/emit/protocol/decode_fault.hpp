// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace emit::protocol {

enum class DecodeStatus : std::uint8_t;

/// The field of a host frame that a decoder refused, with its value and range. A plain struct:
/// filling it allocates nothing.
struct DecodeFault {
  enum class Part : std::uint8_t { message, seeker, entity, environment, part };
  enum class Kind : std::uint8_t {
    none,          ///< the decoder names no field: the bytes are not a host frame
    out_of_range,  ///< `value` is outside `lowest` to `highest`, or NaN
    missing,       ///< `field` is mandatory
    repeated,      ///< the entity or the part stands in the frame twice
  };
  Kind kind = Kind::none;
  Part part = Part::message;
  std::uint32_t entity_id = 0;  ///< id of the entity, for Part::entity and Part::part
  const char* field = "";       ///< name as in host.proto, static storage
  double value = 0.0;
  double lowest = 0.0;
  double highest = 0.0;
  std::uint32_t part_id = 0;  ///< id of the part, for Part::part
};

/// Length that is enough for every text of the functions below, bytes.
inline constexpr std::size_t kFaultTextBytes = 192;

/// Writes for example "invalid pose: entity 7: position_m.x is nan, must be -1e+08 to 1e+08".
/// Returns the part of `buffer` that it used; a text that is too long is cut off.
[[nodiscard]] std::string_view fault_text(DecodeStatus status, const DecodeFault& fault,
                                          std::span<char> buffer) noexcept;
/// Writes the text of fault_text() without the value, so that frames with the same fault have the
/// same text, for example "invalid pose: entity 7: position_m.x".
[[nodiscard]] std::string_view fault_place(DecodeStatus status, const DecodeFault& fault,
                                           std::span<char> buffer) noexcept;

}  // namespace emit::protocol
