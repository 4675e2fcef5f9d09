// SPDX-License-Identifier: Apache-2.0
// A capture of a host's datagrams makes the frames of the run that was captured.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/small_world.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

constexpr std::chrono::seconds kRenderLimit{280};

/// A socket in the place of a daemon's host port, which keeps what arrives.
class Tap {
 public:
  Tap() : fd_(::socket(AF_INET, SOCK_DGRAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof(address);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&address), length), 0);
    EXPECT_EQ(::getsockname(fd_, reinterpret_cast<sockaddr*>(&address), &length), 0);
    port_ = ntohs(address.sin_port);
  }
  ~Tap() { ::close(fd_); }
  Tap(const Tap&) = delete;
  Tap& operator=(const Tap&) = delete;
  [[nodiscard]] std::uint16_t port() const { return port_; }
  /// Returns the datagrams that have arrived.
  [[nodiscard]] std::vector<std::string> taken() const {
    std::vector<std::string> out;
    std::array<char, 65536> bytes{};
    for (ssize_t got = 0; (got = ::recv(fd_, bytes.data(), bytes.size(), MSG_DONTWAIT)) >= 0;) {
      out.emplace_back(bytes.data(), static_cast<std::size_t>(got));
    }
    return out;
  }

 private:
  int fd_;
  std::uint16_t port_ = 0;
};

std::string little(std::uint64_t value, int bytes) {
  std::string out;
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xFF);
  return out;
}
std::string big(std::uint64_t value, int bytes) {
  const std::string out = little(value, bytes);
  return {out.rbegin(), out.rend()};
}

/// Wraps a payload as a datagram to `port` in a tagged Ethernet frame.
std::string tagged_frame(const std::string& payload, std::uint16_t port) {
  return big(0x112233445566, 6) + big(0x665544332211, 6) + big(0x81000005, 4) + big(0x0800, 2) +
         big(0x4500, 2) + big(28 + payload.size(), 2) + big(0, 4) + big(0x4011, 2) + big(0, 2) +
         big(0x7F000001, 4) + big(0x7F000001, 4) + big(40000, 2) + big(port, 2) +
         big(8 + payload.size(), 2) + big(0, 2) + payload;
}

std::string pcap_of(const std::vector<std::string>& packets) {
  std::string out = little(0xA1B2C3D4, 4) + little(2, 2) + little(4, 2) + little(0, 8) +
                    little(262144, 4) + little(1, 4);
  for (const std::string& packet : packets) {
    out += little(1'700'000'000, 4) + little(7, 4) + little(packet.size(), 4) +
           little(packet.size(), 4) + packet;
  }
  return out;
}

std::string pcapng_of(const std::vector<std::string>& packets) {
  const auto block = [](std::uint32_t type, std::string content) {
    content.resize((content.size() + 3) / 4 * 4);
    const std::string length = little(content.size() + 12, 4);
    return little(type, 4) + length + content + length;
  };
  std::string out = block(0x0A0D0D0A, little(0x1A2B3C4D, 4) + little(1, 2) + little(0, 2) +
                                          std::string(8, '\xFF')) +
                    block(1, little(1, 2) + little(0, 2) + little(0, 4));
  for (const std::string& packet : packets) {
    out += block(6, little(0, 4) + little(5, 4) + little(1234, 4) + little(packet.size(), 4) +
                        little(packet.size(), 4) + packet);
  }
  return out;
}

class CaptureReplay : public ::testing::Test {
 protected:
  static ProcessResult expect_success(const std::vector<std::string>& arguments) {
    ProcessResult result = run_emit(arguments, kRenderLimit);
    EXPECT_EQ(result.exit_code, 0) << result.out << result.err;
    return result;
  }
  /// Sends a log to a new daemon in lock step and returns what it recorded.
  Journal record(const std::string& log, const std::vector<std::string>& more = {}) {
    std::filesystem::remove(folder_.file("stdout"));
    std::filesystem::remove(folder_.file("journal.mcap"));
    DaemonProcess daemon(folder_, {"--config", folder_.file("emitd.toml")});
    EXPECT_TRUE(daemon.wait_ready(kRenderLimit)) << folder_.read("stderr");
    std::vector<std::string> command{"send", folder_.file(log), "--to", "tcp://" + daemon.control(),
                                     "--step"};
    command.insert(command.end(), more.begin(), more.end());
    expect_success(command);
    daemon.signal(SIGTERM);
    EXPECT_EQ(daemon.wait(), 0);
    return Journal(folder_.file("journal.mcap"));
  }
  /// CRCs by the numbers of the frames: runs have other ids.
  static std::vector<std::uint32_t> crcs_of(const Journal& journal) {
    std::vector<std::uint32_t> out;
    for (const auto& [key, crc] : journal.crcs) out.push_back(crc);
    return out;
  }
  ScratchFolder folder_;
};

TEST_F(CaptureReplay, a_capture_of_the_wire_gives_the_frames_of_the_run) {
  folder_.write("world.toml", small_world("cached"));
  folder_.write("emitd.toml",
                "scenario = \"world.toml\"\n[pacing]\nmode = \"host-step\"\n"
                "[host]\nudp = \"127.0.0.1:0\"\n[control]\ntcp = \"127.0.0.1:0\"\n"
                "[journal]\nfile = \"journal.mcap\"\n");
  expect_success({"make-log", folder_.file("world.toml"), "--rate-hz", "1", "--duration-s", "8",
                  "--start-s", "0", "--out", folder_.file("poses.mcap")});
  const std::vector<std::uint32_t> live = crcs_of(record("poses.mcap"));
  ASSERT_EQ(live.size(), 9U);

  const Tap tap;
  expect_success({"send", folder_.file("poses.mcap"), "--to",
                  "udp://127.0.0.1:" + std::to_string(tap.port()), "--rate", "1000"});
  std::vector<std::string> packets;
  for (const std::string& payload : tap.taken()) packets.push_back(tagged_frame(payload, 7311));
  ASSERT_EQ(packets.size(), 9U);
  std::ofstream(folder_.file("host.pcap"), std::ios::binary) << pcap_of(packets);
  std::ofstream(folder_.file("host.pcapng"), std::ios::binary) << pcapng_of(packets);

  for (const char* capture : {"host.pcap", "host.pcapng"}) {
    EXPECT_EQ(crcs_of(record(capture, {"--host-port", "7311"})), live) << capture;
    const ProcessResult replay = expect_success(
        {"replay", folder_.file("journal.mcap"), "--scenario", folder_.file("world.toml")});
    EXPECT_THAT(replay.out, HasSubstr("9 frames replayed"));
    EXPECT_THAT(replay.out, HasSubstr("bit-identical"));
  }
}

/// A table of the host's poses sets zoom and gimbal again where the host has set them.
TEST_F(CaptureReplay, a_table_of_poses_gives_the_frames_of_the_run_with_zoom_and_gimbal) {
  std::string world = small_world("per-frame");
  const std::string size = "width_px = 48\n";
  world.insert(world.find(size), "fov_h_deg = 30\nfov_h_min_deg = 5\n");
  folder_.write("world.toml", world);
  folder_.write("emitd.toml",
                "scenario = \"world.toml\"\n[pacing]\nmode = \"host-step\"\n"
                "[host]\nudp = \"127.0.0.1:0\"\n[control]\ntcp = \"127.0.0.1:0\"\n"
                "[journal]\nfile = \"journal.mcap\"\n");
  std::string poses =
      "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz,fov_h_rad,gimbal_yaw_rad,gimbal_pitch_rad,"
      "gimbal_roll_rad\n";
  // The sensor stands 16 m above the road and looks down to the north.
  const auto row = [&](int second, const std::string& view) {
    poses += std::to_string(second) +
             ",0.1,-12.3,16,0.29883623873011983,0.64085638205578580,0.64085638205578580,"
             "-0.29883623873011983," +
             view + "\n";
  };
  row(0, ",,,");
  row(1, "0.17453292519943295,,,");
  row(2, ",0.01,-0.02,0.03333333333333333");
  row(3, ",,,");
  row(4, "0.3,0,0,0");
  folder_.write("poses.csv", poses);
  const std::vector<std::uint32_t> live = crcs_of(record("poses.csv"));
  ASSERT_EQ(live.size(), 5U);
  EXPECT_NE(live[0], live[1]) << "the sensor zooms";
  EXPECT_NE(live[1], live[2]) << "the gimbal turns";
  expect_success({"log", "export", "csv", folder_.file("journal.mcap"), "--table", "seeker",
                  "--out", folder_.file("seeker.csv")});
  EXPECT_EQ(crcs_of(record("seeker.csv")), live);
  const ProcessResult replay = expect_success(
      {"replay", folder_.file("journal.mcap"), "--scenario", folder_.file("world.toml")});
  EXPECT_THAT(replay.out, HasSubstr("bit-identical"));
}

}  // namespace
}  // namespace emit::test
