// SPDX-License-Identifier: Apache-2.0
// A real emitd, a client, and between them a network that loses, doubles, reorders, delays and
// spoils datagrams. Every pixel of every frame is held against the canned pattern.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "agents/frame_source.hpp"
#include "client/fault_relay.hpp"
#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"

namespace emit::server {
namespace {

using test::DaemonProcess;
using test::ScratchFolder;

constexpr std::uint32_t kWidthPx = 256;
constexpr std::uint32_t kHeightPx = 128;

struct Setup {
  NetworkFaults faults;
  protocol::FecParams fec;
  bool resend = false;
  std::uint64_t frames = 0;
  std::uint64_t ahead = 2;  ///< frames asked for beyond the one that is waited for
};

struct Outcome {
  std::uint64_t came = 0;
  std::uint64_t whole = 0;  ///< neither flagged partial nor corrupt, every pixel right
  std::uint64_t partial = 0;
  std::uint64_t corrupt = 0;
  /// Numbers of frames with a valid pixel that is wrong: those without a flag, then those with the
  /// flag partial.
  std::uint64_t wrong_unflagged = 0;
  std::uint64_t wrong_in_partial = 0;
  std::uint64_t unflagged_missing = 0;
  std::uint64_t out_of_order = 0;
  std::uint64_t lost_before = 0;     ///< frames that say so
  std::uint64_t unflagged_lost = 0;  ///< frames_lost_before without the flag, or the other way
  std::uint64_t untold_gaps = 0;     ///< frames before which more is missing than they say
  client::ReceiveCounters counters;
  FaultInjector::Counts network;
  std::uint64_t relay_drops = 0;
};

/// Sends poses, up to `ahead` of the frames, and checks the frames.
void play(const Setup& setup, Outcome& out) {
  const ScratchFolder folder;
  DaemonProcess daemon(
      folder,
      {"--config",
       folder.write("emitd.toml", test::canned_config(kWidthPx, kHeightPx, "mode = \"host-step\"",
                                                      "[stream]\nqueue_frames = 13"))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  config::SourceConfig pattern;
  pattern.canned_width_px = kWidthPx;
  pattern.canned_height_px = kHeightPx;
  pattern.canned_frames = 8;
  const auto images = canned_pattern(pattern);

  auto relay = client::FaultRelay::start(setup.faults);
  ASSERT_TRUE(relay.has_value()) << relay.error().text;
  auto client = client::FrameClient::connect("udp://" + daemon.control());
  ASSERT_TRUE(client.has_value()) << client.error().text;
  client::SubscribeOptions options;
  options.fragment_payload_bytes = 1400;
  options.announced_udp_port = (*relay)->port();
  options.fec = setup.fec;
  options.resend = setup.resend;
  const auto channel = (*client)->subscribe(options);
  ASSERT_TRUE(channel.has_value()) << channel.error().text;
  ASSERT_EQ((*client)->terms().fec, setup.fec);
  ASSERT_EQ((*client)->terms().resend, setup.resend);
  (*relay)->forward_to((*client)->terms().udp_port);
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value()) << host.error().text;

  std::uint64_t newest = 0;
  std::uint64_t nameless = 0;         // since then: came without a number
  std::uint64_t lost_on_the_way = 0;  // since then
  const auto look = [&](const client::ReceivedFrame& frame) {
    ++out.came;
    const bool partial = (frame.header.flags & protocol::kFlagPartial) != 0;
    const bool corrupt = (frame.header.flags & protocol::kFlagCorrupt) != 0;
    out.partial += partial ? 1 : 0;
    out.corrupt += corrupt ? 1 : 0;
    out.unflagged_missing += partial != (frame.missing_px > 0) ? 1 : 0;
    const bool lost_before = (frame.header.flags & protocol::kFlagLostBefore) != 0;
    out.lost_before += lost_before ? 1 : 0;
    out.unflagged_lost += lost_before != (frame.frames_lost_before > 0) ? 1 : 0;
    lost_on_the_way += frame.frames_lost_before;
    ASSERT_EQ(frame.pixels.size(), images[0].size());
    if (!frame.header_known) {
      ASSERT_TRUE(partial || corrupt);
      ++nameless;
      return;
    }
    // The losses before the first frame are unknown.
    if (newest > 0 && frame.header.frame_number > newest) {
      const std::uint64_t missing = frame.header.frame_number - newest - 1;
      out.untold_gaps += missing > nameless + lost_on_the_way ? 1 : 0;
    }
    lost_on_the_way = 0;
    nameless = 0;
    out.out_of_order += frame.header.frame_number <= newest ? 1 : 0;
    newest = std::max(newest, frame.header.frame_number);
    const auto& image = images[(frame.header.frame_number + images.size() - 1) % images.size()];
    bool wrong = false;
    for (std::size_t i = 0; i < image.size(); ++i) {
      const bool valid = !partial || frame.validity.pixel(i);
      wrong = wrong || frame.pixels[i] != (valid ? image[i] : 0.0F);
    }
    out.whole += !partial && !corrupt && !wrong ? 1 : 0;
    out.wrong_unflagged += wrong && !partial && !corrupt ? 1 : 0;
    out.wrong_in_partial += wrong && partial ? 1 : 0;
  };
  for (std::uint64_t number = 1; number <= setup.frames + setup.ahead; ++number) {
    if (number <= setup.frames) {
      protocol::HostFrameData pose;
      pose.run_id = 1;
      pose.frame_number = number;
      pose.sim_time_ns = static_cast<std::int64_t>(number) * 1'000'000;
      ASSERT_TRUE((*host)->send(pose).has_value());
    }
    const std::uint64_t wanted = number > setup.ahead ? number - setup.ahead : 0;
    for (int patience = 0; newest < wanted && patience < 4; ++patience) {
      const auto frame = (*client)->receive(100'000'000);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      if (*frame != nullptr) look(**frame);
      if (::testing::Test::HasFatalFailure()) return;
    }
  }
  (*relay)->stop();
  out.counters = (*client)->counters();
  out.network = (*relay)->counts();
  out.relay_drops = (*relay)->own_losses();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

NetworkFaults one_percent() {
  NetworkFaults faults;
  faults.seed = 20261122;
  faults.loss_frac = 0.01;
  return faults;
}

TEST(DaemonLossy, WithErrorCorrectionNearlyEveryFrameIsWhole) {
  Outcome out;
  constexpr std::uint64_t kFrames = 2500;
  play({one_percent(), {48, 5}, false, kFrames}, out);
  ASSERT_FALSE(HasFatalFailure());
  EXPECT_GT(out.network.lost, out.network.taken / 200);
  EXPECT_GE(static_cast<double>(out.whole), 0.999 * kFrames) << out.partial << " partial";
  EXPECT_EQ(out.whole + out.partial + out.corrupt, out.came);
  EXPECT_GT(out.counters.repaired, kFrames / 2);
  EXPECT_GT(out.counters.repaired_frames, kFrames / 3);
  EXPECT_EQ(out.wrong_unflagged + out.wrong_in_partial + out.unflagged_missing, 0U);
}

TEST(DaemonLossy, WithoutItEveryPartialFrameIsFlaggedAndItsValidPixelsAreRight) {
  Outcome out;
  constexpr std::uint64_t kFrames = 600;
  play({one_percent(), {}, false, kFrames}, out);
  ASSERT_FALSE(HasFatalFailure());
  EXPECT_GT(out.partial, kFrames / 3);
  EXPECT_EQ(out.whole + out.partial, out.came);
  EXPECT_GE(out.came, kFrames - 2) << "partial frames are handed out, not dropped";
  EXPECT_LE(out.lost_before, 2U);
  EXPECT_EQ(out.untold_gaps + out.unflagged_lost, 0U);
  EXPECT_EQ(out.counters.partial, out.partial);
  EXPECT_EQ(out.wrong_unflagged + out.wrong_in_partial + out.unflagged_missing, 0U);
  EXPECT_EQ(out.counters.repaired + out.counters.resent, 0U);
}

TEST(DaemonLossy, WhatIsMissingIsSentAgainOnRequest) {
  Outcome out;
  constexpr std::uint64_t kFrames = 600;
  play({one_percent(), {}, true, kFrames}, out);
  ASSERT_FALSE(HasFatalFailure());
  EXPECT_GE(static_cast<double>(out.whole), 0.99 * kFrames) << out.partial << " partial";
  EXPECT_GT(out.counters.resent, kFrames / 3);
  EXPECT_GT(out.counters.resend_requests, kFrames / 4);
  EXPECT_EQ(out.wrong_unflagged + out.wrong_in_partial + out.unflagged_missing, 0U);
  EXPECT_EQ(out.out_of_order, 0U);
}

TEST(DaemonLossy, BurstsOfLossesAreSpreadOverTheGroups) {
  Outcome out;
  constexpr std::uint64_t kFrames = 400;
  NetworkFaults faults = one_percent();
  faults.burst_mean = 4.0;
  play({faults, {24, 12}, false, kFrames}, out);
  ASSERT_FALSE(HasFatalFailure());
  EXPECT_GE(static_cast<double>(out.whole), 0.98 * kFrames) << out.partial << " partial";
  EXPECT_GT(out.counters.repaired, 0U);
  EXPECT_EQ(out.wrong_unflagged + out.wrong_in_partial + out.unflagged_missing, 0U);
}

TEST(DaemonLossy, FramesOfWhichNothingCameAreToldByTheNextOne) {
  Outcome out;
  constexpr std::uint64_t kFrames = 300;
  NetworkFaults faults = one_percent();
  faults.loss_frac = 0.2;
  faults.burst_mean = 150.0;  // a frame has 95 datagrams
  play({faults, {}, false, kFrames, 6}, out);
  ASSERT_FALSE(HasFatalFailure());
  EXPECT_LT(out.came, kFrames - 5);
  EXPECT_GT(out.lost_before, 5U);
  EXPECT_LE(out.lost_before, kFrames - out.came) << "each for one that is missing, at least";
  EXPECT_EQ(out.untold_gaps + out.unflagged_lost, 0U);
  // The last ones are left out, because nothing came after them.
  EXPECT_LE(out.counters.lost, kFrames - out.came);
  EXPECT_GE(out.counters.lost + 12, kFrames - out.came);
  EXPECT_EQ(out.counters.skipped, 0U);
  EXPECT_EQ(out.wrong_unflagged + out.wrong_in_partial + out.unflagged_missing, 0U);
}

TEST(DaemonLossy, ReorderedDoubledAndDelayedDatagramsMakeNoFrameWrong) {
  constexpr std::uint64_t kFrames = 300;
  NetworkFaults faults;
  faults.seed = 3;
  faults.duplicate_frac = 0.05;
  faults.reorder_frac = 0.1;
  faults.reorder_ns = 500'000;
  faults.jitter_ns = 300'000;
  for (const protocol::FecParams fec : {protocol::FecParams{}, protocol::FecParams{48, 5}}) {
    // Each frame waits for its last datagram, because only one is under way.
    Outcome alone;
    play({faults, fec, false, kFrames, 0}, alone);
    ASSERT_FALSE(HasFatalFailure());
    EXPECT_GT(alone.network.held_back, 0U);
    EXPECT_GE(alone.whole + alone.relay_drops, kFrames);
    // Several frames at once overtake each other. The number of partial ones depends on speed.
    Outcome out;
    play({faults, fec, false, kFrames}, out);
    ASSERT_FALSE(HasFatalFailure());
    EXPECT_GT(out.network.duplicated, 0U);
    EXPECT_GT(out.network.held_back, 0U);
    EXPECT_GE(out.came, kFrames - 2);
    EXPECT_EQ(out.whole + out.partial, out.came) << out.corrupt << " corrupt";
    EXPECT_EQ(out.out_of_order, 0U);
    EXPECT_EQ(out.wrong_unflagged + out.wrong_in_partial + out.unflagged_missing, 0U);
  }
}

/// Bits are turned over behind UDP's own checksum, in header and payload alike.
TEST(DaemonLossy, NoSpoiltPixelGoesUnflagged) {
  for (const bool fec : {false, true}) {
    Outcome out;
    constexpr std::uint64_t kFrames = 500;
    NetworkFaults faults;
    faults.seed = 11;
    faults.loss_frac = 0.002;
    faults.corrupt_frac = 0.003;
    play({faults, fec ? protocol::FecParams{48, 5} : protocol::FecParams{}, false, kFrames}, out);
    ASSERT_FALSE(HasFatalFailure());
    EXPECT_GT(out.network.corrupted, 50U);
    EXPECT_GT(out.corrupt, 0U) << "spoilt, complete and told so";
    EXPECT_EQ(out.counters.crc_errors, out.corrupt);
    EXPECT_EQ(out.wrong_unflagged + out.unflagged_missing, 0U);
    EXPECT_GE(out.whole, kFrames / 2);
  }
}

}  // namespace
}  // namespace emit::server
