// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/fragment.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "protocol/frames.hpp"
#include "protocol/hex.hpp"

namespace emit::protocol {
namespace {

TEST(FragmentHeader, EncodesToTheGoldenBytes) {
  FragmentHeader header;
  header.flags = kFragmentFirst | kFragmentLast;
  header.stream_id = 0x0102;
  header.frame_id = 0xFFFFFFFE;
  header.total_bytes = 1284;
  header.payload_bytes = 1284;
  header.sim_time_ns = -5;
  std::vector<std::byte> datagram(32 + 1284);
  encode(header, std::span(datagram).first<kFragmentHeaderBytes>());
  EXPECT_EQ(test::to_hex(std::span(datagram).first(32)),
            "45464d4701030201feffffff000000000405000004050000fbffffffffffffff");
  FragmentHeader decoded;
  ASSERT_EQ(decode_fragment_header(datagram, decoded), FragmentStatus::accepted);
  EXPECT_EQ(decoded.flags, header.flags);
  EXPECT_EQ(decoded.stream_id, header.stream_id);
  EXPECT_EQ(decoded.frame_id, header.frame_id);
  EXPECT_EQ(decoded.byte_offset, 0u);
  EXPECT_EQ(decoded.total_bytes, 1284u);
  EXPECT_EQ(decoded.payload_bytes, 1284u);
  EXPECT_EQ(decoded.sim_time_ns, -5);
}

TEST(FragmentHeader, EveryLieThatOneDatagramCanTellIsNamed) {
  const auto good = test::datagrams_of(test::make_frame(32, 16, 1), 640, 1)[1];
  struct Case {
    std::size_t at;
    std::uint8_t value;
    FragmentStatus expected;
  };
  for (const Case& c :
       {Case{0, 0, FragmentStatus::wrong_magic}, Case{4, 2, FragmentStatus::wrong_version},
        Case{5, kFragmentFirst, FragmentStatus::inconsistent},
        Case{5, kFragmentLast, FragmentStatus::inconsistent},
        Case{12, 1, FragmentStatus::bad_offset}, Case{15, 0xFF, FragmentStatus::bad_offset},
        Case{17, 0, FragmentStatus::oversize}, Case{20, 4, FragmentStatus::bad_length},
        Case{21, 0xFF, FragmentStatus::short_input}}) {
    auto bytes = good;
    bytes[c.at] = std::byte{c.value};
    FragmentHeader header;
    EXPECT_EQ(decode_fragment_header(bytes, header), c.expected)
        << c.at << " " << to_string(c.expected);
  }
  FragmentHeader header;
  EXPECT_EQ(decode_fragment_header(std::span(good).first(31), header), FragmentStatus::short_input);
  EXPECT_EQ(decode_fragment_header(std::span(good).first(60), header), FragmentStatus::short_input);
}

TEST(Fragmenter, AllFragmentsButTheLastHaveTheSameSizeAndCoverTheFrameOnce) {
  for (const std::uint32_t height_px : {1u, 2u, 3u, 7u, 16u, 61u}) {
    for (std::uint32_t payload = 384; payload < 3000; payload += 52) {
      const auto frame = test::make_frame(40, height_px, 9);
      const Fragmenter fragmenter({.frame_id = 4, .row_bytes = 160, .max_payload_bytes = payload},
                                  frame.header_bytes, frame.pixels);
      const auto datagrams = test::datagrams_of(frame, payload, 4);
      std::vector<std::byte> stream;
      for (std::size_t i = 0; i < datagrams.size(); ++i) {
        FragmentHeader header;
        ASSERT_EQ(decode_fragment_header(datagrams[i], header), FragmentStatus::accepted);
        ASSERT_EQ(header.byte_offset, stream.size());
        if (i + 1 < datagrams.size()) {
          ASSERT_EQ(datagrams[i].size(), fragmenter.datagram_bytes());
        } else {
          ASSERT_LE(datagrams[i].size(), fragmenter.datagram_bytes());
          // The second header is never split.
          ASSERT_GE(header.payload_bytes, kFrameHeaderBytes);
        }
        stream.insert(stream.end(), datagrams[i].begin() + 32, datagrams[i].end());
      }
      ASSERT_EQ(stream.size(), fragmenter.total_bytes());
      const std::span<const std::byte> bytes(stream);
      ASSERT_TRUE(std::ranges::equal(bytes.first(kFrameHeaderBytes), frame.header_bytes));
      ASSERT_TRUE(
          std::ranges::equal(bytes.subspan(kFrameHeaderBytes, frame.pixels.size()), frame.pixels));
      ASSERT_TRUE(std::ranges::equal(bytes.last(kFrameHeaderBytes), frame.header_bytes));
      ASSERT_LT(stream.size() - 2 * kFrameHeaderBytes - frame.pixels.size(), kFrameHeaderBytes);
    }
  }
}

TEST(Fragmenter, PointsIntoTheCallersPixels) {
  const auto frame = test::make_frame(64, 64, 2);
  const Fragmenter fragmenter({.max_payload_bytes = 1440}, frame.header_bytes, frame.pixels);
  std::array<std::byte, kFragmentHeaderBytes> memory{};
  const auto pieces = fragmenter.pieces(3, memory);
  ASSERT_EQ(pieces.count, 2u);
  EXPECT_EQ(pieces.piece[0].data(), memory.data());
  EXPECT_EQ(pieces.piece[1].data(), frame.pixels.data() + 3 * 1440 - kFrameHeaderBytes);
  EXPECT_EQ(pieces.bytes, 1472u);
}

TEST(Fragmenter, NamesTheFirstRowOfEachFragment) {
  const auto datagrams = test::datagrams_of(test::make_frame(100, 20, 2), 800, 1);
  for (std::size_t i = 0; i < datagrams.size(); ++i) {
    FragmentHeader header;
    ASSERT_EQ(decode_fragment_header(datagrams[i], header), FragmentStatus::accepted);
    const std::size_t expected = i == 0 ? 0 : (i * 800 - 384) / 400;
    if (expected < 20) {
      EXPECT_EQ(header.row, expected) << i;
    }
  }
}

}  // namespace
}  // namespace emit::protocol
