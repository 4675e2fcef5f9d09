// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/parity.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "emit/protocol/reassembler.hpp"
#include "protocol/frames.hpp"
#include "protocol/received_frames.hpp"

namespace emit::protocol {
namespace {

using test::Datagram;
using test::expect_true_to;
using test::Frame;

Fragmenter cut(const Frame& frame, std::uint32_t payload, std::uint32_t id) {
  return Fragmenter({.stream_id = 1,
                     .frame_id = id,
                     .sim_time_ns = frame.header.sim_time_ns,
                     .row_bytes = frame.header.width_px * 4,
                     .max_payload_bytes = payload},
                    frame.header_bytes, frame.pixels);
}

std::vector<Datagram> parity_of(const Frame& frame, const FecParams& fec, std::uint32_t payload,
                                std::uint32_t id) {
  const Fragmenter fragments = cut(frame, payload, id);
  ParityEncoder encoder(fec, fragments);
  encoder.begin();
  while (!encoder.encode_some(fragments, 1)) {
  }
  std::vector<Datagram> out;
  for (std::uint32_t i = 0; i < encoder.datagram_count(); ++i) {
    const auto bytes = encoder.datagrams(i, 1);
    out.emplace_back(bytes.begin(), bytes.end());
  }
  return out;
}

Reassembler::Params params(const Frame& frame, const FecParams& fec) {
  Reassembler::Params out;
  out.max_payload_bytes = static_cast<std::uint32_t>(frame.pixels.size());
  out.fec = fec;
  return out;
}

struct GeometryCase {
  std::uint32_t width_px;
  std::uint32_t height_px;
  std::uint32_t payload;
  FecParams fec;
};

class ParityGeometries : public ::testing::TestWithParam<GeometryCase> {};

/// Each group loses as many fragments, whichever they are, as parity fragments arrived.
TEST_P(ParityGeometries, AnyLossUpToTheParityIsRepaired) {
  const GeometryCase& test = GetParam();
  const Frame frame = test::make_frame(test.width_px, test.height_px, 5);
  const auto data = test::datagrams_of(frame, test.payload, 1);
  const auto parity = parity_of(frame, test.fec, test.payload, 1);
  const Fragmenter fragments = cut(frame, test.payload, 1);
  const auto geometry =
      ParityGeometry::of(test.fec, fragments.total_bytes(), fragments.payload_bytes());
  ASSERT_EQ(geometry.fragments, data.size());
  ASSERT_EQ(parity.size(), geometry.parity_count());
  std::mt19937 random(7);
  for (int round = 0; round < 40; ++round) {
    std::vector<const Datagram*> arriving;
    std::uint32_t lost = 0;
    for (std::uint32_t group = 0; group < geometry.groups; ++group) {
      const std::uint32_t size = geometry.group_size(group);
      ASSERT_LE(size, test.fec.data_fragments);
      std::vector<const Datagram*> all;
      for (std::uint32_t j = 0; j < size; ++j) all.push_back(&data[geometry.fragment(group, j)]);
      for (std::uint32_t p = 0; p < test.fec.parity_fragments; ++p) {
        all.push_back(&parity[p * geometry.groups + group]);
      }
      std::ranges::shuffle(all, random);
      all.resize(size);
      lost += size - static_cast<std::uint32_t>(std::ranges::count_if(
                         all, [](const Datagram* d) { return !is_parity(*d); }));
      arriving.insert(arriving.end(), all.begin(), all.end());
    }
    std::ranges::shuffle(arriving, random);
    Reassembler reassembler(params(frame, test.fec));
    for (const Datagram* datagram : arriving) {
      const FragmentStatus status = reassembler.push(*datagram);
      ASSERT_TRUE(status == FragmentStatus::accepted || status == FragmentStatus::late ||
                  status == FragmentStatus::duplicate)
          << to_string(status);
    }
    const ReceivedFrame* received = reassembler.pop();
    ASSERT_NE(received, nullptr);
    EXPECT_TRUE(received->complete);
    EXPECT_TRUE(received->crc_ok);
    EXPECT_GE(received->repaired_fragments, lost > 0 ? 1u : 0u);
    expect_true_to(*received, frame);
  }
}

INSTANTIATE_TEST_SUITE_P(
    Geometries, ParityGeometries,
    ::testing::Values(GeometryCase{64, 48, 400, {8, 3}}, GeometryCase{64, 48, 1400, {48, 5}},
                      GeometryCase{100, 71, 396, {128, 32}}, GeometryCase{64, 48, 384, {1, 1}},
                      GeometryCase{64, 48, 384, {2, 1}}, GeometryCase{4, 3, 1400, {48, 2}},
                      GeometryCase{8, 1, 384, {48, 5}}, GeometryCase{128, 96, 65000, {4, 4}},
                      GeometryCase{640, 512, 8900, {48, 5}}),
    [](const auto& each) {
      const GeometryCase& test = each.param;
      return std::to_string(test.width_px) + "x" + std::to_string(test.height_px) + "_" +
             std::to_string(test.payload) + "_" + std::to_string(test.fec.data_fragments) + "and" +
             std::to_string(test.fec.parity_fragments);
    });

/// Returns the product in GF(2^8) as docs/wire.md defines it, bit by bit.
std::uint8_t multiply(std::uint8_t a, std::uint8_t b) {
  std::uint32_t product = 0;
  for (int bit = 0; bit < 8; ++bit) {
    if ((b >> bit & 1) != 0) product ^= std::uint32_t{a} << bit;
  }
  for (int bit = 15; bit >= 8; --bit) {
    if ((product >> bit & 1) != 0) product ^= 0x11Du << (bit - 8);
  }
  return static_cast<std::uint8_t>(product);
}

TEST(Parity, BytesAreTheSumsOfTheDocument) {
  const FecParams fec{7, 3};
  const Frame frame = test::make_frame(32, 20, 9);
  const auto data = test::datagrams_of(frame, 400, 1);
  const auto parity = parity_of(frame, fec, 400, 1);
  const auto geometry = ParityGeometry::of(fec, cut(frame, 400, 1).total_bytes(), 400);
  for (std::uint32_t p = 0; p < 3; ++p) {
    for (std::uint32_t group = 0; group < geometry.groups; ++group) {
      const Datagram& sent = parity[p * geometry.groups + group];
      for (const std::size_t byte : {0u, 1u, 198u, 399u}) {
        std::uint8_t expected = 0;
        for (std::uint32_t j = 0; j < geometry.group_size(group); ++j) {
          const auto divisor = static_cast<std::uint8_t>((128 + p) ^ j);
          std::uint8_t inverse = 1;
          while (multiply(inverse, divisor) != 1) ++inverse;
          const Datagram& fragment = data[geometry.fragment(group, j)];
          const std::size_t at = kFragmentHeaderBytes + byte;
          const auto value =
              at < fragment.size() ? std::to_integer<std::uint8_t>(fragment[at]) : std::uint8_t{0};
          expected = static_cast<std::uint8_t>(expected ^ multiply(inverse, value));
        }
        ASSERT_EQ(std::to_integer<std::uint8_t>(sent[kFragmentHeaderBytes + byte]), expected)
            << p << ' ' << group << ' ' << byte;
      }
    }
  }
}

TEST(Parity, DatagramsLostInARowFallIntoDifferentGroups) {
  const FecParams fec{48, 5};
  const Frame frame = test::make_frame(320, 256, 1);
  auto wire = test::datagrams_of(frame, 1400, 1);
  const auto geometry = ParityGeometry::of(fec, cut(frame, 1400, 1).total_bytes(), 1400);
  const std::uint32_t burst = geometry.groups * fec.parity_fragments;
  ASSERT_GT(burst, 20u);
  const auto parity = parity_of(frame, fec, 1400, 1);
  wire.insert(wire.end(), parity.begin(), parity.end());
  for (std::size_t begin = 0; begin + burst <= wire.size(); ++begin) {
    Reassembler reassembler(params(frame, fec));
    for (std::size_t i = 0; i < wire.size(); ++i) {
      if (i < begin || i >= begin + burst) reassembler.push(wire[i]);
    }
    const ReceivedFrame* received = reassembler.pop();
    ASSERT_NE(received, nullptr) << begin;
    ASSERT_TRUE(received->complete && received->crc_ok) << begin;
  }
}

TEST(Parity, WhatIsBeyondRepairStaysMissingAndIsCounted) {
  const FecParams fec{16, 2};
  const Frame frame = test::make_frame(64, 48, 3);
  const auto data = test::datagrams_of(frame, 400, 1);
  const auto geometry = ParityGeometry::of(fec, cut(frame, 400, 1).total_bytes(), 400);
  ASSERT_GE(geometry.groups, 2u);
  Reassembler reassembler(params(frame, fec));
  for (std::uint32_t i = 0; i < data.size(); ++i) {
    // Three fragments of group 0 and two of group 1 are lost.
    const bool lost =
        (i % geometry.groups == 0 && i / geometry.groups >= 3 && i / geometry.groups < 6) ||
        (i % geometry.groups == 1 && i / geometry.groups < 2);
    if (!lost) reassembler.push(data[i]);
  }
  for (const auto& datagram : parity_of(frame, fec, 400, 1)) {
    EXPECT_EQ(reassembler.push(datagram), FragmentStatus::accepted);
  }
  reassembler.flush();
  const ReceivedFrame* received = reassembler.pop();
  ASSERT_NE(received, nullptr);
  EXPECT_FALSE(received->complete);
  EXPECT_NE(received->header.flags & kFlagPartial, 0u);
  EXPECT_EQ(received->missing_px, 300u);
  EXPECT_EQ(received->repaired_fragments, 2u);
  EXPECT_EQ(reassembler.counters().groups_unrepairable, 1u);
  EXPECT_EQ(reassembler.counters().fragments_repaired, 2u);
  EXPECT_EQ(reassembler.counters().frames_repaired, 0u);
  expect_true_to(*received, frame);
}

TEST(Parity, IsRefusedAndCountedWhereItWasNotAgreed) {
  const Frame frame = test::make_frame(64, 48, 3);
  const auto parity = parity_of(frame, {16, 2}, 400, 1);
  FragmentHeader header;
  EXPECT_EQ(decode_fragment_header(parity[0], header), FragmentStatus::wrong_version)
      << "receivers without error correction drop and count it";
  Reassembler without(params(frame, {}));
  EXPECT_EQ(without.push(parity[0]), FragmentStatus::bad_parity);
  for (const FecParams other : {FecParams{16, 3}, FecParams{17, 2}, FecParams{8, 2}}) {
    Reassembler reassembler(params(frame, other));
    EXPECT_EQ(reassembler.push(parity[0]), FragmentStatus::bad_parity) << other.data_fragments;
  }
}

TEST(Parity, HeadersThatContradictAreRefused) {
  const FecParams fec{16, 2};
  const Frame frame = test::make_frame(64, 48, 3);
  const auto parity = parity_of(frame, fec, 400, 1);
  ParityHeader sound;
  ASSERT_EQ(decode_parity_header(std::span(parity[1]).first(kFragmentHeaderBytes), 400, fec, sound),
            FragmentStatus::accepted);
  const auto status_of = [&](ParityHeader header, std::size_t payload) {
    Reassembler reassembler(params(frame, fec));
    reassembler.push(parity[0]);
    Datagram datagram(kFragmentHeaderBytes + payload);
    header.payload_bytes = static_cast<std::uint16_t>(payload);
    encode(header, std::span(datagram).first<kFragmentHeaderBytes>());
    return reassembler.push(datagram);
  };
  EXPECT_EQ(status_of(sound, 400), FragmentStatus::accepted);
  auto header = sound;
  header.group = sound.groups;
  EXPECT_EQ(status_of(header, 400), FragmentStatus::bad_parity);
  header = sound;
  header.index = 2;
  EXPECT_EQ(status_of(header, 400), FragmentStatus::bad_parity);
  header = sound;
  header.parity_fragments = 3;
  EXPECT_EQ(status_of(header, 400), FragmentStatus::bad_parity);
  header = sound;
  header.groups = static_cast<std::uint16_t>(sound.groups + 1);
  EXPECT_EQ(status_of(header, 400), FragmentStatus::bad_parity);
  header = sound;
  header.groups = 0;
  EXPECT_EQ(status_of(header, 400), FragmentStatus::bad_parity);
  EXPECT_EQ(status_of(sound, 404), FragmentStatus::bad_parity) << "another length in one frame";
  EXPECT_EQ(status_of(sound, 380), FragmentStatus::bad_parity);
  EXPECT_EQ(status_of(sound, 402), FragmentStatus::bad_length);
  header = sound;
  header.total_bytes += 4;
  EXPECT_EQ(status_of(header, 400), FragmentStatus::inconsistent);
  header.total_bytes = 0xFFFFFFFC;
  EXPECT_NE(status_of(header, 400), FragmentStatus::accepted);
  header = sound;
  header.sim_time_ns += 1;
  EXPECT_EQ(status_of(header, 400), FragmentStatus::inconsistent);
  EXPECT_EQ(status_of(sound, 0), FragmentStatus::bad_parity);
}

TEST(Parity, WrongParityShowsInTheChecksumOfTheFrame) {
  const FecParams fec{16, 2};
  const Frame frame = test::make_frame(64, 48, 3);
  const auto data = test::datagrams_of(frame, 400, 1);
  auto parity = parity_of(frame, fec, 400, 1);
  parity[0][100] ^= std::byte{4};
  Reassembler reassembler(params(frame, fec));
  const auto groups = ParityGeometry::of(fec, cut(frame, 400, 1).total_bytes(), 400).groups;
  for (std::size_t i = 0; i < data.size(); ++i) {
    if (i != 2 * groups) reassembler.push(data[i]);
  }
  reassembler.push(parity[0]);
  const ReceivedFrame* received = reassembler.pop();
  ASSERT_NE(received, nullptr);
  EXPECT_TRUE(received->complete);
  EXPECT_FALSE(received->crc_ok);
}

}  // namespace
}  // namespace emit::protocol
