// SPDX-License-Identifier: Apache-2.0
// A cable between two networks that the kernel makes slow or lossy.
#include <gtest/gtest.h>

#include <csignal>
#include <string>

#include "client/client_connection.hpp"
#include "emit/client/client.hpp"
#include "support/times.hpp"
#include "support/two_networks.hpp"

namespace emit::server {
namespace {

using test::DaemonProcess;
using test::ScratchFolder;
using test::TwoNetworks;

constexpr std::uint64_t kFrames = 60;
using emit::test::kLongNs;
constexpr std::uint64_t kFrameBytes = 320 * 256 * sizeof(float);

std::string config() {
  std::string text = test::canned_config(320, 256, "mode = \"host-step\"",
                                         "[access]\nallow = [\"192.0.2.0/24\"]\n");
  for (std::size_t at; (at = text.find("127.0.0.1")) != std::string::npos;) {
    text.replace(at, 9, "192.0.2.1");
  }
  return text;
}

/// A daemon "here" and a client "there".
class Shaped {
 public:
  Shaped(TwoNetworks& networks, const std::string& scheme)
      : daemon_(folder_, {"--config", folder_.write("emitd.toml", config())}) {
    EXPECT_TRUE(daemon_.wait_ready()) << folder_.read("stderr");
    auto host = client::HostClient::connect("tcp://" + daemon_.control());
    networks.enter_there();  // subscribing makes a socket too
    auto client = client::FrameClient::connect(scheme + daemon_.control());
    const bool subscribed = client && (*client)->subscribe({}).has_value();
    networks.enter_here();
    EXPECT_TRUE(host.has_value() && subscribed);
    if (!host || !subscribed) return;
    host_ = std::move(*host);
    client_ = std::move(*client);
  }
  ~Shaped() {
    daemon_.signal(SIGTERM);
    EXPECT_EQ(daemon_.wait(), 0) << folder_.read("stderr");
  }
  [[nodiscard]] bool ready() const { return client_ != nullptr; }
  [[nodiscard]] client::FrameClient& client() { return *client_; }
  void send_poses() {
    protocol::HostFrameData pose;
    pose.run_id = 1;
    for (pose.frame_number = 1; pose.frame_number <= kFrames; ++pose.frame_number) {
      pose.sim_time_ns = static_cast<std::int64_t>(pose.frame_number) * 1'000'000;
      ASSERT_TRUE(host_->send(pose).has_value());
    }
  }

 private:
  ScratchFolder folder_;
  DaemonProcess daemon_;
  std::unique_ptr<client::HostClient> host_;
  std::unique_ptr<client::FrameClient> client_;
};

TEST(DaemonShaped, ATcpClientBehindASlowLinkSkipsFramesAndTheNewestComes) {
  test::in_two_networks([](TwoNetworks& networks) {
    networks.shape("tbf rate 40mbit burst 64kb limit 1mb");
    Shaped rig(networks, "tcp://");
    ASSERT_TRUE(rig.ready());
    const std::int64_t start_ns = client::monotonic_now_ns();
    rig.send_poses();
    std::uint64_t frames = 0;
    for (std::uint64_t newest = 0; newest < kFrames; ++frames) {
      const auto frame = rig.client().receive(kLongNs);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      ASSERT_NE(*frame, nullptr) << "no frame after " << newest;
      EXPECT_GT((*frame)->header.frame_number, newest);
      newest = (*frame)->header.frame_number;
    }
    // The link lets no more through, however busy the machine is.
    const double seconds = 1e-9 * static_cast<double>(client::monotonic_now_ns() - start_ns);
    EXPECT_GE(seconds, 8.0 * static_cast<double>(frames * kFrameBytes - (64u << 10)) / 40e6);
    const client::ReceiveCounters& counters = rig.client().counters();
    EXPECT_EQ(counters.lost, 0U) << "what is missing is flagged";
    EXPECT_EQ(counters.crc_errors, 0U);
    EXPECT_EQ(frames + counters.skipped, kFrames);
  });
}

class DaemonShapedUdp : public ::testing::TestWithParam<const char*> {};

TEST_P(DaemonShapedUdp, WhatTheLinkDropsIsToldInEveryFrame) {
  const std::string shape = GetParam();
  test::in_two_networks([&shape](TwoNetworks& networks) {
    networks.shape(shape);
    Shaped rig(networks, "udp://");
    ASSERT_TRUE(rig.ready());
    rig.send_poses();
    constexpr std::int64_t kQuietNs = 2'000'000'000;
    std::uint64_t frames = 0;
    for (;; ++frames) {
      const auto frame = rig.client().receive(frames == 0 ? kLongNs : kQuietNs);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      if (*frame == nullptr) break;
      const bool partial = ((*frame)->header.flags & protocol::kFlagPartial) != 0;
      EXPECT_EQ(partial, (*frame)->missing_px > 0);
    }
    const client::ReceiveCounters& counters = rig.client().counters();
    EXPECT_GT(frames, 0U);
    EXPECT_EQ(counters.received + counters.partial, frames);
    EXPECT_EQ(counters.crc_errors, 0U);
    EXPECT_EQ(counters.bad_datagrams, 0U);
  });
}

INSTANTIATE_TEST_SUITE_P(Links, DaemonShapedUdp,
                         ::testing::Values("tbf rate 200mbit burst 64kb limit 200kb",
                                           "netem loss 2%", "netem delay 2ms reorder 25%",
                                           "netem duplicate 5%"),
                         [](const auto& each) { return "Link" + std::to_string(each.index); });

}  // namespace
}  // namespace emit::server
