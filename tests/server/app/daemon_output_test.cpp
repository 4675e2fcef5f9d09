// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <numbers>
#include <vector>

#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"
#include "support/output_files.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::OutputFiles;

using emit::test::kLongNs;
constexpr std::uint32_t kWidthPx = 64;  // of the canned image
constexpr std::uint32_t kHeightPx = 48;

const char* const kWorld =
    "[sensor]\nwidth_px = 64\nheight_px = 48\n[atmosphere]\nenabled = false\n"
    "[[material]]\nname = \"concrete\"\nsolar_absorptance_frac = 0.6\nemissivity_frac = 0.9\n"
    "prescribed_k = 300.0\n"
    "[[channel]]\nname = \"truth\"\nband = \"8-12\"\n";

/// One subscription.
struct OutputStream {
  std::unique_ptr<client::FrameClient> client;
  client::ChannelDescription channel;
  protocol::FrameHeader header;
  std::vector<float> pixels;

  static OutputStream open(const std::string& url, const char* name) {
    OutputStream out;
    auto client = client::FrameClient::connect(url);
    EXPECT_TRUE(client.has_value()) << client.error().text;
    client::SubscribeOptions options;
    options.channel_name = name;
    auto channel = (*client)->subscribe(options);
    EXPECT_TRUE(channel.has_value()) << channel.error().text;
    out.client = std::move(*client);
    out.channel = *channel;
    return out;
  }
  void take() {
    const auto frame = client->receive(kLongNs);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_NE(*frame, nullptr) << channel.name;
    header = (*frame)->header;
    ASSERT_EQ((*frame)->pixels.size(), std::size_t{channel.width_px} * channel.height_px);
    pixels.assign((*frame)->pixels.begin(), (*frame)->pixels.end());
  }
};

void send_pose(client::HostClient& host, std::uint64_t number) {
  protocol::HostFrameData frame;
  frame.frame_number = number;
  frame.run_id = 1;
  frame.sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
  ASSERT_TRUE(host.send(frame).has_value());
}

/// A barrel about the middle of a picture of 30 x 40: a map of 28 x 36 that looks beyond its
/// corners.
protocol::ImagePoint barrel(double x_px, double y_px) {
  const double dx = x_px - 14.0;
  const double dy = y_px - 18.0;
  const double scale = 1.0 + 4e-4 * (dx * dx + dy * dy);
  return {15.0 + scale * dx, 20.0 + scale * dy};
}

/// Bilinear value of an image at a place, in double. The image goes on at its edges.
double sampled(const std::vector<float>& image, double x_px, double y_px) {
  const auto at = [&](double column, double row) {
    const auto c = static_cast<std::size_t>(std::clamp(column, 0.0, kWidthPx - 1.0));
    const auto r = static_cast<std::size_t>(std::clamp(row, 0.0, kHeightPx - 1.0));
    return static_cast<double>(image[r * kWidthPx + c]);
  };
  const double left = std::floor(x_px - 0.5);
  const double above = std::floor(y_px - 0.5);
  const double u = x_px - 0.5 - left;
  const double v = y_px - 0.5 - above;
  return (1 - v) * ((1 - u) * at(left, above) + u * at(left + 1, above)) +
         v * ((1 - u) * at(left, above + 1) + u * at(left + 1, above + 1));
}

/// A projector's channel against the injection channel of the same frame, transformed here.
TEST(DaemonOutput, AProjectorsFrameIsTheTransformedFrameOfTheOtherChannel) {
  const OutputFiles files;
  const test::ScratchFolder& folder = files.folder();
  const std::string name = "test-output-" + std::to_string(::getpid());
  files.map("barrel.exr", {28, 36}, barrel);
  files.text("drive.csv", "radiance_w_m2_sr,drive\n26,100\n40,1500\n100,3000\n110,3050\n");
  folder.write("world.toml",
               std::string(kWorld) +
                   "[[channel]]\nname = \"scene\"\nband = \"8-12\"\nkind = \"projector\"\n"
                   "window_px = [12, 9, 40, 30]\nmirror = \"horizontal\"\nrotate_deg = 270\n"
                   "distortion_file = \"barrel.exr\"\noutside_w_m2_sr = 12.5\n"
                   "drive_table_file = \"drive.csv\"\n"
                   "[[channel]]\nname = \"turned\"\nband = \"8-12\"\nkind = \"projector\"\n"
                   "window_px = [12, 9, 40, 30]\nmirror = \"horizontal\"\nrotate_deg = 270\n");
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", "scenario = \"world.toml\"\n" +
                                                  canned_config(64, 48, "mode = \"host-step\"") +
                                                  "[stream]\nshm = \"" + name + "\"\n")});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const std::string tcp = "tcp://" + daemon.control();
  OutputStream truth = OutputStream::open(tcp, "truth");
  OutputStream scene = OutputStream::open("udp://" + daemon.control(), "scene");
  OutputStream turned = OutputStream::open("shm://" + name, "turned");
  EXPECT_EQ(scene.channel.width_px, 28U);
  EXPECT_EQ(scene.channel.height_px, 36U);
  EXPECT_EQ(scene.channel.window_width_px, 40U);
  EXPECT_EQ(scene.channel.window_height_px, 30U);
  EXPECT_EQ(turned.channel.width_px, 30U);
  EXPECT_FALSE(scene.channel.sensor_point({1.0, 1.0}).has_value()) << "only the map knows";
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value());
  std::size_t outside = 0;
  std::size_t clamped = 0;
  for (std::uint64_t k = 1; k <= 12; ++k) {
    ASSERT_NO_FATAL_FAILURE(send_pose(**host, k));
    ASSERT_NO_FATAL_FAILURE(truth.take());
    ASSERT_NO_FATAL_FAILURE(scene.take());
    ASSERT_NO_FATAL_FAILURE(turned.take());
    ASSERT_EQ(truth.header.frame_number, k);
    ASSERT_EQ(scene.header.frame_number, k);
    ASSERT_EQ(turned.header.frame_number, k);
    std::size_t clamped_here = 0;
    outside = 0;
    for (std::uint32_t y = 0; y < 36; ++y) {
      for (std::uint32_t x = 0; x < 28; ++x) {
        const protocol::ImagePoint at = barrel(x + 0.5, y + 0.5);
        double radiance = 12.5;
        if (at.x_px >= 0.0 && at.x_px <= 30.0 && at.y_px >= 0.0 && at.y_px <= 40.0) {
          // Rotated clockwise by 270 degrees, a place (x, y) shows the mirrored window at (40 - y,
          // x).
          const double mirrored_x = 40.0 - at.y_px;
          radiance = sampled(truth.pixels, 12.0 + 40.0 - mirrored_x, 9.0 + at.x_px);
        } else {
          ++outside;
        }
        clamped_here += radiance < 26.0 || radiance > 110.0 ? 1U : 0U;
        const double drive = radiance < 26.0    ? 100.0
                             : radiance < 40.0  ? 100.0 + (radiance - 26.0) * 100.0
                             : radiance < 100.0 ? 1500.0 + (radiance - 40.0) * 25.0
                             : radiance < 110.0 ? 3000.0 + (radiance - 100.0) * 5.0
                                                : 3050.0;
        // Positions in float32 are good to 2e-6 px; the disc has 95 W m-2 sr-1 within a pixel, and
        // the table 100 for each of them.
        ASSERT_NEAR(scene.pixels[y * 28 + x], drive, 0.05) << k << ": " << x << ", " << y;
      }
    }
    // Values at the very ends of the table may fall to either side in float32.
    EXPECT_NEAR(scene.header.clamped_px, static_cast<double>(clamped_here), 2.0);
    clamped += clamped_here;
    for (std::uint32_t y = 0; y < 40; ++y) {
      for (std::uint32_t x = 0; x < 30; ++x) {
        // The same rule for whole pixels, bit for bit, and as the client maps back.
        const float expected = truth.pixels[(9 + x) * kWidthPx + 12 + y];
        ASSERT_EQ(std::memcmp(&turned.pixels[y * 30 + x], &expected, sizeof(float)), 0);
        const auto at = turned.channel.sensor_point({x + 0.5, y + 0.5});
        ASSERT_TRUE(at.has_value());
        ASSERT_EQ(*at, (protocol::ImagePoint{12.5 + y, 9.5 + x}));
      }
    }
    EXPECT_EQ(scene.header.quantity, protocol::PixelQuantity::drive);
    EXPECT_EQ(truth.header.quantity, protocol::PixelQuantity::radiance_w_m2_sr);
    EXPECT_EQ(truth.header.output_steps, 0);
    EXPECT_NE(scene.header.flags & protocol::kFlagClamped, 0U);
    EXPECT_EQ(truth.header.flags & protocol::kFlagClamped, 0U);
  }
  EXPECT_GT(outside, 0U);
  EXPECT_GT(clamped, 12 * outside) << "the scene has values beyond the table too";
  EXPECT_NE(folder.read("stderr").find("event=output_outside channel=\"scene\" pixels=" +
                                       std::to_string(outside) + " of=1008 value_w_m2_sr=12.5"),
            std::string::npos)
      << folder.read("stderr");
}

/// Counts of a seeker's channel against the radiance of the same frame: a wide spot and noise leave
/// the mean of an even part, and the spread is that of the noise.
TEST(DaemonOutput, ASeekersCountsAreTheRadianceWithOpticsAndNoise) {
  const OutputFiles files;
  const test::ScratchFolder& folder = files.folder();
  folder.write("world.toml", std::string(kWorld) +
                                 "[[channel]]\nname = \"seen\"\nband = \"8-12\"\n"
                                 "[channel.optics]\nspot = \"gaussian\"\nsigma_px = 1.0\n"
                                 "[channel.detector]\nnetd_k = 0.5\ncounts_per_w_m2_sr = 100\n"
                                 "counts_offset = 1000\n");
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", "scenario = \"world.toml\"\n" +
                                                  canned_config(64, 48, "mode = \"host-step\""))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const std::string tcp = "tcp://" + daemon.control();
  OutputStream truth = OutputStream::open(tcp, "truth");
  OutputStream seen = OutputStream::open(tcp, "seen");
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value());
  std::vector<float> first;
  for (std::uint64_t k = 1; k <= 3; ++k) {
    ASSERT_NO_FATAL_FAILURE(send_pose(**host, k));
    ASSERT_NO_FATAL_FAILURE(truth.take());
    ASSERT_NO_FATAL_FAILURE(seen.take());
    EXPECT_EQ(seen.header.quantity, protocol::PixelQuantity::counts);
    EXPECT_EQ(seen.channel.output_steps, seen.header.output_steps);
    EXPECT_EQ(seen.header.width_px, kWidthPx) << "pixels stay where they are";
    // The convolution and the counts by their definition; what is left is noise.
    double sum = 0.0;
    double squares = 0.0;
    int count = 0;
    for (std::uint32_t y = 8; y < kHeightPx - 8; ++y) {
      for (std::uint32_t x = 8; x < kWidthPx - 8; ++x) {
        double blurred = 0.0;
        double weights = 0.0;
        for (int v = -5; v <= 5; ++v) {
          for (int u = -5; u <= 5; ++u) {
            const auto share = [](int at) {
              return 0.5 * (std::erf((at + 0.5) / std::numbers::sqrt2) -
                            std::erf((at - 0.5) / std::numbers::sqrt2));
            };
            const auto row = static_cast<std::size_t>(static_cast<int>(y) + v);
            const auto column = static_cast<std::size_t>(static_cast<int>(x) + u);
            blurred +=
                share(u) * share(v) * static_cast<double>(truth.pixels[row * kWidthPx + column]);
            weights += share(u) * share(v);
          }
        }
        const float counts = seen.pixels[y * kWidthPx + x];
        ASSERT_EQ(counts, std::floor(counts));
        const double off = static_cast<double>(counts) - 1000.0 - 100.0 * blurred / weights;
        sum += off;
        squares += off * off;
        ++count;
      }
    }
    // dL/dT of 8 to 12 um at 300 K is 0.645 W m-2 sr-1 K-1; rounding adds 1/12 to the variance.
    const double expected = 0.5 * 64.5;
    EXPECT_NEAR(sum / count, 0.0, 4.0 * expected / std::sqrt(count));
    EXPECT_NEAR(std::sqrt(squares / count), expected, 0.08 * expected);
    if (k == 1) first = seen.pixels;
  }
  EXPECT_NE(seen.pixels, first);
}

TEST(DaemonOutput, AShiftWithoutAMotionSimulatorIsRefusedAtStart) {
  const OutputFiles files;
  const test::ScratchFolder& folder = files.folder();
  folder.write("world.toml", std::string(kWorld) + "kind = \"projector\"\napply_shift = true\n");
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", "scenario = \"world.toml\"\n" +
                                                  canned_config(64, 48, "mode = \"host-step\""))});
  EXPECT_NE(daemon.wait(), 0);
  EXPECT_NE(folder.read("stderr").find(
                "channel 'truth' of the scenario has 'apply_shift', which needs [motion]"),
            std::string::npos)
      << folder.read("stderr");
}

TEST(DaemonOutput, ABadFileEndsTheStartWithItsName) {
  const OutputFiles files;
  const test::ScratchFolder& folder = files.folder();
  files.text("drive.csv", "radiance_w_m2_sr,drive\n0,0\n5,10\n4,20\n");
  folder.write("world.toml", std::string(kWorld) + "drive_table_file = \"drive.csv\"\n");
  DaemonProcess daemon(
      folder,
      {"--config", folder.write("emitd.toml", "scenario = \"world.toml\"\n" +
                                                  canned_config(64, 48, "mode = \"host-step\""))});
  EXPECT_EQ(daemon.wait(), 78);
  EXPECT_NE(folder.read("stderr").find("drive.csv:4: 4 W m-2 sr-1 to 20: 'radiance_w_m2_sr' is not "
                                       "above 5"),
            std::string::npos)
      << folder.read("stderr");
}

}  // namespace
}  // namespace emit::server
