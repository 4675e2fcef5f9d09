// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "support/channel_clients.hpp"
#include "support/conductor_rig.hpp"

namespace emit::server {
namespace {

using test::kHeightPx;
using test::kMs;
using test::kWidthPx;
using test::seeker_channels;
using test::table_of;
using Clients = test::ChannelClients;
using Rig = test::ConductorRig;

void use_channels(Rig& rig) {
  auto table = table_of(seeker_channels());
  rig.context().channels = std::move(table.channels);
  rig.context().pictures = std::move(table.pictures);
}

TEST(Channels, ShareAPictureOnlyWithTheSameBandAndWindow) {
  auto scenario = seeker_channels();
  scenario.channels.push_back({"gate2", scene::ChannelKind::projector, "8-12", {2, 1, 3, 2}, 8});
  const auto table = table_of(scenario);
  ASSERT_EQ(table.channels.size(), 4U);
  EXPECT_EQ(table.pictures.size(), 3U);
  EXPECT_EQ(table.channels[3].picture, table.channels[1].picture);
  EXPECT_EQ(table.pictures[table.channels[1].picture].channels, 0b1010U);
  EXPECT_EQ(table.channels[1].width_px, 3U);
  EXPECT_EQ(table.channels[1].height_px, 2U);
  EXPECT_EQ(table.channels[1].window_px, (scene::PixelRect{2, 1, 3, 2}));
  EXPECT_EQ(table.channels[1].sensor_width_px, kWidthPx);
  EXPECT_EQ(table.channels[1].sensor_height_px, kHeightPx);
  EXPECT_TRUE(table.pictures[2].copies.empty()) << "whole rows need no copy";
}

TEST(Channels, RefuseAWindowBeyondThePictureOfTheSource) {
  SourceInfo info;
  info.width_px = kWidthPx;
  info.height_px = kHeightPx;
  info.planes = 1;
  info.slots = 2;
  for (const scene::PixelRect& window :
       {scene::PixelRect{6, 0, 3, 1}, scene::PixelRect{0, 3, 1, 2}, scene::PixelRect{8, 0, 1, 1}}) {
    auto scenario = seeker_channels();
    scenario.file = "s.toml";
    scenario.channels[1].window_px = window;
    const auto table = make_channels(scenario, info);
    ASSERT_FALSE(table.has_value());
    EXPECT_EQ(table.error().text,
              "s.toml: window_px of channel 'gate' reaches beyond the image of 8 x 4");
  }
}

TEST(Channels, OnlyWhatAChannelIsDueForIsAskedOfTheRenderer) {
  Rig rig;
  use_channels(rig);
  for (std::uint64_t k = 1; k <= 9; ++k) {
    rig.send(k, static_cast<std::int64_t>(k) * kMs);
    rig.settle();
  }
  ASSERT_EQ(rig.script.submitted.size(), 9U);
  ASSERT_EQ(rig.frames.size(), 9U);
  const scene::PixelRect all{0, 0, kWidthPx, kHeightPx};
  const scene::PixelRect gate{2, 1, 3, 2};
  const scene::PixelRect gate_and_lines{0, 1, kWidthPx, 3};
  for (std::size_t i = 0; i < 9; ++i) {
    const bool field = i % 4 == 0;
    const bool lines = i % 2 == 0;
    EXPECT_EQ(rig.script.submitted[i].window_px, field   ? all
                                                 : lines ? gate_and_lines
                                                         : gate)
        << "frame " << i + 1;
    EXPECT_EQ(rig.frames[i].image.channels, (field ? 1U : 0U) | 2U | (lines ? 4U : 0U));
    EXPECT_EQ(rig.frames[i].image.pictures[0].size(), field ? 32U : 0U);
    EXPECT_EQ(rig.frames[i].image.pictures[1].size(), 6U);
    EXPECT_EQ(rig.frames[i].image.pictures[2].size(), lines ? 16U : 0U);
  }
  // The source counts its pixels up, so the window holds those of its place.
  const auto& last = rig.frames[8].image;
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(last.pictures[1][i], last.pictures[0][(1 + i / 3) * kWidthPx + 2 + i % 3]) << i;
  }
  EXPECT_EQ(last.pictures[2][0], last.pictures[0][2 * kWidthPx]);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(last.crc32c[i], protocol::crc32c(std::as_bytes(last.pictures[i])));
  }
}

TEST(Channels, ALateFrameKeepsTheChannelsItWasMadeForAndARepeatGoesWhereItHasPixels) {
  config::PacingConfig pacing;
  pacing.mode = config::PacingMode::ig_clock;
  pacing.rate_hz = 100.0;
  Rig rig(pacing);
  use_channels(rig);
  rig.settle();
  for (int slot = 2; slot <= 4; ++slot) rig.next_slot();  // frames 1 to 4
  rig.script.ready = false;
  rig.next_slot();  // frame 5 is for everybody, and is not ready
  rig.next_slot();
  ASSERT_EQ(rig.frames.size(), 5U);
  EXPECT_TRUE(rig.frames[4].repeat);
  EXPECT_EQ(rig.frames[4].header.frame_number, 5U);
  EXPECT_EQ(rig.frames[4].image.channels, 7U) << "the sender knows what the last image has";
  rig.script.ready = true;
  rig.pass(1 * kMs);
  ASSERT_EQ(rig.frames.size(), 6U);
  EXPECT_EQ(rig.frames[5].header.frame_number, 6U);
  EXPECT_NE(rig.frames[5].header.flags & protocol::kFlagLate, 0U);
  EXPECT_EQ(rig.frames[5].image.channels, 7U) << "made for frame 5";
  rig.next_slot();
  EXPECT_EQ(rig.frames[6].image.channels, 2U | 4U) << "frame 7 is as if nothing had been late";
}

using Numbers = std::vector<std::uint64_t>;

TEST(Channels, EveryClientGetsTheRateOfItsChannelTimesItsOwn) {
  Clients rig;
  const auto& field = rig.connect(0);
  const auto& half_field = rig.connect(0, 2);
  const auto& gate = rig.connect(1);
  const auto& third_of_gate = rig.connect(1, 3);
  const auto& lines = rig.connect(2);
  for (int i = 0; i < 12; ++i) rig.publish_due();
  EXPECT_EQ(field.numbers, (Numbers{1, 5, 9}));
  EXPECT_EQ(half_field.numbers, (Numbers{1, 9}));
  EXPECT_EQ(gate.numbers, (Numbers{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12}));
  EXPECT_EQ(third_of_gate.numbers, (Numbers{1, 4, 7, 10}));
  EXPECT_EQ(lines.numbers, (Numbers{1, 3, 5, 7, 9, 11}));
  for (const auto* peer : {&field, &half_field, &gate, &third_of_gate, &lines}) {
    EXPECT_TRUE(peer->gaps.empty()) << "what a channel does not show is no gap";
  }
  EXPECT_EQ(rig.context().counters.get(Counter::frames_skipped), 0U);
}

TEST(Channels, AFrameThatWasNotReadyForItsChannelLeavesAGap) {
  Clients rig;
  const auto& field = rig.connect(0);
  const auto& half_field = rig.connect(0, 2);
  const auto& gate = rig.connect(1);
  for (int i = 0; i < 4; ++i) rig.publish_due();
  // Frame 5 repeats frame 4, which has no pixels of the field. The image made for frame 5 comes as
  // 6.
  rig.publish(7, true);
  rig.settle();
  rig.publish(7);
  rig.settle();
  for (int i = 0; i < 7; ++i) rig.publish_due();
  EXPECT_EQ(field.numbers, (Numbers{1, 6, 9, 13}));
  EXPECT_EQ(field.gaps, (Numbers{6}));
  EXPECT_EQ(half_field.numbers, (Numbers{1, 9}));
  EXPECT_TRUE(half_field.gaps.empty()) << "5 and 6 were never for it";
  EXPECT_EQ(gate.numbers.size(), 13U) << "the repeat has its pixels";
  EXPECT_TRUE(gate.gaps.empty());
  EXPECT_EQ(rig.context().counters.get(Counter::frames_skipped), 1U);
}

}  // namespace
}  // namespace emit::server
