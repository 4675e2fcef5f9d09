// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <array>
#include <cstring>
#include <string>
#include <vector>

#include "protocol/hex.hpp"
#include "support/daemon_process.hpp"
#include "support/times.hpp"
#include "telemetry/ptp_monitor.hpp"

namespace emit::server {
namespace {

using test::from_hex;

// This is the answer of ptp4l (linuxptp 3.1.1) to sequence 7 while it listened alone.
constexpr std::string_view kPortData =
    "0d0200500000000000000000000000000000000042eaa5fffe1c149f00010007047f000000000000"
    "00000000000002000001001c200442eaa5fffe1c149f000104000000000000000000010300010002";
constexpr std::string_view kTimeStatus =
    "0d0200680000000000000000000000000000000042eaa5fffe1c149f00000007047f000000000000"
    "000000000000020000010034c0000000000000000000000000000000000000000000000000000000"
    "0000000000000000000000000000000042eaa5fffe1c149f";

constexpr std::uint16_t kSequence = 7;

std::vector<std::byte> changed(std::string_view hex, std::size_t at, std::uint8_t value) {
  auto bytes = from_hex(hex);
  bytes[at] = std::byte{value};
  return bytes;
}

TEST(PtpStatus, AsksAsTheStandardHasIt) {
  const auto bytes = encode_ptp_get(PtpManagementId::time_status_np, 3, 0x0102);
  EXPECT_EQ(test::to_hex({bytes.begin(), bytes.end()}),
            "0d0200360300000000000000000000000000000000000000000000000000"
            "0102047f"
            "ffffffffffffffffffff00000000"
            "00010002c000");
}

TEST(PtpStatus, ReadsTheAnswersOfLinuxptp) {
  PtpStatus status;
  EXPECT_EQ(take_ptp_answer(from_hex(kPortData), 0, kSequence, status), PtpAnswer::port_data);
  EXPECT_EQ(status.state, PtpState::listening);
  EXPECT_EQ(take_ptp_answer(from_hex(kTimeStatus), 0, kSequence, status), PtpAnswer::time_status);
  EXPECT_FALSE(status.grandmaster_present);
  EXPECT_EQ(status.grandmaster, "42eaa5.fffe.1c149f");
  EXPECT_EQ(status.offset_ns, 0);
  auto following = changed(kTimeStatus, 54 + 41, 1);
  for (std::size_t i = 0; i < 8; ++i) following[54 + i] = std::byte{0xFF};
  following[54 + 7] = std::byte{0x85};
  EXPECT_EQ(take_ptp_answer(following, 0, kSequence, status), PtpAnswer::time_status);
  EXPECT_TRUE(status.grandmaster_present);
  EXPECT_EQ(status.offset_ns, -123);
  EXPECT_EQ(take_ptp_answer(changed(kPortData, 64, 9), 0, kSequence, status), PtpAnswer::port_data);
  EXPECT_EQ(status.state, PtpState::slave);
  EXPECT_EQ(take_ptp_answer(from_hex(kPortData), 0, kSequence, status), PtpAnswer::port_data);
  EXPECT_EQ(status.state, PtpState::slave) << "of several ports the one that steers";
}

TEST(PtpStatus, IgnoresWhatIsNoAnswerToItsQuestion) {
  const PtpStatus before;
  PtpStatus status;
  const auto ignored = [&](std::span<const std::byte> bytes) {
    return take_ptp_answer(bytes, 0, kSequence, status) == PtpAnswer::none &&
           status.grandmaster == before.grandmaster && status.state == before.state;
  };
  for (const std::string_view hex : {kPortData, kTimeStatus}) {
    const auto whole = from_hex(hex);
    for (std::size_t size = 0; size < whole.size(); ++size) {
      // The copy has memory of its own size, so that a sanitizer sees a read beyond it.
      const std::vector<std::byte> cut(whole.begin(),
                                       whole.begin() + static_cast<std::ptrdiff_t>(size));
      EXPECT_TRUE(ignored(cut)) << size;
    }
    EXPECT_TRUE(ignored(changed(hex, 0, 0x00))) << "no management message";
    EXPECT_TRUE(ignored(changed(hex, 1, 0x01))) << "version 1";
    EXPECT_TRUE(ignored(changed(hex, 3, 0x20))) << "shorter than its own TLV";
    EXPECT_TRUE(ignored(changed(hex, 4, 0x01))) << "another domain";
    EXPECT_TRUE(ignored(changed(hex, 31, 0x06))) << "an earlier question";
    EXPECT_TRUE(ignored(changed(hex, 46, 0x00))) << "a question";
    EXPECT_TRUE(ignored(changed(hex, 49, 0x02))) << "an error";
    EXPECT_TRUE(ignored(changed(hex, 51, 0x01))) << "a TLV too short for its identifier";
    EXPECT_TRUE(ignored(changed(hex, 50, 0xFF))) << "a TLV beyond the message";
    EXPECT_TRUE(ignored(changed(hex, 53, 0x77))) << "something else";
  }
  EXPECT_TRUE(ignored(changed(kPortData, 64, 10))) << "no such state";
}

/// Plays ptp4l at a socket.
class FakePtp4l {
 public:
  explicit FakePtp4l(const std::string& path)
      : socket_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)) {
    sockaddr_un own{};
    own.sun_family = AF_UNIX;
    std::memcpy(own.sun_path, path.data(), path.size());
    bound_ = ::bind(socket_.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) == 0;
  }
  [[nodiscard]] bool bound() const { return bound_; }
  /// Answers every question that waits and returns their number.
  int answer(std::uint8_t state) {
    int answered = 0;
    for (;;) {
      std::array<std::byte, 256> question;
      sockaddr_un from{};
      socklen_t length = sizeof from;
      if (::recvfrom(socket_.get(), question.data(), question.size(), 0,
                     reinterpret_cast<sockaddr*>(&from), &length) < 0) {
        return answered;
      }
      const bool ports = question[52] == std::byte{0x20};
      auto reply = ports ? changed(kPortData, 64, state) : changed(kTimeStatus, 54 + 7, 42);
      reply[30] = question[30];
      reply[31] = question[31];
      static_cast<void>(::sendto(socket_.get(), reply.data(), reply.size(), 0,
                                 reinterpret_cast<const sockaddr*>(&from), length));
      ++answered;
    }
  }

 private:
  Fd socket_;
  bool bound_ = false;
};

TEST(PtpMonitor, FollowsWhoAnswersAndNoticesWhenNobodyDoes) {
  using emit::test::kSecondNs;
  test::ScratchFolder folder;
  auto monitor = PtpMonitor::open(folder.file("ptp"), 0);
  ASSERT_TRUE(monitor.has_value()) << monitor.error().text;
  PtpMonitor& ptp = **monitor;
  using Change = PtpMonitor::Change;
  std::int64_t now_ns = 5;
  EXPECT_EQ(ptp.turn(now_ns), Change::none) << "nobody there yet";
  FakePtp4l daemon(folder.file("ptp"));
  ASSERT_TRUE(daemon.bound());
  now_ns += kSecondNs;
  EXPECT_EQ(ptp.turn(now_ns), Change::none);
  EXPECT_EQ(daemon.answer(8), 2);
  EXPECT_EQ(ptp.turn(now_ns + 1), Change::went_up);
  EXPECT_EQ(daemon.answer(8), 0) << "once a second";
  EXPECT_TRUE(ptp.status().up);
  EXPECT_EQ(ptp.status().state, PtpState::uncalibrated);
  EXPECT_EQ(ptp.status().offset_ns, 42);
  now_ns += kSecondNs;
  EXPECT_EQ(ptp.turn(now_ns), Change::none);
  EXPECT_EQ(daemon.answer(9), 2);
  EXPECT_EQ(ptp.turn(now_ns + 1), Change::state);
  EXPECT_EQ(ptp.status().state, PtpState::slave);
  now_ns += kSecondNs;
  EXPECT_EQ(ptp.turn(now_ns), Change::none);
  EXPECT_EQ(ptp.turn(now_ns + kSecondNs), Change::none);
  EXPECT_EQ(ptp.turn(now_ns + 3 * kSecondNs), Change::went_down);
  EXPECT_FALSE(ptp.status().up);
  EXPECT_EQ(daemon.answer(9) > 0, true);
  EXPECT_EQ(ptp.turn(now_ns + 3 * kSecondNs + 1), Change::went_up);
}

TEST(PtpMonitor, RefusesAPathThatIsNoSocketsPath) {
  const auto monitor = PtpMonitor::open(std::string(200, 'x'), 0);
  ASSERT_FALSE(monitor.has_value());
  EXPECT_EQ(monitor.error().code, physics::ErrorCode::config);
}

}  // namespace
}  // namespace emit::server
