// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/codec.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <string>
#include <vector>

#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"
#include "protocol/hex.hpp"
#include "protocol/host_frames.hpp"
#include "support/heap_counter.hpp"

namespace emit::protocol {
namespace {

using Bytes = std::vector<std::byte>;

Bytes encoded(const v1::HostFrame& message) {
  Bytes bytes(message.ByteSizeLong());
  message.SerializeToArray(bytes.data(), static_cast<int>(bytes.size()));
  return bytes;
}

v1::HostFrame valid_message(std::uint32_t entities = 3) {
  v1::HostFrame message;
  to_proto(*test::make_host_frame(entities), message);
  return message;
}

DecodeStatus decode(const Bytes& bytes) {
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  return decode_host_frame(bytes, decoder, *out);
}

void expect_equal(const std::optional<PoseRates>& a, const std::optional<PoseRates>& b) {
  ASSERT_EQ(a.has_value(), b.has_value());
  if (!a) return;
  EXPECT_EQ(a->velocity_world_m_s, b->velocity_world_m_s);
  EXPECT_EQ(a->angular_rate_body_rad_s, b->angular_rate_body_rad_s);
}

void expect_equal(const HostFrameData& a, const HostFrameData& b) {
  EXPECT_EQ(a.frame_number, b.frame_number);
  EXPECT_EQ(a.sim_time_ns, b.sim_time_ns);
  EXPECT_EQ(a.run_id, b.run_id);
  EXPECT_EQ(a.seeker.position_world_m, b.seeker.position_world_m);
  EXPECT_EQ(a.seeker.world_from_body, b.seeker.world_from_body);
  expect_equal(a.seeker_rates, b.seeker_rates);
  ASSERT_EQ(a.entity_count, b.entity_count);
  for (std::uint32_t i = 0; i < a.entity_count; ++i) {
    EXPECT_EQ(a.entities[i].entity_id, b.entities[i].entity_id);
    EXPECT_EQ(a.entities[i].on, b.entities[i].on);
    EXPECT_EQ(a.entities[i].teleport, b.entities[i].teleport);
    ASSERT_EQ(a.entities[i].has_pose, b.entities[i].has_pose);
    if (!a.entities[i].has_pose) continue;
    EXPECT_EQ(a.entities[i].pose.position_world_m, b.entities[i].pose.position_world_m);
    EXPECT_EQ(a.entities[i].pose.world_from_body, b.entities[i].pose.world_from_body);
    expect_equal(a.entities[i].rates, b.entities[i].rates);
  }
  ASSERT_EQ(a.part_count, b.part_count);
  for (std::uint32_t i = 0; i < a.part_count; ++i) {
    EXPECT_EQ(a.parts[i].entity_id, b.parts[i].entity_id);
    EXPECT_EQ(a.parts[i].part_id, b.parts[i].part_id);
    EXPECT_EQ(a.parts[i].kind, b.parts[i].kind);
    EXPECT_EQ(a.parts[i].value, b.parts[i].value);
  }
  ASSERT_EQ(a.environment.has_value(), b.environment.has_value());
  if (!a.environment) return;
  EXPECT_EQ(a.environment->direct_normal_w_m2, b.environment->direct_normal_w_m2);
  EXPECT_EQ(a.environment->diffuse_horizontal_w_m2, b.environment->diffuse_horizontal_w_m2);
  EXPECT_EQ(a.environment->longwave_down_w_m2, b.environment->longwave_down_w_m2);
  EXPECT_EQ(a.environment->air_k, b.environment->air_k);
  EXPECT_EQ(a.environment->wind_m_s, b.environment->wind_m_s);
  EXPECT_EQ(a.environment->cloud_frac, b.environment->cloud_frac);
  EXPECT_EQ(a.environment->environment_k, b.environment->environment_k);
  EXPECT_EQ(a.environment->film_w_m2_k, b.environment->film_w_m2_k);
  EXPECT_EQ(a.environment->wind_from_deg, b.environment->wind_from_deg);
  EXPECT_EQ(a.environment->relative_humidity_frac, b.environment->relative_humidity_frac);
  EXPECT_EQ(a.environment->rain_mm_h, b.environment->rain_mm_h);
}

TEST(HostFrameCodec, RoundTripsBitForBit) {
  for (const std::uint32_t entities : {0u, 1u, 9u, 128u}) {
    const auto sent = test::make_host_frame(entities);
    if (entities == 1) sent->environment.reset();
    if (entities == 9) sent->seeker_rates.reset();
    HostFrameEncoder encoder;
    HostFrameDecoder decoder;
    const auto received = std::make_unique<HostFrameData>();
    received->received_ns = 5;
    ASSERT_EQ(decode_host_frame(encoder.encode(*sent), decoder, *received), DecodeStatus::ok);
    expect_equal(*received, *sent);
    EXPECT_EQ(received->received_ns, 0);
  }
}

TEST(HostFrameCodec, DecodesTheGoldenBytes) {
  // The bytes hold protocol_version 1, frame_number 300, sim_time_ns 5, run_id 7 and a seeker at
  // (1, 2, 0) with identity attitude. They were written by hand after the Protobuf encoding rules.
  const auto bytes = test::from_hex(
      "0801"
      "10ac02"
      "190500000000000000"
      "221f"
      "0a12"
      "09000000000000f03f"
      "110000000000000040"
      "1209"
      "09000000000000f03f"
      "3807");
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  ASSERT_EQ(decode_host_frame(bytes, decoder, *out), DecodeStatus::ok);
  EXPECT_EQ(out->frame_number, 300u);
  EXPECT_EQ(out->sim_time_ns, 5);
  EXPECT_EQ(out->run_id, 7u);
  EXPECT_EQ(out->seeker.position_world_m, glm::dvec3(1.0, 2.0, 0.0));
  EXPECT_EQ(out->seeker.world_from_body, glm::dquat(1.0, 0.0, 0.0, 0.0));
  HostFrameEncoder encoder;
  EXPECT_EQ(test::to_hex(encoder.encode(*out)), test::to_hex(bytes));
}

TEST(HostFrameCodec, DecodesTheGoldenBytesOfParts) {
  // The frame of the other golden bytes is followed by part 2 of entity 300 at throttle 0.5, part 1
  // of entity 3 off. The bytes were written by hand after the Protobuf encoding rules.
  const auto bytes = test::from_hex(
      "0801"
      "10ac02"
      "190500000000000000"
      "221f"
      "0a12"
      "09000000000000f03f"
      "110000000000000040"
      "1209"
      "09000000000000f03f"
      "3807"
      "720e"
      "08ac02"
      "1002"
      "29000000000000e03f"
      "7204"
      "0803"
      "1001");
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  ASSERT_EQ(decode_host_frame(bytes, decoder, *out), DecodeStatus::ok);
  ASSERT_EQ(out->part_count, 2U);
  EXPECT_EQ(out->parts[0].entity_id, 300U);
  EXPECT_EQ(out->parts[0].part_id, 2U);
  EXPECT_EQ(out->parts[0].kind, PartCommandData::Kind::throttle);
  EXPECT_EQ(out->parts[0].value, 0.5);
  EXPECT_EQ(out->parts[1].entity_id, 3U);
  EXPECT_EQ(out->parts[1].kind, PartCommandData::Kind::off);
  HostFrameEncoder encoder;
  EXPECT_EQ(test::to_hex(encoder.encode(*out)), test::to_hex(bytes));
}

TEST(HostFrameCodec, RefusesPartsOutsideTheirRangesTwiceOrTooMany) {
  using Change = void (*)(v1::PartCommand&);
  const Change changes[] = {
      [](v1::PartCommand& p) { p.set_part_id(0); },
      [](v1::PartCommand& p) { p.set_part_id(65536); },
      [](v1::PartCommand& p) { p.set_temperature_k(49.0); },
      [](v1::PartCommand& p) { p.set_temperature_k(std::numeric_limits<double>::quiet_NaN()); },
      [](v1::PartCommand& p) { p.set_power_w_m2(-1.0); },
      [](v1::PartCommand& p) { p.set_power_w_m2(1e7); },
      [](v1::PartCommand& p) { p.set_throttle(1.01); },
      [](v1::PartCommand& p) { p.set_throttle(std::numeric_limits<double>::infinity()); },
  };
  for (const Change change : changes) {
    auto message = valid_message();
    change(*message.mutable_parts(0));
    EXPECT_EQ(decode(encoded(message)), DecodeStatus::invalid_part);
  }
  auto twice = valid_message();
  twice.mutable_parts(1)->set_part_id(twice.parts(0).part_id());
  EXPECT_EQ(decode(encoded(twice)), DecodeStatus::invalid_part);
  auto many = valid_message();
  while (many.parts_size() < 32) {
    v1::PartCommand& part = *many.add_parts();
    part.set_entity_id(100);
    part.set_part_id(static_cast<std::uint32_t>(many.parts_size()));
  }
  EXPECT_EQ(decode(encoded(many)), DecodeStatus::ok);
  many.add_parts()->set_entity_id(101);
  EXPECT_EQ(decode(encoded(many)), DecodeStatus::oversize);
}

TEST(HostFrameCodec, DoesNotAllocateInSteadyState) {
  const auto sent = test::make_host_frame(kMaxEntitiesPerFrame);
  HostFrameEncoder encoder;
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(decode_host_frame(encoder.encode(*sent), decoder, *out), DecodeStatus::ok);
  }
  const std::uint64_t before = test::heap_request_count();
  DecodeStatus status = DecodeStatus::malformed;
  for (int i = 0; i < 100; ++i) status = decode_host_frame(encoder.encode(*sent), decoder, *out);
  const std::uint64_t after = test::heap_request_count();
  EXPECT_EQ(status, DecodeStatus::ok);
  EXPECT_EQ(after - before, 0u);
}

TEST(HostFrameCodec, AQuaternionSlightlyOffUnitLengthIsNormalisedOnce) {
  auto message = valid_message(0);
  message.mutable_seeker()->mutable_world_from_body()->set_w(0.505);
  HostFrameDecoder decoder;
  const auto first = std::make_unique<HostFrameData>();
  ASSERT_EQ(decode_host_frame(encoded(message), decoder, *first), DecodeStatus::ok);
  const auto& q = first->seeker.world_from_body;
  EXPECT_NEAR(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z, 1.0, 1e-15);
  // A decoded frame decodes to the same bits after encoding, so a journal replays exactly.
  HostFrameEncoder encoder;
  const auto second = std::make_unique<HostFrameData>();
  ASSERT_EQ(decode_host_frame(encoder.encode(*first), decoder, *second), DecodeStatus::ok);
  EXPECT_EQ(second->seeker.world_from_body, q);
}

TEST(HostFrameCodec, RefusesPosesThatAreNoPoses) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  constexpr double kInf = std::numeric_limits<double>::infinity();
  using Change = void (*)(v1::Pose&);
  const Change changes[] = {
      [](v1::Pose& p) { p.mutable_position_m()->set_x(kNan); },
      [](v1::Pose& p) { p.mutable_position_m()->set_z(-kInf); },
      [](v1::Pose& p) { p.mutable_position_m()->set_y(1e9); },
      [](v1::Pose& p) { p.mutable_world_from_body()->set_x(kNan); },
      [](v1::Pose& p) { p.mutable_world_from_body()->set_w(kInf); },
      [](v1::Pose& p) { p.mutable_world_from_body()->set_w(2.0); },
      [](v1::Pose& p) { p.mutable_world_from_body()->Clear(); },
      [](v1::Pose& p) { p.clear_position_m(); },
      [](v1::Pose& p) { p.clear_world_from_body(); },
      [](v1::Pose& p) { p.mutable_velocity_m_s()->set_x(kNan); },
      [](v1::Pose& p) { p.mutable_angular_rate_rad_s()->set_x(kInf); },
      [](v1::Pose& p) {
        p.mutable_velocity_m_s();
        p.clear_angular_rate_rad_s();
      },
  };
  for (const Change change : changes) {
    auto seeker = valid_message();
    change(*seeker.mutable_seeker());
    EXPECT_EQ(decode(encoded(seeker)), DecodeStatus::invalid_pose) << seeker.ShortDebugString();
    auto entity = valid_message();
    change(*entity.mutable_entities(0)->mutable_pose());
    EXPECT_EQ(decode(encoded(entity)), DecodeStatus::invalid_pose) << entity.ShortDebugString();
  }
  auto none = valid_message();
  none.clear_seeker();
  EXPECT_EQ(decode(encoded(none)), DecodeStatus::invalid_pose);
}

TEST(HostFrameCodec, RefusesSimulationTimesThatNoScenarioReaches) {
  constexpr std::int64_t kLargest = 1'000'000'000'000'000'000;
  constexpr auto kAny = std::numeric_limits<std::int64_t>::max();
  const auto with_time = [](std::int64_t time_ns) {
    auto message = valid_message();
    message.set_sim_time_ns(time_ns);
    return decode(encoded(message));
  };
  for (const std::int64_t time_ns : {kLargest, -kLargest, std::int64_t{0}}) {
    EXPECT_EQ(with_time(time_ns), DecodeStatus::ok) << time_ns;
  }
  for (const std::int64_t time_ns : {kLargest + 1, -kLargest - 1, kAny, -kAny - 1}) {
    EXPECT_EQ(with_time(time_ns), DecodeStatus::malformed) << time_ns;
  }
}

TEST(HostFrameCodec, TakesTheWeatherThatScenariosTakeAndNoOther) {
  using Set = void (*)(v1::Environment&, double);
  struct Range {
    Set set;
    double lowest;
    double highest;
  };
  // The ranges are those of [[weather.sample]].
  const Range ranges[] = {
      {[](v1::Environment& e, double v) { e.set_direct_normal_w_m2(v); }, 0.0, 2000.0},
      {[](v1::Environment& e, double v) { e.set_diffuse_horizontal_w_m2(v); }, 0.0, 1500.0},
      {[](v1::Environment& e, double v) { e.set_longwave_down_w_m2(v); }, 0.0, 1000.0},
      {[](v1::Environment& e, double v) { e.set_air_k(v); }, 180.0, 340.0},
      {[](v1::Environment& e, double v) { e.set_wind_m_s(v); }, 0.0, 100.0},
      {[](v1::Environment& e, double v) { e.set_cloud_frac(v); }, 0.0, 1.0},
      {[](v1::Environment& e, double v) { e.set_environment_k(v); }, 100.0, 400.0},
      {[](v1::Environment& e, double v) { e.set_film_w_m2_k(v); }, 0.0, 1000.0},
      {[](v1::Environment& e, double v) { e.set_wind_from_deg(v); }, 0.0, 360.0},
      {[](v1::Environment& e, double v) { e.set_relative_humidity_frac(v); }, 0.0, 1.0},
      {[](v1::Environment& e, double v) { e.set_rain_mm_h(v); }, 0.0, 500.0},
  };
  for (const Range& range : ranges) {
    const auto with_value = [&](double value) {
      auto message = valid_message();
      range.set(*message.mutable_environment(), value);
      return decode(encoded(message));
    };
    EXPECT_EQ(with_value(range.lowest), DecodeStatus::ok) << range.lowest;
    EXPECT_EQ(with_value(range.highest), DecodeStatus::ok) << range.highest;
    EXPECT_EQ(with_value(range.lowest - 1e-3), DecodeStatus::invalid_environment) << range.lowest;
    EXPECT_EQ(with_value(range.highest + 1e-3), DecodeStatus::invalid_environment) << range.highest;
  }
}

TEST(HostFrameCodec, WeatherOfOlderHostsStatesNoHumidityWindDirectionOrRain) {
  auto message = valid_message();
  message.mutable_environment()->Clear();
  message.mutable_environment()->set_air_k(290.0);
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  out->environment.emplace().rain_mm_h = 3.0;  // of the frame before
  ASSERT_EQ(decode_host_frame(encoded(message), decoder, *out), DecodeStatus::ok);
  EXPECT_FALSE(out->environment->wind_from_deg);
  EXPECT_FALSE(out->environment->relative_humidity_frac);
  EXPECT_EQ(out->environment->rain_mm_h, 0.0);
}

TEST(HostFrameCodec, CarriesAFieldOfViewAndRefusesWhatIsNone) {
  auto message = valid_message();
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  out->fov_h_rad = 1.0;  // of the frame before
  ASSERT_EQ(decode_host_frame(encoded(message), decoder, *out), DecodeStatus::ok);
  EXPECT_FALSE(out->fov_h_rad);
  message.set_fov_h_rad(0.125);
  ASSERT_EQ(decode_host_frame(encoded(message), decoder, *out), DecodeStatus::ok);
  EXPECT_EQ(out->fov_h_rad, 0.125);
  HostFrameEncoder encoder;
  const auto again = std::make_unique<HostFrameData>();
  ASSERT_EQ(decode_host_frame(encoder.encode(*out), decoder, *again), DecodeStatus::ok);
  EXPECT_EQ(again->fov_h_rad, 0.125);
  for (const double wrong : {0.0, -0.1, 3.2, std::numeric_limits<double>::infinity(),
                             std::numeric_limits<double>::quiet_NaN()}) {
    message.set_fov_h_rad(wrong);
    EXPECT_EQ(decode(encoded(message)), DecodeStatus::invalid_view) << wrong;
  }
}

TEST(HostFrameCodec, RefusesEnvironmentsOutsideTheirRanges) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  using Change = void (*)(v1::Environment&);
  const Change changes[] = {
      [](v1::Environment& e) { e.set_direct_normal_w_m2(-1.0); },
      [](v1::Environment& e) { e.set_diffuse_horizontal_w_m2(kNan); },
      [](v1::Environment& e) { e.set_longwave_down_w_m2(1e6); },
      [](v1::Environment& e) { e.set_air_k(0.0); },
      [](v1::Environment& e) { e.set_wind_m_s(-0.1); },
      [](v1::Environment& e) { e.set_cloud_frac(1.01); },
      [](v1::Environment& e) { e.set_environment_k(0.0); },
      [](v1::Environment& e) { e.set_film_w_m2_k(kNan); },
  };
  for (const Change change : changes) {
    auto message = valid_message();
    change(*message.mutable_environment());
    EXPECT_EQ(decode(encoded(message)), DecodeStatus::invalid_environment);
  }
}

TEST(HostFrameCodec, RefusesOtherVersionsEvenWhereTheRestCannotBeParsed) {
  auto message = valid_message();
  message.set_protocol_version(2);
  EXPECT_EQ(decode(encoded(message)), DecodeStatus::wrong_version);
  message.clear_protocol_version();
  EXPECT_EQ(decode(encoded(message)), DecodeStatus::wrong_version);
  // The version is 2 and the content of the seeker is no Pose.
  EXPECT_EQ(decode(test::from_hex("08022202ffff")), DecodeStatus::wrong_version);
  EXPECT_EQ(decode(test::from_hex("08012202ffff")), DecodeStatus::malformed);
}

TEST(HostFrameCodec, RefusesTooManyEntitiesTooManyBytesAndIdsTwice) {
  auto message = valid_message(128);
  EXPECT_EQ(decode(encoded(message)), DecodeStatus::ok);
  message.add_entities()->set_entity_id(9999);
  EXPECT_EQ(decode(encoded(message)), DecodeStatus::oversize);
  EXPECT_EQ(decode(Bytes(kMaxHostFrameBytes + 1)), DecodeStatus::oversize);
  auto twice = valid_message(3);
  twice.mutable_entities(2)->set_entity_id(twice.entities(0).entity_id());
  EXPECT_EQ(decode(encoded(twice)), DecodeStatus::malformed);
}

TEST(HostFrameCodec, NamesTheFrameThatItRefuses) {
  auto message = valid_message();
  message.mutable_seeker()->mutable_position_m()->set_x(std::numeric_limits<double>::infinity());
  HostFrameDecoder decoder;
  const auto out = std::make_unique<HostFrameData>();
  ASSERT_EQ(decode_host_frame(encoded(message), decoder, *out), DecodeStatus::invalid_pose);
  EXPECT_EQ(out->frame_number, 42u);
  EXPECT_EQ(out->run_id, 0xABCDEFu);
  EXPECT_EQ(out->sim_time_ns, -1'500'000'000);
}

TEST(HostFrameCodec, IgnoresFieldsOfLaterVersionsThatOnlyAdd) {
  auto bytes = encoded(valid_message());
  for (const std::byte byte : test::from_hex("fa06036162637d010203048107aabbccddeeff0011")) {
    bytes.push_back(byte);
  }
  EXPECT_EQ(decode(bytes), DecodeStatus::ok);
}

TEST(ControlRecord, AHostFrameWithinIsFoundWithoutParsing) {
  v1::ControlRecord record;
  *record.mutable_host_frame() = valid_message();
  std::vector<std::byte> wire;
  append_control_record(record, wire);
  const auto body = std::span<const std::byte>(wire).subspan(kRecordHeaderBytes);
  const auto inner = host_frame_in_control_record(body);
  EXPECT_TRUE(std::ranges::equal(inner, encoded(record.host_frame())));
  EXPECT_TRUE(host_frame_in_control_record(body.first(body.size() - 1)).empty());

  v1::ControlRecord other;
  other.mutable_command()->set_kind(v1::Command::KIND_STEP);
  std::vector<std::byte> command;
  append_control_record(other, command);
  const auto command_body = std::span<const std::byte>(command).subspan(kRecordHeaderBytes);
  EXPECT_TRUE(host_frame_in_control_record(command_body).empty());
  v1::ControlRecord parsed;
  ASSERT_TRUE(parse_control_record(command_body, parsed));
  EXPECT_EQ(parsed.command().kind(), v1::Command::KIND_STEP);
  EXPECT_FALSE(parse_control_record({}, parsed));
}

TEST(DecodeStatus, HasTheNumbersOfStatusCode) {
  for (const auto status :
       {DecodeStatus::ok, DecodeStatus::wrong_version, DecodeStatus::oversize,
        DecodeStatus::malformed, DecodeStatus::invalid_pose, DecodeStatus::invalid_environment,
        DecodeStatus::invalid_view, DecodeStatus::invalid_part}) {
    EXPECT_TRUE(v1::Status::Code_IsValid(static_cast<int>(status)));
    EXPECT_NE(to_string(status), "unknown");
  }
}

}  // namespace
}  // namespace emit::protocol
