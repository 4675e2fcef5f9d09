// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "emit/protocol/cigi.hpp"
#include "protocol/cigi/cigi_samples.hpp"
#include "protocol/hex.hpp"
#include "support/heap_counter.hpp"

namespace emit::protocol::cigi {
namespace {

using CigiBytes = std::vector<std::byte>;
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

std::vector<Packet> samples_of(Sender sender, Version version = Version::v3_3) {
  return sender == Sender::host ? test::sample_host_packets(version)
                                : test::sample_ig_packets(version);
}

CigiBytes message_of(std::initializer_list<Packet> packets, ByteOrder order = ByteOrder::big,
                     Version version = Version::v3_3) {
  return test::cigi_message(std::vector<Packet>(packets), order, version);
}

/// Every sender, byte order and version of a message.
struct Way {
  Sender sender;
  ByteOrder order;
  Version version;
};
std::vector<Way> all_ways() {
  std::vector<Way> ways;
  for (const Sender sender : {Sender::host, Sender::ig}) {
    for (const ByteOrder order : {ByteOrder::big, ByteOrder::little}) {
      for (const Version version : {Version::v3_3, Version::v4_0}) {
        ways.push_back({sender, order, version});
      }
    }
  }
  return ways;
}

/// Returns the size that the packet at an offset states.
std::size_t stated_size(const CigiBytes& message, std::size_t at, const Way& way) {
  const auto byte = [&](std::size_t i) { return std::to_integer<std::size_t>(message[at + i]); };
  if (way.version == Version::v3_3) return byte(1);
  return way.order == ByteOrder::big ? 256 * byte(0) + byte(1) : byte(0) + 256 * byte(1);
}

/// All that a reader says about a message.
struct Told {
  std::vector<Packet> packets;
  std::vector<Fault> refused;
  Step last = Step::packet;
  Fault fault;
  std::size_t skipped = 0;
  std::size_t user_defined = 0;
};

Told told(std::span<const std::byte> message, Sender sender) {
  // The copy lies in heap memory of its exact size, so that sanitizers see a read beyond the end.
  const CigiBytes exact(message.begin(), message.end());
  Reader reader(exact, sender);
  Told out;
  for (std::size_t steps = 0; steps <= message.size() / 8 + 1; ++steps) {
    Packet packet = EventNotification{.event_id = 4711};
    out.last = reader.next(packet);
    if (out.last == Step::packet) {
      out.packets.push_back(packet);
      continue;
    }
    EXPECT_TRUE(packet == Packet(EventNotification{.event_id = 4711})) << "changed";
    if (out.last != Step::refused) break;
    EXPECT_TRUE(reader.fault());
    out.refused.push_back(reader.fault());
  }
  EXPECT_TRUE(out.last == Step::end || out.last == Step::broken) << "does not end";
  if (out.last == Step::broken) {
    out.fault = reader.fault();
    EXPECT_TRUE(out.fault);
  }
  Packet after;
  EXPECT_EQ(reader.next(after), out.last) << "the end stays";
  out.skipped = reader.skipped_packets();
  out.user_defined = reader.user_defined_packets();
  EXPECT_EQ(reader.refused_packets(), out.refused.size());
  return out;
}

std::string text_of(const Fault& fault) {
  std::array<char, kFaultTextBytes> buffer;
  return std::string(fault_text(fault, buffer));
}

/// Returns a message of IG Control and raw bytes.
CigiBytes with_bytes(std::string_view hex) {
  auto message = message_of({IgControl{}});
  const auto more = test::from_hex(hex);
  message.insert(message.end(), more.begin(), more.end());
  return message;
}

TEST(CigiReader, MessagesOfAllPacketsSurviveInBothOrders) {
  for (const Way& way : all_ways()) {
    const auto samples = samples_of(way.sender, way.version);
    const auto message = test::cigi_message(samples, way.order, way.version);
    const Told out = told(message, way.sender);
    EXPECT_EQ(out.last, Step::end);
    EXPECT_TRUE(out.packets == samples);
    EXPECT_TRUE(out.refused.empty());
    EXPECT_EQ(out.skipped, 0U);
    const Reader reader(message, way.sender);
    EXPECT_EQ(reader.version(), way.version);
    EXPECT_EQ(reader.byte_order(), way.order);
  }
}

TEST(CigiReader, FrameNumbersGoBothWays) {
  StartOfFrame frame{.mode = IgMode::operate, .ig_frame = 41, .last_host_frame = 6};
  IgControl answer{.mode = IgMode::operate, .host_frame = 7};
  const auto from_ig = told(message_of({frame}, ByteOrder::little), Sender::ig);
  answer.last_ig_frame = std::get<StartOfFrame>(from_ig.packets.at(0)).ig_frame;
  const auto from_host = told(message_of({answer}, ByteOrder::big), Sender::host);
  const auto& read = std::get<IgControl>(from_host.packets.at(0));
  EXPECT_EQ(read.last_ig_frame, 41U);
  EXPECT_EQ(read.host_frame, 7U);
}

TEST(CigiReader, UnknownPacketsAreSkippedBySizeAndCounted) {
  // Motion Tracker Control (18), an id without a meaning (99), user-defined ids 201 and 255.
  auto message = with_bytes(
      "1208000000000000"
      "63100000000000000000000000000000"
      "c90800000000ffff"
      "ff080000ffffffff");
  const auto entity = message_of({IgControl{}, EntityControl{.entity_id = 5}});
  message.insert(message.end(), entity.begin() + 24, entity.end());
  const Told out = told(message, Sender::host);
  EXPECT_EQ(out.last, Step::end);
  EXPECT_EQ(out.skipped, 4U);
  EXPECT_EQ(out.user_defined, 2U);
  ASSERT_EQ(out.packets.size(), 2U);
  EXPECT_EQ(std::get<EntityControl>(out.packets[1]).entity_id, 5);
}

TEST(CigiReader, TheTailOfALongerPacketIsIgnored) {
  auto message = message_of({IgControl{}, EntityControl{.entity_id = 5}});
  // Eight bytes more belong to the entity, and another entity follows.
  message[24 + 1] = static_cast<std::byte>(std::to_integer<unsigned>(message[24 + 1]) + 8);
  message.insert(message.end(), 8, std::byte{0xEE});
  const auto next = message_of({IgControl{}, EntityControl{.entity_id = 6}});
  message.insert(message.end(), next.begin() + 24, next.end());
  const Told out = told(message, Sender::host);
  EXPECT_EQ(out.last, Step::end);
  ASSERT_EQ(out.packets.size(), 3U);
  EXPECT_EQ(std::get<EntityControl>(out.packets[1]).entity_id, 5);
  EXPECT_EQ(std::get<EntityControl>(out.packets[2]).entity_id, 6);
}

TEST(CigiReader, WrongFirstPacketsBreakTheMessage) {
  const auto fault = [](CigiBytes message, Sender sender = Sender::host) {
    const Told out = told(message, sender);
    EXPECT_TRUE(out.packets.empty());
    EXPECT_EQ(out.last, Step::broken);
    return out.fault;
  };
  const auto good = message_of({IgControl{}});
  const auto changed = [&](std::size_t at, unsigned value) {
    auto bytes = good;
    bytes[at] = static_cast<std::byte>(value);
    return bytes;
  };
  EXPECT_EQ(fault({}).kind, Fault::Kind::too_short);
  EXPECT_EQ(fault(CigiBytes(7)).kind, Fault::Kind::too_short);
  EXPECT_EQ(fault(good, Sender::ig).kind, Fault::Kind::first_packet);
  EXPECT_EQ(fault(changed(0, 2)).kind, Fault::Kind::first_packet);
  EXPECT_EQ(fault(changed(1, 16)).kind, Fault::Kind::size_of_packet);
  EXPECT_EQ(fault(changed(1, 32)).kind, Fault::Kind::size_beyond_end);
  EXPECT_EQ(text_of(fault(changed(2, 2))),
            "packet 0 (id 1, IG Control) at byte 0: CIGI version 2.0, must be 3.3 or 4.0");
  EXPECT_EQ(text_of(fault(changed(4, 0x20))),
            "packet 0 (id 1, IG Control) at byte 0: CIGI version 3.2, must be 3.3 or 4.0");
  EXPECT_EQ(text_of(fault(changed(6, 0x70))),
            "packet 0 (id 1, IG Control) at byte 0: byte swap magic number 0x7000, must be 0x8000 "
            "or 0x0080");
  EXPECT_EQ(text_of(fault(changed(4, 0x33))),
            "packet 0 (id 1, IG Control) at byte 0: mode is 3, must be 0 to 2");
  // CIGI 3.1 has 16 bytes and no minor version; CIGI 4 begins with a size of 16 bits.
  EXPECT_EQ(text_of(fault(test::from_hex("01100300000080000000000000000000"))),
            "packet 0 (id 1, IG Control) at byte 0: CIGI version 3.0, must be 3.3 or 4.0");
  for (const char* later : {"18000000050000000000", "00180000050000000000"}) {
    EXPECT_EQ(text_of(fault(test::from_hex(later))),
              "packet 0 (id 0x0000, IG Control) at byte 0: CIGI version 5.0, must be 3.3 or 4.0");
  }
  EXPECT_NE(text_of(fault(test::from_hex("1800ffff040000100000"), Sender::ig)).find("version 4.1"),
            std::string::npos);
}

TEST(CigiReader, WrongSizesEndTheMessageAndNameThePlace) {
  const auto fault = [](std::string_view hex) {
    const Told out = told(with_bytes("0508000000000000" + std::string(hex)), Sender::host);
    EXPECT_EQ(out.last, Step::broken);
    return text_of(out.fault);
  };
  // A Short Component Control has 16 bytes, so that the one in front breaks the message itself.
  EXPECT_EQ(fault(""),
            "packet 1 (id 5, Short Component Control) at byte 24: states 8 bytes, must be 16");
  const auto later = [](std::string_view hex) {
    const Told out = told(with_bytes("1b080001000000c0" + std::string(hex)), Sender::host);
    EXPECT_EQ(out.last, Step::broken);
    EXPECT_EQ(out.packets.size(), 2U) << "packets in front stay good";
    return text_of(out.fault);
  };
  EXPECT_EQ(later("0200000000000000"),
            "packet 2 (id 2, Entity Control) at byte 32: states 0 bytes");
  EXPECT_EQ(later("c901000000000000"),
            "packet 2 (id 201, user defined) at byte 32: states 1 bytes");
  EXPECT_EQ(later("c90c000000000000"),
            "packet 2 (id 201, user defined) at byte 32: states 12 bytes, must be a multiple of 8");
  EXPECT_EQ(later("c910000000000000"),
            "packet 2 (id 201, user defined) at byte 32: states 16 bytes, 8 are left");
  EXPECT_EQ(later("02"),
            "packet 2 (id 2, Entity Control) at byte 32: 1 bytes are left, it needs 2");
  EXPECT_EQ(later("06180000000000000000000000000000000000000000000000"),
            "packet 2 (id 6, Articulated Part Control) at byte 32: states 24 bytes, must be 32");
}

TEST(CigiReader, WrongNumbersRefuseOnePacketAlone) {
  struct Case {
    std::function<void(CigiBytes&)> damage;
    std::string text;
  };
  // The message: IG Control at 0, Entity Control at 24, Sensor Control at 72.
  const auto message = message_of(
      {IgControl{}, EntityControl{.entity_id = 3}, SensorControl{.sensor_id = 4, .gain = 0.5f}});
  const auto number = [](std::size_t at, double value) {
    return [=](CigiBytes& bytes) {
      const auto bits = std::bit_cast<std::uint64_t>(value);
      for (std::size_t i = 0; i < 8; ++i) {
        bytes[at + i] = static_cast<std::byte>((bits >> (56 - 8 * i)) & 0xFFu);
      }
    };
  };
  const auto real = [](std::size_t at, float value) {
    return [=](CigiBytes& bytes) {
      const auto bits = std::bit_cast<std::uint32_t>(value);
      for (std::size_t i = 0; i < 4; ++i) {
        bytes[at + i] = static_cast<std::byte>((bits >> (24 - 8 * i)) & 0xFFu);
      }
    };
  };
  const std::string entity = "packet 1 (id 2, Entity Control) at byte 24: ";
  const std::string sensor = "packet 2 (id 17, Sensor Control) at byte 72: ";
  const std::vector<Case> cases = {
      {real(36, kNan), entity + "roll_deg is nan, must be -180 to 180"},
      {real(40, 90.5f), entity + "pitch_deg is 90.5, must be -90 to 90"},
      {real(44, 361.0f), entity + "yaw_deg is 361, must be -180 to 360"},
      {number(48, 91.0), entity + "latitude_deg is 91, must be -90 to 90"},
      {number(56, -180.5), entity + "longitude_deg is -180.5, must be -180 to 180"},
      {number(64, kInfinity), entity + "altitude_m is inf, must be finite"},
      {[](CigiBytes& b) { b[28] = std::byte{3}; }, entity + "state is 3, must be 0 to 2"},
      {[](CigiBytes& b) { b[28] = std::byte{0x60}; }, entity + "clamp is 3, must be 0 to 2"},
      {real(80, 1.5f), sensor + "gain is 1.5, must be 0 to 1"},
      {real(88, -1.0f), sensor + "ac_coupling_us is -1, must be finite and at least 0"},
  };
  for (const Case& each : cases) {
    SCOPED_TRACE(each.text);
    auto bytes = message;
    each.damage(bytes);
    const Told out = told(bytes, Sender::host);
    EXPECT_EQ(out.last, Step::end);
    EXPECT_EQ(out.packets.size(), 2U);
    ASSERT_EQ(out.refused.size(), 1U);
    EXPECT_EQ(text_of(out.refused[0]), each.text);
  }
}

TEST(CigiReader, OffsetsOfChildrenAreNoGeodeticPositions) {
  const EntityControl child{.attached = true, .place = {500.0, -4000.0, 20.0}};
  EXPECT_EQ(told(message_of({IgControl{}, child}), Sender::host).packets.size(), 2U);
  EntityControl top = child;
  top.attached = false;
  std::array<std::byte, 256> memory;
  Writer writer(memory, Version::v3_3, ByteOrder::big);
  EXPECT_FALSE(writer.add(IgControl{}));
  EXPECT_EQ(writer.add(top).kind, Fault::Kind::field);
}

TEST(CigiReader, DatesMustBeDaysOfTheCalendarIfValid) {
  const auto kind = [](std::uint32_t date, bool valid) {
    std::array<std::byte, 256> memory;
    Writer writer(memory, Version::v3_3, ByteOrder::big);
    EXPECT_FALSE(writer.add(IgControl{}));
    return writer.add(CelestialSphereControl{.date_valid = valid, .date_mmddyyyy = date}).kind;
  };
  EXPECT_EQ(kind(2292024, true), Fault::Kind::none);
  EXPECT_EQ(kind(12312099, true), Fault::Kind::none);
  EXPECT_EQ(kind(0, false), Fault::Kind::none);
  for (const std::uint32_t wrong : {0U, 2292023U, 2302024U, 13012024U, 1002024U, 4294967295U}) {
    EXPECT_EQ(kind(wrong, true), Fault::Kind::date) << wrong;
  }
}

TEST(CigiReader, PacketsThatDoNotBelongHereAreRefused) {
  auto message = message_of({IgControl{}, EntityControl{}});
  const auto second = message_of({IgControl{.host_frame = 8}});
  message.insert(message.end(), second.begin(), second.end());
  const auto answer = message_of({StartOfFrame{}, HatHotResponse{}});
  message.insert(message.end(), answer.begin() + 24, answer.end());
  const Told out = told(message, Sender::host);
  EXPECT_EQ(out.last, Step::end);
  EXPECT_EQ(out.packets.size(), 2U);
  ASSERT_EQ(out.refused.size(), 2U);
  EXPECT_EQ(text_of(out.refused[0]),
            "packet 2 (id 1, IG Control) at byte 72: a message has one such packet, the first");
  EXPECT_EQ(text_of(out.refused[1]),
            "packet 3 (id 102, HAT/HOT Response) at byte 96: the other side sends such packets");
}

TEST(CigiReader, TextsWithoutAnEndAreRefused) {
  auto message = message_of({StartOfFrame{}, ImageGeneratorMessage::make(1, "abc")});
  ASSERT_EQ(message.size(), 32U);
  message[31] = std::byte{'d'};
  const Told out = told(message, Sender::ig);
  ASSERT_EQ(out.refused.size(), 1U);
  EXPECT_EQ(text_of(out.refused[0]),
            "packet 1 (id 117, Image Generator Message) at byte 24: the text has no end");
}

TEST(CigiReader, EveryPrefixGivesThePacketsThatItHolds) {
  for (const Way& way : all_ways()) {
    const auto samples = samples_of(way.sender, way.version);
    const auto message = test::cigi_message(samples, way.order, way.version);
    std::vector<std::size_t> ends = {0};
    while (ends.back() < message.size()) {
      ends.push_back(ends.back() + stated_size(message, ends.back(), way));
    }
    for (std::size_t length = 0; length < message.size(); ++length) {
      const Told out = told(std::span(message).first(length), way.sender);
      const auto whole = static_cast<std::size_t>(
          std::upper_bound(ends.begin(), ends.end(), length) - ends.begin() - 1);
      ASSERT_EQ(out.packets.size(), whole) << length;
      EXPECT_TRUE(std::equal(out.packets.begin(), out.packets.end(), samples.begin()));
      EXPECT_TRUE(out.refused.empty());
      const bool at_an_end = whole > 0 && ends[whole] == length;
      EXPECT_EQ(out.last, at_an_end ? Step::end : Step::broken) << length;
      if (!at_an_end) {
        EXPECT_EQ(out.fault.offset, ends[whole]);
      }
    }
  }
}

TEST(CigiReader, EveryFlippedBitHarmsItsOwnPacketAlone) {
  for (const Way& way : all_ways()) {
    const auto samples = samples_of(way.sender, way.version);
    const auto message = test::cigi_message(samples, way.order, way.version);
    const std::size_t header = way.version == Version::v3_3 ? 2 : 4;
    std::size_t begin = 0;
    for (std::size_t hit = 0; hit < samples.size(); ++hit) {
      const auto size = stated_size(message, begin, way);
      for (std::size_t bit = 0; bit < 8 * size; ++bit) {
        auto bytes = message;
        bytes[begin + bit / 8] ^= static_cast<std::byte>(1u << (bit % 8));
        const Told out = told(bytes, way.sender);
        // Packets in front are what they were. Those behind are too, if the size still holds.
        ASSERT_GE(out.packets.size(), hit);
        for (std::size_t i = 0; i < std::min(hit, out.packets.size()); ++i) {
          EXPECT_TRUE(out.packets[i] == samples[i]);
        }
        if (bit / 8 < header || (hit == 0 && out.last == Step::broken)) continue;
        ASSERT_EQ(out.last, Step::end) << hit << ' ' << bit;
        ASSERT_EQ(out.packets.size() + out.refused.size(), samples.size());
        for (std::size_t k = 1; k < samples.size() - hit; ++k) {
          EXPECT_TRUE(out.packets[out.packets.size() - k] == samples[samples.size() - k]);
        }
      }
      begin += size;
    }
  }
}

TEST(CigiReader, RandomDamageEndsWithAFaultOrSoundPackets) {
  std::mt19937 random(7);
  const auto ways = all_ways();
  for (std::size_t round = 0; round < 40'000; ++round) {
    const Way& way = ways[random() % ways.size()];
    auto bytes = test::cigi_message(samples_of(way.sender, way.version), way.order, way.version);
    for (std::size_t k = 1 + random() % 6; k > 0; --k) {
      bytes[24 + random() % (bytes.size() - 24)] = static_cast<std::byte>(random() & 0xFFu);
    }
    bytes.resize(24 + random() % (bytes.size() - 23));
    const Told out = told(bytes, way.sender);
    std::array<std::byte, 4096> memory;
    Writer writer(memory, way.version, way.order);
    for (const Packet& packet : out.packets) {
      ASSERT_FALSE(writer.add(packet)) << "what was read can be written";
    }
    const Told again = told(writer.message(), way.sender);
    ASSERT_TRUE(again.packets == out.packets);
  }
}

TEST(CigiWriter, RefusesWhatAReaderWouldRefuse) {
  std::array<std::byte, 80> memory;
  Writer writer(memory, Version::v3_3, ByteOrder::big);
  EXPECT_EQ(writer.add(EntityControl{}).kind, Fault::Kind::first_packet);
  EXPECT_EQ(writer.add(IgControl{.mode = IgMode::maintenance}).kind, Fault::Kind::field);
  EXPECT_EQ(writer.add(IgControl{.database = -1}).kind, Fault::Kind::field);
  EXPECT_TRUE(writer.message().empty());
  EXPECT_FALSE(writer.add(IgControl{}));
  EXPECT_EQ(writer.add(IgControl{}).kind, Fault::Kind::repeated);
  EXPECT_EQ(writer.add(StartOfFrame{}).kind, Fault::Kind::repeated);
  EXPECT_EQ(writer.add(LosResponse{}).kind, Fault::Kind::sender);
  EXPECT_EQ(text_of(writer.add(RateControl{.yaw_deg_s = kNan})),
            "packet 1 (id 8, Rate Control) at byte 24: yaw_deg_s is nan, must be finite");
  EXPECT_EQ(writer.add(ComponentControl{.component_class = static_cast<ComponentClass>(64)}).kind,
            Fault::Kind::field);
  EXPECT_FALSE(writer.add(EntityControl{}));
  EXPECT_EQ(text_of(writer.add(PositionRequest{.object_id = 1})), "no fault");
  EXPECT_EQ(text_of(writer.add(PositionRequest{.object_id = 1})),
            "packet 3 (id 27, Position Request) at byte 80: it has 8 bytes, 0 are free");
  EXPECT_EQ(writer.message().size(), 80U);
  writer.clear();
  EXPECT_FALSE(writer.add(StartOfFrame{}));
  ImageGeneratorMessage endless = ImageGeneratorMessage::make(1, "a");
  endless.text.fill('x');
  EXPECT_EQ(writer.add(endless).kind, Fault::Kind::text);
  EXPECT_EQ(writer.message().size(), 24U);
}

TEST(CigiWriter, NothingAllocates) {
  const auto samples = samples_of(Sender::host);
  std::array<std::byte, 4096> memory;
  std::array<char, kFaultTextBytes> text;
  Packet packet;
  std::size_t read = 0;
  std::size_t texts = 0;
  const auto before = test::heap_request_count();
  Writer writer(memory, Version::v3_3, ByteOrder::big);
  for (const Packet& each : samples) static_cast<void>(writer.add(each));
  const Fault fault = writer.add(RateControl{.x_m_s = kNan});
  texts += fault_text(fault, text).size();
  Reader reader(writer.message(), Sender::host);
  while (reader.next(packet) == Step::packet) ++read;
  Reader other(writer.message(), Sender::ig);
  static_cast<void>(other.next(packet));
  texts += fault_text(other.fault(), text).size();
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_EQ(read, samples.size());
  EXPECT_GT(texts, 40U);
}

TEST(CigiFaults, TextsFitAndAreCutOff) {
  const Fault longest{.kind = Fault::Kind::field,
                      .packet = 8190,
                      .id = 113,
                      .offset = 65528,
                      .field = "horizontal_wind_m_s_and_more",
                      .value = -1.2345678901234567e-300,
                      .lowest = -1.2345678901234567e-300,
                      .highest = -1.2345678901234567e-300};
  EXPECT_LT(text_of(longest).size(), kFaultTextBytes);
  std::array<char, 10> small;
  EXPECT_EQ(fault_text(longest, small), "packet 819");
  const auto name = [](std::uint16_t id) { return packet_name(id, Version::v3_3); };
  EXPECT_EQ(name(0), "unknown");
  EXPECT_EQ(name(35), "Short Symbol Control");
  EXPECT_EQ(name(36), "unknown");
  EXPECT_EQ(name(117), "Image Generator Message");
  EXPECT_EQ(name(200), "unknown");
  EXPECT_EQ(name(201), "user defined");
}

}  // namespace
}  // namespace emit::protocol::cigi
