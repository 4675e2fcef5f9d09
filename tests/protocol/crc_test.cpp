// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <random>
#include <string_view>
#include <vector>

#include "../../protocol/src/crc.hpp"
#include "emit/protocol/frame_header.hpp"

namespace emit::protocol {
namespace {

std::span<const std::byte> bytes_of(std::string_view text) {
  return std::as_bytes(std::span(text));
}

std::vector<std::byte> random_bytes(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::vector<std::byte> bytes(count);
  std::ranges::generate(bytes, [&] { return static_cast<std::byte>(random() & 0xFFu); });
  return bytes;
}

TEST(Crc32c, MatchesTheVectorsOfRfc3720) {
  std::vector<std::byte> zeros(32, std::byte{0});
  std::vector<std::byte> ones(32, std::byte{0xFF});
  std::vector<std::byte> rising(32);
  for (std::size_t i = 0; i < 32; ++i) rising[i] = static_cast<std::byte>(i);
  std::vector<std::byte> falling(rising.rbegin(), rising.rend());
  for (auto* crc : {&crc32c, &crc32c_portable}) {
    EXPECT_EQ(crc(zeros, 0), 0x8A9136AAu);
    EXPECT_EQ(crc(ones, 0), 0x62A8AB43u);
    EXPECT_EQ(crc(rising, 0), 0x46DD794Eu);
    EXPECT_EQ(crc(falling, 0), 0x113FDB5Cu);
    EXPECT_EQ(crc(bytes_of("123456789"), 0), 0xE3069283u);
    EXPECT_EQ(crc({}, 0), 0u);
  }
}

TEST(Crc32c, InstructionAndTablesAgreeForEveryLengthAndAlignment) {
  if (!has_crc32c_instruction()) GTEST_SKIP() << "the CPU has no CRC-32C instruction";
  const auto bytes = random_bytes(60000, 1);
  const std::span<const std::byte> all(bytes);
  for (std::size_t length = 0; length < 200; ++length) {
    const auto part = all.subspan(length % 9, length);
    ASSERT_EQ(crc32c_hardware(part), crc32c_portable(part)) << length;
  }
  // The lengths lie around one and several rounds of the three interleaved streams of 4096 bytes.
  for (const std::size_t length : {12287u, 12288u, 12289u, 24575u, 24576u, 36865u, 59990u}) {
    const auto part = all.subspan(3, length);
    ASSERT_EQ(crc32c_hardware(part, 0x12345678u), crc32c_portable(part, 0x12345678u)) << length;
  }
}

void expect_as_by_tables(std::uint32_t (*crc)(std::span<const std::byte>, std::uint32_t) noexcept) {
  const auto bytes = random_bytes(20000, 4);
  const std::span<const std::byte> all(bytes);
  for (std::size_t length = 0; length < 2000; ++length) {
    const auto part = all.subspan(length % 67, length);
    ASSERT_EQ(crc(part, 0x12345678u), crc32c_portable(part, 0x12345678u)) << length;
  }
  EXPECT_EQ(crc(all, 0), crc32c_portable(all));
}

TEST(Crc32c, FoldingAndTablesAgreeForEveryLengthAndAlignment) {
  if (!has_crc32c_folding()) GTEST_SKIP() << "the CPU has no carry-less product of 32 bytes";
  expect_as_by_tables(crc32c_folding);
}

TEST(Crc32c, WideFoldingAndTablesAgreeForEveryLengthAndAlignment) {
  if (!has_crc32c_wide_folding()) GTEST_SKIP() << "the CPU has no carry-less product of 64 bytes";
  expect_as_by_tables(crc32c_wide_folding);
}

TEST(Crc32c, ContinuesAnEarlierCall) {
  const auto bytes = random_bytes(40000, 2);
  const std::span<const std::byte> all(bytes);
  const std::uint32_t whole = crc32c(all);
  for (const std::size_t cut : {0u, 1u, 7u, 12288u, 20001u, 40000u}) {
    EXPECT_EQ(crc32c(all.subspan(cut), crc32c(all.first(cut))), whole) << cut;
  }
}

TEST(Crc32c, NoticesEverySingleFlippedBit) {
  auto bytes = random_bytes(512, 3);
  const std::uint32_t good = crc32c(bytes);
  for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
    const auto mask = static_cast<std::byte>(1u << (bit % 8));
    bytes[bit / 8] ^= mask;
    ASSERT_NE(crc32c(bytes), good);
    bytes[bit / 8] ^= mask;
  }
}

TEST(Crc32, MatchesThePublishedCheckValue) {
  EXPECT_EQ(crc32(bytes_of("123456789")), 0xCBF43926u);
  EXPECT_EQ(crc32({}), 0u);
  EXPECT_EQ(crc32(bytes_of("456789"), crc32(bytes_of("123"))), 0xCBF43926u);
}

}  // namespace
}  // namespace emit::protocol
