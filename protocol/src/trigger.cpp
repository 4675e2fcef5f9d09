// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/trigger.hpp"

#include <algorithm>

#include "emit/protocol/frame_header.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {
namespace {

// Offsets of the fields (docs/wire.md section 10). All other bytes are zero.
enum Offset : std::size_t {
  kMagicAt = 0,
  kVersionAt = 4,
  kRunIdAt = 8,
  kNumberAt = 16,
  kEdgeAt = 24,
  kCrcAt = 36,
};
static_assert(kCrcAt + 4 == kTriggerBytes);

}  // namespace

std::string_view to_string(TriggerFault fault) noexcept {
  switch (fault) {
    case TriggerFault::none:
      return "sound";
    case TriggerFault::size:
      return "not of a trigger's size";
    case TriggerFault::magic:
      return "wrong magic";
    case TriggerFault::version:
      return "wrong version";
    case TriggerFault::crc:
      return "CRC does not match";
    case TriggerFault::value:
      return "number or run id 0, or a negative instant";
  }
  return "unknown fault";
}

void encode(const Trigger& trigger, std::span<std::byte, kTriggerBytes> out) noexcept {
  const std::span<std::byte> to = out;
  std::ranges::fill(to, std::byte{0});
  wire::put(to, kMagicAt, kTriggerMagic);
  wire::put(to, kVersionAt, kTriggerVersion);
  wire::put(to, kRunIdAt, trigger.run_id);
  wire::put(to, kNumberAt, trigger.number);
  wire::put(to, kEdgeAt, trigger.edge_ns);
  wire::put(to, kCrcAt, crc32c(to.first(kCrcAt)));
}

TriggerFault decode_trigger(std::span<const std::byte> bytes, Trigger& trigger) noexcept {
  if (bytes.size() != kTriggerBytes) return TriggerFault::size;
  if (wire::get<std::uint32_t>(bytes, kMagicAt) != kTriggerMagic) return TriggerFault::magic;
  if (wire::get<std::uint8_t>(bytes, kVersionAt) != kTriggerVersion) return TriggerFault::version;
  if (wire::get<std::uint32_t>(bytes, kCrcAt) != crc32c(bytes.first(kCrcAt))) {
    return TriggerFault::crc;
  }
  const Trigger read{wire::get<std::uint64_t>(bytes, kRunIdAt),
                     wire::get<std::uint64_t>(bytes, kNumberAt),
                     wire::get<std::int64_t>(bytes, kEdgeAt)};
  if (read.run_id == 0 || read.number == 0 || read.edge_ns < 0) return TriggerFault::value;
  trigger = read;
  return TriggerFault::none;
}

}  // namespace emit::protocol
