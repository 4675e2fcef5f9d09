// SPDX-License-Identifier: Apache-2.0
// A refused host frame names the field that is wrong, its value and its range.
#include <gtest/gtest.h>

#include <array>
#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "emit/protocol/codec.hpp"
#include "host_frames.hpp"
#include "support/heap_counter.hpp"

namespace emit::protocol {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Case {
  std::function<void(HostFrameData&)> spoil;
  std::string text;
};

std::vector<Case> cases() {
  return {
      {[](auto& frame) { frame.seeker.position_world_m.y = kNan; },
       "invalid pose: seeker: position_m.y is nan, must be -100000000 to 100000000"},
      {[](auto& frame) {
         frame.seeker.world_from_body = {0.0, 0.0, 0.0, 0.0};
       },
       "invalid pose: seeker: norm of world_from_body is 0, must be 0.99 to 1.01"},
      {[](auto& frame) { frame.seeker_rates->velocity_world_m_s.z = -2e6; },
       "invalid pose: seeker: velocity_m_s.z is -2000000, must be -1000000 to 1000000"},
      {[](auto& frame) { frame.entities[2].pose.position_world_m.x = 1e9; },
       "invalid pose: entity 14: position_m.x is 1000000000, must be -100000000 to 100000000"},
      {[](auto& frame) { frame.entities[0].rates->angular_rate_body_rad_s.x = kInfinity; },
       "invalid pose: entity 0: angular_rate_rad_s.x is inf, must be -10000 to 10000"},
      {[](auto& frame) { frame.entities[3].entity_id = 7; },
       "malformed message: entity 7 stands in the frame twice"},
      {[](auto& frame) { frame.environment->air_k = 400.5; },
       "invalid environment: air_k is 400.5, must be 180 to 340"},
      {[](auto& frame) { frame.environment->film_w_m2_k = -1.0; },
       "invalid environment: film_w_m2_k is -1, must be 0 to 1000"},
      {[](auto& frame) { frame.parts[0].value = 4000.0; },
       "invalid part: entity 7, part 1: temperature_k is 4000, must be 50 to 3000"},
      {[](auto& frame) { frame.parts[2].value = -0.5; },
       "invalid part: entity 14, part 1: throttle is -0.5, must be 0 to 1"},
      {[](auto& frame) { frame.parts[1].part_id = 1; },
       "invalid part: entity 7, part 1 stands in the frame twice"},
      {[](auto& frame) { frame.sim_time_ns = 2 * kMaxSimTimeNs; },
       "malformed message: sim_time_ns is 2e+18, must be -1e+18 to 1e+18"},
  };
}

TEST(DecodeFault, NamesEntityFieldValueAndRange) {
  HostFrameEncoder encoder;
  HostFrameDecoder decoder;
  auto out = std::make_unique<HostFrameData>();
  for (const Case& each : cases()) {
    SCOPED_TRACE(each.text);
    auto frame = test::make_host_frame(4);
    each.spoil(*frame);
    const DecodeStatus status = decode_host_frame(encoder.encode(*frame), decoder, *out);
    ASSERT_NE(status, DecodeStatus::ok);
    std::array<char, kFaultTextBytes> buffer;
    EXPECT_EQ(fault_text(status, decoder.fault(), buffer), each.text);
    // The log's text has no value, so that a fault that repeats is one warning.
    std::array<char, kFaultTextBytes> place;
    const std::string_view without_value = fault_place(status, decoder.fault(), place);
    EXPECT_EQ(each.text.compare(0, without_value.size(), without_value), 0);
    EXPECT_EQ(without_value.find(" is "), std::string_view::npos);
  }
  auto good = test::make_host_frame(4);
  ASSERT_EQ(decode_host_frame(encoder.encode(*good), decoder, *out), DecodeStatus::ok);
  EXPECT_EQ(decoder.fault().kind, DecodeFault::Kind::none);
}

TEST(DecodeFault, NamesAMissingPart) {
  // The bytes hold frame_number 1, protocol_version 1 and nothing else.
  const std::array bytes{std::byte{0x08}, std::byte{1}, std::byte{0x10}, std::byte{1}};
  HostFrameDecoder decoder;
  auto out = std::make_unique<HostFrameData>();
  const DecodeStatus status = decode_host_frame(bytes, decoder, *out);
  std::array<char, kFaultTextBytes> buffer;
  EXPECT_EQ(fault_text(status, decoder.fault(), buffer), "invalid pose: seeker is missing");
}

TEST(DecodeFault, AllocatesNothing) {
  HostFrameEncoder encoder;
  HostFrameDecoder decoder;
  auto out = std::make_unique<HostFrameData>();
  auto frame = test::make_host_frame(4);
  frame->entities[2].pose.position_world_m.x = kNan;
  const auto bytes = encoder.encode(*frame);
  std::array<char, kFaultTextBytes> buffer;
  std::size_t length = 0;
  static_cast<void>(decode_host_frame(bytes, decoder, *out));  // Protobuf's own first use
  const std::uint64_t before = test::heap_request_count();
  for (int i = 0; i < 100; ++i) {
    const DecodeStatus status = decode_host_frame(bytes, decoder, *out);
    length += fault_text(status, decoder.fault(), buffer).size();
  }
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_GT(length, 0U);
}

TEST(DecodeFault, ATextThatIsTooLongIsCutOff) {
  DecodeFault fault;
  fault.kind = DecodeFault::Kind::out_of_range;
  fault.field = "position_m.x";
  std::array<char, 20> buffer;
  EXPECT_EQ(fault_text(DecodeStatus::invalid_pose, fault, buffer), "invalid pose: positi");
}

}  // namespace
}  // namespace emit::protocol
