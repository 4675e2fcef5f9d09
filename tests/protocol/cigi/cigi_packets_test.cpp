// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

#include "emit/protocol/cigi.hpp"
#include "protocol/cigi/cigi_bytes.hpp"
#include "protocol/cigi/cigi_samples.hpp"
#include "protocol/hex.hpp"

namespace emit::protocol::cigi {
namespace {

// Bytes of the sample packets, big endian and little endian. They were written from the tables of
// the interface control document by another program, and tshark reads them (cigi_tshark_test.cpp).
struct GoldenPacket {
  const char* name;
  std::string_view big;
  std::string_view little;
};
constexpr GoldenPacket kGoldenPackets[] = {
    {"IgControl", "011803053d0080000102030405060708090a0b0c00000000",
     "011803053d00008004030201080706050c0b0a0900000000"},
    {"EntityControl",
     "023011222d1ac80033445566c148000040e800004387c000bff8000000000000"
     "409f410000000000c00e000000000000",
     "023022112d1ac80044336655000048c10000e84000c08743000000000000f8bf"
     "0000000000419f400000000000000ec0"},
    {"ComponentControl", "0420010203040d09111213142122232431323334414243445152535461626364",
     "0420020104030d09141312112423222134333231444342415453525164636261"},
    {"ShortComponentControl", "05100506070803087172737481828384",
     "05100605080703087473727184838281"},
    {"ArticulatedPartControl", "06200203042500003fc00000c020000040600000c32a000042a0000043af0000",
     "06200302042500000000c03f000020c00000604000002ac30000a0420000af43"},
    {"ShortArticulatedPartControl", "0710040506076b00c090000042340000",
     "0710050406076b00000090c000003442"},
    {"RateControl", "082006070802000042c90000c348800043964000c124000041a20000c1f20000",
     "08200706080200000000c942008048c300409643000024c10000a2410000f2c1"},
    {"CelestialSphereControl", "09100d2f160000000022f938427a0000",
     "09100d2f1600000038f9220000007a42"},
    {"AtmosphereControl", "0a200137c148000046b3b00041080000bf00000043898000447d500000000000",
     "0a200137000048c100b0b34600000841000000bf0080894300507d4400000000"},
    {"EnvironmentalRegionControl",
     "0b300708190000004047c00000000000c05e900000000000459c400045bb8000"
     "442f0000c234000042a1000000000000",
     "0b300807190000000000000000c047400000000000905ec000409c450080bb45"
     "00002f44000034c20000a14200000000"},
    {"WeatherControl",
     "0c38090a025a7511c0b0000044bb80004148000042af00004496000043c80000"
     "4248000041180000bfc00000439b00004454a0003e800000",
     "0c380a09025a75110000b0c00080bb44000048410000af42000096440000c843"
     "00004842000018410000c0bf00009b4300a054440000803e"},
    {"ViewControl", "10200b0c0d290e0f3f000000be8000003e0000003fc00000c0200000c0600000",
     "10200c0b0d290f0e0000003f000080be0000003e0000c03f000020c0000060c0"},
    {"SensorControl", "11181011126b01003f4000003e800000418400003e000000",
     "11181110126b01000000403f0000803e000084410000003e"},
    {"EarthReferenceModel", "1318010000000000415854a6400000003f6b775a84f3e128",
     "131801000000000000000040a654584128e1f3845a776b3f"},
    {"ViewDefinition", "1520121314ad52003f000000471c4000bfc000003fa000003f400000bf200000",
     "1520131214ad52000000003f00401c470000c0bf0000a03f0000403f000020bf"},
    {"HatHotRequest", "18201415061617184025000000000000c034800000000000403e800000000000",
     "1820151406161817000000000000254000000000008034c00000000000803e40"},
    {"LosSegmentRequest",
     "1940191a151b1c1d3ff4000000000000c00200000000000040a7708000000000"
     "4079080000000000c07f4800000000004082c400000000001e1f202122002324",
     "19401a19151b1d1c000000000000f43f00000000000002c0000000008070a740"
     "00000000000879400000000000487fc00000000000c4824021201f1e22002423"},
    {"LosVectorRequest",
     "1a38252605272829c2f100004205000041200000460ca0004049c00000000000"
     "401f00000000000040560800000000002a2b2c2d2e000000",
     "1a382625052729280000f1c2000005420000204100a00c460000000000c04940"
     "0000000000001f4000000000000856402d2c2b2a2e000000"},
    {"PositionRequest", "1b082f3031230000", "1b08302f31230000"},
    {"EnvironmentalConditionsRequest",
     "1c20063200000000c040c000000000004062e800000000004034c00000000000",
     "1c200632000000000000000000c040c00000000000e862400000000000c03440"},
    {"StartOfFrame", "651803fb333d80003435363738393a3b3c3d3e3f00000000",
     "651803fb333d0080373635343b3a39383f3e3d3c00000000"},
    {"HatHotResponse", "66104041a3000000c045400000000000", "66104140a300000000000000004045c0"},
    {"HatHotExtendedResponse",
     "67284243b1000000405e100000000000c01e00000000000044454647c2b50000"
     "42b3000000000000",
     "67284342b10000000000000000105e400000000000001ec0474645440000b5c2"
     "0000b34200000000"},
    {"LosResponse", "68104849c54a4b4c40934a0000000000", "68104948c54a4c4b00000000004a9340"},
    {"LosExtendedResponse",
     "69384d4ed74f505140b0e18000000000c026800000000000406bd00000000000"
     "c0090000000000005253545556575859432a4000c2370000",
     "69384e4dd74f51500000000080e1b04000000000008026c00000000000d06b40"
     "00000000000009c0525354555958575600402a43000037c2"},
    {"SensorResponse", "6a185a5b5c0100005d5e5f60bec000003f60000061626364",
     "6a185b5a5c0100005e5d605f0000c0be0000603f64636261"},
    {"SensorExtendedResponse",
     "6b306566670668696a6b6c6d3fb00000bff000006e6f7071404e400000000000"
     "c06550000000000040c1944000000000",
     "6b306665670669686b6a6d6c0000b03f0000f0bf71706f6e0000000000404e40"
     "00000000005065c0000000004094c140"},
    {"PositionResponse",
     "6c307273740a00003ff8000000000000c004000000000000400c000000000000"
     "c090000040b000004283000000000000",
     "6c307372740a0000000000000000f83f00000000000004c00000000000000c40"
     "000090c00000b0400000834200000000"},
    {"WeatherConditionsResponse",
     "6d20752c41ac0000468ca000406000003f400000433900004479a00000000000",
     "6d20752c0000ac4100a08c46000060400000403f0000394300a0794400000000"},
    {"EventNotification", "7410767778797a7b7c7d7e7f80818283", "741077767b7a79787f7e7d7c83828180"},
    {"ImageGeneratorMessage", "7510848568656c6c6f2c20686f737400",
     "7510858468656c6c6f2c20686f737400"},
};

std::vector<Packet> all_samples() {
  auto packets = test::sample_host_packets();
  const auto more = test::sample_ig_packets();
  packets.insert(packets.end(), more.begin(), more.end());
  return packets;
}

TEST(CigiPackets, EveryPacketHasItsGoldenBytesInBothOrders) {
  const auto samples = all_samples();
  ASSERT_EQ(samples.size(), std::size(kGoldenPackets));
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const GoldenPacket& golden = kGoldenPackets[i];
    SCOPED_TRACE(golden.name);
    EXPECT_EQ(samples[i].index(), i);
    for (const ByteOrder order : {ByteOrder::big, ByteOrder::little}) {
      const auto text = order == ByteOrder::big ? golden.big : golden.little;
      EXPECT_EQ(test::to_hex(test::bytes_alone(samples[i], order)), text);
      EXPECT_TRUE(test::read_alone(test::from_hex(text), test::sender_of(samples[i]), samples[i],
                                   order) == samples[i]);
    }
  }
}

TEST(CigiPackets, DefaultsHaveOnlyIdSizeAndVersion) {
  for (const Packet& sample : all_samples()) {
    std::visit(
        [](const auto& each) {
          using P = std::decay_t<decltype(each)>;
          const auto bytes = test::bytes_alone(P{}, ByteOrder::little);
          ASSERT_EQ(bytes.size(), P::kWire.v3_3.bytes);
          EXPECT_EQ(std::to_integer<unsigned>(bytes[0]), P::kWire.v3_3.id);
          EXPECT_EQ(std::to_integer<unsigned>(bytes[1]), P::kWire.v3_3.bytes);
          if (test::begins_message(each)) return;
          EXPECT_TRUE(std::ranges::all_of(bytes.begin() + 2, bytes.end(),
                                          [](std::byte b) { return b == std::byte{0}; }));
        },
        sample);
  }
}

// One flag or one part of a byte, with the offset and the bits that it must set.
struct BitCase {
  const char* name;
  Packet packet;
  std::size_t offset;
  unsigned bits;
};

std::vector<BitCase> bit_cases() {
  using enum PartAxis;
  return {
      {"debug", IgControl{.mode = IgMode::debug}, 4, 0x32},
      {"ig timestamp", IgControl{.timestamp_valid = true}, 4, 0x34},
      {"smoothing", IgControl{.smoothing_enabled = true}, 4, 0x38},
      {"destroyed", EntityControl{.state = EntityState::destroyed}, 4, 0x02},
      {"attach", EntityControl{.attached = true}, 4, 0x04},
      {"collision", EntityControl{.collision_detection = true}, 4, 0x08},
      {"inherit alpha", EntityControl{.inherit_alpha = true}, 4, 0x10},
      {"clamp", EntityControl{.clamp = Clamp::conformal}, 4, 0x40},
      {"backward", EntityControl{.animation_backward = true}, 5, 0x01},
      {"loop", EntityControl{.animation_loop = true}, 5, 0x02},
      {"pause", EntityControl{.animation = Animation::pause}, 5, 0x04},
      {"continue", EntityControl{.animation = Animation::proceed}, 5, 0x0C},
      {"extrapolation", EntityControl{.extrapolation_enabled = true}, 5, 0x10},
      {"class", ComponentControl{.component_class = ComponentClass::symbol}, 6, 0x0F},
      {"part", ArticulatedPartControl{.part_enabled = true}, 5, 0x01},
      {"part x", ArticulatedPartControl{.x_enabled = true}, 5, 0x02},
      {"part y", ArticulatedPartControl{.y_enabled = true}, 5, 0x04},
      {"part z", ArticulatedPartControl{.z_enabled = true}, 5, 0x08},
      {"part roll", ArticulatedPartControl{.roll_enabled = true}, 5, 0x10},
      {"part pitch", ArticulatedPartControl{.pitch_enabled = true}, 5, 0x20},
      {"part yaw", ArticulatedPartControl{.yaw_enabled = true}, 5, 0x40},
      {"axis 1", ShortArticulatedPartControl{.motions = {{{.axis = roll}, {}}}}, 6, 0x06},
      {"axis 2", ShortArticulatedPartControl{.motions = {{{}, {.axis = roll}}}}, 6, 0x30},
      {"enable 1", ShortArticulatedPartControl{.motions = {{{.part_enabled = true}, {}}}}, 6, 0x40},
      {"enable 2", ShortArticulatedPartControl{.motions = {{{}, {.part_enabled = true}}}}, 6, 0x80},
      {"rate part", RateControl{.applies_to_part = true}, 5, 0x01},
      {"rate local", RateControl{.local = true}, 5, 0x02},
      {"ephemeris", CelestialSphereControl{.ephemeris_enabled = true}, 4, 0x01},
      {"sun", CelestialSphereControl{.sun_enabled = true}, 4, 0x02},
      {"moon", CelestialSphereControl{.moon_enabled = true}, 4, 0x04},
      {"stars", CelestialSphereControl{.stars_enabled = true}, 4, 0x08},
      {"model", AtmosphereControl{.model_enabled = true}, 2, 0x01},
      {"region", EnvironmentalRegionControl{.state = RegionState::destroyed}, 4, 0x02},
      {"merge weather", EnvironmentalRegionControl{.merge_weather = true}, 4, 0x04},
      {"merge aerosol", EnvironmentalRegionControl{.merge_aerosol = true}, 4, 0x08},
      {"merge maritime", EnvironmentalRegionControl{.merge_maritime = true}, 4, 0x10},
      {"merge terrestrial", EnvironmentalRegionControl{.merge_terrestrial = true}, 4, 0x20},
      {"weather", WeatherControl{.enabled = true}, 6, 0x01},
      {"scud", WeatherControl{.scud_enabled = true}, 6, 0x02},
      {"winds", WeatherControl{.random_winds = true}, 6, 0x04},
      {"lightning", WeatherControl{.random_lightning = true}, 6, 0x08},
      {"cloud", WeatherControl{.cloud_type = 15}, 6, 0xF0},
      {"scope", WeatherControl{.scope = WeatherScope::entity}, 7, 0x02},
      {"severity", WeatherControl{.severity = 7}, 7, 0x1C},
      {"view x", ViewControl{.x_enabled = true}, 5, 0x01},
      {"view y", ViewControl{.y_enabled = true}, 5, 0x02},
      {"view z", ViewControl{.z_enabled = true}, 5, 0x04},
      {"view roll", ViewControl{.roll_enabled = true}, 5, 0x08},
      {"view pitch", ViewControl{.pitch_enabled = true}, 5, 0x10},
      {"view yaw", ViewControl{.yaw_enabled = true}, 5, 0x20},
      {"sensor on", SensorControl{.on = true}, 5, 0x01},
      {"black hot", SensorControl{.black_hot = true}, 5, 0x02},
      {"dropout", SensorControl{.line_dropout = true}, 5, 0x04},
      {"gain", SensorControl{.automatic_gain = true}, 5, 0x08},
      {"track black", SensorControl{.track_black = true}, 5, 0x10},
      {"track mode", SensorControl{.track_mode = static_cast<TrackMode>(7)}, 5, 0xE0},
      {"sensor response", SensorControl{.extended_response = true}, 6, 0x01},
      {"earth", EarthReferenceModel{.custom_enabled = true}, 2, 0x01},
      {"near", ViewDefinition{.near_enabled = true}, 5, 0x01},
      {"far", ViewDefinition{.far_enabled = true}, 5, 0x02},
      {"left", ViewDefinition{.left_enabled = true}, 5, 0x04},
      {"right", ViewDefinition{.right_enabled = true}, 5, 0x08},
      {"top", ViewDefinition{.top_enabled = true}, 5, 0x10},
      {"bottom", ViewDefinition{.bottom_enabled = true}, 5, 0x20},
      {"mirror", ViewDefinition{.mirror = Mirror::both}, 5, 0xC0},
      {"replication", ViewDefinition{.pixel_replication = 7}, 6, 0x07},
      {"orthographic", ViewDefinition{.orthographic = true}, 6, 0x08},
      {"reorder", ViewDefinition{.bring_to_top = true}, 6, 0x10},
      {"view type", ViewDefinition{.view_type = 7}, 6, 0xE0},
      {"height of", HatHotRequest{.type = HatHotType::height_of}, 4, 0x01},
      {"hat relative", HatHotRequest{.relative_to_entity = true}, 4, 0x04},
      {"segment extended", LosSegmentRequest{.extended = true}, 4, 0x01},
      {"segment source", LosSegmentRequest{.source_relative = true}, 4, 0x02},
      {"segment destination", LosSegmentRequest{.destination_relative = true}, 4, 0x04},
      {"segment response", LosSegmentRequest{.response_relative = true}, 4, 0x08},
      {"segment entity", LosSegmentRequest{.destination_entity_valid = true}, 4, 0x10},
      {"vector extended", LosVectorRequest{.extended = true}, 4, 0x01},
      {"vector source", LosVectorRequest{.source_relative = true}, 4, 0x02},
      {"vector response", LosVectorRequest{.response_relative = true}, 4, 0x04},
      {"continuous", PositionRequest{.continuous = true}, 5, 0x01},
      {"tracker", PositionRequest{.object_class = ObjectClass::motion_tracker}, 5, 0x08},
      {"submodel", PositionRequest{.frame = PositionFrame::submodel}, 5, 0x20},
      {"maritime", EnvironmentalConditionsRequest{.maritime = true}, 2, 0x01},
      {"terrestrial", EnvironmentalConditionsRequest{.terrestrial = true}, 2, 0x02},
      {"conditions", EnvironmentalConditionsRequest{.weather = true}, 2, 0x04},
      {"aerosol", EnvironmentalConditionsRequest{.aerosol = true}, 2, 0x08},
      {"maintenance", StartOfFrame{.mode = IgMode::maintenance}, 5, 0x33},
      {"sof timestamp", StartOfFrame{.timestamp_valid = true}, 5, 0x34},
      {"custom earth", StartOfFrame{.custom_earth = true}, 5, 0x38},
      {"hat valid", HatHotResponse{.valid = true}, 4, 0x01},
      {"hat kind", HatHotResponse{.height_of_terrain = true}, 4, 0x02},
      {"hat lsn", HatHotResponse{.host_frame_lsn = 15}, 4, 0xF0},
      {"extended valid", HatHotExtendedResponse{.valid = true}, 4, 0x01},
      {"los valid", LosResponse{.valid = true}, 4, 0x01},
      {"los entity", LosResponse{.entity_valid = true}, 4, 0x02},
      {"los visible", LosResponse{.visible = true}, 4, 0x04},
      {"ray valid", LosExtendedResponse{.valid = true}, 4, 0x01},
      {"ray entity", LosExtendedResponse{.entity_valid = true}, 4, 0x02},
      {"ray range", LosExtendedResponse{.range_valid = true}, 4, 0x04},
      {"ray visible", LosExtendedResponse{.visible = true}, 4, 0x08},
      {"breaklock", SensorResponse{.state = TrackState::breaklock}, 5, 0x03},
      {"track entity", SensorExtendedResponse{.entity_valid = true}, 5, 0x04},
      {"position class", PositionResponse{.object_class = ObjectClass::motion_tracker}, 5, 0x04},
      {"position frame", PositionResponse{.frame = PositionFrame::submodel}, 5, 0x10},
  };
}

TEST(CigiPackets, EveryFlagSetsItsOwnBits) {
  for (const BitCase& each : bit_cases()) {
    SCOPED_TRACE(each.name);
    const auto bytes = test::bytes_alone(each.packet, ByteOrder::big);
    EXPECT_EQ(std::to_integer<unsigned>(bytes[each.offset]), each.bits);
    EXPECT_TRUE(test::read_alone(bytes, test::sender_of(each.packet), each.packet,
                                 ByteOrder::big) == each.packet);
  }
}

TEST(CigiPackets, ReservedBitsAreIgnored) {
  auto bytes = test::bytes_alone(EntityControl{.entity_id = 9}, ByteOrder::big);
  bytes[4] |= std::byte{0x80};
  bytes[5] |= std::byte{0xE0};
  bytes[7] = std::byte{0xFF};
  const Packet like = EntityControl{.entity_id = 9};
  EXPECT_TRUE(test::read_alone(bytes, Sender::host, like, ByteOrder::big) == like);
}

TEST(CigiPackets, TextsTakeWholeMultiplesOfEightBytes) {
  for (std::size_t length = 0; length < 120; ++length) {
    const std::string text(length, 'x');
    const auto message = ImageGeneratorMessage::make(7, text);
    const std::size_t kept = std::min<std::size_t>(length, 99);
    EXPECT_EQ(message.view(), text.substr(0, kept));
    const auto bytes = test::bytes_alone(message, ByteOrder::little);
    EXPECT_EQ(bytes.size(), (4 + kept + 1 + 7) / 8 * 8);
    EXPECT_TRUE(test::read_alone(bytes, Sender::ig, message, ByteOrder::little) == Packet(message));
  }
  EXPECT_EQ(ImageGeneratorMessage::make(7, std::string_view("ab\0cd", 5)).view(), "ab");
}

TEST(CigiPackets, TimestampsAreTicksOfTenMicrosecondsThatWrap) {
  EXPECT_EQ(timestamp_ticks(0), 0U);
  EXPECT_EQ(timestamp_ticks(9'999), 0U);
  EXPECT_EQ(timestamp_ticks(10'000), 1U);
  EXPECT_EQ(timestamp_ticks(1'000'000'000), 100'000U);
  EXPECT_EQ(timestamp_ticks(-1), 0xFFFF'FFFFU);
  EXPECT_EQ(timestamp_ticks(-10'000), 0xFFFF'FFFFU);
  EXPECT_EQ(timestamp_ticks(42'949'672'960'000), 0U);
  EXPECT_EQ(timestamp_ticks(42'949'672'960'000 + 30'000), 3U);
}

}  // namespace
}  // namespace emit::protocol::cigi
