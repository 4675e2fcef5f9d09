// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/framing.hpp"

#include <gmock/gmock.h>

#include <algorithm>
#include <random>
#include <vector>

#include "protocol/frames.hpp"
#include "protocol/hex.hpp"

namespace emit::protocol {
namespace {

using Bytes = std::vector<std::byte>;

void append_record(Bytes& stream, RecordKind kind, std::span<const std::byte> body) {
  std::array<std::byte, kRecordHeaderBytes> header{};
  encode_record_header(kind, static_cast<std::uint32_t>(body.size()), header);
  stream.insert(stream.end(), header.begin(), header.end());
  stream.insert(stream.end(), body.begin(), body.end());
}

/// Hands over as many bytes as there is room for and returns their number.
std::size_t feed(RecordParser& parser, std::span<const std::byte> bytes) {
  const auto space = parser.writable();
  const std::size_t count = std::min(space.size(), bytes.size());
  std::ranges::copy(bytes.first(count), space.begin());
  parser.commit(count);
  return count;
}

TEST(RecordHeader, EncodesToTheGoldenBytes) {
  std::array<std::byte, kRecordHeaderBytes> header{};
  encode_record_header(RecordKind::frame, 0x01020304, header);
  EXPECT_EQ(test::to_hex(header), "454d52430102000004030201");
}

TEST(RecordParser, CutsTheSameRecordsWhateverThePiecesTheyArriveIn) {
  std::mt19937 random(5);
  std::vector<Bytes> bodies;
  Bytes stream;
  for (std::size_t i = 0; i < 300; ++i) {
    Bytes body(random() % 90);
    std::ranges::generate(body, [&] { return static_cast<std::byte>(random() & 0xFFu); });
    append_record(stream, i % 3 == 0 ? RecordKind::frame : RecordKind::control, body);
    bodies.push_back(std::move(body));
  }
  for (const std::size_t largest_piece : {1u, 7u, 64u, 100000u}) {
    RecordParser parser({.max_control_bytes = 90, .max_frame_bytes = 90});
    std::size_t at = 0;
    std::size_t found = 0;
    while (true) {
      Record record;
      const ParseStatus status = parser.next(record);
      if (status == ParseStatus::record) {
        ASSERT_LT(found, bodies.size());
        ASSERT_EQ(record.kind, found % 3 == 0 ? RecordKind::frame : RecordKind::control);
        ASSERT_TRUE(std::ranges::equal(record.body, bodies[found]));
        ++found;
        continue;
      }
      ASSERT_EQ(status, ParseStatus::need_more);
      if (at == stream.size()) break;
      const std::size_t piece = std::min(1 + random() % largest_piece, stream.size() - at);
      const std::size_t fed = feed(parser, std::span(stream).subspan(at, piece));
      ASSERT_GT(fed, 0u);
      at += fed;
    }
    EXPECT_EQ(found, bodies.size());
    EXPECT_EQ(parser.pending_bytes(), 0u);
  }
}

TEST(RecordParser, SumsTheBytesBehindAFrameHeaderHoweverTheyArrive) {
  std::mt19937 random(11);
  for (const std::size_t largest_piece : {1u, 7u, 333u, 5000u}) {
    RecordParser parser({.max_control_bytes = 100, .max_frame_bytes = 3000});
    Bytes stream;
    std::vector<std::uint32_t> sums;
    for (const std::size_t bytes : {320u, 321u, 3000u, 50u, 3000u, 1000u}) {
      Bytes body(bytes);
      std::ranges::generate(body, [&] { return static_cast<std::byte>(random() & 0xFFu); });
      append_record(stream, RecordKind::frame, body);
      append_record(stream, RecordKind::control, Bytes(random() % 100));
      const std::size_t header = std::min(bytes, kFrameHeaderBytes);
      sums.push_back(crc32c(std::span<const std::byte>(body).subspan(header)));
    }
    std::size_t found = 0;
    for (std::size_t at = 0;;) {
      Record record;
      while (parser.next(record) == ParseStatus::record) {
        if (record.kind != RecordKind::frame) continue;
        ASSERT_LT(found, sums.size());
        EXPECT_EQ(record.payload_crc32c, sums[found]) << found;
        ++found;
      }
      if (at == stream.size()) break;
      const std::size_t piece = std::min(1 + random() % largest_piece, stream.size() - at);
      at += feed(parser, std::span(stream).subspan(at, piece));
    }
    EXPECT_EQ(found, sums.size());
  }
}

TEST(RecordParser, TellsWrongMagicWrongVersionAndOversizeApart) {
  Bytes good;
  append_record(good, RecordKind::control, Bytes(10));
  struct Case {
    std::size_t at;
    std::uint8_t value;
    ParseStatus expected;
    std::uint32_t offending;
  };
  for (const Case& c :
       {Case{0, 0x58, ParseStatus::wrong_magic, 0x43524D58},
        Case{4, 7, ParseStatus::wrong_version, 7}, Case{8, 101, ParseStatus::oversize, 101},
        Case{11, 0xFF, ParseStatus::oversize, 0xFF00000A}}) {
    Bytes bytes = good;
    bytes[c.at] = std::byte{c.value};
    RecordParser parser({.max_control_bytes = 100, .max_frame_bytes = 0});
    feed(parser, bytes);
    Record record;
    EXPECT_EQ(parser.next(record), c.expected);
    EXPECT_EQ(parser.offending_value(), c.offending);
    // The framing is lost: no record comes out and no byte is accepted.
    EXPECT_EQ(parser.next(record), c.expected);
    EXPECT_TRUE(parser.writable().empty());
    // The parser works again after reset(), for a new connection.
    parser.reset();
    feed(parser, good);
    EXPECT_EQ(parser.next(record), ParseStatus::record);
    EXPECT_EQ(record.body.size(), 10u);
  }
}

TEST(RecordParser, HasALimitForFramesOfTheirOwn) {
  Bytes stream;
  append_record(stream, RecordKind::frame, Bytes(50));
  RecordParser refusing({.max_control_bytes = 100, .max_frame_bytes = 0});
  feed(refusing, stream);
  Record record;
  EXPECT_EQ(refusing.next(record), ParseStatus::oversize);
}

TEST(RecordParser, HandsRecordsOfUnknownKindOnForSkipping) {
  Bytes stream;
  append_record(stream, static_cast<RecordKind>(200), Bytes(5));
  append_record(stream, RecordKind::control, Bytes(6));
  RecordParser parser({.max_control_bytes = 100, .max_frame_bytes = 0});
  feed(parser, stream);
  Record record;
  ASSERT_EQ(parser.next(record), ParseStatus::record);
  EXPECT_EQ(static_cast<int>(record.kind), 200);
  ASSERT_EQ(parser.next(record), ParseStatus::record);
  EXPECT_EQ(record.body.size(), 6u);
}

TEST(RecordParser, TellsThatAStreamEndedWithinARecord) {
  Bytes stream;
  append_record(stream, RecordKind::control, Bytes(20));
  RecordParser parser({.max_control_bytes = 100, .max_frame_bytes = 0});
  feed(parser, std::span(stream).first(25));
  Record record;
  EXPECT_EQ(parser.next(record), ParseStatus::need_more);
  EXPECT_EQ(parser.pending_bytes(), 25u);
}

TEST(RecordParser, TellsWhatTheRecordBegunStillLacks) {
  Bytes stream;
  append_record(stream, RecordKind::control, Bytes(20));
  append_record(stream, RecordKind::control, Bytes(7));
  RecordParser parser({.max_control_bytes = 100, .max_frame_bytes = 0});
  Record record;
  EXPECT_EQ(parser.next(record), ParseStatus::need_more);
  EXPECT_EQ(parser.missing_bytes(), 0u) << "nothing begun";
  feed(parser, std::span(stream).first(11));
  EXPECT_EQ(parser.next(record), ParseStatus::need_more);
  EXPECT_EQ(parser.missing_bytes(), 0u) << "its length is not known";
  feed(parser, std::span(stream).subspan(11, 14));
  EXPECT_EQ(parser.next(record), ParseStatus::need_more);
  EXPECT_EQ(parser.missing_bytes(), 7u);
  feed(parser, std::span(stream).subspan(25, 20));
  EXPECT_EQ(parser.next(record), ParseStatus::record);
  EXPECT_EQ(parser.missing_bytes(), 0u);
  EXPECT_EQ(parser.next(record), ParseStatus::need_more);
  EXPECT_EQ(parser.missing_bytes(), 6u);
  parser.reset();
  EXPECT_EQ(parser.missing_bytes(), 0u);
}

TEST(FrameRecord, DecodesHeaderAndPixels) {
  const auto frame = test::make_frame(8, 4, 3);
  Bytes body(frame.header_bytes.begin(), frame.header_bytes.end());
  body.insert(body.end(), frame.pixels.begin(), frame.pixels.end());
  auto view = decode_frame_record(body);
  ASSERT_TRUE(view) << view.error().text;
  EXPECT_EQ(view->header.frame_number, 3u);
  EXPECT_TRUE(std::ranges::equal(view->pixels, frame.pixels));
  EXPECT_TRUE(payload_crc_matches(*view));
  body[400] ^= std::byte{1};
  view = decode_frame_record(body);
  ASSERT_TRUE(view);
  EXPECT_FALSE(payload_crc_matches(*view));
  body.pop_back();
  view = decode_frame_record(body);
  ASSERT_FALSE(view);
  EXPECT_THAT(view.error().text, ::testing::HasSubstr("frame 3: 127 bytes follow"));
}

}  // namespace
}  // namespace emit::protocol
