// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

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

std::unique_ptr<client::FrameClient> open(const std::string& url, bool compression) {
  auto client = client::FrameClient::connect(url);
  EXPECT_TRUE(client.has_value()) << client.error().text;
  client::SubscribeOptions options;
  options.compression = compression;
  const auto channel = (*client)->subscribe(options);
  EXPECT_TRUE(channel.has_value()) << channel.error().text;
  return std::move(*client);
}

TEST(DaemonCompression, CompressedFramesHaveTheBitsOfTheOthers) {
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(640, 512, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const std::string tcp = "tcp://" + daemon.control();
  const auto raw = open(tcp, false);
  const auto first = open(tcp, true);
  const auto second = open(tcp, true);
  const auto udp = open("udp://" + daemon.control(), true);
  EXPECT_FALSE(raw->terms().compression);
  EXPECT_TRUE(first->terms().compression);
  EXPECT_FALSE(udp->terms().compression) << "fragments carry pixels as they are";
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value());
  for (std::uint64_t k = 1; k <= 20; ++k) {
    protocol::HostFrameData frame;
    frame.frame_number = k;
    frame.run_id = 1;
    frame.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
    ASSERT_TRUE((*host)->send(frame).has_value());
    const auto whole = raw->receive(kLongNs);
    ASSERT_TRUE(whole.has_value() && *whole != nullptr);
    EXPECT_EQ((*whole)->encoded_bytes, 0U);
    const std::vector<float> pixels((*whole)->pixels.begin(), (*whole)->pixels.end());
    for (const auto* client : {&first, &second}) {
      const auto small = (*client)->receive(kLongNs);
      ASSERT_TRUE(small.has_value()) << small.error().text;
      ASSERT_NE(*small, nullptr);
      EXPECT_EQ((*small)->header.frame_number, k);
      EXPECT_EQ((*small)->header.flags, (*whole)->header.flags);
      EXPECT_GT((*small)->encoded_bytes, 0U);
      EXPECT_LT((*small)->encoded_bytes, (*small)->header.payload_bytes);
      EXPECT_TRUE(std::ranges::equal((*small)->pixels, pixels));
    }
  }
  EXPECT_EQ(first->counters().crc_errors, 0U);
  EXPECT_EQ(first->counters().received, 20U);
}

TEST(DaemonCompression, IsNotGrantedWhereTheDaemonForbidsIt) {
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\"") +
                                     "[stream]\ncompression = false\n");
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  EXPECT_FALSE(open("tcp://" + daemon.control(), true)->terms().compression);
}

}  // namespace
}  // namespace emit::server
