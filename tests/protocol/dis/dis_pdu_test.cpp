// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "emit/protocol/dis.hpp"
#include "protocol/capture.hpp"
#include "protocol/dis/dis_samples.hpp"
#include "protocol/hex.hpp"
#include "support/heap_counter.hpp"

namespace emit::protocol::dis {
namespace {

using DisBytes = std::vector<std::byte>;

// Bytes of the sample PDUs, version 7 and exercise 9. Another program wrote them from the tables of
// the standard, and tshark reads them below.
struct GoldenPdu {
  const char* name;
  std::string_view hex;
};
constexpr GoldenPdu kGoldenPdus[] = {
    {"EntityState",
     "070901011234567900b000000102030405060202020100e101020304010200de"
     "0506070842cb0000c34a400043979000415085c844000000412151e300000000"
     "4151ac8b500000003fa00000bf00000040300000a1b2c3d40801020304050607"
     "08090a0b0c0d0e0f41180000c104000040e400003e800000bf0000003f400000"
     "015345454b45522d3100000000000102000300000000100b3f00000000000000"
     "000400010000114dbe80000000000000"},
    {"Fire",
     "070902020000222200600000000100020003000400050006000700080009000a"
     "000b000c0000004d415085c844000000412151e3000000004151ac8b50000000"
     "020100e10102030403e8044c0001003c42cb0000c34a40004397900044bb9000"},
    {"Detonation",
     "070903020000333400780000000100020003000400050006000700080009000a"
     "000b000c42cb0000c34a400043979000415085c844000000412151e300000000"
     "4151ac8b50000000020100e10102030403e8044c0001003c3fc00000c0200000"
     "4060000005010000000300000000100b3f00000000000000"},
    {"StartResume",
     "07090d0500004444002c0000000100020003ffffffffffff0007530010000001"
     "000000052000000000000063"},
    {"StopFreeze",
     "07090e050000555500280000000100020003ffffffffffff0007530130000001"
     "0106000000000064"},
    {"EntityStateUpdate",
     "070943011234567900580000010203040506000142cb0000c34a400043979000"
     "415085c844000000412151e3000000004151ac8b500000003fa00000bf000000"
     "40300000a1b2c3d4000300000000100b3f00000000000000"},
};

/// All that a reader says about a datagram.
struct DisOutcome {
  std::vector<Pdu> pdus;
  std::vector<Header> headers;
  std::vector<std::vector<VariableParameter>> parameters;
  std::vector<std::uint8_t> other_types;
  std::vector<std::string> refused;
  Step last = Step::pdu;
  std::string fault;
};

std::string text_of_dis(const Fault& fault) {
  std::array<char, kFaultTextBytes> buffer;
  return std::string(fault_text(fault, buffer));
}

DisOutcome read_all(std::span<const std::byte> datagram) {
  // The copy lies in heap memory of its exact size, so that sanitizers see a read beyond the end.
  const DisBytes exact(datagram.begin(), datagram.end());
  Reader reader(exact);
  DisOutcome out;
  for (std::size_t steps = 0; steps <= datagram.size() / 12 + 1; ++steps) {
    Pdu pdu = StopFreeze{.request_id = 4711};
    out.last = reader.next(pdu);
    if (out.last == Step::pdu) {
      out.pdus.push_back(pdu);
      out.headers.push_back(reader.header());
      auto& parameters = out.parameters.emplace_back();
      for (std::size_t i = 0; i < reader.parameters().size(); ++i) {
        parameters.push_back(reader.parameters()[i]);
      }
      continue;
    }
    EXPECT_TRUE(pdu == Pdu(StopFreeze{.request_id = 4711})) << "changed";
    EXPECT_EQ(reader.parameters().size(), 0U);
    if (out.last == Step::other) out.other_types.push_back(reader.header().type);
    if (out.last == Step::refused) out.refused.push_back(text_of_dis(reader.fault()));
    if (out.last == Step::end || out.last == Step::broken) break;
  }
  EXPECT_TRUE(out.last == Step::end || out.last == Step::broken) << "does not end";
  if (out.last == Step::broken) out.fault = text_of_dis(reader.fault());
  Pdu after;
  EXPECT_EQ(reader.next(after), out.last) << "the end stays";
  return out;
}

DisBytes one_pdu(const Pdu& pdu, std::uint8_t version = 7) {
  const test::SamplePdu sample{pdu, 2, {}};
  return test::dis_datagram(std::span(&sample, 1), version);
}

void append_bytes(DisBytes& out, std::span<const std::byte> more) {
  out.insert(out.end(), more.begin(), more.end());
}

template <class T>
void put_big(DisBytes& bytes, std::size_t at, T value) {
  std::array<std::byte, sizeof(T)> raw;
  std::memcpy(raw.data(), &value, sizeof value);
  std::reverse_copy(raw.begin(), raw.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
}

TEST(DisPdus, EveryPduHasItsGoldenBytes) {
  const auto samples = test::sample_pdus();
  ASSERT_EQ(samples.size(), std::size(kGoldenPdus));
  ASSERT_EQ(samples.size(), std::variant_size_v<Pdu>);
  for (std::size_t i = 0; i < samples.size(); ++i) {
    SCOPED_TRACE(kGoldenPdus[i].name);
    EXPECT_EQ(samples[i].pdu.index(), i);
    EXPECT_EQ(test::to_hex(test::dis_datagram(std::span(&samples[i], 1), 7)), kGoldenPdus[i].hex);
    for (const std::uint8_t version : {std::uint8_t{6}, std::uint8_t{7}}) {
      auto bytes = test::from_hex(kGoldenPdus[i].hex);
      bytes[0] = std::byte{version};
      const auto out = read_all(bytes);
      EXPECT_EQ(out.last, Step::end);
      ASSERT_EQ(out.pdus.size(), 1U);
      EXPECT_TRUE(out.pdus[0] == samples[i].pdu);
      EXPECT_TRUE(out.parameters[0] == samples[i].parameters);
      EXPECT_EQ(out.headers[0].version, version);
      EXPECT_EQ(out.headers[0].exercise_id, 9);
      EXPECT_EQ(out.headers[0].timestamp, samples[i].timestamp);
      EXPECT_EQ(out.headers[0].length, bytes.size());
    }
  }
}

TEST(DisPdus, StatusIsAFieldOfVersionSevenAlone) {
  auto bytes = one_pdu(StopFreeze{});
  bytes[10] = std::byte{0x5A};
  EXPECT_EQ(read_all(bytes).headers.at(0).status, 0x5A);
  bytes[0] = std::byte{6};
  EXPECT_EQ(read_all(bytes).headers.at(0).status, 0);
}

TEST(DisPdus, MarkingsEndAtTheirFirstZeroOrAtTheField) {
  EntityState state;
  EXPECT_EQ(state.marking_text(), "");
  state.marking = {'a', 'b', '\0', 'c'};
  EXPECT_EQ(state.marking_text(), "ab");
  state.marking.fill('x');
  EXPECT_EQ(state.marking_text(), "xxxxxxxxxxx");
}

TEST(DisPdus, ParametersSplitTheirTypeAndReadNoValueOfOtherRecords) {
  const VariableParameter turret{.type = 4096 + 11};
  EXPECT_EQ(turret.part_class(), 4096U);
  EXPECT_EQ(turret.metric(), 11U);
  EntityState state;
  const VariableParameter attached{
      .record_type = VariableParameter::kAttachedPart, .attached_to = 7, .type = 898};
  const test::SamplePdu sample{state, 2, {attached}};
  auto bytes = test::dis_datagram(std::span(&sample, 1), 7);
  put_big(bytes, 144 + 8, 1.5f);  // the type of the attached entity lies here
  const auto out = read_all(bytes);
  ASSERT_EQ(out.parameters.at(0).size(), 1U);
  EXPECT_TRUE(out.parameters[0][0] == attached);
}

TEST(DisReader, BundledPdusOfBothVersionsAreRead) {
  const auto samples = test::sample_pdus();
  for (const std::uint8_t version : {std::uint8_t{6}, std::uint8_t{7}}) {
    const auto datagram = test::dis_datagram(samples, version);
    const auto out = read_all(datagram);
    EXPECT_EQ(out.last, Step::end);
    ASSERT_EQ(out.pdus.size(), samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i) {
      EXPECT_TRUE(out.pdus[i] == samples[i].pdu) << i;
      EXPECT_TRUE(out.parameters[i] == samples[i].parameters) << i;
    }
  }
  // Start/Resume has 44 bytes, so that version 7 puts 4 bytes behind it.
  EXPECT_EQ(test::dis_datagram(samples, 7).size(), test::dis_datagram(samples, 6).size() + 4);
}

TEST(DisReader, PaddingMayBelongToTheLengthToo) {
  auto datagram = one_pdu(StartResume{.request_id = 5});
  ASSERT_EQ(datagram.size(), 44U);
  datagram.resize(48);
  put_big(datagram, 8, std::uint16_t{48});
  append_bytes(datagram, one_pdu(StopFreeze{.request_id = 6}));
  const auto out = read_all(datagram);
  EXPECT_EQ(out.last, Step::end);
  EXPECT_EQ(out.pdus.size(), 2U);
}

TEST(DisReader, ZerosAtTheEndAreNoPdu) {
  auto datagram = one_pdu(StartResume{});
  datagram.resize(48);
  EXPECT_EQ(read_all(datagram).last, Step::end);
  datagram.resize(56);
  EXPECT_EQ(read_all(datagram).fault, "PDU 1 at byte 48: 8 bytes are left, it needs 12");
}

TEST(DisReader, OtherTypesAreNamedAndPassedOver) {
  DisBytes datagram = one_pdu(EntityState{.force_id = 1});
  auto signal = one_pdu(StopFreeze{});
  signal[2] = std::byte{26};
  append_bytes(datagram, signal);
  append_bytes(datagram, one_pdu(EntityState{.force_id = 2}));
  const auto out = read_all(datagram);
  EXPECT_EQ(out.last, Step::end);
  EXPECT_EQ(out.pdus.size(), 2U);
  EXPECT_EQ(out.other_types, std::vector<std::uint8_t>{26});
}

TEST(DisReader, LengthsThatCannotBeEndTheDatagram) {
  auto datagram = one_pdu(EntityState{});
  append_bytes(datagram, one_pdu(Fire{}));
  const auto fault = [&](std::uint16_t length) {
    auto bytes = datagram;
    put_big(bytes, 144 + 8, length);
    const auto out = read_all(bytes);
    EXPECT_EQ(out.last, Step::broken);
    EXPECT_EQ(out.pdus.size(), 1U) << "the PDU in front stays good";
    return out.fault;
  };
  EXPECT_EQ(fault(11), "PDU 1 (type 2, Fire) at byte 144: states 11 bytes, must be 12 to 96");
  EXPECT_EQ(fault(97), "PDU 1 (type 2, Fire) at byte 144: states 97 bytes, must be 12 to 96");
  EXPECT_EQ(read_all(std::span(datagram).first(150)).fault,
            "PDU 1 at byte 144: 6 bytes are left, it needs 12");
  EXPECT_EQ(read_all({}).last, Step::end);
}

TEST(DisReader, FaultsInsideAPduLeaveOutThatOneAlone) {
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
  const auto refused = [](const Pdu& pdu, const auto& damage) {
    auto datagram = one_pdu(pdu);
    damage(datagram);
    append_bytes(datagram, one_pdu(StopFreeze{}));
    const auto out = read_all(datagram);
    EXPECT_EQ(out.last, Step::end);
    EXPECT_EQ(out.pdus.size(), 1U);
    return out.refused.size() == 1 ? out.refused[0] : "not one";
  };
  const auto set = [](std::size_t at, auto value) {
    return [=](DisBytes& bytes) { put_big(bytes, at, value); };
  };
  const std::string state = "PDU 0 (type 1, Entity State) at byte 0: ";
  EXPECT_EQ(refused(EntityState{}, set(0, std::uint8_t{5})), state + "version 5, must be 6 or 7");
  EXPECT_EQ(refused(EntityState{}, set(19, std::uint8_t{1})),
            state + "states 144 bytes, needs 160");
  EXPECT_EQ(refused(EntityState{}, set(36, kNan)), state + "velocity_m_s is nan, must be finite");
  EXPECT_EQ(refused(EntityState{}, set(56, 2e8)),
            state + "location_ecef_m is 200000000, must be -100000000 to 100000000");
  EXPECT_EQ(refused(EntityState{}, set(64, std::numeric_limits<double>::infinity())),
            state + "location_ecef_m is inf, must be -100000000 to 100000000");
  EXPECT_EQ(refused(EntityState{}, set(72, kNan)), state + "psi_rad is nan, must be finite");
  EXPECT_EQ(refused(EntityState{}, set(76, kNan)), state + "theta_rad is nan, must be finite");
  EXPECT_EQ(refused(EntityState{}, set(80, kNan)), state + "phi_rad is nan, must be finite");
  EXPECT_EQ(refused(EntityState{}, set(88, std::uint8_t{10})),
            state + "model is 10, must be 0 to 9");
  EXPECT_EQ(refused(EntityState{}, set(112, kNan)),
            state + "acceleration_m_s2 is nan, must be finite");
  EXPECT_EQ(refused(EntityState{}, set(124, kNan)),
            state + "angular_velocity_rad_s is nan, must be finite");
  const std::string update = "PDU 0 (type 67, Entity State Update) at byte 0: ";
  EXPECT_EQ(refused(EntityStateUpdate{}, set(28, kNan)),
            update + "velocity_m_s is nan, must be finite");
  EXPECT_EQ(refused(EntityStateUpdate{}, set(64, kNan)), update + "phi_rad is nan, must be finite");
  EXPECT_EQ(refused(EntityStateUpdate{}, set(19, std::uint8_t{2})),
            update + "states 72 bytes, needs 104");
  const std::string fire = "PDU 0 (type 2, Fire) at byte 0: ";
  EXPECT_EQ(refused(Fire{}, set(92, -1.0f)),
            fire + "range_m is -1, must be finite and not negative");
  EXPECT_EQ(refused(Fire{}, set(80, kNan)), fire + "velocity_ecef_m_s is nan, must be finite");
  const std::string detonation = "PDU 0 (type 3, Detonation) at byte 0: ";
  EXPECT_EQ(refused(Detonation{}, set(96, kNan)),
            detonation + "location_in_target_m is nan, must be finite");
  EXPECT_EQ(refused(Detonation{}, set(101, std::uint8_t{1})),
            detonation + "states 104 bytes, needs 120");
  // A header without a body is too small for its type.
  DisBytes header = one_pdu(StopFreeze{});
  header.resize(12);
  put_big(header, 8, std::uint16_t{12});
  EXPECT_EQ(read_all(header).refused.at(0),
            "PDU 0 (type 14, Stop/Freeze) at byte 0: states 12 bytes, needs 40");
}

TEST(DisReader, EveryPrefixGivesThePdusThatItHolds) {
  const auto samples = test::sample_pdus();
  const auto datagram = test::dis_datagram(samples, 6);
  std::vector<std::size_t> ends = {0};
  for (const auto& each : samples) {
    ends.push_back(ends.back() + test::dis_datagram(std::span(&each, 1), 6).size());
  }
  for (std::size_t length = 0; length < datagram.size(); ++length) {
    const auto out = read_all(std::span(datagram).first(length));
    const auto whole = static_cast<std::size_t>(std::upper_bound(ends.begin(), ends.end(), length) -
                                                ends.begin() - 1);
    ASSERT_EQ(out.pdus.size(), whole) << length;
    EXPECT_EQ(out.last, ends[whole] == length ? Step::end : Step::broken) << length;
  }
}

TEST(DisReader, RandomDamageEndsWithAFaultOrSoundPdus) {
  std::mt19937 random(11);
  const auto datagram = test::dis_datagram(test::sample_pdus(), 7);
  for (std::size_t round = 0; round < 20'000; ++round) {
    auto bytes = datagram;
    for (std::size_t k = 1 + random() % 6; k > 0; --k) {
      bytes[random() % bytes.size()] = static_cast<std::byte>(random() & 0xFFu);
    }
    bytes.resize(random() % (bytes.size() + 1));
    const auto out = read_all(bytes);
    for (std::size_t i = 0; i < out.pdus.size(); ++i) {
      std::vector<std::byte> memory(8192);
      Writer writer(memory, out.headers[i].version, 1);
      ASSERT_FALSE(writer.add(out.pdus[i], 0, out.parameters[i])) << "what was read can be written";
      const auto again = read_all(writer.datagram());
      ASSERT_EQ(again.pdus.size(), 1U);
      ASSERT_TRUE(again.pdus[0] == out.pdus[i]);
    }
  }
}

TEST(DisWriter, RefusesWhatDoesNotFitOrAReaderWouldRefuse) {
  std::array<std::byte, 150> memory;
  Writer writer(memory, 7, 1);
  EXPECT_FALSE(writer.add(StartResume{}, 0));
  EXPECT_EQ(text_of_dis(writer.add(EntityState{.location_ecef_m = {0.0, 0.0, -2e8}}, 0)),
            "PDU 1 (type 1, Entity State) at byte 48: location_ecef_m is -200000000, must be "
            "-100000000 to 100000000");
  EXPECT_EQ(text_of_dis(writer.add(EntityState{}, 0)),
            "PDU 1 (type 1, Entity State) at byte 48: it has 144 bytes, 102 are free");
  EXPECT_EQ(writer.datagram().size(), 44U);
  EXPECT_FALSE(writer.add(Fire{}, 0));
  EXPECT_EQ(writer.datagram().size(), 144U);
  EXPECT_EQ(writer.add(StopFreeze{}, 0).kind, Fault::Kind::no_space);
}

TEST(DisWriter, NothingAllocates) {
  const auto samples = test::sample_pdus();
  std::array<std::byte, 2048> memory;
  std::array<char, kFaultTextBytes> text;
  Pdu pdu;
  std::size_t read = 0;
  const auto before = test::heap_request_count();
  Writer writer(memory, 7, 1);
  for (const auto& each : samples) {
    static_cast<void>(writer.add(each.pdu, each.timestamp, each.parameters));
  }
  const Fault fault = writer.add(Fire{.range_m = -1.0f}, 0);
  const auto words = fault_text(fault, text);
  Reader reader(writer.datagram());
  while (reader.next(pdu) == Step::pdu) ++read;
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_EQ(read, samples.size());
  EXPECT_GT(words.size(), 20U);
}

/// A field of tshark and the values that the sample PDU has there; several are separated by commas.
struct DisField {
  const char* name;
  const char* value;
};
using DisFields = std::vector<DisField>;
const std::vector<DisFields>& tshark_fields() {
  static const std::vector<DisFields> fields = {
      {{"dis.pdu_type", "1"},
       {"dis.proto_fam", "1"},
       {"dis.exer_id", "9"},
       {"dis.pdu_length", "176"},
       {"dis.entity_id_site", "258"},
       {"dis.entity_id_application", "772"},
       {"dis.entity_id_entity", "1286"},
       {"dis.force_id", "2"},
       {"dis.num_articulation_params", "2"},
       {"dis.entityKind", "2,1"},
       {"dis.entityDomain", "1,2"},
       {"dis.country", "225,222"},
       {"dis.subcategory", "2,6"},
       {"dis.specific", "3,7"},
       {"dis.extra", "4,8"},
       {"dis.entity_linear_velocity.x", "101.5"},
       {"dis.entity_linear_velocity.y", "-202.25"},
       {"dis.entity_linear_velocity.z", "303.125"},
       {"dis.entity_location.x", "4331297.0625"},
       {"dis.entity_location.y", "567537.5"},
       {"dis.entity_location.z", "4633133.25"},
       {"dis.entity_orientation.psi", "1.25"},
       {"dis.entity_orientation.theta", "-0.5"},
       {"dis.entity_orientation.phi", "2.75"},
       {"dis.dead_reckoning_other_parameters", "0102030405060708090a0b0c0d0e0f"},
       {"dis.entity_linear_acceleration.x", "9.5"},
       {"dis.entity_linear_acceleration.y", "-8.25"},
       {"dis.entity_linear_acceleration.z", "7.125"},
       {"dis.entity_angular_velocity.x", "0.25"},
       {"dis.entity_angular_velocity.y", "-0.5"},
       {"dis.entity_angular_velocity.z", "0.75"},
       {"dis.entity_marking", "SEEKER-1"},
       {"dis.capabilities", "258"},
       {"dis.vp.change", "3,4"},
       {"dis.vp.part_attached_to_id", "0,1"},
       {"dis.vp.artic_param_type", "4107,4429"},
       {"dis.vp.parameter_value", "0.5,-0.25"}},
      {{"dis.pdu_type", "2"},
       {"dis.proto_fam", "2"},
       {"dis.pdu_length", "96"},
       {"dis.entity_id_site", "1,4,7"},
       {"dis.entity_id_application", "2,5,8"},
       {"dis.entity_id_entity", "3,6,9"},
       {"dis.event_number", "12"},
       {"dis.fire.mission_index", "77"},
       {"dis.fire.location.x", "4331297.0625"},
       {"dis.fire.location.z", "4633133.25"},
       {"dis.country", "225"},
       {"dis.warhead", "1000"},
       {"dis.fuse", "1100"},
       {"dis.quality", "1"},
       {"dis.rate", "60"},
       {"dis.linear_velocity.x", "101.5"},
       {"dis.linear_velocity.z", "303.125"},
       {"dis.range", "1500.5"}},
      {{"dis.pdu_type", "3"},
       {"dis.proto_fam", "2"},
       {"dis.pdu_length", "120"},
       {"dis.event_number", "12"},
       {"dis.linear_velocity.y", "-202.25"},
       {"dis.detonation.location.x", "4331297.0625"},
       {"dis.detonation.location.y", "567537.5"},
       {"dis.warhead", "1000"},
       {"dis.rate", "60"},
       {"dis.detonation.result", "5"},
       {"dis.num_articulation_params", "1"}},
      {{"dis.pdu_type", "13"},
       {"dis.proto_fam", "5"},
       {"dis.pdu_length", "44"},
       {"dis.entity_id_site", "1,65535"},
       {"dis.request_id", "99"}},
      {{"dis.pdu_type", "14"},
       {"dis.proto_fam", "5"},
       {"dis.pdu_length", "40"},
       {"dis.entity_id_entity", "3,65535"},
       {"dis.reason", "1"},
       {"dis.frozen_behavior", "6"},
       {"dis.request_id", "100"}},
      {{"dis.pdu_type", "67"},
       {"dis.proto_fam", "1"},
       {"dis.pdu_length", "88"},
       {"dis.entity_id_entity", "1286"},
       {"dis.num_variable_records", "1"},
       {"dis.entity_linear_velocity.z", "303.125"},
       {"dis.entity_location.y", "567537.5"},
       {"dis.entity_orientation.phi", "2.75"},
       {"dis.vp.artic_param_type", "4107"},
       {"dis.vp.parameter_value", "0.5"}},
  };
  return fields;
}

TEST(DisTshark, ReadsThePdusOfBothVersions) {
  if (!test::tshark_is_here()) GTEST_SKIP() << "tshark is not installed";
  const auto samples = test::sample_pdus();
  ASSERT_EQ(samples.size(), tshark_fields().size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    SCOPED_TRACE(kGoldenPdus[i].name);
    const test::TemporaryFolder folder;
    const std::string file = folder.file("dis.pcap");
    std::ofstream out(file, std::ios::binary);
    out << test::capture_head();
    for (const std::uint8_t version : {std::uint8_t{6}, std::uint8_t{7}}) {
      out << test::capture_record(test::dis_datagram(std::span(&samples[i], 1), version), 3000,
                                  3000);
    }
    out.close();
    std::vector<std::string> command = {"tshark", "-n",           "-r", file,
                                        "-T",     "fields",       "-E", "separator=|",
                                        "-E",     "aggregator=,", "-e", "_ws.malformed",
                                        "-e",     "dis.proto_ver"};
    for (const DisField& field : tshark_fields()[i]) {
      command.emplace_back("-e");
      command.emplace_back(field.name);
    }
    const auto result = test::run_process(command);
    ASSERT_EQ(result.exit_code, 0) << result.err;
    std::istringstream lines(result.out);
    for (const char* version : {"6", "7"}) {
      std::string line;
      ASSERT_TRUE(std::getline(lines, line));
      std::istringstream values(line + '|');
      std::string value;
      ASSERT_TRUE(std::getline(values, value, '|'));
      EXPECT_EQ(value, "") << "malformed";
      ASSERT_TRUE(std::getline(values, value, '|'));
      EXPECT_EQ(value, version);
      for (const DisField& field : tshark_fields()[i]) {
        ASSERT_TRUE(std::getline(values, value, '|')) << field.name;
        EXPECT_EQ(value, field.value) << field.name << " of version " << version;
      }
    }
  }
}

}  // namespace
}  // namespace emit::protocol::dis
