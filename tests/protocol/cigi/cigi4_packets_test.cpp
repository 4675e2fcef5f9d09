// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "emit/protocol/cigi.hpp"
#include "protocol/cigi/cigi_bytes.hpp"
#include "protocol/cigi/cigi_samples.hpp"
#include "protocol/hex.hpp"
#include "support/emit_process.hpp"

namespace emit::protocol::cigi {
namespace {

// Bytes of the sample packets of version 4.0, big endian and little endian. cigi4_judge.py wrote
// them from the tables of the packets, without the library.
struct GoldenPacketV4 {
  const char* name;
  std::string_view big;
  std::string_view little;
};
constexpr GoldenPacketV4 kGoldenPacketsV4[] = {
    {"IG Control", "001800000405010d01020304090a0b0c0506070800000000",
     "180000000405010d040302010c0b0a090807060500000000"},
    {"Component Control",
     "0028000301020d09030400000000000011121314212223243132333441424344"
     "5152535461626364",
     "2800030002010d09040300000000000014131211242322213433323144434241"
     "5453525164636261"},
    {"Short Component Control", "001800040506030807080000000000007172737481828384",
     "180004000605030808070000000000007473727184838281"},
    {"Articulated Part Control", "00200005020304253fc00000c020000040600000c32a000042a0000043af0000",
     "20000500030204250000c03f000020c00000604000002ac30000a0420000af43"},
    {"Short Articulated Part Control", "00180006040506076b000000c09000004234000000000000",
     "18000600050406076b000000000090c00000344200000000"},
    {"Velocity Control", "002000070607080242c90000c348800043964000c124000041a20000c1f20000",
     "20000700070608020000c942008048c300409643000024c10000a2410000f2c1"},
    {"Celestial Sphere Control", "0018000816000d2f426200000022f938427a000000000000",
     "1800080016000d2f0000624238f9220000007a4200000000"},
    {"Atmosphere Control", "00200009b7000000c148000046b3b00041080000bf00000043898000447d5000",
     "20000900b7000000000048c100b0b34600000841000000bf0080894300507d44"},
    {"Environmental Region Control",
     "0030000a190007084047c00000000000c05e900000000000459c400045bb8000"
     "442f0000c234000042a1000000000000",
     "30000a00190008070000000000c047400000000000905ec000409c450080bb45"
     "00002f44000034c20000a14200000000"},
    {"Weather Control",
     "0048000b025a7531090a0000c0b0000044bb80004148000042af000044960000"
     "43c800004248000041180000bfc00000c24800004454a0003e80000042160000"
     "4296000000000000",
     "48000b00025a75310a0900000000b0c00080bb44000048410000af4200009644"
     "0000c84300004842000018410000c0bf000048c200a054440000803e00001642"
     "0000964200000000"},
    {"View Control",
     "0028000f0d290b0c0e0f00003f000000be8000003e0000003fc00000c0200000"
     "c060000000000000",
     "28000f000d290c0b0f0e00000000003f000080be0000003e0000c03f000020c0"
     "000060c000000000"},
    {"Sensor Control", "00200010126b0100101100003f4000003e800000418400003e00000000000000",
     "20001000126b0100111000000000403f0000803e000084410000003e00000000"},
    {"Earth Reference Model Definition", "0018001201000000415854a6400000003f6b775a84f3e128",
     "180012000100000000000040a654584128e1f3845a776b3f"},
    {"View Definition",
     "00280014121314ad520000003f000000471c4000bfc000003fa000003f400000"
     "bf20000000000000",
     "28001400131214ad520000000000003f00401c470000c0bf0000a03f0000403f"
     "000020bf00000000"},
    {"HAT/HOT Request",
     "002800171415171806160000000000004025000000000000c034800000000000"
     "403e800000000000",
     "28001700151418170616000000000000000000000000254000000000008034c0"
     "0000000000803e40"},
    {"Line of Sight Segment Request",
     "00480018191a1c1d151b2324220000003ff4000000000000c002000000000000"
     "40a77080000000004079080000000000c07f4800000000004082c40000000000"
     "1e1f202100000000",
     "480018001a191d1c151b242322000000000000000000f43f00000000000002c0"
     "000000008070a74000000000000879400000000000487fc00000000000c48240"
     "21201f1e00000000"},
    {"Line of Sight Vector Request",
     "004000192526282905272e0000000000c2f100004205000041200000460ca000"
     "4049c00000000000401f00000000000040560800000000002a2b2c2d00000000",
     "400019002625292805272e00000000000000f1c2000005420000204100a00c46"
     "0000000000c049400000000000001f4000000000000856402d2c2b2a00000000"},
    {"Position Request", "0008001a31232f30", "08001a003123302f"},
    {"Environmental Conditions Request",
     "0020001b06320000c040c000000000004062e800000000004034c00000000000",
     "20001b00063200000000000000c040c00000000000e862400000000000c03440"},
    {"Entity Position",
     "003000010300112255660000c148000040e800004387c000bff8000000000000"
     "409f410000000000c00e000000000000",
     "300001000300221166550000000048c10000e84000c08743000000000000f8bf"
     "0000000000419f400000000000000ec0"},
    {"Entity Control", "0010002535c81122010200e103040506", "1000250035c822110102e10003040506"},
    {"Animation Control", "0010002605c9313233340000bfe00000", "1000260005c93231343300000000e0bf"},
    {"Acceleration Control", "0020001335363701c11c000041280000c134000041480000c158000041680000",
     "200013003635370100001cc100002841000034c100004841000058c100006841"},
    {"Start Of Frame", "0018ffff04fb000d3435363738393a3b3c3d3e3f05000000",
     "1800ffff04fb000d373635343b3a39383f3e3d3c00050000"},
    {"HAT/HOT Response", "00100fffa3004041c045400000000000", "1000ff0fa300414000000000004045c0"},
    {"HAT/HOT Extended Response",
     "00280ffeb1004243405e100000000000c01e00000000000044454647c2b50000"
     "42b3000000000000",
     "2800fe0fb10043420000000000105e400000000000001ec0474645440000b5c2"
     "0000b34200000000"},
    {"Line of Sight Response", "00180ffd48494b4cc54a00000000000040934a0000000000",
     "1800fd0f49484c4bc54a00000000000000000000004a9340"},
    {"Line of Sight Extended Response",
     "00400ffc4d4e5051d74f00000000000040b0e18000000000c026800000000000"
     "406bd00000000000c0090000000000005253545556575859432a4000c2370000",
     "4000fc0f4e4d5150d74f0000000000000000000080e1b04000000000008026c0"
     "0000000000d06b4000000000000009c0525354555958575600402a43000037c2"},
    {"Sensor Response", "00180ffb5c015a5b5d5e5f60bec000003f60000061626364",
     "1800fb0f5c015b5a5e5d605f0000c0be0000603f64636261"},
    {"Sensor Extended Response",
     "00380ffa65666869670600006a6b6c6d3fb00000bff000006e6f707100000000"
     "404e400000000000c06550000000000040c1944000000000",
     "3800fa0f66656968670600006b6a6d6c0000b03f0000f0bf71706f6e00000000"
     "0000000000404e4000000000005065c0000000004094c140"},
    {"Position Response",
     "00300ff9740a72733ff8000000000000c004000000000000400c000000000000"
     "c090000040b000004283000000000000",
     "3000f90f740a7372000000000000f83f00000000000004c00000000000000c40"
     "000090c00000b0400000834200000000"},
    {"Weather Conditions Response",
     "00200ff8752c000041ac0000468ca000406000003f400000433900004479a000",
     "2000f80f752c00000000ac4100a08c46000060400000403f0000394300a07944"},
    {"Event Notification", "00180ff17677000078797a7b7c7d7e7f8081828300000000",
     "1800f10f777600007b7a79787f7e7d7c8382818000000000"},
    {"Image Generator Message", "00180ff08485000068656c6c6f2c20686f73740000000000",
     "1800f00f8584000068656c6c6f2c20686f73740000000000"},
};

std::vector<Packet> all_samples_v4() {
  auto packets = test::sample_host_packets(Version::v4_0);
  const auto more = test::sample_ig_packets(Version::v4_0);
  packets.insert(packets.end(), more.begin(), more.end());
  return packets;
}

TEST(Cigi4Packets, EveryPacketHasItsGoldenBytesInBothOrders) {
  const auto samples = all_samples_v4();
  ASSERT_EQ(samples.size(), std::size(kGoldenPacketsV4));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const GoldenPacketV4& golden = kGoldenPacketsV4[i];
    SCOPED_TRACE(golden.name);
    EXPECT_EQ(packet_name(packet_id(samples[i], Version::v4_0), Version::v4_0), golden.name);
    for (const ByteOrder order : {ByteOrder::big, ByteOrder::little}) {
      const auto text = order == ByteOrder::big ? golden.big : golden.little;
      EXPECT_EQ(test::to_hex(test::bytes_alone(samples[i], order, Version::v4_0)), text);
      EXPECT_TRUE(test::read_alone(test::from_hex(text), test::sender_of(samples[i]), samples[i],
                                   order, Version::v4_0) == samples[i]);
    }
  }
}

TEST(Cigi4Packets, SamplesOfBothVersionsCoverEveryPacket) {
  std::vector<bool> seen(std::variant_size_v<Packet>, false);
  for (const Version version : {Version::v3_3, Version::v4_0}) {
    std::size_t expected = 0;
    std::size_t found = 0;
    for (const Packet& each : test::sample_host_packets(version)) {
      seen[each.index()] = true;
      ++found;
    }
    for (const Packet& each : test::sample_ig_packets(version)) {
      seen[each.index()] = true;
      ++found;
    }
    [&]<std::size_t... I>(std::index_sequence<I...>) {
      ((expected += std::variant_alternative_t<I, Packet>::kWire.exists(version) ? 1U : 0U), ...);
    }
    (std::make_index_sequence<std::variant_size_v<Packet>>());
    EXPECT_EQ(found, expected);
  }
  EXPECT_TRUE(std::ranges::all_of(seen, [](bool each) { return each; }));
}

TEST(Cigi4Packets, DefaultsHaveOnlySizeIdAndVersion) {
  for (const Packet& sample : all_samples_v4()) {
    std::visit(
        [](const auto& each) {
          using P = std::decay_t<decltype(each)>;
          const auto bytes = test::bytes_alone(P{}, ByteOrder::little, Version::v4_0);
          ASSERT_EQ(bytes.size(), P::kWire.v4_0.bytes);
          const auto byte = [&](std::size_t i) { return std::to_integer<unsigned>(bytes[i]); };
          EXPECT_EQ(byte(0) + 256 * byte(1), P::kWire.v4_0.bytes);
          EXPECT_EQ(byte(2) + 256 * byte(3), P::kWire.v4_0.id);
          const bool first = test::begins_message(each);
          EXPECT_EQ(byte(4), first ? 4U : 0U);
          EXPECT_TRUE(std::ranges::all_of(bytes.begin() + 5, bytes.end(),
                                          [](std::byte b) { return b == std::byte{0}; }));
        },
        sample);
  }
}

/// A flag or a part of a byte, with the offset and the bits that it must set.
struct BitCaseV4 {
  const char* name;
  Packet packet;
  std::size_t offset;
  unsigned bits;
};

std::vector<BitCaseV4> bit_cases_v4() {
  using enum PartAxis;
  return {
      {"substitution", IgControl{.type_substitution_enabled = true}, 6, 0x01},
      {"debug", IgControl{.mode = IgMode::debug}, 7, 0x02},
      {"ig timestamp", IgControl{.timestamp_valid = true}, 7, 0x04},
      {"smoothing", IgControl{.smoothing_enabled = true}, 7, 0x08},
      {"attach", EntityPosition{.attached = true}, 4, 0x01},
      {"clamp", EntityPosition{.clamp = Clamp::conformal}, 4, 0x04},
      {"destroyed", EntityControl40{.state = EntityState::destroyed}, 4, 0x02},
      {"collision", EntityControl40{.collision_detection = true}, 4, 0x04},
      {"inherit alpha", EntityControl40{.inherit_alpha = true}, 4, 0x08},
      {"entity smoothing", EntityControl40{.smoothing_enabled = true}, 4, 0x10},
      {"extended type", EntityControl40{.type = {.extended = true}}, 4, 0x20},
      {"playing", AnimationControl{.playing = true}, 4, 0x01},
      {"reset", AnimationControl{.reset = true}, 4, 0x02},
      {"loop", AnimationControl{.loop = true}, 4, 0x04},
      {"animation alpha", AnimationControl{.inherit_alpha = true}, 4, 0x08},
      {"class", ComponentControl{.component_class = ComponentClass::symbol}, 6, 0x0F},
      {"part", ArticulatedPartControl{.part_enabled = true}, 7, 0x01},
      {"part x", ArticulatedPartControl{.x_enabled = true}, 7, 0x02},
      {"part y", ArticulatedPartControl{.y_enabled = true}, 7, 0x04},
      {"part z", ArticulatedPartControl{.z_enabled = true}, 7, 0x08},
      {"part roll", ArticulatedPartControl{.roll_enabled = true}, 7, 0x10},
      {"part pitch", ArticulatedPartControl{.pitch_enabled = true}, 7, 0x20},
      {"part yaw", ArticulatedPartControl{.yaw_enabled = true}, 7, 0x40},
      {"axis 1", ShortArticulatedPartControl{.motions = {{{.axis = roll}, {}}}}, 8, 0x06},
      {"axis 2", ShortArticulatedPartControl{.motions = {{{}, {.axis = roll}}}}, 8, 0x30},
      {"enable 1", ShortArticulatedPartControl{.motions = {{{.part_enabled = true}, {}}}}, 8, 0x40},
      {"enable 2", ShortArticulatedPartControl{.motions = {{{}, {.part_enabled = true}}}}, 8, 0x80},
      {"rate part", RateControl{.applies_to_part = true}, 7, 0x01},
      {"rate local", RateControl{.local = true}, 7, 0x02},
      {"acceleration part", AccelerationControl{.applies_to_part = true}, 7, 0x01},
      {"acceleration local", AccelerationControl{.local = true}, 7, 0x02},
      {"ephemeris", CelestialSphereControl{.ephemeris_enabled = true}, 4, 0x01},
      {"sun", CelestialSphereControl{.sun_enabled = true}, 4, 0x02},
      {"moon", CelestialSphereControl{.moon_enabled = true}, 4, 0x04},
      {"stars", CelestialSphereControl{.stars_enabled = true}, 4, 0x08},
      {"model", AtmosphereControl{.model_enabled = true}, 4, 0x80},
      {"humidity", AtmosphereControl{.humidity_percent = 100}, 4, 0x64},
      {"region", EnvironmentalRegionControl{.state = RegionState::destroyed}, 4, 0x02},
      {"merge weather", EnvironmentalRegionControl{.merge_weather = true}, 4, 0x04},
      {"merge terrestrial", EnvironmentalRegionControl{.merge_terrestrial = true}, 4, 0x20},
      {"scud", WeatherControl{.scud_enabled = true}, 6, 0x02},
      {"lightning", WeatherControl{.random_lightning = true}, 6, 0x08},
      {"scope", WeatherControl{.scope = WeatherScope::entity}, 7, 0x02},
      {"severity", WeatherControl{.severity = 7}, 7, 0x1C},
      {"top scud", WeatherControl{.top_scud_enabled = true}, 7, 0x20},
      {"view y", ViewControl{.y_enabled = true}, 5, 0x02},
      {"view z", ViewControl{.z_enabled = true}, 5, 0x04},
      {"view pitch", ViewControl{.pitch_enabled = true}, 5, 0x10},
      {"dropout", SensorControl{.line_dropout = true}, 5, 0x04},
      {"track black", SensorControl{.track_black = true}, 5, 0x10},
      {"track mode", SensorControl{.track_mode = static_cast<TrackMode>(7)}, 5, 0xE0},
      {"far", ViewDefinition{.far_enabled = true}, 7, 0x02},
      {"top", ViewDefinition{.top_enabled = true}, 7, 0x10},
      {"mirror", ViewDefinition{.mirror = Mirror::both}, 7, 0xC0},
      {"replication", ViewDefinition{.pixel_replication = 7}, 8, 0x07},
      {"orthographic", ViewDefinition{.orthographic = true}, 8, 0x08},
      {"view type", ViewDefinition{.view_type = 7}, 8, 0xE0},
      {"height of", HatHotRequest{.type = HatHotType::height_of}, 8, 0x01},
      {"segment source", LosSegmentRequest{.source_relative = true}, 8, 0x02},
      {"segment response", LosSegmentRequest{.response_relative = true}, 8, 0x08},
      {"vector source", LosVectorRequest{.source_relative = true}, 8, 0x02},
      {"tracker", PositionRequest{.object_class = ObjectClass::motion_tracker}, 5, 0x08},
      {"maritime", EnvironmentalConditionsRequest{.maritime = true}, 4, 0x01},
      {"aerosol", EnvironmentalConditionsRequest{.aerosol = true}, 4, 0x08},
      {"maintenance", StartOfFrame{.mode = IgMode::maintenance}, 7, 0x03},
      {"custom earth", StartOfFrame{.custom_earth = true}, 7, 0x08},
      {"overframing", StartOfFrame{.overframing = true}, 20, 0x01},
      {"paging", StartOfFrame{.paging = true}, 20, 0x02},
      {"variable data", StartOfFrame{.excessive_variable_data = true}, 20, 0x04},
      {"los entity", LosResponse{.entity_valid = true}, 8, 0x02},
      {"ray visible", LosExtendedResponse{.visible = true}, 8, 0x08},
      {"breaklock", SensorResponse{.state = TrackState::breaklock}, 5, 0x03},
      {"track entity", SensorExtendedResponse{.entity_valid = true}, 9, 0x04},
      {"position class", PositionResponse{.object_class = ObjectClass::motion_tracker}, 5, 0x04},
  };
}

TEST(Cigi4Packets, EveryFlagSetsItsOwnBits) {
  for (const BitCaseV4& each : bit_cases_v4()) {
    SCOPED_TRACE(each.name);
    const auto bytes = test::bytes_alone(each.packet, ByteOrder::big, Version::v4_0);
    EXPECT_EQ(std::to_integer<unsigned>(bytes[each.offset]), each.bits);
    EXPECT_TRUE(test::read_alone(bytes, test::sender_of(each.packet), each.packet, ByteOrder::big,
                                 Version::v4_0) == each.packet);
  }
}

TEST(Cigi4Packets, EchoedFrameAndTimeStampChangePlacesBetweenTheSides) {
  const auto control =
      test::bytes_alone(IgControl{.host_frame = 1, .timestamp_ticks = 2, .last_ig_frame = 3},
                        ByteOrder::big, Version::v4_0);
  const auto frame =
      test::bytes_alone(StartOfFrame{.ig_frame = 1, .timestamp_ticks = 2, .last_host_frame = 3},
                        ByteOrder::big, Version::v4_0);
  const std::array<unsigned, 3> at = {11, 15, 19};
  const auto low = [&](const auto& bytes, std::size_t i) {
    return std::to_integer<unsigned>(bytes[at[i]]);
  };
  EXPECT_EQ(low(control, 0), 1U);
  EXPECT_EQ(low(control, 1), 3U);
  EXPECT_EQ(low(control, 2), 2U);
  EXPECT_EQ(low(frame, 0), 1U);
  EXPECT_EQ(low(frame, 1), 2U);
  EXPECT_EQ(low(frame, 2), 3U);
}

TEST(Cigi4Packets, SecondsOfTheCelestialSphereAreAFloat) {
  const auto bytes =
      test::bytes_alone(CelestialSphereControl{.second_utc = 56.5f}, ByteOrder::big, Version::v4_0);
  EXPECT_EQ(test::to_hex(std::span(bytes).subspan(8, 4)), "42620000");
}

TEST(Cigi4Packets, TextsTakeWholeMultiplesOfEightBytes) {
  for (std::size_t length = 0; length < 120; ++length) {
    const auto message = ImageGeneratorMessage::make(7, std::string(length, 'x'));
    const auto bytes = test::bytes_alone(message, ByteOrder::little, Version::v4_0);
    EXPECT_EQ(bytes.size(), (8 + message.view().size() + 1 + 7) / 8 * 8);
    EXPECT_TRUE(test::read_alone(bytes, Sender::ig, message, ByteOrder::little, Version::v4_0) ==
                Packet(message));
  }
}

TEST(Cigi4Judge, ReadsTheMessagesOfBothSidesInBothOrders) {
  if (test::run_process({"python3", "--version"}).exit_code != 0) {
    GTEST_SKIP() << "python3 is not installed";
  }
  const std::string judge = std::string(EMIT_TEST_SOURCE_DIR) + "/protocol/cigi/cigi4_judge.py";
  const auto judged = [&](const std::string& side, std::span<const std::byte> message) {
    const test::TemporaryFolder folder;
    const std::string file = folder.file("message");
    std::ofstream(file, std::ios::binary)
        .write(reinterpret_cast<const char*>(message.data()),
               static_cast<std::streamsize>(message.size()));
    return test::run_process({"python3", judge, "check", side, file});
  };
  for (const ByteOrder order : {ByteOrder::big, ByteOrder::little}) {
    for (const std::string side : {"host", "ig"}) {
      const auto packets = side == "host" ? test::sample_host_packets(Version::v4_0)
                                          : test::sample_ig_packets(Version::v4_0);
      auto message = test::cigi_message(packets, order, Version::v4_0);
      const auto result = judged(side, message);
      EXPECT_EQ(result.exit_code, 0) << result.out << result.err;
      EXPECT_EQ(result.out, "");
      message[60] ^= std::byte{1};
      EXPECT_EQ(judged(side, message).exit_code, 1) << "the judge sees a flipped bit";
    }
  }
}

}  // namespace
}  // namespace emit::protocol::cigi
