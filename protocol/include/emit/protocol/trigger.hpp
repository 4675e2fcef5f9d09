// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

/// Datagram of an external sync source that starts a frame: fixed size, little endian, versioned
/// (docs/wire.md section 10).
namespace emit::protocol {

inline constexpr std::uint32_t kTriggerMagic = 0x544D4645;  ///< "EFMT" as bytes E F M T
inline constexpr std::uint8_t kTriggerVersion = 1;
inline constexpr std::size_t kTriggerBytes = 40;
inline constexpr std::uint16_t kDefaultTriggerPort = 7003;

/// Contents of a trigger.
struct Trigger {
  std::uint64_t run_id = 0;  ///< run of the source, not 0; it is larger at each of its starts
  std::uint64_t number = 0;  ///< counts up by one within a run of the source; not 0
  std::int64_t edge_ns = 0;  ///< wall instant of the edge, ns TAI, not negative; 0: not known
};

/// Reason why a datagram is no valid trigger.
enum class TriggerFault : std::uint8_t { none, size, magic, version, crc, value };
/// Returns the English name of a fault, for messages. RT-safe.
[[nodiscard]] std::string_view to_string(TriggerFault fault) noexcept;

/// Writes the datagram, with its own CRC-32C in the last four bytes. RT-safe.
void encode(const Trigger& trigger, std::span<std::byte, kTriggerBytes> out) noexcept;

/// Decodes and checks a trigger. `trigger` is written only when the result is none. RT-safe.
[[nodiscard]] TriggerFault decode_trigger(std::span<const std::byte> bytes,
                                          Trigger& trigger) noexcept;

}  // namespace emit::protocol
