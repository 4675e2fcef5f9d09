// SPDX-License-Identifier: Apache-2.0
// Command emit send against a daemon with canned frames.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/protocol/codec.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"

namespace emit::test {
namespace {

using ::testing::HasSubstr;

constexpr const char* kPoses =
    "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n"
    "0,0,0,10,0,0.7071067811865476,0.7071067811865476,0\n"
    "0.005,1,0,10,0,0.7071067811865476,0.7071067811865476,0\n"
    "0.010,2,0,10,0,0.7071067811865476,0.7071067811865476,0\n";

class CliSend : public ::testing::Test {
 protected:
  void SetUp() override {
    daemon_.emplace(
        folder_, std::vector<std::string>{
                     "--config",
                     folder_.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\""))});
    ASSERT_TRUE(daemon_->wait_ready()) << folder_.read("stderr");
  }
  ProcessResult send(const std::string& log, std::vector<std::string> more = {}) {
    std::vector<std::string> arguments{"send", log, "--to", "udp://" + daemon_->host_udp()};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return run_emit(arguments);
  }

  ScratchFolder folder_;
  std::optional<DaemonProcess> daemon_;
};

TEST_F(CliSend, a_second_sending_is_a_run_of_its_own) {
  const std::string log = folder_.write("poses.csv", kPoses);
  for (int sending = 0; sending < 3; ++sending) {
    const ProcessResult result = send(log);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    EXPECT_THAT(result.out, HasSubstr("3 poses sent"));
    EXPECT_THAT(result.out, HasSubstr("0 refused"));
  }
}

TEST_F(CliSend, a_run_id_that_was_replaced_is_refused_with_the_way_out) {
  const std::string log = folder_.write("poses.csv", kPoses);
  EXPECT_EQ(send(log, {"--run-id", "7"}).exit_code, 0);
  const ProcessResult same = send(log, {"--run-id", "7"});
  EXPECT_EQ(same.exit_code, 1);
  EXPECT_THAT(same.err, HasSubstr("already seen in this run"));
  EXPECT_EQ(send(log, {"--run-id", "8"}).exit_code, 0);
  const ProcessResult old = send(log, {"--run-id", "7"});
  EXPECT_EQ(old.exit_code, 1);
  EXPECT_THAT(old.out, HasSubstr("3 refused"));
  EXPECT_THAT(old.err, HasSubstr("send under a new run id"));
  EXPECT_EQ(send(log, {"--run-id", "0"}).exit_code, 2) << "0 stands for none";
}

TEST_F(CliSend, plays_a_network_capture) {
  const auto le = [](std::uint64_t value, int bytes) {
    std::string out;
    for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xFF);
    return out;
  };
  const auto be = [&](std::uint64_t value, int bytes) {
    const std::string out = le(value, bytes);
    return std::string(out.rbegin(), out.rend());
  };
  // The packet is raw IPv4 over UDP to port 5555.
  std::string capture =
      le(0xA1B2C3D4, 4) + le(2, 2) + le(4, 2) + le(0, 8) + le(262144, 4) + le(101, 4);
  auto pose = std::make_unique<protocol::HostFrameData>();
  protocol::HostFrameEncoder encoder;
  for (std::uint64_t k = 1; k <= 4; ++k) {
    pose->frame_number = k;
    pose->sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
    pose->run_id = 3;
    const auto bytes = encoder.encode(*pose);
    const std::string payload(reinterpret_cast<const char*>(bytes.data()), bytes.size());
    const std::string packet = be(0x4500, 2) + be(28 + payload.size(), 2) + be(0, 4) +
                               be(0x4011, 2) + be(0, 2) + be(0x7F000001, 4) + be(0x7F000001, 4) +
                               be(40000, 2) + be(5555, 2) + be(8 + payload.size(), 2) + be(0, 2) +
                               payload;
    capture +=
        le(1'700'000'000, 4) + le(k, 4) + le(packet.size(), 4) + le(packet.size(), 4) + packet;
  }
  const std::string file = folder_.file("host.pcap");
  std::ofstream(file, std::ios::binary) << capture;
  const ProcessResult played = send(file, {"--host-port", "5555"});
  EXPECT_EQ(played.exit_code, 0) << played.err;
  EXPECT_THAT(played.out, HasSubstr("4 poses sent"));
  EXPECT_THAT(played.out, HasSubstr("0 refused"));
  const ProcessResult other_port = send(file);
  EXPECT_EQ(other_port.exit_code, 1);
  EXPECT_THAT(other_port.err, HasSubstr("none of 4 packets is a datagram to port 7001"));
  const ProcessResult replayed = run_emit({"replay", file, "--scenario", "box"});
  EXPECT_EQ(replayed.exit_code, 1);
  EXPECT_THAT(replayed.err, HasSubstr("holds the host's poses, not the daemon's decisions"));
}

}  // namespace
}  // namespace emit::test
