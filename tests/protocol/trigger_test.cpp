// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/trigger.hpp"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "protocol/hex.hpp"

namespace emit::protocol {
namespace {

// Bytes of kTrigger, written by another program after docs/wire.md, CRC included.
constexpr std::string_view kGoldenTrigger =
    "45464d54010000008877665544332211e8030000000000000500b49376e2fa18000000000afb71a5";

constexpr Trigger kTrigger{0x1122334455667788, 1000, 1'800'000'000'000'000'005};

std::vector<std::byte> encoded(const Trigger& trigger) {
  std::vector<std::byte> bytes(kTriggerBytes, std::byte{0xEE});
  encode(trigger, std::span<std::byte, kTriggerBytes>(bytes));
  return bytes;
}

/// Returns the bytes of the trigger with one byte changed and a correct CRC.
std::vector<std::byte> forged_trigger(std::size_t at, std::uint8_t value) {
  auto bytes = encoded(kTrigger);
  bytes[at] = std::byte{value};
  const std::uint32_t crc = crc32c(std::span(bytes).first(36));
  for (std::size_t i = 0; i < 4; ++i) {
    bytes[36 + i] = static_cast<std::byte>((crc >> (8 * i)) & 0xFFu);
  }
  return bytes;
}

TriggerFault fault_of(std::span<const std::byte> bytes) {
  Trigger untouched{3, 4, 5};
  const TriggerFault fault = decode_trigger(bytes, untouched);
  if (fault != TriggerFault::none) {
    EXPECT_EQ(untouched.run_id, 3U);
    EXPECT_EQ(untouched.number, 4U);
    EXPECT_EQ(untouched.edge_ns, 5);
  }
  return fault;
}

TEST(Trigger, EncodesToTheGoldenBytesAndBack) {
  EXPECT_EQ(test::to_hex(encoded(kTrigger)), kGoldenTrigger);
  Trigger read;
  ASSERT_EQ(decode_trigger(test::from_hex(kGoldenTrigger), read), TriggerFault::none);
  EXPECT_EQ(read.run_id, kTrigger.run_id);
  EXPECT_EQ(read.number, kTrigger.number);
  EXPECT_EQ(read.edge_ns, kTrigger.edge_ns);
}

TEST(Trigger, RefusesWhatIsNone) {
  const auto good = encoded(kTrigger);
  EXPECT_EQ(fault_of({}), TriggerFault::size);
  EXPECT_EQ(fault_of(std::span(good).first(39)), TriggerFault::size);
  auto longer = good;
  longer.push_back(std::byte{0});
  EXPECT_EQ(fault_of(longer), TriggerFault::size);
  EXPECT_EQ(fault_of(forged_trigger(3, 'R')), TriggerFault::magic);
  EXPECT_EQ(fault_of(forged_trigger(4, 2)), TriggerFault::version);
  EXPECT_EQ(fault_of(forged_trigger(31, 0x80)), TriggerFault::value) << "an instant before 1970";
  EXPECT_EQ(fault_of(encoded({0, 1, 0})), TriggerFault::value);
  EXPECT_EQ(fault_of(encoded({1, 0, 0})), TriggerFault::value);
  for (std::size_t at = 0; at < good.size(); ++at) {
    auto flipped = good;
    flipped[at] ^= std::byte{0x10};
    EXPECT_NE(fault_of(flipped), TriggerFault::none) << "byte " << at;
  }
  EXPECT_EQ(fault_of(forged_trigger(6, 0x55)), TriggerFault::none) << "reserved bytes are ignored";
}

}  // namespace
}  // namespace emit::protocol
