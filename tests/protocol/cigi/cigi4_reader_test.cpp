// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "emit/protocol/cigi.hpp"
#include "protocol/cigi/cigi_bytes.hpp"
#include "protocol/cigi/cigi_samples.hpp"
#include "protocol/hex.hpp"
#include "support/heap_counter.hpp"

namespace emit::protocol::cigi {
namespace {

using BytesV4 = std::vector<std::byte>;

/// All that a reader gives of one message of version 4.0.
struct OutcomeV4 {
  std::vector<Packet> packets;
  std::vector<std::string> refused;
  Step last = Step::packet;
  std::string fault;
  std::size_t skipped = 0;
  std::size_t user_defined = 0;
};

std::string text_of_v4(const Fault& fault) {
  std::array<char, kFaultTextBytes> buffer;
  return std::string(fault_text(fault, buffer));
}

OutcomeV4 outcome_of(const BytesV4& message, Sender sender = Sender::host) {
  Reader reader(message, sender);
  OutcomeV4 out;
  for (std::size_t steps = 0; steps <= message.size() / 8 + 1; ++steps) {
    Packet packet;
    out.last = reader.next(packet);
    if (out.last == Step::packet) out.packets.push_back(packet);
    if (out.last == Step::refused) out.refused.push_back(text_of_v4(reader.fault()));
    if (out.last == Step::end || out.last == Step::broken) break;
  }
  if (out.last == Step::broken) out.fault = text_of_v4(reader.fault());
  out.skipped = reader.skipped_packets();
  out.user_defined = reader.user_defined_packets();
  return out;
}

BytesV4 message_v4(std::initializer_list<Packet> packets, ByteOrder order = ByteOrder::big) {
  return test::cigi_message(std::vector<Packet>(packets), order, Version::v4_0);
}

/// Returns a message of IG Control and raw bytes.
BytesV4 with_bytes_v4(std::string_view hex) {
  auto message = message_v4({IgControl{}});
  const auto more = test::from_hex(hex);
  message.insert(message.end(), more.begin(), more.end());
  return message;
}

TEST(Cigi4Reader, TheFirstPacketTellsVersionAndOrder) {
  for (const Sender sender : {Sender::host, Sender::ig}) {
    for (const Version version : {Version::v3_3, Version::v4_0}) {
      for (const ByteOrder order : {ByteOrder::big, ByteOrder::little}) {
        const Packet first = sender == Sender::host ? Packet(IgControl{.host_frame = 0x0400})
                                                    : Packet(StartOfFrame{.ig_frame = 0x0400});
        const auto message = test::cigi_message(std::span(&first, 1), order, version);
        Reader reader(message, sender);
        Packet packet;
        ASSERT_EQ(reader.next(packet), Step::packet);
        EXPECT_TRUE(packet == first);
        EXPECT_EQ(reader.version(), version);
        EXPECT_EQ(reader.byte_order(), order);
      }
    }
  }
}

TEST(Cigi4Reader, PoseAndTypeOfAnEntityComeInTwoPackets) {
  const EntityType missile{.extended = true, .kind = 2, .domain = 1, .country_or_type = 225};
  const auto out = outcome_of(
      message_v4({IgControl{.mode = IgMode::operate},
                  EntityPosition{.entity_id = 7, .place = {47.0, 8.0, 900}},
                  EntityControl40{.entity_id = 7, .state = EntityState::active, .type = missile}}));
  ASSERT_EQ(out.packets.size(), 3U);
  EXPECT_EQ(std::get<EntityPosition>(out.packets[1]).place.altitude_m_or_z_m, 900.0);
  EXPECT_TRUE(std::get<EntityControl40>(out.packets[2]).type == missile);
}

TEST(Cigi4Reader, UnknownPacketsAreSkippedBySizeAndCounted) {
  // Motion Tracker Control, an id that SISO registers, two local ids, and the last one of these.
  auto message = with_bytes_v4(
      "00100011000000000000000000000000"
      "0008123400000000"
      "0010800000000000ffffffffffffffff"
      "0008fffe00000000");
  const auto entity = message_v4({IgControl{}, EntityControl40{.entity_id = 5}});
  message.insert(message.end(), entity.begin() + 24, entity.end());
  const auto out = outcome_of(message);
  EXPECT_EQ(out.last, Step::end);
  EXPECT_EQ(out.skipped, 4U);
  EXPECT_EQ(out.user_defined, 2U);
  ASSERT_EQ(out.packets.size(), 2U);
  EXPECT_EQ(std::get<EntityControl40>(out.packets[1]).entity_id, 5);
}

TEST(Cigi4Reader, SizesOfSixteenBitsAreRead) {
  auto message = with_bytes_v4("02088001");
  message.resize(24 + 0x208, std::byte{0xEE});
  const auto entity = message_v4({IgControl{}, EntityControl40{.entity_id = 5}});
  message.insert(message.end(), entity.begin() + 24, entity.end());
  const auto out = outcome_of(message);
  EXPECT_EQ(out.last, Step::end);
  EXPECT_EQ(out.packets.size(), 2U);
}

TEST(Cigi4Reader, TheTailOfALongerPacketIsIgnored) {
  auto message = message_v4({IgControl{}, EntityControl40{.entity_id = 5}});
  message[25] = std::byte{24};
  message.insert(message.end(), 8, std::byte{0xEE});
  const auto next = message_v4({IgControl{}, EntityPosition{.entity_id = 6}});
  message.insert(message.end(), next.begin() + 24, next.end());
  const auto out = outcome_of(message);
  EXPECT_EQ(out.last, Step::end);
  ASSERT_EQ(out.packets.size(), 3U);
  EXPECT_EQ(std::get<EntityControl40>(out.packets[1]).entity_id, 5);
}

TEST(Cigi4Reader, WrongFirstPacketsBreakTheMessage) {
  const auto good = message_v4({IgControl{}});
  const auto changed = [&](std::size_t at, unsigned value) {
    auto bytes = good;
    bytes[at] = static_cast<std::byte>(value);
    return outcome_of(bytes).fault;
  };
  const std::string place = "packet 0 (id 0x0000, IG Control) at byte 0: ";
  EXPECT_EQ(changed(4, 5), place + "CIGI version 5.0, must be 3.3 or 4.0");
  EXPECT_EQ(changed(7, 0x10), place + "CIGI version 4.1, must be 3.3 or 4.0");
  EXPECT_EQ(changed(7, 3), place + "mode is 3, must be 0 to 2");
  EXPECT_EQ(changed(5, 0x80), place + "database is -128, must be 0 to 127");
  EXPECT_EQ(outcome_of(good, Sender::ig).fault,
            place + "the message must begin with IG Control or Start Of Frame");
  EXPECT_EQ(outcome_of(BytesV4(good.begin(), good.begin() + 16)).fault,
            place + "states 24 bytes, 16 are left");
  // Neither version begins with these.
  EXPECT_NE(changed(1, 32).find("must begin with"), std::string::npos);
  EXPECT_NE(changed(2, 1).find("must begin with"), std::string::npos);
}

TEST(Cigi4Reader, WrongSizesEndTheMessageAndNameThePlace) {
  const auto fault = [](std::string_view hex) {
    const auto out = outcome_of(with_bytes_v4("0008001a00000001" + std::string(hex)));
    EXPECT_EQ(out.last, Step::broken);
    EXPECT_EQ(out.packets.size(), 2U) << "packets in front stay good";
    return out.fault;
  };
  EXPECT_EQ(fault("0000000100000000"),
            "packet 2 (id 0x0001, Entity Position) at byte 32: states 0 bytes");
  EXPECT_EQ(fault("0003900000000000"),
            "packet 2 (id 0x9000, user defined) at byte 32: states 3 bytes");
  EXPECT_EQ(
      fault("000c200000000000"),
      "packet 2 (id 0x2000, registered) at byte 32: states 12 bytes, must be a multiple of 8");
  EXPECT_EQ(fault("0010200000000000"),
            "packet 2 (id 0x2000, registered) at byte 32: states 16 bytes, 8 are left");
  EXPECT_EQ(fault("000800"), "packet 2 at byte 32: 3 bytes are left, it needs 4");
  EXPECT_EQ(fault("0008002500000000"),
            "packet 2 (id 0x0025, Entity Control) at byte 32: states 8 bytes, must be 16");
}

TEST(Cigi4Reader, WrongNumbersRefuseOnePacketAlone) {
  auto message = message_v4({IgControl{}, EntityPosition{.entity_id = 3}, EntityControl40{}});
  const auto refused = [&](std::size_t at, std::string_view hex) {
    auto bytes = message;
    const auto part = test::from_hex(hex);
    std::copy(part.begin(), part.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
    const auto out = outcome_of(bytes);
    EXPECT_EQ(out.last, Step::end);
    EXPECT_EQ(out.packets.size(), 2U);
    return out.refused.size() == 1 ? out.refused[0] : "not one";
  };
  const std::string pose = "packet 1 (id 0x0001, Entity Position) at byte 24: ";
  const std::string type = "packet 2 (id 0x0025, Entity Control) at byte 72: ";
  EXPECT_EQ(refused(24 + 12, "7fc00000"), pose + "roll_deg is nan, must be -180 to 180");
  EXPECT_EQ(refused(24 + 16, "42b50000"), pose + "pitch_deg is 90.5, must be -90 to 90");
  EXPECT_EQ(refused(24 + 24, "4056c00000000000"), pose + "latitude_deg is 91, must be -90 to 90");
  EXPECT_EQ(refused(24 + 4, "06"), pose + "clamp is 3, must be 0 to 2");
  EXPECT_EQ(refused(72 + 4, "03"), type + "state is 3, must be 0 to 2");
}

TEST(Cigi4Reader, PacketsThatDoNotBelongHereAreRefused) {
  auto message = message_v4({IgControl{}});
  const auto answer = message_v4({StartOfFrame{}, HatHotResponse{}});
  message.insert(message.end(), answer.begin() + 24, answer.end());
  message.insert(message.end(), message.begin(), message.begin() + 24);
  const auto out = outcome_of(message);
  EXPECT_EQ(out.last, Step::end);
  ASSERT_EQ(out.refused.size(), 2U);
  EXPECT_EQ(out.refused[0],
            "packet 1 (id 0x0fff, HAT/HOT Response) at byte 24: the other side sends such packets");
  EXPECT_EQ(
      out.refused[1],
      "packet 2 (id 0x0000, IG Control) at byte 40: a message has one such packet, the first");
}

TEST(Cigi4Reader, TextsLongerThanTheStructAreRefused) {
  auto message = message_v4({StartOfFrame{}, ImageGeneratorMessage::make(1, std::string(99, 'x'))});
  ASSERT_EQ(message.size(), 24U + 112U);
  EXPECT_EQ(outcome_of(message, Sender::ig).packets.size(), 2U);
  message[24 + 8 + 99] = std::byte{'x'};
  const auto out = outcome_of(message, Sender::ig);
  ASSERT_EQ(out.refused.size(), 1U);
  EXPECT_EQ(out.refused[0],
            "packet 1 (id 0x0ff0, Image Generator Message) at byte 24: the text has no end");
}

TEST(Cigi4Writer, RefusesWhatAVersionCannotCarry) {
  std::array<std::byte, 512> memory;
  const auto fault = [&](Version version, const Packet& packet) {
    Writer writer(memory, version, ByteOrder::big);
    if (!test::begins_message(packet)) {
      EXPECT_FALSE(test::sender_of(packet) == Sender::host ? writer.add(IgControl{})
                                                           : writer.add(StartOfFrame{}));
    }
    const auto before = writer.message().size();
    const Fault result = writer.add(packet);
    EXPECT_EQ(writer.message().size() == before, static_cast<bool>(result));
    if (result) {
      EXPECT_EQ(result.kind, Fault::Kind::not_in_version);
    }
    return text_of_v4(result);
  };
  const std::string none = "packet 1 at byte 24: the version has no such packet";
  EXPECT_EQ(fault(Version::v4_0, EntityControl{}), none);
  EXPECT_EQ(fault(Version::v3_3, EntityPosition{}), none);
  EXPECT_EQ(fault(Version::v3_3, EntityControl40{}), none);
  EXPECT_EQ(fault(Version::v3_3, AnimationControl{}), none);
  EXPECT_EQ(fault(Version::v3_3, AccelerationControl{}), none);
  const std::pair<const char*, Packet> later[] = {
      {"type_substitution_enabled", IgControl{.type_substitution_enabled = true}},
      {"overframing", StartOfFrame{.overframing = true}},
      {"paging", StartOfFrame{.paging = true}},
      {"excessive_variable_data", StartOfFrame{.excessive_variable_data = true}},
      {"second_utc", CelestialSphereControl{.second_utc = 0.5f}},
      {"top_scud_enabled", WeatherControl{.top_scud_enabled = true}},
      {"top_scud_percent", WeatherControl{.top_scud_percent = 1.0f}},
      {"top_transition_m", WeatherControl{.top_transition_m = 1.0f}},
  };
  for (const auto& [field, packet] : later) {
    const std::string text = fault(Version::v3_3, packet);
    EXPECT_NE(text.find("the version has no " + std::string(field)), std::string::npos) << text;
    EXPECT_EQ(fault(Version::v4_0, packet), "no fault");
  }
  EXPECT_EQ(fault(Version::v4_0, StartOfFrame{.ig_status = 1}),
            "packet 0 (id 0xffff, Start Of Frame) at byte 0: the version has no ig_status");
}

TEST(Cigi4Writer, SecondsMustBeOfAMinuteIfTheDateIsValid) {
  std::array<std::byte, 512> memory;
  const auto refused = [&](float second, bool valid) {
    Writer writer(memory, Version::v4_0, ByteOrder::big);
    EXPECT_FALSE(writer.add(IgControl{}));
    return static_cast<bool>(writer.add(CelestialSphereControl{
        .second_utc = second, .date_valid = valid, .date_mmddyyyy = 1012024}));
  };
  EXPECT_FALSE(refused(59.999f, true));
  EXPECT_TRUE(refused(60.5f, true));
  EXPECT_TRUE(refused(-0.5f, true));
  EXPECT_FALSE(refused(60.5f, false));
  EXPECT_TRUE(refused(std::numeric_limits<float>::quiet_NaN(), false));
}

TEST(Cigi4Writer, RefusesNumbersOutOfRange) {
  constexpr float kBad = std::numeric_limits<float>::infinity();
  std::array<std::byte, 512> memory;
  const auto field = [&](const Packet& packet) {
    Writer writer(memory, Version::v4_0, ByteOrder::big);
    EXPECT_FALSE(writer.add(IgControl{}));
    const Fault fault = writer.add(packet);
    return std::string(fault.kind == Fault::Kind::field ? fault.field : "none");
  };
  EXPECT_EQ(field(WeatherControl{.top_scud_percent = 100.5f}), "top_scud_percent");
  EXPECT_EQ(field(WeatherControl{.top_transition_m = -0.5f}), "top_transition_m");
  EXPECT_EQ(field(WeatherControl{.wind_from_deg = -180.5f}), "wind_from_deg");
  EXPECT_EQ(field(WeatherControl{.wind_from_deg = 360.5f}), "wind_from_deg");
  EXPECT_EQ(field(AnimationControl{.speed = kBad}), "speed");
  EXPECT_EQ(field(AccelerationControl{.z_m_s2 = kBad}), "z_m_s2");
  EXPECT_EQ(field(AccelerationControl{.yaw_deg_s2 = kBad}), "yaw_deg_s2");
  EXPECT_EQ(field(EntityPosition{.yaw_deg = 361.0f}), "yaw_deg");
  EXPECT_EQ(field(EntityPosition{.attached = true, .place = {500.0, 0.0, 0.0}}), "none");
  EXPECT_EQ(field(EntityPosition{.place = {500.0, 0.0, 0.0}}), "latitude_deg");
}

TEST(Cigi4Writer, NothingAllocates) {
  const auto samples = test::sample_host_packets(Version::v4_0);
  std::array<std::byte, 4096> memory;
  Packet packet;
  std::size_t read = 0;
  const auto before = test::heap_request_count();
  Writer writer(memory, Version::v4_0, ByteOrder::little);
  for (const Packet& each : samples) static_cast<void>(writer.add(each));
  Reader reader(writer.message(), Sender::host);
  while (reader.next(packet) == Step::packet) ++read;
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_EQ(read, samples.size());
}

TEST(Cigi4Faults, IdsHaveTheNamesOfVersionFour) {
  const auto name = [](std::uint16_t id) { return packet_name(id, Version::v4_0); };
  EXPECT_EQ(name(0x26), "Animation Control");
  EXPECT_EQ(name(0x27), "unknown");
  EXPECT_EQ(name(0x0FEF), "unknown");
  EXPECT_EQ(name(0x0FF0), "Image Generator Message");
  EXPECT_EQ(name(0x0FF2), "Animation Stop Notification");
  EXPECT_EQ(name(0x0FFF), "HAT/HOT Response");
  EXPECT_EQ(name(0x1000), "registered");
  EXPECT_EQ(name(0x7FFF), "registered");
  EXPECT_EQ(name(0x8000), "user defined");
  EXPECT_EQ(name(0xFFFE), "user defined");
  EXPECT_EQ(name(0xFFFF), "Start Of Frame");
}

}  // namespace
}  // namespace emit::protocol::cigi
