// SPDX-License-Identifier: Apache-2.0
// Tests of the capture reader. They build the captures byte by byte, without the reader's own code.
#include "emit/protocol/record/pose_pcap.hpp"

#include <gmock/gmock.h>

#include <filesystem>
#include <fstream>
#include <random>
#include <string>
#include <vector>

#include "emit/protocol/codec.hpp"
#include "protocol/host_frames.hpp"

namespace emit::protocol {
namespace {

using ::testing::HasSubstr;

using Octets = std::string;

Octets big(std::uint64_t value, int bytes) {
  Octets out;
  for (int i = bytes - 1; i >= 0; --i) {
    out += static_cast<char>(i < 8 ? value >> (8 * i) & 0xFF : 0);
  }
  return out;
}
Octets little(std::uint64_t value, int bytes) {
  const Octets out = big(value, bytes);
  return {out.rbegin(), out.rend()};
}
Octets ordered(bool big_endian, std::uint64_t value, int bytes) {
  return big_endian ? big(value, bytes) : little(value, bytes);
}

Octets host_frame(std::uint64_t number) {
  auto frame = test::make_host_frame(2);
  frame->frame_number = number;
  frame->sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
  HostFrameEncoder encoder;
  const auto bytes = encoder.encode(*frame);
  return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
}

Octets udp(const Octets& payload, std::uint16_t port = 7001) {
  return big(40000, 2) + big(port, 2) + big(8 + payload.size(), 2) + big(0xBAD1, 2) + payload;
}
Octets ipv4(const Octets& content, std::uint16_t fragment = 0x4000, std::uint8_t protocol = 17,
            const Octets& options = "") {
  const std::size_t header = 20 + options.size();
  return big(0x40 | header / 4, 1) + big(0, 1) + big(header + content.size(), 2) + big(7, 2) +
         big(fragment, 2) + big(64, 1) + big(protocol, 1) + big(0, 2) + big(0x7F000001, 4) +
         big(0x7F000001, 4) + options + content;
}
Octets ipv6(const Octets& content, std::uint8_t next = 17) {
  return big(0x60000000, 4) + big(content.size(), 2) + big(next, 1) + big(64, 1) + big(0, 15) +
         big(1, 1) + big(0, 15) + big(1, 1) + content;
}
Octets ethernet(const Octets& content, std::uint16_t type = 0x0800, const Octets& tags = "") {
  return big(0x112233445566, 6) + big(0x665544332211, 6) + tags + big(type, 2) + content;
}

Octets pcap_header(bool big_endian, bool nanoseconds, std::uint32_t link_type) {
  return ordered(big_endian, nanoseconds ? 0xA1B23C4D : 0xA1B2C3D4, 4) + ordered(big_endian, 2, 2) +
         ordered(big_endian, 4, 2) + ordered(big_endian, 0, 8) + ordered(big_endian, 262144, 4) +
         ordered(big_endian, link_type, 4);
}
Octets pcap_record(bool big_endian, const Octets& packet, std::size_t wire_bytes = 0) {
  return ordered(big_endian, 1'700'000'000, 4) + ordered(big_endian, 999'999, 4) +
         ordered(big_endian, packet.size(), 4) +
         ordered(big_endian, wire_bytes == 0 ? packet.size() : wire_bytes, 4) + packet;
}

Octets block(bool big_endian, std::uint32_t type, Octets content) {
  while (content.size() % 4 != 0) content += '\0';
  const Octets length = ordered(big_endian, content.size() + 12, 4);
  return ordered(big_endian, type, 4) + length + content + length;
}
Octets section(bool big_endian) {
  return block(big_endian, 0x0A0D0D0A,
               ordered(big_endian, 0x1A2B3C4D, 4) + ordered(big_endian, 1, 2) +
                   ordered(big_endian, 0, 2) + Octets(8, '\xFF'));
}
Octets interface(bool big_endian, std::uint16_t link_type, const Octets& options = "") {
  return block(big_endian, 1,
               ordered(big_endian, link_type, 2) + ordered(big_endian, 0, 2) +
                   ordered(big_endian, 0, 4) + options);
}
Octets enhanced(bool big_endian, std::uint32_t index, const Octets& packet) {
  return block(big_endian, 6,
               ordered(big_endian, index, 4) + ordered(big_endian, 0x0005'0000, 4) +
                   ordered(big_endian, 0x1234, 4) + ordered(big_endian, packet.size(), 4) +
                   ordered(big_endian, packet.size(), 4) + packet);
}

class PosePcap : public ::testing::Test {
 protected:
  void SetUp() override {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    path_ = std::filesystem::path(EMIT_TEST_BINARY_DIR) /
            (std::string("pose_pcap_test_") + info->name() + ".pcap");
  }
  void TearDown() override { std::filesystem::remove(path_); }

  void write(const Octets& bytes) const {
    std::ofstream(path_, std::ios::binary | std::ios::trunc) << bytes;
  }

  struct Outcome {
    std::vector<std::uint64_t> frames;
    std::string error;
    std::string notes;
  };
  /// Reads the whole file.
  [[nodiscard]] Outcome read(const Octets& bytes, std::uint16_t port = 7001) const {
    write(bytes);
    Outcome out;
    auto reader = PosePcapReader::open(path_, port);
    if (!reader) {
      out.error = reader.error().text;
      return out;
    }
    for (;;) {
      const auto more = reader->next();
      if (!more) {
        out.error = more.error().text;
        EXPECT_FALSE(reader->next().has_value()) << "an error is final";
        break;
      }
      if (!*more) break;
      out.frames.push_back(reader->host().frame_number);
      EXPECT_EQ(reader->host().sim_time_ns,
                static_cast<std::int64_t>(reader->host().frame_number) * 5'000'000);
      EXPECT_EQ(reader->host().entity_count, 2U);
    }
    out.notes = reader->notes().value_or("");
    return out;
  }

  std::filesystem::path path_;
};

using Frames = std::vector<std::uint64_t>;

TEST_F(PosePcap, ReadsClassicFilesOfEitherByteOrderAndResolution) {
  for (const bool big_endian : {false, true}) {
    for (const bool nanoseconds : {false, true}) {
      const auto out =
          read(pcap_header(big_endian, nanoseconds, 1) +
               pcap_record(big_endian, ethernet(ipv4(udp(host_frame(1))))) +
               pcap_record(big_endian, ethernet(ipv4(udp(host_frame(2))) + Octets(6, '\0'))));
      EXPECT_EQ(out.error, "");
      EXPECT_EQ(out.frames, (Frames{1, 2}));
      EXPECT_EQ(out.notes, "");
      EXPECT_TRUE(PosePcapReader::is_capture(path_));
    }
  }
}

TEST_F(PosePcap, ReadsEveryLinkLayer) {
  const auto one = [&](std::uint32_t link_type, const Octets& packet) {
    const auto out = read(pcap_header(false, false, link_type) + pcap_record(false, packet));
    EXPECT_EQ(out.error, "") << link_type;
    return out.frames;
  };
  const Octets v4 = ipv4(udp(host_frame(9)));
  const Octets v6 = ipv6(udp(host_frame(9)));
  const Frames expected{9};
  EXPECT_EQ(one(1, ethernet(v4)), expected);
  EXPECT_EQ(one(1, ethernet(v6, 0x86DD)), expected);
  EXPECT_EQ(one(1, ethernet(v4, 0x0800, big(0x81000005, 4))), expected);
  EXPECT_EQ(one(1, ethernet(v4, 0x0800, big(0x88A80005, 4) + big(0x81000006, 4))), expected);
  const Octets three_tags = big(0x91000005, 4) + big(0x88A80005, 4) + big(0x81000006, 4);
  EXPECT_EQ(one(1, ethernet(v6, 0x86DD, three_tags)), expected);
  EXPECT_EQ(one(113, big(0, 14) + big(0x8100, 2) + big(0x0005'0800, 4) + v4), expected);
  EXPECT_EQ(one(276, big(0x8100, 2) + big(0, 18) + big(0x0005'86DD, 4) + v6), expected);
  EXPECT_EQ(one(101, v4), expected);
  EXPECT_EQ(one(101, v6), expected);
  EXPECT_EQ(one(228, v4), expected);
  EXPECT_EQ(one(229, v6), expected);
  EXPECT_EQ(one(113, big(0, 2) + big(772, 2) + big(6, 2) + big(0, 8) + big(0x0800, 2) + v4),
            expected);
  EXPECT_EQ(one(276, big(0x86DD, 2) + big(0, 18) + v6), expected);
  EXPECT_EQ(one(0, little(2, 4) + v4), expected);
  EXPECT_EQ(one(0, big(30, 4) + v6), expected);
  EXPECT_EQ(one(108, big(24, 4) + v6), expected);
  EXPECT_EQ(one(1, ethernet(ipv4(udp(host_frame(9)), 0, 17, big(0x01010101, 4)))), expected);
}

TEST_F(PosePcap, FindsTheDatagramBehindIpv6ExtensionHeaders) {
  const Octets hop = big(60, 1) + big(0, 1) + Octets(6, '\0');
  const Octets destination = big(17, 1) + big(1, 1) + Octets(14, '\0');
  const Octets whole = big(17, 1) + big(0, 1) + big(0, 2) + big(77, 4);  // an atomic fragment
  const auto out = read(pcap_header(false, false, 101) +
                        pcap_record(false, ipv6(hop + destination + udp(host_frame(3)), 0)) +
                        pcap_record(false, ipv6(whole + udp(host_frame(4)), 44)));
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.frames, (Frames{3, 4}));
}

TEST_F(PosePcap, ReadsNextGenerationFilesWithSectionsOfEitherByteOrder) {
  const Octets packet = ethernet(ipv4(udp(host_frame(1))));
  const Octets nanoseconds_option = little(9, 2) + little(1, 2) + "\x09" + Octets(3, '\0') +
                                    little(14, 2) + little(8, 2) + little(3600, 8) + little(0, 4);
  const Octets simple = ethernet(ipv4(udp(host_frame(4))));
  const auto out = read(section(false) + block(false, 0x0BAD, "custom") +
                        interface(false, 1, nanoseconds_option) + interface(false, 101) +
                        enhanced(false, 0, packet) + enhanced(false, 1, ipv4(udp(host_frame(2)))) +
                        section(true) + interface(true, 1) +
                        enhanced(true, 0, ethernet(ipv6(udp(host_frame(3))), 0x86DD)) +
                        block(true, 3, big(simple.size(), 4) + simple) +
                        block(true, 2,
                              big(0, 2) + big(0, 2) + big(0, 8) + big(packet.size(), 4) +
                                  big(packet.size(), 4) + ethernet(ipv4(udp(host_frame(5))))));
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.frames, (Frames{1, 2, 3, 4, 5}));
}

TEST_F(PosePcap, PassesOtherTrafficOverAndSaysWhatItLeftOut) {
  const Octets first = pcap_record(false, ethernet(ipv4(udp(host_frame(1)))));
  const Octets junk = pcap_record(false, ethernet(ipv4(udp("hello"))));
  const Octets other_port = pcap_record(false, ethernet(ipv4(udp(host_frame(7), 9000))));
  const Octets tcp = pcap_record(false, ethernet(ipv4(udp(host_frame(8)), 0x4000, 6)));
  const Octets arp = pcap_record(false, ethernet(Octets(28, '\1'), 0x0806));
  const auto out = read(pcap_header(false, false, 1) + tcp + arp + other_port + first + first +
                        junk + pcap_record(false, ethernet(ipv4(udp(host_frame(2))))));
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.frames, (Frames{1, 2}));
  EXPECT_THAT(out.notes, HasSubstr("1 datagrams to port 7001 are no host frames (packet 6: "));
  EXPECT_THAT(out.notes, HasSubstr("1 datagrams stand there twice"));
  EXPECT_EQ(read(pcap_header(false, false, 1) + other_port, 9000).frames, Frames{7});
  EXPECT_THAT(read(pcap_header(false, false, 1) + other_port).notes,
              HasSubstr("none of 1 packets is a datagram to port 7001"));
}

TEST_F(PosePcap, RefusesFragmentsCutPacketsAndUnknownLinkLayers) {
  const Octets head = pcap_header(false, false, 1);
  const Octets datagram = udp(host_frame(1));
  const Octets good = pcap_record(false, ethernet(ipv4(datagram)));
  auto out = read(head + good + pcap_record(false, ethernet(ipv4(datagram, 0x2000))));
  EXPECT_EQ(out.frames, Frames{1});
  EXPECT_THAT(out.error, HasSubstr("packet 2: a datagram to port 7001 in IP fragments"));
  const Octets fragment = big(17, 1) + big(0, 1) + big(1, 2) + big(77, 4);
  out = read(pcap_header(false, false, 101) + pcap_record(false, ipv6(fragment + datagram, 44)));
  EXPECT_THAT(out.error, HasSubstr("packet 1: a datagram to port 7001 in IP fragments"));
  // A later fragment has no ports: whose datagram it is part of is not known.
  out = read(head + good + pcap_record(false, ethernet(ipv4(datagram, 0x0010))) +
             pcap_record(false, ethernet(ipv4(datagram, 0x0020, 6))));
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.frames, Frames{1});
  EXPECT_THAT(out.notes, HasSubstr("1 later IP fragments of UDP datagrams"));
  const Octets later = big(17, 1) + big(0, 1) + big(8, 2) + big(77, 4);
  out = read(pcap_header(false, false, 101) + pcap_record(false, ipv6(later + datagram, 44)));
  EXPECT_THAT(out.notes, HasSubstr("1 later IP fragments of UDP datagrams"));
  const Octets packet = ethernet(ipv4(datagram));
  out = read(head + pcap_record(false, packet.substr(0, 96), packet.size()));
  EXPECT_THAT(out.error,
              HasSubstr("only 96 of " + std::to_string(packet.size()) + " bytes were captured"));
  out = read(pcap_header(false, false, 127) + pcap_record(false, packet));
  EXPECT_THAT(out.error, HasSubstr("packet 1: link type 127 is not handled"));
}

TEST_F(PosePcap, NamesNetworkLayersThatItDoesNotRead) {
  const Octets head = pcap_header(false, false, 1);
  const Octets good = pcap_record(false, ethernet(ipv4(udp(host_frame(1)))));
  const Octets pppoe = pcap_record(false, ethernet(Octets(40, '\1'), 0x8864));
  const Octets tagged = pcap_record(false, ethernet(Octets(40, '\1'), 0x88E5, big(0x81000005, 4)));
  const auto out = read(head + good + pppoe + tagged);
  EXPECT_EQ(out.frames, Frames{1});
  EXPECT_THAT(out.notes, HasSubstr("2 packets are neither IP nor ARP and are left out (packet 2: "
                                   "Ethernet type 0x8864)"));
  const Octets spanning_tree = pcap_record(false, ethernet(Octets(38, '\1'), 38));
  EXPECT_EQ(read(head + good + spanning_tree).notes, "");
}

TEST_F(PosePcap, DamagedFilesAreErrorsWithTheirOffset) {
  const Octets head = pcap_header(false, false, 1);
  EXPECT_THAT(read("").error, HasSubstr("no pcap or pcapng file"));
  EXPECT_THAT(read(head.substr(0, 20)).error, HasSubstr("ends within its header"));
  EXPECT_THAT(read(little(0xA1B2CD34, 4) + Octets(40, '\0')).error, HasSubstr("patched"));
  EXPECT_THAT(read(head + little(0, 4) + little(2'000'000, 4) + little(0, 8)).error,
              HasSubstr("offset 24: a time stamp with the fraction 2000000"));
  EXPECT_THAT(read(head + little(0, 8) + little(0x7FFFFFFF, 4) + little(0, 4)).error,
              HasSubstr("offset 24: a packet of 2147483647 bytes"));
  EXPECT_THAT(read(section(false) + little(6, 4) + little(9, 4)).error,
              HasSubstr("offset 28: a block of 9 bytes"));
  EXPECT_THAT(read(section(false) + little(6, 4) + little(12, 4) + little(16, 4)).error,
              HasSubstr("says 16 at its end"));
  EXPECT_THAT(read(section(false) + enhanced(false, 0, "x")).error,
              HasSubstr("a packet of interface 0, which is not described"));
  EXPECT_THAT(read(section(false) + interface(false, 1, little(9, 2) + little(900, 2))).error,
              HasSubstr("an option beyond its block"));
}

TEST_F(PosePcap, ACutTailEndsTheLogAndIsReported) {
  const Octets whole = pcap_header(false, false, 1) +
                       pcap_record(false, ethernet(ipv4(udp(host_frame(1))))) +
                       pcap_record(false, ethernet(ipv4(udp(host_frame(2)))));
  const auto out = read(whole.substr(0, whole.size() - 1));
  EXPECT_EQ(out.error, "");
  EXPECT_EQ(out.frames, Frames{1});
  EXPECT_THAT(out.notes, HasSubstr("the file ends within a packet, which is not used"));
}

TEST_F(PosePcap, NoCutAndNoFlippedByteBreaksTheReader) {
  const Octets packet = ethernet(ipv6(udp(host_frame(1)), 17), 0x86DD);
  const Octets files[] = {
      pcap_header(true, true, 1) + pcap_record(true, packet),
      section(false) + interface(false, 1, little(9, 2) + little(1, 2) + Octets("\x06\0\0\0", 4)) +
          enhanced(false, 0, packet)};
  std::mt19937 random(5);
  for (const Octets& file : files) {
    for (std::size_t length = 0; length < file.size(); length += 3) {
      EXPECT_LE(read(file.substr(0, length)).frames.size(), 1U);
    }
    for (int round = 0; round < 600; ++round) {
      Octets damaged = file;
      // The damage goes into the headers, where it matters.
      damaged[random() % std::min<std::size_t>(damaged.size(), 160)] = static_cast<char>(random());
      write(damaged);
      auto reader = PosePcapReader::open(path_, 7001);
      for (int i = 0; reader && i < 10; ++i) {
        const auto more = reader->next();
        if (!more || !*more) break;
      }
    }
  }
}

}  // namespace
}  // namespace emit::protocol
