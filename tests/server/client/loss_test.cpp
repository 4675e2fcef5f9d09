// SPDX-License-Identifier: Apache-2.0
// Losses: the fault injector, the instants of resend requests, and the resends that the sender
// grants.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "agents/sender/resend_window.hpp"
#include "agents/sender/sender.hpp"
#include "agents/sender/socket_client.hpp"
#include "client/resend_planner.hpp"
#include "net/fault_injector.hpp"
#include "net/socket.hpp"
#include "support/fake_clock.hpp"
#include "support/heap_counter.hpp"
#include "support/scripted_source.hpp"

namespace emit::server {
namespace {

std::vector<std::byte> datagram(std::uint32_t number) {
  std::vector<std::byte> out(100);
  std::memcpy(out.data(), &number, sizeof number);
  return out;
}
std::uint32_t number_of(const std::vector<std::byte>& bytes) {
  std::uint32_t number = 0;
  std::memcpy(&number, bytes.data(), sizeof number);
  return number;
}

/// Returns what comes out, in order, when datagrams enter 1 us apart.
std::vector<std::vector<std::byte>> through(FaultInjector& injector, std::uint32_t count) {
  std::vector<std::vector<std::byte>> out;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::int64_t now_ns = std::int64_t{i} * 1000;
    injector.push(datagram(i), now_ns);
    while (auto given = injector.pop(now_ns)) out.push_back(std::move(*given));
  }
  while (const auto due_ns = injector.due_ns()) {
    EXPECT_FALSE(injector.pop(*due_ns - 1).has_value());
    out.push_back(*injector.pop(*due_ns));
  }
  return out;
}

TEST(FaultInjector, WithoutFaultsPassesEverythingInOrder) {
  FaultInjector injector({});
  const auto out = through(injector, 1000);
  ASSERT_EQ(out.size(), 1000U);
  for (std::uint32_t i = 0; i < out.size(); ++i) EXPECT_EQ(out[i], datagram(i));
}

TEST(FaultInjector, LosesTheShareAskedForInBurstsAskedFor) {
  for (const double burst : {1.0, 5.0}) {
    NetworkFaults faults;
    faults.loss_frac = 0.05;
    faults.burst_mean = burst;
    FaultInjector injector(faults);
    constexpr std::uint32_t kCount = 200'000;
    const auto out = through(injector, kCount);
    const double lost = static_cast<double>(kCount - out.size());
    EXPECT_NEAR(lost / kCount, 0.05, 0.004);
    EXPECT_EQ(injector.counts().lost, kCount - out.size());
    std::uint32_t bursts = 0;
    std::uint32_t before = 0;
    for (const auto& bytes : out) {
      bursts += number_of(bytes) > before + 1 ? 1U : 0U;
      before = number_of(bytes);
    }
    EXPECT_NEAR(lost / bursts, burst == 1.0 ? 1.0 / 0.95 : burst, 0.25);
  }
}

TEST(FaultInjector, TheSameSeedDoesTheSame) {
  NetworkFaults faults;
  faults.loss_frac = 0.1;
  faults.duplicate_frac = 0.1;
  faults.reorder_frac = 0.1;
  faults.jitter_ns = 50'000;
  faults.corrupt_frac = 0.1;
  FaultInjector first(faults);
  FaultInjector second(faults);
  faults.seed = 2;
  FaultInjector other(faults);
  const auto out = through(first, 2000);
  EXPECT_EQ(out, through(second, 2000));
  EXPECT_NE(out, through(other, 2000));
}

TEST(FaultInjector, DoublesHoldsBackAndSpoilsWhatItSays) {
  NetworkFaults faults;
  faults.duplicate_frac = 0.2;
  faults.reorder_frac = 0.1;
  faults.reorder_ns = 20'000;
  faults.corrupt_frac = 0.05;
  FaultInjector injector(faults);
  const auto out = through(injector, 20'000);
  const auto& counts = injector.counts();
  EXPECT_EQ(out.size(), 20'000 + counts.duplicated);
  EXPECT_NEAR(static_cast<double>(counts.duplicated), 4000.0, 300.0);
  EXPECT_NEAR(static_cast<double>(counts.corrupted), 1000.0, 150.0);
  std::uint64_t overtaken = 0;
  std::uint32_t newest = 0;
  for (const auto& bytes : out) {
    const std::uint32_t number = number_of(bytes);
    if (number >= 20'000) continue;  // its number was spoilt
    overtaken += number + 5 < newest ? 1 : 0;
    newest = std::max(newest, number);
  }
  EXPECT_GT(overtaken, counts.held_back / 2);
}

using OpenFrame = protocol::Reassembler::OpenFrame;
using Kind = client::ResendPlanner::Step::Kind;

TEST(ResendPlanner, AsksOnceAGapHasSettledThenAgainThenGivesUp) {
  client::ResendPlanner planner(
      {.settle_ns = 500, .quiet_ns = 3000, .answer_ns = 10'000, .requests = 2});
  std::vector<OpenFrame> open{{7, 10, true}};
  auto step = planner.next(open, 1000);
  EXPECT_EQ(step.kind, Kind::wait);
  EXPECT_EQ(step.wake_ns, 1500);
  open[0].arrivals = 11;  // reordered ones still come
  step = planner.next(open, 1400);
  EXPECT_EQ(step.kind, Kind::wait);
  EXPECT_EQ(step.wake_ns, 1900);
  step = planner.next(open, 1900);
  EXPECT_EQ(step.kind, Kind::ask);
  EXPECT_EQ(step.frame_id, 7U);
  step = planner.next(open, 1900);
  EXPECT_EQ(step.kind, Kind::wait) << "once is enough";
  EXPECT_EQ(step.wake_ns, 11'900);
  EXPECT_EQ(planner.next(open, 11'900).kind, Kind::ask);
  EXPECT_EQ(planner.next(open, 21'899).kind, Kind::wait);
  EXPECT_EQ(planner.next(open, 21'900).kind, Kind::give_up);
}

TEST(ResendPlanner, AFrameWhoseEndIsOutstandingIsGivenLongerTime) {
  client::ResendPlanner planner(
      {.settle_ns = 500, .quiet_ns = 3000, .answer_ns = 10'000, .requests = 2});
  const std::vector<OpenFrame> open{{7, 10, false}};
  EXPECT_EQ(planner.next(open, 1000).kind, Kind::wait);
  EXPECT_EQ(planner.next(open, 3999).kind, Kind::wait);
  auto step = planner.next(open, 4000);
  EXPECT_EQ(step.kind, Kind::ask);
  EXPECT_FALSE(step.tail) << "what is not sent yet is not lost";
  step = planner.next(open, 14'000);
  EXPECT_EQ(step.kind, Kind::ask);
  EXPECT_TRUE(step.tail) << "nothing came for long";
}

TEST(ResendPlanner, AnAnswerThatWasLostInPartIsFollowedUntilNothingComes) {
  client::ResendPlanner planner(
      {.settle_ns = 500, .quiet_ns = 3000, .answer_ns = 10'000, .requests = 2});
  std::vector<OpenFrame> open{{7, 10, true}};
  EXPECT_EQ(planner.next(open, 1000).kind, Kind::wait);
  std::int64_t now_ns = 1500;
  for (int round = 0; round < 10; ++round, now_ns += 10'000) {
    const auto step = planner.next(open, now_ns);
    EXPECT_EQ(step.kind, Kind::ask) << round;
    EXPECT_TRUE(step.tail);
    ++open[0].arrivals;
    EXPECT_EQ(planner.next(open, now_ns + 600).kind, Kind::wait) << "not more often than answers";
  }
  EXPECT_EQ(planner.next(open, now_ns).kind, Kind::ask);
  EXPECT_EQ(planner.next(open, now_ns + 10'000).kind, Kind::ask);
  EXPECT_EQ(planner.next(open, now_ns + 20'000).kind, Kind::give_up);
}

TEST(ResendPlanner, EveryFrameCountsForItself) {
  client::ResendPlanner planner(
      {.settle_ns = 500, .quiet_ns = 3000, .answer_ns = 10'000, .requests = 1});
  std::vector<OpenFrame> open{{7, 10, true}};
  EXPECT_EQ(planner.next(open, 1000).kind, Kind::wait);
  EXPECT_EQ(planner.next(open, 1500).kind, Kind::ask);
  open.push_back({8, 1, true});
  EXPECT_EQ(planner.next(open, 1600).kind, Kind::wait);
  const auto step = planner.next(open, 2100);
  EXPECT_EQ(step.kind, Kind::ask);
  EXPECT_EQ(step.frame_id, 8U);
  open.clear();
  EXPECT_EQ(planner.next(open, 2200).wake_ns, 0);
  open.push_back({8, 1, true});  // the same number anew, after a restart
  EXPECT_EQ(planner.next(open, 2300).kind, Kind::wait);
}

/// A sender's window over a real socket.
class ResendWindowTest : public ::testing::Test {
 protected:
  static constexpr std::uint32_t kPayload = 400;
  void SetUp() override {
    const auto any = numeric_address("127.0.0.1", 0);
    auto in = UdpSocket::open_bound(sockets_, any);
    auto out = UdpSocket::open(sockets_, any);
    ASSERT_TRUE(in.has_value() && out.has_value());
    ASSERT_TRUE(out->connect(in->local_address()).has_value());
    in_ = std::move(*in);
    out_ = std::move(*out);
  }
  static protocol::Fragmenter::Params cut(std::uint32_t id) { return {1, id, 0, 0, kPayload}; }
  void add(ResendWindow& window, std::uint32_t id) {
    window.add(100 + id, cut(id), head_, pixels_);
  }
  static protocol::ResendRequest ask_for(std::uint32_t id,
                                         std::initializer_list<protocol::ByteRange> ranges) {
    protocol::ResendRequest request;
    request.stream_id = 1;
    request.frame_id = id;
    for (const auto& range : ranges) request.ranges[request.count++] = range;
    return request;
  }
  /// Returns the offsets of the fragments that go out.
  std::vector<std::uint32_t> sent(ResendWindow& window) {
    std::vector<std::uint32_t> offsets;
    while (window.pending()) {
      const auto result = window.send(out_.fd(), batch_);
      EXPECT_EQ(result.status, UdpBatch::Status::sent);
      std::array<std::byte, 2048> bytes;
      for (IoResult got; (got = in_.receive(bytes)).status == IoStatus::done;) {
        protocol::FragmentHeader header;
        EXPECT_EQ(protocol::decode_fragment_header(std::span(bytes).first(got.bytes), header),
                  protocol::FragmentStatus::accepted);
        EXPECT_NE(header.flags & protocol::kFragmentResent, 0);
        offsets.push_back(header.byte_offset);
      }
    }
    return offsets;
  }

  SocketContext sockets_;
  UdpSocket in_;
  UdpSocket out_;
  UdpBatch batch_;
  std::array<std::byte, protocol::kFrameHeaderBytes> head_{};
  std::vector<std::byte> pixels_ = std::vector<std::byte>(400 * 20);
};

TEST_F(ResendWindowTest, SendsWhatWasAskedForAndNothingElse) {
  ResendWindow window({4, 22, 0.5});
  add(window, 1);
  add(window, 2);
  EXPECT_TRUE(window.ask(ask_for(1, {{0, 400}, {2000, 401}}), std::nullopt));
  EXPECT_EQ(sent(window), (std::vector<std::uint32_t>{0, 2000, 2400}));
  EXPECT_FALSE(window.ask(ask_for(3, {{0, 400}}), std::nullopt)) << "never sent";
  auto strange = ask_for(1, {{0, 400}});
  strange.stream_id = 2;
  EXPECT_FALSE(window.ask(strange, std::nullopt));
  EXPECT_FALSE(window.ask(ask_for(1, {{1u << 30, 400}}), std::nullopt)) << "beyond its end";
}

TEST_F(ResendWindowTest, AFrameThatLeftTheWindowIsGone) {
  ResendWindow window({2, 22, 0.5});
  add(window, 1);
  EXPECT_TRUE(window.ask(ask_for(1, {{0, 400}}), std::nullopt));
  window.forget(101);
  EXPECT_FALSE(window.pending());
  EXPECT_FALSE(window.ask(ask_for(1, {{0, 400}}), std::nullopt));
  add(window, 2);
  add(window, 3);
  add(window, 4);  // takes the place of 2
  EXPECT_FALSE(window.ask(ask_for(2, {{0, 400}}), std::nullopt));
  EXPECT_TRUE(window.ask(ask_for(3, {{0, 400}}), std::nullopt));
}

TEST_F(ResendWindowTest, WhatIsStillOnItsWayIsNotSentTwice) {
  ResendWindow window({2, 22, 0.5});
  add(window, 1);
  EXPECT_TRUE(window.ask(ask_for(1, {{0, 4000}}), ResendWindow::OnItsWay{1, 3}));
  EXPECT_EQ(sent(window), (std::vector<std::uint32_t>{0, 400, 800}));
}

TEST_F(ResendWindowTest, GrantsAFrameAtOnceAndThenItsPartOfWhatIsSent) {
  ResendWindow window({8, 22, 0.25});
  add(window, 1);
  EXPECT_TRUE(window.ask(ask_for(1, {{0, 1u << 20}}), std::nullopt));
  EXPECT_EQ(sent(window).size(), 20U) << "the bytes of a frame";
  EXPECT_FALSE(window.ask(ask_for(1, {{0, 400}}), std::nullopt)) << "used up";
  add(window, 2);
  EXPECT_TRUE(window.ask(ask_for(2, {{0, 1u << 20}}), std::nullopt));
  EXPECT_EQ(sent(window).size(), 5U);
  for (std::uint32_t id = 3; id < 30; ++id) add(window, id);
  for (int twice = 0; twice < 3; ++twice) {
    static_cast<void>(window.ask(ask_for(29, {{0, 1u << 20}}), std::nullopt));
  }
  EXPECT_EQ(sent(window).size(), 20U) << "no more is saved up";
}

/// The sender with one client over UDP that has error correction and may ask again.
class LossySender : public ::testing::Test {
 protected:
  static constexpr std::uint32_t kWidthPx = 64;
  static constexpr std::uint32_t kHeightPx = 48;
  static constexpr std::uint32_t kQueue = 4;
  void SetUp() override {
    Channel channel;
    channel.width_px = kWidthPx;
    channel.height_px = kHeightPx;
    context_.channels.push_back(channel);
    const auto any = numeric_address("127.0.0.1", 0);
    auto in = UdpSocket::open_bound(sockets_, any);
    auto out = UdpSocket::open(sockets_, any);
    ASSERT_TRUE(in.has_value() && out.has_value());
    ASSERT_TRUE(out->connect(in->local_address()).has_value());
    in_ = std::move(*in);
    SocketClient::Params params;
    params.connection = 7;
    params.channel = &context_.channels.front();
    params.udp = true;
    params.udp_socket = std::move(*out);
    params.stream_id = 1;
    params.fragment_payload_bytes = 400;
    params.fec = kFec;
    params.resend_frames = kQueue;
    params.resend_max_frac = 0.5;
    client_ = std::make_unique<SocketClient>(std::move(params));
    ASSERT_TRUE(sender_.on_start());
    ASSERT_TRUE(context_.to_sender.push({ClientCommand::Kind::add, 7, client_.get()}));
  }
  void TearDown() override { sender_.on_stop(); }
  [[nodiscard]] bool publish() {
    renderer::FrameRequest request;
    request.frame_number = ++number_;
    const int slot = source_.submit(request);
    if (slot < 0) return false;
    const auto& view = source_.collect(static_cast<std::uint32_t>(slot));
    PublishFrame frame;
    frame.image.source = &source_;
    frame.image.slot = static_cast<std::uint32_t>(slot);
    frame.image.pictures[0] = view.radiance_w_m2_sr[0];
    frame.image.crc32c[0] = protocol::crc32c(std::as_bytes(view.radiance_w_m2_sr[0]));
    frame.header.frame_number = number_;
    return context_.published.push(frame);
  }
  void ask(std::uint32_t frame_id, std::span<const protocol::ByteRange> ranges) {
    ResendCommand& command = context_.resends.claim_reserved();
    command.connection = 7;
    command.request.stream_id = 1;
    command.request.frame_id = frame_id;
    command.request.count = static_cast<std::uint16_t>(ranges.size());
    std::ranges::copy(ranges, command.request.ranges.begin());
    context_.resends.commit();
  }
  /// Turns the sender. Datagrams whose turn `loses` names are lost.
  template <class Loses>
  void settle(Loses loses) {
    for (int idle = 0; idle < 2;) {
      const std::uint64_t before = test::heap_request_count();
      idle = sender_.do_work(clock_.tai_ns()) == 0 ? idle + 1 : 0;
      std::array<std::byte, 2048> bytes;
      for (IoResult got; (got = in_.receive(bytes)).status == IoStatus::done; ++arrived_) {
        if (!loses(arrived_)) reassembler_.push(std::span(bytes).first(got.bytes));
      }
      allocations_ += test::heap_request_count() - before;
    }
  }
  std::uint64_t take_whole() {
    std::uint64_t whole = 0;
    while (const auto* frame = reassembler_.pop()) {
      whole += frame->complete && frame->crc_ok ? 1 : 0;
      reassembler_.release(frame);
    }
    return whole;
  }

  static constexpr protocol::FecParams kFec{8, 2};
  test::FakeClock clock_;
  test::SourceScript script_;
  SocketContext sockets_;
  Context context_{clock_, 1u << 20, 4};
  test::ScriptedSource source_{script_, kWidthPx, kHeightPx, kQueue + 3};
  Sender sender_{context_, kQueue, 4, false};
  std::unique_ptr<SocketClient> client_;
  UdpSocket in_;
  protocol::Reassembler reassembler_{{.max_payload_bytes = kWidthPx * kHeightPx * 4,
                                      .buffers = 6,
                                      .max_open_per_stream = 4,
                                      .max_streams = 1,
                                      .check_crc = true,
                                      .fec = kFec,
                                      .wait_for_missing = true}};
  std::uint64_t number_ = 0;
  std::uint64_t arrived_ = 0;
  std::uint64_t allocations_ = 0;  // while sender and reassembler worked
};

TEST_F(LossySender, RepairsAndResendsWithoutAllocating) {
  // A frame has 33 fragments and 10 of parity. Three losses in a group are one too many.
  const auto loses = [](std::uint64_t index) {
    return index == 5 || index == 10 || index == 15 || index == 16;
  };
  std::uint64_t whole = 0;
  const auto frame = [&](std::uint32_t id) {
    arrived_ = 0;
    ASSERT_TRUE(publish());
    settle(loses);
    std::array<protocol::ByteRange, 16> ranges;
    const std::size_t missing = reassembler_.missing(1, id, true, ranges);
    ASSERT_EQ(missing, 3U) << "one of the four came back by parity";
    ask(id, std::span(ranges).first(missing));
    settle([](std::uint64_t) { return false; });
    whole += take_whole();
  };
  for (std::uint32_t id = 0; id < 10; ++id) ASSERT_NO_FATAL_FAILURE(frame(id));
  allocations_ = 0;
  for (std::uint32_t id = 10; id < 200; ++id) ASSERT_NO_FATAL_FAILURE(frame(id));
  EXPECT_EQ(allocations_, 0U) << "neither the sender nor the reassembler";
  EXPECT_EQ(whole, 200U);
  EXPECT_EQ(context_.counters.get(Counter::fragments_resent), 600U);
  EXPECT_EQ(context_.counters.get(Counter::parity_sent), 2000U);
  EXPECT_EQ(context_.counters.get(Counter::resend_requests), 200U);
  EXPECT_EQ(context_.counters.get(Counter::resends_refused), 0U);
}

TEST_F(LossySender, KeepsItsWindowForThoseWhoMayAskAndRefusesWhatHasLeftIt) {
  for (std::uint32_t id = 0; id < 12; ++id) {
    ASSERT_TRUE(publish()) << "there is always a slot to render into";
    settle([](std::uint64_t) { return false; });
    EXPECT_LE(script_.held.load(), static_cast<int>(kQueue));
  }
  EXPECT_EQ(script_.held.load(), static_cast<int>(kQueue));
  const protocol::ByteRange range{0, 400};
  ask(11 - kQueue, std::span(&range, 1));
  settle([](std::uint64_t) { return false; });
  EXPECT_EQ(context_.counters.get(Counter::resends_refused), 1U);
  EXPECT_EQ(context_.counters.get(Counter::fragments_resent), 0U);
  ask(12 - kQueue, std::span(&range, 1));
  settle([](std::uint64_t) { return false; });
  EXPECT_EQ(context_.counters.get(Counter::fragments_resent), 1U);
  ASSERT_TRUE(context_.to_sender.push({ClientCommand::Kind::remove, 7, nullptr}));
  settle([](std::uint64_t) { return false; });
  EXPECT_EQ(script_.held.load(), 0);
  ask(11, std::span(&range, 1));
  settle([](std::uint64_t) { return false; });
  EXPECT_EQ(context_.counters.get(Counter::resends_refused), 2U) << "the client is gone";
}

}  // namespace
}  // namespace emit::server
