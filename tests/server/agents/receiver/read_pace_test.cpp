// SPDX-License-Identifier: Apache-2.0
// A connection that sends more than its pace is not read on, and nothing of it is lost.
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <memory>
#include <vector>

#include "agents/receiver/read_pace.hpp"
#include "agents/receiver/receiver.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"
#include "rt/fd.hpp"
#include "support/fake_clock.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using emit::test::kMs;
/// Number of refused messages that may come at once.
constexpr std::uint64_t kBurst = ReadPace::kBurstNs / ReadPace::kRefusalNs;

TEST(ReadPace, LetsTheRateThroughForEver) {
  ReadPace pace(1000);
  for (std::int64_t ms = 0; ms < 5000; ++ms) {
    pace.record(ms * kMs);
    EXPECT_FALSE(pace.in_debt(ms * kMs)) << ms;
  }
}

TEST(ReadPace, IsInDebtBehindABurstAndRestsBeforeItGoesOn) {
  for (const std::int64_t start_ns : {std::int64_t{0}, 100'000 * kMs}) {
    ReadPace pace(1000);
    std::uint64_t taken = 0;
    for (; !pace.in_debt(start_ns); ++taken) pace.refusal(start_ns);
    EXPECT_EQ(taken, kBurst + 1);
    const std::int64_t wait_ns = pace.wait_ns(start_ns);
    EXPECT_EQ(wait_ns, ReadPace::kRefusalNs + ReadPace::kRestNs);
    EXPECT_GT(pace.wait_ns(start_ns + wait_ns - 1), 0);
    EXPECT_FALSE(pace.in_debt(start_ns + wait_ns));
  }
}

TEST(ReadPace, BytesCountToo) {
  ReadPace pace(1000);
  pace.bytes(8u << 20, 0);
  EXPECT_FALSE(pace.in_debt(0));
  pace.bytes(16u << 20, 0);
  EXPECT_TRUE(pace.in_debt(0));
}

/// The receiver with one connection; the test plays everybody else.
class FloodTest : public ::testing::Test {
 protected:
  FloodTest() : context_(clock_, 1u << 16, 4) {
    config_.host.udp.clear();
    config_.control.tcp = "127.0.0.1:0";
    receiver_ = std::make_unique<Receiver>(context_, config_);
  }
  void SetUp() override {
    ASSERT_TRUE(receiver_->open() && receiver_->on_start());
    connect();
  }
  void TearDown() override { receiver_->on_stop(); }

  void connect(bool greeted = true) {
    peer_ = Fd(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0));
    const SocketAddress control = receiver_->control_address();
    ASSERT_EQ(::connect(peer_.get(), control.get(), control.length), 0);
    settle();
    if (!greeted) return;
    v1::ControlRecord hello;
    hello.mutable_hello()->set_protocol_version(1);
    hello.mutable_hello()->set_role(v1::Hello::ROLE_HOST);
    std::vector<std::byte> bytes;
    protocol::append_control_record(hello, bytes);
    say(bytes);
    settle();
  }
  /// Closes the peer's end. The receiver notices it at its next write, or after it has read earlier
  /// bytes.
  void reset_peer() {
    const linger abrupt{1, 0};
    ::setsockopt(peer_.get(), SOL_SOCKET, SO_LINGER, &abrupt, sizeof abrupt);
    peer_.reset();
  }
  void say(std::span<const std::byte> bytes) {
    ASSERT_EQ(::send(peer_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL),
              static_cast<ssize_t>(bytes.size()));
  }
  /// Sends records that only the daemon may send: each is refused.
  void say_refused(std::uint32_t count) {
    std::vector<std::byte> bytes(count * protocol::kRecordHeaderBytes);
    for (std::uint32_t i = 0; i < count; ++i) {
      protocol::encode_record_header(protocol::RecordKind::frame, 0,
                                     std::span(bytes)
                                         .subspan(i * protocol::kRecordHeaderBytes)
                                         .first<protocol::kRecordHeaderBytes>());
    }
    say(bytes);
  }
  /// Turns the agents until there is nothing to do at this instant.
  void settle() {
    for (int turn = 0; receiver_->do_work(clock_.tai_ns()) > 0 || turn < 3; ++turn) {
      ASSERT_LT(turn, 100'000) << "never idle";
      while (context_.host_inputs.front() != nullptr) {
        ++inputs_;
        context_.host_inputs.pop();
      }
    }
  }
  [[nodiscard]] std::uint64_t counted(Counter counter) const {
    return context_.counters.get(counter);
  }

  test::FakeClock clock_;
  config::DaemonConfig config_;
  Context context_;
  std::unique_ptr<Receiver> receiver_;
  Fd peer_;
  std::uint64_t inputs_ = 0;
};

TEST_F(FloodTest, WaitsUnreadUntilItsPaceAllowsAndIsTakenWhole) {
  constexpr std::uint32_t kRecords = 300;
  say_refused(kRecords);
  settle();
  EXPECT_EQ(counted(Counter::refused_not_allowed), kBurst) << "records and bytes cost a little too";
  EXPECT_EQ(counted(Counter::reads_paused), 1U);
  std::uint64_t pauses = 0;
  while (counted(Counter::refused_not_allowed) < kRecords) {
    const std::uint64_t before = counted(Counter::refused_not_allowed);
    const std::int64_t wake_ns = receiver_->wake_at_ns();
    ASSERT_GT(wake_ns, clock_.tai_ns());
    ASSERT_LE(wake_ns - clock_.tai_ns(), 20 * kMs) << "soon enough";
    clock_.set(wake_ns - 1);
    settle();
    ASSERT_EQ(counted(Counter::refused_not_allowed), before) << "not read yet";
    clock_.set(wake_ns);
    settle();
    ASSERT_GT(counted(Counter::refused_not_allowed), before);
    ASSERT_LE(counted(Counter::refused_not_allowed), before + 2);
    ASSERT_LT(++pauses, 1000U);
  }
  EXPECT_EQ(counted(Counter::refused_not_allowed), kRecords) << "nothing is lost";
  EXPECT_EQ(counted(Counter::connections_closed), 0U);
}

TEST_F(FloodTest, GoesOnWithWhatIsSoundBehindAFlood) {
  say_refused(100);
  protocol::HostFrameEncoder encoder;
  protocol::HostFrameData frame;
  frame.frame_number = 1;
  const auto body = encoder.encode(frame);
  std::vector<std::byte> record(protocol::kRecordHeaderBytes);
  protocol::encode_record_header(protocol::RecordKind::host_frame,
                                 static_cast<std::uint32_t>(body.size()),
                                 std::span(record).first<protocol::kRecordHeaderBytes>());
  record.insert(record.end(), body.begin(), body.end());
  say(record);
  settle();
  EXPECT_EQ(inputs_, 0U);
  for (int i = 0; i < 100; ++i) {
    clock_.advance(20 * kMs);
    settle();
  }
  EXPECT_EQ(inputs_, 1U);
  // A connection that has behaved for a while is read at once again.
  say(record);
  settle();
  EXPECT_EQ(inputs_, 2U);
}

TEST_F(FloodTest, EndsWithItsPeerThoughItIsNotRead) {
  // Few records wait in the receiver alone, many in the kernel, too.
  for (const std::uint32_t records : {100U, 20'000U}) {
    const std::uint64_t paused = counted(Counter::reads_paused);
    const std::uint64_t closed = counted(Counter::connections_closed);
    say_refused(records);
    settle();
    ASSERT_EQ(counted(Counter::reads_paused), paused + 1);
    reset_peer();
    settle();
    EXPECT_EQ(counted(Counter::connections_closed), closed + 1) << records;
    connect();
  }
}

TEST_F(FloodTest, IsNotAnsweredOnceItsPeerIsGone) {
  // Each record is refused and ends its connection, here while the refusal itself cannot be written
  // any more. The record is read, refused and the connection ended in one turn.
  v1::ControlRecord wrong_version;
  wrong_version.mutable_hello()->set_protocol_version(77);
  std::vector<std::byte> unknown_hello;
  protocol::append_control_record(wrong_version, unknown_hello);
  const std::vector<std::byte> lost_framing(protocol::kRecordHeaderBytes, std::byte{0xff});
  reset_peer();
  settle();
  for (const bool greeted : {false, true}) {
    for (const auto& last_words : {lost_framing, unknown_hello}) {
      const std::uint64_t closed = counted(Counter::connections_closed);
      connect(greeted);
      say(last_words);
      reset_peer();
      settle();
      EXPECT_EQ(counted(Counter::connections_closed), closed + 1) << greeted;
    }
  }
}

TEST_F(FloodTest, IsClosedOnceThoughItsLastWriteFails) {
  reset_peer();
  settle();
  // A welcome that the socket's buffers do not hold waits in the receiver until it stops.
  context_.channels.resize(1);
  context_.channels[0].name.assign(250'000, 'x');
  for (int fd = 0; fd < 1024; ++fd) {
    int listens = 0;
    socklen_t length = sizeof listens;
    const int smallest = 1;
    if (::getsockopt(fd, SOL_SOCKET, SO_ACCEPTCONN, &listens, &length) == 0 && listens != 0) {
      ::setsockopt(fd, SOL_SOCKET, SO_SNDBUF, &smallest, sizeof smallest);  // of what it accepts
    }
  }
  connect();
  reset_peer();
  const std::uint64_t closed = counted(Counter::connections_closed);
  receiver_->on_stop();
  EXPECT_EQ(counted(Counter::connections_closed), closed + 1);
}

}  // namespace
}  // namespace emit::server
