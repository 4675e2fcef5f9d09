// SPDX-License-Identifier: Apache-2.0
// Tests with seeded random damage to everything that comes from outside. Inputs lie in heap memory
// of their exact size, so that the address sanitizer sees a read beyond the end.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/reassembler.hpp"
#include "emit/v1/control.pb.h"
#include "protocol/frames.hpp"
#include "protocol/host_frames.hpp"

namespace emit::protocol {
namespace {

using Bytes = std::vector<std::byte>;

/// Returns a damaged copy: bits flipped, runs overwritten, parts cut, inserted and doubled.
Bytes damaged(const Bytes& good, std::mt19937& random) {
  Bytes bytes = good;
  const auto place = [&] { return bytes.empty() ? 0 : random() % bytes.size(); };
  const std::size_t changes = 1 + random() % 4;
  for (std::size_t i = 0; i < changes; ++i) {
    const auto at = static_cast<std::ptrdiff_t>(place());
    switch (random() % 6) {
      case 0:
        if (!bytes.empty()) bytes[place()] ^= static_cast<std::byte>(1u << (random() % 8));
        break;
      case 1:
        for (std::size_t k = place(), n = random() % 8; n > 0 && k < bytes.size(); --n, ++k) {
          bytes[k] = static_cast<std::byte>(random() & 0xFFu);
        }
        break;
      case 2:
        if (!bytes.empty()) bytes[place()] = std::byte{0xFF};
        break;
      case 3:
        bytes.resize(place());
        break;
      case 4:
        bytes.insert(bytes.begin() + at, random() % 40, static_cast<std::byte>(random() & 0xFFu));
        break;
      default: {
        const Bytes part(bytes.begin() + at, bytes.end());
        bytes.insert(bytes.end(), part.begin(), part.end());
      }
    }
  }
  return Bytes(bytes.begin(), bytes.end());  // exact capacity
}

bool is_sound(const physics::Pose& pose) {
  const auto& p = pose.position_world_m;
  const auto& q = pose.world_from_body;
  const double norm = std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z) &&
         std::abs(norm - 1.0) < 1e-9;
}

TEST(CorruptInput, HostFramesAreRefusedOrSound) {
  std::mt19937 random(11);
  HostFrameEncoder encoder;
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  int refused = 0;
  for (const std::uint32_t entities : {0u, 3u, 128u}) {
    const auto encoded = encoder.encode(*test::make_host_frame(entities));
    const Bytes good(encoded.begin(), encoded.end());
    for (int i = 0; i < 10000; ++i) {
      if (decode_host_frame(damaged(good, random), decoder, *out) != DecodeStatus::ok) {
        ++refused;
        continue;
      }
      ASSERT_LE(out->entity_count, kMaxEntitiesPerFrame);
      ASSERT_TRUE(is_sound(out->seeker));
      for (const auto& entity : out->entity_span()) {
        if (entity.has_pose) {
          ASSERT_TRUE(is_sound(entity.pose));
        }
      }
    }
  }
  EXPECT_GT(refused, 1000);
}

TEST(CorruptInput, RandomBytesAreNoHostFrame) {
  std::mt19937 random(12);
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  for (int i = 0; i < 20000; ++i) {
    Bytes bytes(random() % 300);
    std::ranges::generate(bytes, [&] { return static_cast<std::byte>(random() & 0xFFu); });
    EXPECT_NE(decode_host_frame(bytes, decoder, *out), DecodeStatus::ok);
  }
}

TEST(CorruptInput, ControlRecordsAreRefusedOrParsed) {
  std::mt19937 random(13);
  v1::ControlRecord record;
  auto& welcome = *record.mutable_welcome();
  welcome.set_scenario("airfield");
  auto& channel = *welcome.add_channels();
  channel.set_name("lwir");
  channel.set_width_px(640);
  Bytes wire;
  append_control_record(record, wire);
  const Bytes good(wire.begin() + kRecordHeaderBytes, wire.end());
  for (int i = 0; i < 20000; ++i) {
    const Bytes bytes = damaged(good, random);
    v1::ControlRecord parsed;
    static_cast<void>(host_frame_in_control_record(bytes));
    if (parse_control_record(bytes, parsed)) {
      EXPECT_NE(parsed.body_case(), v1::ControlRecord::BODY_NOT_SET);
    }
  }
}

TEST(CorruptInput, FrameHeadersAreRefusedUnlessTheyAreTheSentOne) {
  std::mt19937 random(14);
  const auto frame = test::make_frame(16, 8, 1);
  const Bytes good(frame.header_bytes.begin(), frame.header_bytes.end());
  for (int i = 0; i < 30000; ++i) {
    const Bytes bytes = damaged(good, random);
    const auto header = decode_frame_header(bytes);
    if (header) {
      ASSERT_GE(bytes.size(), kFrameHeaderBytes);
      ASSERT_TRUE(std::equal(good.begin(), good.end(), bytes.begin()));
    }
  }
}

TEST(CorruptInput, RecordStreamsEndInAnErrorOrInRecordsWithinTheLimits) {
  std::mt19937 random(15);
  Bytes good;
  for (std::size_t i = 0; i < 12; ++i) {
    std::array<std::byte, kRecordHeaderBytes> header{};
    const auto kind = static_cast<RecordKind>(1 + i % 4);
    const Bytes body(random() % 60, static_cast<std::byte>(i));
    encode_record_header(kind, static_cast<std::uint32_t>(body.size()), header);
    good.insert(good.end(), header.begin(), header.end());
    good.insert(good.end(), body.begin(), body.end());
  }
  for (int i = 0; i < 5000; ++i) {
    const Bytes bytes = damaged(good, random);
    RecordParser parser({.max_control_bytes = 64, .max_frame_bytes = 80});
    std::size_t at = 0;
    std::size_t taken = 0;
    while (true) {
      Record record;
      const ParseStatus status = parser.next(record);
      if (status == ParseStatus::record) {
        ASSERT_LE(record.body.size(), 80u);
        taken += kRecordHeaderBytes + record.body.size();
        continue;
      }
      if (status != ParseStatus::need_more || at == bytes.size()) break;
      const auto space = parser.writable();
      ASSERT_FALSE(space.empty());
      const std::size_t count = std::min({space.size(), bytes.size() - at, 1 + random() % 50});
      std::copy_n(bytes.begin() + static_cast<std::ptrdiff_t>(at), count, space.begin());
      parser.commit(count);
      at += count;
    }
    ASSERT_LE(taken, at);
  }
}

TEST(CorruptInput, FragmentsNeverReachBeyondTheBuffers) {
  std::mt19937 random(16);
  for (int round = 0; round < 40; ++round) {
    Reassembler reassembler({.max_payload_bytes = 48 * 32 * 4, .buffers = 5});
    std::uint64_t pushed = 0;
    for (std::uint32_t id = 1; id <= 40; ++id) {
      const auto frame = test::make_frame(48, 32, id);
      for (const auto& datagram : test::datagrams_of(frame, 640, id)) {
        reassembler.push(random() % 3 == 0 ? damaged(datagram, random) : datagram);
        ++pushed;
      }
      while (const ReceivedFrame* received = reassembler.pop()) {
        ASSERT_EQ(received->pixels.size() * 4, received->header.payload_bytes);
        double sum = 0.0;
        for (const float pixel : received->pixels) sum += pixel == 0.0F ? 0.0 : 1.0;
        ASSERT_LE(sum, 48 * 32);
        reassembler.release(received);
      }
    }
    reassembler.flush();
    std::uint64_t counted = 0;
    for (const std::uint64_t n : reassembler.counters().fragments) counted += n;
    ASSERT_EQ(counted, pushed);
  }
}

/// Valid fragment headers with random values reach the checks behind the magic number.
TEST(CorruptInput, FragmentHeadersWithWildValuesAreSurvived) {
  std::mt19937 random(17);
  Reassembler reassembler({.max_payload_bytes = 48 * 32 * 4, .buffers = 4, .max_streams = 3});
  const auto wild = [&](std::uint32_t sensible) -> std::uint32_t {
    const auto any = static_cast<std::uint32_t>(random());
    switch (random() % 4) {
      case 0:
        return sensible;
      case 1:
        return sensible + 4 * (any % 3);
      case 2:
        return 0xFFFFFFFFu - any % 8;
      default:
        return any >> (random() % 32);
    }
  };
  std::uint64_t accepted = 0;
  for (int i = 0; i < 200000; ++i) {
    FragmentHeader header;
    header.stream_id = static_cast<std::uint16_t>(random() % 4);
    header.frame_id = wild(5);
    header.byte_offset = wild(320) & (random() % 8 == 0 ? ~0u : ~3u);
    header.total_bytes = wild(48 * 32 * 4 + 640) & (random() % 8 == 0 ? ~0u : ~3u);
    Bytes datagram(kFragmentHeaderBytes + (random() % 200) * 4, std::byte{0x5A});
    header.payload_bytes = static_cast<std::uint16_t>(datagram.size() - kFragmentHeaderBytes);
    header.flags = static_cast<std::uint8_t>(
        (header.byte_offset == 0 ? kFragmentFirst : 0) |
        (header.byte_offset + header.payload_bytes == header.total_bytes ? kFragmentLast : 0));
    encode(header, std::span(datagram).first<kFragmentHeaderBytes>());
    if (reassembler.push(datagram) == FragmentStatus::accepted) ++accepted;
    while (const ReceivedFrame* received = reassembler.pop()) reassembler.release(received);
  }
  EXPECT_GT(accepted, 1000u);
}

}  // namespace
}  // namespace emit::protocol
