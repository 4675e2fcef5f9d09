// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <glm/ext/quaternion_common.hpp>
#include <glm/ext/quaternion_double.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/protocol/net_fdm.hpp"
#include "protocol/hex.hpp"
#include "support/heap_counter.hpp"

namespace emit::protocol::net_fdm {
namespace {

// A datagram with a number in every field, written by another program from the order and the types
// of the fields alone: > I 4x 3d 6f 11f 3f 2f I 4I 9 times 4f, I 4f I 3I 3f 3f 3f I i f 10f.
constexpr std::string_view kGoldenFdm =
    "0000001800000000bff40000000000003fe8000000000000409772000000000042f000003e800000"
    "be000000402000003d800000bd0000003f000000be8000003e000000437a00004140000042c80000"
    "c348000042480000439600003f8000004000000041000000c0800000c20000003dcccccd3e4ccccd"
    "0000000200000002000000020000000000000000000000003f800000400000004040000040800000"
    "40a0000040c0000040e0000041000000411000004120000041300000414000004150000041600000"
    "417000004180000041880000419000004198000041a0000041a8000041b0000041b8000041c00000"
    "41c8000041d0000041d8000041e0000041e8000041f0000041f80000420000004204000042080000"
    "420c000000000003000000004120000041a0000041f0000000000003000000010000000100000000"
    "3f0000003f0000003f0000003f0000003f0000003f0000003f0000003f0000003f0000006553f100"
    "fffff1f046c35000000000003dcccccd3e4ccccd3e99999a3ecccccd3f0000003f19999a3f333333"
    "3f4ccccd3f666666";

State golden_state() {
  return {.longitude_rad = -1.25,
          .latitude_rad = 0.75,
          .altitude_m = 1500.5,
          .roll_rad = 0.25f,
          .pitch_rad = -0.125f,
          .heading_rad = 2.5f,
          .roll_rate_rad_s = 0.5f,
          .pitch_rate_rad_s = -0.25f,
          .heading_rate_rad_s = 0.125f,
          .velocity_ned_m_s = {30.48, -60.96, 15.24},
          .pilot_specific_force_m_s2 = {8 * 0.3048, -4 * 0.3048, -32 * 0.3048},
          .unix_time_s = 1'700'000'000,
          .warp_s = -3600};
}

using FdmBytes = std::array<std::byte, kBytes>;

FdmBytes encoded(const State& state) {
  FdmBytes bytes;
  encode(state, bytes);
  return bytes;
}

std::string text_of_fdm(const Fault& fault) {
  std::array<char, kFaultTextBytes> buffer;
  return std::string(fault_text(fault, buffer));
}

template <class T>
void put_number(std::span<std::byte> bytes, std::size_t at, T value) {
  std::array<std::byte, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof value);
  std::reverse_copy(raw.begin(), raw.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
}

TEST(NetFdm, FieldsAreReadAtTheirOffsetsInSiUnits) {
  const auto bytes = test::from_hex(kGoldenFdm);
  ASSERT_EQ(bytes.size(), kBytes);
  State state;
  EXPECT_EQ(text_of_fdm(decode(bytes, state)), "no fault");
  const State expected = golden_state();
  EXPECT_EQ(state.longitude_rad, expected.longitude_rad);
  EXPECT_EQ(state.latitude_rad, expected.latitude_rad);
  EXPECT_EQ(state.altitude_m, expected.altitude_m);
  EXPECT_EQ(state.roll_rad, expected.roll_rad);
  EXPECT_EQ(state.pitch_rad, expected.pitch_rad);
  EXPECT_EQ(state.heading_rad, expected.heading_rad);
  EXPECT_EQ(state.roll_rate_rad_s, expected.roll_rate_rad_s);
  EXPECT_EQ(state.pitch_rate_rad_s, expected.pitch_rate_rad_s);
  EXPECT_EQ(state.heading_rate_rad_s, expected.heading_rate_rad_s);
  EXPECT_LT(glm::length(state.velocity_ned_m_s - expected.velocity_ned_m_s), 1e-12);
  EXPECT_LT(glm::length(state.pilot_specific_force_m_s2 - expected.pilot_specific_force_m_s2),
            1e-12);
  EXPECT_EQ(state.unix_time_s, expected.unix_time_s);
  EXPECT_EQ(state.warp_s, expected.warp_s);
}

/// The same datagram in version 25: 16 and 128 bytes about tanks stand between tanks and gear.
std::vector<std::byte> golden_25() {
  std::vector<std::byte> bytes = test::from_hex(kGoldenFdm);
  bytes[3] = std::byte{25};
  bytes.insert(bytes.begin() + kTanksAt, 144, std::byte{0x3F});
  return bytes;
}

TEST(NetFdm, TheVersionOfNewerFlightGearHasTheSameFields) {
  State state;
  EXPECT_EQ(text_of_fdm(decode(golden_25(), state)), "no fault");
  State of_24;
  EXPECT_FALSE(decode(test::from_hex(kGoldenFdm), of_24));
  EXPECT_TRUE(state == of_24);
  std::vector<std::byte> wrong = golden_25();
  wrong.pop_back();
  EXPECT_EQ(text_of_fdm(decode(wrong, state)), "551 bytes, version 25 has 552");
  wrong.resize(408);
  EXPECT_EQ(text_of_fdm(decode(wrong, state)), "408 bytes, version 25 has 552");
  std::vector<std::byte> swapped = golden_25();
  std::reverse(swapped.begin(), swapped.begin() + 4);
  EXPECT_EQ(text_of_fdm(decode(swapped, state)),
            "the sender's byte order is little endian, must be big endian");
  EXPECT_TRUE(state == of_24);
}

TEST(NetFdm, TheEncoderWritesTheSameBytesAndZerosElsewhere) {
  const auto golden = test::from_hex(kGoldenFdm);
  const FdmBytes bytes = encoded(golden_state());
  std::size_t written = 0;
  for (std::size_t i = 0; i < kBytes; ++i) {
    if (bytes[i] == std::byte{0}) continue;
    EXPECT_EQ(bytes[i], golden[i]) << i;
    ++written;
  }
  EXPECT_GT(written, 25U);
  State again;
  EXPECT_FALSE(decode(bytes, again));
  const FdmBytes twice = encoded(again);
  EXPECT_TRUE(std::ranges::equal(bytes, twice)) << "feet survive the way to metres and back";
}

TEST(NetFdm, OtherVersionsSizesAndOrdersAreRefused) {
  State state{.altitude_m = 5.0};
  const State before = state;
  const auto refused = [&](std::span<const std::byte> bytes) {
    const Fault fault = decode(bytes, state);
    EXPECT_TRUE(fault);
    EXPECT_TRUE(state == before) << "a refused datagram changes nothing";
    return text_of_fdm(fault);
  };
  const FdmBytes good = encoded({});
  EXPECT_EQ(refused({}), "0 bytes, must be 408 or 552");
  EXPECT_EQ(refused(std::span(good).first(3)), "3 bytes, must be 408 or 552");
  EXPECT_EQ(refused(std::span(good).first(407)), "407 bytes, version 24 has 408");
  std::vector<std::byte> longer(good.begin(), good.end());
  longer.resize(552);
  EXPECT_EQ(refused(longer), "552 bytes, version 24 has 408");
  put_number(std::span(longer), 0, std::uint32_t{26});
  EXPECT_EQ(refused(longer), "version 26, must be 24 or 25");
  FdmBytes swapped = good;
  std::reverse(swapped.begin(), swapped.begin() + 4);
  EXPECT_EQ(refused(swapped), "the sender's byte order is little endian, must be big endian");
}

TEST(NetFdm, NumbersOutOfRangeAreNamed) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto refused = [](std::size_t at, auto value) {
    FdmBytes bytes = encoded(golden_state());
    put_number(std::span(bytes), at, value);
    State state;
    return text_of_fdm(decode(bytes, state));
  };
  EXPECT_EQ(refused(16, 47.0), "latitude_rad is 47, must be -1.5708 to 1.5708");
  EXPECT_EQ(refused(8, -6.5), "longitude_rad is -6.5, must be -6.2832 to 6.2832");
  EXPECT_EQ(refused(24, -2e4), "altitude_m is -20000, must be -10000 to 100000000");
  EXPECT_EQ(refused(24, std::numeric_limits<double>::infinity()),
            "altitude_m is inf, must be -10000 to 100000000");
  EXPECT_EQ(refused(36, 90.0f), "roll_rad is 90, must be -6.2832 to 6.2832");
  EXPECT_EQ(refused(40, 1.75f), "pitch_rad is 1.75, must be -1.5708 to 1.5708");
  EXPECT_EQ(refused(44, 6.5f), "heading_rad is 6.5, must be -6.2832 to 6.2832");
  EXPECT_EQ(refused(56, kNan), "roll_rate_rad_s is nan, must be finite");
  EXPECT_EQ(refused(60, kNan), "pitch_rate_rad_s is nan, must be finite");
  EXPECT_EQ(refused(64, kNan), "heading_rate_rad_s is nan, must be finite");
  EXPECT_EQ(refused(84, kNan), "velocity_ned_m_s is nan, must be finite");
  EXPECT_EQ(refused(108, kNan), "pilot_specific_force_m_s2 is nan, must be finite");
  // A quarter turn as float32 is a little more than pi / 2, and fields that are not read may be
  // anything.
  EXPECT_EQ(refused(40, 1.57079637f), "no fault");
  EXPECT_EQ(refused(48, kNan), "no fault");
  EXPECT_EQ(refused(88, kNan), "no fault");
}

TEST(NetFdm, BodyRatesAreTheDerivativeOfTheAttitude) {
  // The attitude of the other module is differenced in time, which shares no formula with the
  // rates.
  State state{.roll_rad = 0.7f,
              .pitch_rad = -0.5f,
              .heading_rad = 2.0f,
              .roll_rate_rad_s = 0.3f,
              .pitch_rate_rad_s = -0.2f,
              .heading_rate_rad_s = 0.4f};
  const auto attitude = [&](double t) {
    return physics::world_from_body_heading_pitch_roll(
        state.heading_rad + static_cast<double>(state.heading_rate_rad_s) * t,
        state.pitch_rad + static_cast<double>(state.pitch_rate_rad_s) * t,
        state.roll_rad + static_cast<double>(state.roll_rate_rad_s) * t);
  };
  const double h = 1e-5;
  const glm::dquat turn = glm::conjugate(attitude(-h)) * attitude(h);
  const glm::dvec3 expected =
      glm::dvec3(turn.x, turn.y, turn.z) * (turn.w > 0 ? 2.0 : -2.0) / (2 * h);
  EXPECT_LT(glm::length(body_rates_rad_s(state) - expected), 1e-8);
}

TEST(NetFdm, NothingAllocates) {
  FdmBytes bytes;
  State state;
  std::array<char, kFaultTextBytes> text;
  const auto before = test::heap_request_count();
  encode(golden_state(), bytes);
  const Fault good = decode(bytes, state);
  bytes[3] = std::byte{26};
  const auto words = fault_text(decode(bytes, state), text);
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_FALSE(good);
  EXPECT_EQ(words, "version 26, must be 24 or 25");
}

}  // namespace
}  // namespace emit::protocol::net_fdm
