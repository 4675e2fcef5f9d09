// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <vector>

#include "agents/receiver/channel_info.hpp"
#include "emit/v1/control.pb.h"
#include "support/channel_clients.hpp"
#include "support/conductor_rig.hpp"
#include "support/output_files.hpp"

namespace emit::server {
namespace {

using test::kHeightPx;
using test::kMs;
using test::kWidthPx;
using test::table_of;
using Rig = test::ConductorRig;

/// Channels: the whole image, a window that is turned, and the same as drive.
scene::ScenarioDesc projector_channels(const test::OutputFiles& files) {
  scene::ScenarioDesc scenario;
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  scenario.channels.resize(3);
  for (scene::ChannelDesc& channel : scenario.channels) {
    channel.band = "8-12";
    channel.kind = scene::ChannelKind::projector;
  }
  scenario.channels[0].name = "all";
  scene::ChannelDesc& turned = scenario.channels[1];
  turned.name = "turned";
  turned.window_px = {2, 1, 4, 3};
  turned.output.mirror = scene::PictureMirror::vertical;
  turned.output.rotate_deg = 90;
  scene::ChannelDesc& drive = scenario.channels[2];
  drive = turned;
  drive.name = "drive";
  drive.output.drive_table_file = files.text("drive.csv", "radiance_w_m2_sr,drive\n0,0\n20,2000\n");
  return scenario;
}

TEST(Outputs, ChannelsShareAPictureOnlyWithTheSameOutput) {
  const test::OutputFiles files;
  scene::ScenarioDesc scenario = projector_channels(files);
  scenario.channels.push_back(scenario.channels[1]);
  scenario.channels.push_back(scenario.channels[1]);
  scenario.channels[4].output.rotate_deg = 270;
  const ChannelTable table = table_of(scenario);
  ASSERT_EQ(table.pictures.size(), 4U);
  EXPECT_EQ(table.channels[3].picture, table.channels[1].picture);
  EXPECT_NE(table.channels[4].picture, table.channels[1].picture);
  EXPECT_NE(table.channels[2].picture, table.channels[1].picture);
  EXPECT_EQ(table.channels[1].width_px, 3U);
  EXPECT_EQ(table.channels[1].height_px, 4U);
  EXPECT_EQ(table.pictures[table.channels[1].picture].copies.size(), 7U);
  EXPECT_EQ(table.pictures[table.channels[1].picture].copies[0].size(), 12U);
  EXPECT_EQ(table.channels[0].output_steps, 0);
  EXPECT_TRUE(table.pictures[table.channels[0].picture].copies.empty());
}

TEST(Outputs, AFaultNamesScenarioChannelAndKey) {
  const test::OutputFiles files;
  scene::ScenarioDesc scenario = projector_channels(files);
  scenario.file = "s.toml";
  scenario.sensor.width_px = kWidthPx;
  scenario.sensor.height_px = kHeightPx;
  EXPECT_TRUE(check_outputs(scenario).has_value());
  scenario.channels[2].output.drive_table_file =
      files.text("short.csv", "radiance_w_m2_sr,drive\n0,0\n");
  const auto checked = check_outputs(scenario);
  ASSERT_FALSE(checked.has_value());
  EXPECT_NE(checked.error().text.find("s.toml: channel 'drive': drive_table_file: "),
            std::string::npos)
      << checked.error().text;
}

TEST(Outputs, ARenderedFrameHasEveryPictureWithItsChecksum) {
  const test::OutputFiles files;
  Rig rig;
  auto table = table_of(projector_channels(files));
  rig.context().channels = std::move(table.channels);
  rig.context().pictures = std::move(table.pictures);
  std::uint64_t clamped = 0;
  for (std::uint64_t k = 1; k <= 5; ++k) {
    rig.send(k, static_cast<std::int64_t>(k) * kMs);
    rig.settle();
    ASSERT_EQ(rig.frames.size(), k);
    const Image& image = rig.frames.back().image;
    ASSERT_EQ(image.pictures[1].size(), 12U);
    std::uint32_t beyond = 0;
    for (std::uint32_t y = 0; y < 4; ++y) {
      for (std::uint32_t x = 0; x < 3; ++x) {
        // Rotated clockwise, (x, y) shows the mirrored window at (y, 2 - x), and that row 2 - (2 -
        // x).
        const float radiance = image.pictures[0][(1 + x) * kWidthPx + 2 + y];
        ASSERT_EQ(image.pictures[1][y * 3 + x], radiance);
        ASSERT_NEAR(image.pictures[2][y * 3 + x], std::clamp(radiance * 100.0F, 0.0F, 2000.0F),
                    1e-3);
        beyond += radiance > 20.0F || radiance < 0.0F ? 1U : 0U;
      }
    }
    EXPECT_EQ(image.clamped_px[1], 0U);
    EXPECT_EQ(image.clamped_px[2], beyond);
    clamped += beyond;
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(image.crc32c[i], protocol::crc32c(std::as_bytes(image.pictures[i])));
    }
  }
  EXPECT_GT(clamped, 0U);
  EXPECT_EQ(rig.count(Counter::output_px_clamped), clamped);
}

TEST(Outputs, HeadersSayWhatWasDoneAndWhatRemains) {
  const test::OutputFiles files;
  scene::ScenarioDesc scenario = projector_channels(files);
  scenario.channels[2].output.apply_shift = true;
  scenario.channels.push_back(scenario.channels[0]);
  scenario.channels[3].name = "moved";
  scenario.channels[3].output.apply_shift = true;
  test::ChannelClients rig(scenario);
  const auto& all = rig.connect(0);
  const auto& turned = rig.connect(1);
  const auto& drive = rig.connect(2);
  const auto& moved = rig.connect(3);
  PublishFrame frame;
  frame.header.shift_x_px = 0.75F;
  frame.header.shift_y_px = -0.5F;
  frame.header.clamped_px = 2;
  frame.image.shift_px = {0.75F, -0.5F};
  frame.image.clamped_px[2] = 5;
  rig.publish(15, false, frame);
  rig.settle();

  EXPECT_EQ(all.header.output_steps, 0);
  EXPECT_EQ(all.header.shift_x_px, 0.75F) << "nobody has applied it";
  EXPECT_EQ(all.header.applied_shift_x_px, 0.0F);
  EXPECT_EQ(all.header.sensor_width_px, kWidthPx);
  EXPECT_EQ(all.header.clamped_px, 2U);

  EXPECT_EQ(turned.header.output_steps,
            protocol::kOutputMirroredVertically | protocol::kOutputRotated90);
  EXPECT_EQ(turned.header.sensor_width_px, 0U) << "its pixels do not lie like a window";
  EXPECT_EQ(turned.header.width_px, 3U);
  EXPECT_EQ(turned.header.quantity, protocol::PixelQuantity::radiance_w_m2_sr);
  EXPECT_EQ(turned.header.shift_y_px, -0.5F);

  EXPECT_EQ(drive.header.output_steps,
            turned.header.output_steps | protocol::kOutputShifted | protocol::kOutputDriven);
  EXPECT_EQ(drive.header.quantity, protocol::PixelQuantity::drive);
  EXPECT_EQ(drive.header.applied_shift_x_px, 0.75F);
  EXPECT_EQ(drive.header.applied_shift_y_px, -0.5F);
  EXPECT_EQ(drive.header.shift_x_px, 0.0F) << "nobody may apply it again";
  EXPECT_EQ(drive.header.shift_y_px, 0.0F);
  EXPECT_EQ(drive.header.clamped_px, 7U) << "the renderer's and its own";
  EXPECT_NE(drive.header.flags & protocol::kFlagClamped, 0U);
  EXPECT_EQ(moved.header.flags & protocol::kFlagClamped, 0U);
  EXPECT_EQ(moved.header.sensor_width_px, kWidthPx) << "a shift leaves the window";

  // The image is shown again, and the axes have moved on.
  frame.header.flags |= protocol::kFlagRepeated;
  frame.header.shift_x_px = 1.0F;
  rig.publish(15, true, frame);
  rig.settle();
  EXPECT_EQ(all.header.shift_x_px, 1.0F);
  EXPECT_EQ(moved.header.applied_shift_x_px, 0.75F);
  EXPECT_EQ(moved.header.shift_x_px, 0.25F) << "this much remains";
  EXPECT_EQ(moved.header.shift_y_px, 0.0F);
}

TEST(Outputs, ADescriptionHasTheWindowAndTheSteps) {
  const test::OutputFiles files;
  const ChannelTable table = table_of(projector_channels(files));
  v1::ChannelInfo info;
  fill(table.channels[2], info);
  EXPECT_EQ(info.width_px(), 3U);
  EXPECT_EQ(info.height_px(), 4U);
  EXPECT_EQ(info.window_x_px(), 2U);
  EXPECT_EQ(info.window_y_px(), 1U);
  EXPECT_EQ(info.window_width_px(), 4U);
  EXPECT_EQ(info.window_height_px(), 3U);
  EXPECT_EQ(info.output_steps(), protocol::kOutputMirroredVertically | protocol::kOutputRotated90 |
                                     protocol::kOutputDriven);
}

TEST(Outputs, ThePartOfTheImageThatIsRenderedHoldsWhatIsSampled) {
  const test::OutputFiles files;
  scene::ScenarioDesc scenario = projector_channels(files);
  scenario.channels[1].output.apply_shift = true;
  const ChannelTable table = table_of(scenario);
  EXPECT_EQ(window_around(table.channels, 4U), (scene::PixelRect{2, 1, 4, 3}));
  EXPECT_EQ(window_around(table.channels, 2U), (scene::PixelRect{0, 0, 8, 4}))
      << "the image ends within the margin";
}

}  // namespace
}  // namespace emit::server
