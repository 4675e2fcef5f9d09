// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <unistd.h>
#include <cstring>
#include <map>
#include <vector>

#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;

using emit::test::kLongNs;
constexpr std::uint64_t kFrames = 24;

const char* const kWorld =
    "[sensor]\nwidth_px = 64\nheight_px = 48\n[atmosphere]\nenabled = false\n"
    "[[material]]\nname = \"concrete\"\nsolar_absorptance_frac = 0.6\nemissivity_frac = 0.9\n"
    "prescribed_k = 300.0\n"
    "[[channel]]\nname = \"field\"\nband = \"8-12\"\nevery_nth = 4\n"
    "[[channel]]\nname = \"gate\"\nband = \"8-12\"\nwindow_px = [21, 10, 19, 13]\n"
    "[[channel]]\nname = \"all\"\nband = \"8-12\"\n";

/// Frames that one subscription got, by frame number.
struct Stream {
  std::unique_ptr<client::FrameClient> client;
  client::ChannelDescription channel;
  std::map<std::uint64_t, std::vector<float>> pixels;
  protocol::FrameHeader last;

  static Stream open(const std::string& url, const client::SubscribeOptions& options) {
    Stream out;
    auto client = client::FrameClient::connect(url);
    EXPECT_TRUE(client.has_value()) << client.error().text;
    auto channel = (*client)->subscribe(options);
    EXPECT_TRUE(channel.has_value()) << channel.error().text;
    out.client = std::move(*client);
    out.channel = *channel;
    return out;
  }
  static Stream open(const std::string& url, const char* name, std::uint32_t every_nth = 1) {
    client::SubscribeOptions options;
    options.channel_name = name;
    options.every_nth = every_nth;
    options.fragment_payload_bytes = 384;
    return open(url, options);
  }
  void take() {
    const auto frame = client->receive(kLongNs);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_NE(*frame, nullptr) << channel.name;
    last = (*frame)->header;
    EXPECT_EQ(last.flags & (protocol::kFlagPartial | protocol::kFlagGapBefore), 0U);
    ASSERT_EQ((*frame)->pixels.size(), std::size_t{channel.width_px} * channel.height_px);
    pixels[last.frame_number] = {(*frame)->pixels.begin(), (*frame)->pixels.end()};
  }
};

TEST(DaemonWindow, ChannelsHaveTheirOwnWindowAndRateOverEveryTransport) {
  ScratchFolder folder;
  folder.write("world.toml", kWorld);
  const std::string name = "test-window-" + std::to_string(::getpid());
  const std::string config = folder.write(
      "emitd.toml", "scenario = \"world.toml\"\n" + canned_config(64, 48, "mode = \"host-step\"") +
                        "[stream]\nshm = \"" + name + "\"\n");
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const std::string tcp = "tcp://" + daemon.control();
  const std::string udp = "udp://" + daemon.control();
  const std::string shm = "shm://" + name;
  Stream all = Stream::open(tcp, "all");
  std::vector<Stream> gates;
  std::vector<Stream> fields;
  std::vector<Stream> half_fields;
  for (const std::string& url : {tcp, udp, shm}) {
    gates.push_back(Stream::open(url, "gate"));
    fields.push_back(Stream::open(url, "field"));
    half_fields.push_back(Stream::open(url, "field", 2));
  }
  EXPECT_EQ(fields[0].client->terms().every_nth, 4U);
  EXPECT_EQ(half_fields[2].client->terms().every_nth, 8U);
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value());
  for (std::uint64_t k = 1; k <= kFrames; ++k) {
    protocol::HostFrameData frame;
    frame.frame_number = k;
    frame.run_id = 1;
    frame.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
    ASSERT_TRUE((*host)->send(frame).has_value());
    ASSERT_NO_FATAL_FAILURE(all.take());
    ASSERT_EQ(all.last.frame_number, k);
    for (Stream& gate : gates) ASSERT_NO_FATAL_FAILURE(gate.take());
    for (Stream& field : fields) {
      if (k % 4 == 1) {
        ASSERT_NO_FATAL_FAILURE(field.take());
      }
    }
    for (Stream& field : half_fields) {
      if (k % 8 == 1) {
        ASSERT_NO_FATAL_FAILURE(field.take());
      }
    }
  }
  ASSERT_NE(all.pixels[1], all.pixels[2]) << "the picture moves";
  for (Stream& gate : gates) {
    EXPECT_EQ(gate.channel.window_x_px, 21U);
    EXPECT_EQ(gate.channel.window_y_px, 10U);
    EXPECT_EQ(gate.last.window_x_px, 21U);
    EXPECT_EQ(gate.last.window_y_px, 10U);
    EXPECT_EQ(gate.last.width_px, 19U);
    EXPECT_EQ(gate.last.height_px, 13U);
    EXPECT_EQ(gate.last.sensor_width_px, 64U);
    EXPECT_EQ(gate.last.sensor_height_px, 48U);
    ASSERT_EQ(gate.pixels.size(), kFrames);
    for (const auto& [number, pixels] : gate.pixels) {
      for (std::size_t row = 0; row < 13; ++row) {
        ASSERT_EQ(std::memcmp(&pixels[row * 19], &all.pixels[number][(10 + row) * 64 + 21],
                              19 * sizeof(float)),
                  0)
            << "frame " << number << ", row " << row;
      }
    }
  }
  for (std::vector<Stream>* some : {&fields, &half_fields}) {
    for (Stream& field : *some) {
      EXPECT_EQ(field.pixels.size(), kFrames / field.client->terms().every_nth);
      for (const auto& [number, pixels] : field.pixels) {
        EXPECT_EQ(number % field.client->terms().every_nth, 1U);
        EXPECT_EQ(pixels, all.pixels[number]);
      }
    }
  }
  for (auto* some : {&gates, &fields, &half_fields}) {
    for (Stream& stream : *some) {
      const auto nothing = stream.client->receive(0);
      ASSERT_TRUE(nothing.has_value());
      EXPECT_EQ(*nothing, nullptr) << "no frame beside its rate";
      const client::ReceiveCounters& counters = stream.client->counters();
      EXPECT_EQ(counters.lost + counters.gaps + counters.crc_errors + counters.partial, 0U);
    }
  }
}

TEST(DaemonWindow, AChannelIsNamedOrRefusedByName) {
  ScratchFolder folder;
  folder.write("world.toml", kWorld);
  const std::string config = folder.write(
      "emitd.toml", "scenario = \"world.toml\"\n" + canned_config(64, 48, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  auto client = client::FrameClient::connect("tcp://" + daemon.control());
  ASSERT_TRUE(client.has_value());
  client::SubscribeOptions options;
  options.channel_name = "gates";
  const auto channel = (*client)->subscribe(options);
  ASSERT_FALSE(channel.has_value());
  EXPECT_NE(channel.error().text.find("no channel name 'gates'"), std::string::npos)
      << channel.error().text;
  EXPECT_NE(channel.error().text.find("gate (injection/"), std::string::npos);
}

TEST(DaemonWindow, AWindowBeyondTheCannedPictureIsRefusedAtStart) {
  ScratchFolder folder;
  folder.write("world.toml", kWorld);
  const std::string config = folder.write(
      "emitd.toml", "scenario = \"world.toml\"\n" + canned_config(32, 48, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  EXPECT_NE(daemon.wait(), 0);
  EXPECT_NE(folder.read("stderr").find("window_px of channel 'gate' reaches beyond the image of "
                                       "32 x 48"),
            std::string::npos)
      << folder.read("stderr");
}

}  // namespace
}  // namespace emit::server
