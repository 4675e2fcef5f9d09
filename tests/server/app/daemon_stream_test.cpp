// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <thread>

#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;

#if defined(__SANITIZE_THREAD__) || defined(__SANITIZE_ADDRESS__)
constexpr std::uint64_t kStreamFrames = 200;
#else
constexpr std::uint64_t kStreamFrames = 1000;
#endif
using emit::test::kLongNs;

/// A client and the checks that hold for every stream: missing frames are flagged, complete frames
/// are intact.
struct Watcher {
  std::unique_ptr<client::FrameClient> client;
  std::uint64_t newest = 0;
  std::uint64_t complete = 0;

  static Watcher open(const std::string& url) {
    Watcher out;
    auto connected = client::FrameClient::connect(url);
    EXPECT_TRUE(connected.has_value()) << connected.error().text;
    if (connected) {
      out.client = std::move(*connected);
      const auto channel = out.client->subscribe({});
      EXPECT_TRUE(channel.has_value()) << channel.error().text;
    }
    return out;
  }
  /// Waits for a frame. It returns false when none came within the timeout.
  bool take(std::int64_t timeout_ns) {
    const auto frame = client->receive(timeout_ns);
    EXPECT_TRUE(frame.has_value()) << frame.error().text;
    if (!frame || *frame == nullptr) {
      return false;
    }
    const auto& header = (*frame)->header;
    EXPECT_GT(header.frame_number, newest);
    newest = header.frame_number;
    complete += (header.flags & protocol::kFlagPartial) == 0 ? 1U : 0U;
    return true;
  }
  void drain() {
    while (take(0)) {
    }
  }
};

TEST(DaemonStream, AStoppedClientCostsTheOthersNothingOverTcpAndUdp) {
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(640, 512, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  Watcher tcp = Watcher::open("tcp://" + daemon.control());
  Watcher udp = Watcher::open("udp://" + daemon.control());
  Watcher tcp_stopped = Watcher::open("tcp://" + daemon.control());
  Watcher udp_stopped = Watcher::open("udp://" + daemon.control());
  ASSERT_TRUE(tcp.client && udp.client && tcp_stopped.client && udp_stopped.client);
  const bool udp_has_room = udp.client->receive_buffer_advice().empty();
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value());

  // The test is the slowest link of the chain: every frame is taken before the next is requested.
  // So missing frames were lost by emitd and not by a busy machine.
  for (std::uint64_t k = 1; k <= kStreamFrames; ++k) {
    protocol::HostFrameData frame;
    frame.frame_number = k;
    frame.run_id = 1;
    frame.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
    ASSERT_TRUE((*host)->send(frame).has_value());
    ASSERT_TRUE(tcp.take(kLongNs)) << "frame " << k << folder.read("stderr");
    ASSERT_EQ(tcp.newest, k);
    if (udp_has_room) {
      ASSERT_TRUE(udp.take(kLongNs)) << "frame " << k;
      ASSERT_EQ(udp.newest, k);
    }
    if (k < kStreamFrames / 3 || k > 2 * kStreamFrames / 3) {
      tcp_stopped.drain();
      udp_stopped.drain();
    }
  }
  EXPECT_EQ(tcp.complete, kStreamFrames);
  EXPECT_EQ(tcp.client->counters().lost, 0U);
  EXPECT_EQ(tcp.client->counters().gaps, 0U);
  EXPECT_EQ(tcp.client->counters().crc_errors, 0U);
  if (udp_has_room) {
    EXPECT_EQ(udp.complete, kStreamFrames);
    EXPECT_EQ(udp.client->counters().lost, 0U);
    EXPECT_EQ(udp.client->counters().crc_errors, 0U);
    EXPECT_EQ(udp.client->counters().os_drops, 0U);
  }
  // The clients that stood still get the newest frames again, and every gap of the source's own is
  // announced.
  while (tcp_stopped.newest < kStreamFrames && tcp_stopped.take(kLongNs)) {
  }
  EXPECT_EQ(tcp_stopped.newest, kStreamFrames);
  EXPECT_GT(tcp_stopped.client->counters().skipped, 0U) << "it was stopped for long enough";
  EXPECT_EQ(tcp_stopped.client->counters().lost, 0U);
  EXPECT_EQ(tcp_stopped.client->counters().crc_errors, 0U);
  EXPECT_EQ(udp_stopped.client->counters().crc_errors, 0U);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

TEST(DaemonStream, AClientLearnsTheSpectralResponseOfItsBand) {
  ScratchFolder folder;
  folder.write("world.toml",
               "[atmosphere]\nenabled = false\n"
               "[[material]]\nname = \"concrete\"\nsolar_absorptance_frac = 0.6\n"
               "emissivity_frac = 0.9\nprescribed_k = 300.0\n"
               "[[band]]\nname = \"det\"\nresponse = [[3.0, 0.0], [4.1, 1.0], [5.5, 0.25]]\n"
               "[[channel]]\nname = \"a\"\nband = \"det\"\n"
               "[[channel]]\nname = \"b\"\nband = \"8-12\"\n");
  const std::string config = folder.write(
      "emitd.toml", "scenario = \"world.toml\"\n" + canned_config(64, 48, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  for (const bool det : {true, false}) {
    auto client = client::FrameClient::connect("tcp://" + daemon.control());
    ASSERT_TRUE(client.has_value()) << client.error().text;
    client::SubscribeOptions options;
    options.band = det ? "det" : "8-12";
    const auto channel = (*client)->subscribe(options);
    ASSERT_TRUE(channel.has_value()) << channel.error().text;
    ASSERT_TRUE(channel->response.has_value()) << "known, a rectangle included";
    const auto band = channel->spectral_band();
    ASSERT_TRUE(band.has_value());
    if (det) {
      ASSERT_EQ(band->response.size(), 3U);
      EXPECT_EQ(band->response[1].wavelength_um, 4.1);
      EXPECT_EQ(band->response[2].response_frac, 0.25);
      EXPECT_EQ(band->hi_um, 5.5);
    } else {
      EXPECT_TRUE(band->response.empty());
      EXPECT_EQ(band->lo_um, 8.0);
    }
    EXPECT_EQ((*client)->server().channels[0].response->size(), 3U);
  }
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

TEST(DaemonStream, AUdpClientThatWasBusyTakesAllTheFramesInItsSocket) {
  // The pause is a fifth of a second: forty small frames, which wait there whole.
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(64, 48, "mode = \"ig-clock\"\nrate_hz = 200.0"));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  Watcher watcher = Watcher::open("udp://" + daemon.control());
  ASSERT_NE(watcher.client, nullptr);
  // The receiver does not know before its first look how datagrams come.
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  ASSERT_TRUE(watcher.take(kLongNs));
  const std::uint64_t first = watcher.newest;
  while (watcher.newest < first + 200) {
    std::this_thread::sleep_for(std::chrono::milliseconds(watcher.newest % 50 == 0 ? 200 : 0));
    ASSERT_TRUE(watcher.take(kLongNs));
  }
  const auto& counters = watcher.client->counters();
  EXPECT_EQ(counters.bad_datagrams, 0U);
  EXPECT_EQ(counters.lost, counters.os_drops > 0 ? counters.lost : 0U);
  EXPECT_EQ(counters.received + counters.skipped + counters.lost, watcher.newest - first + 1);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
}

TEST(DaemonStream, AtItsOwn200HzNothingIsLostUnflagged) {
  ScratchFolder folder;
  const std::string config =
      folder.write("emitd.toml", canned_config(640, 512, "mode = \"ig-clock\"\nrate_hz = 200.0"));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const auto watch = [&](bool stops) {
    Watcher watcher = Watcher::open("tcp://" + daemon.control());
    if (!watcher.client) {
      return;
    }
    std::uint64_t first = 0;
    bool stopped = false;
    while (watcher.take(kLongNs)) {
      first = first == 0 ? watcher.newest : first;
      if (stops && !stopped && watcher.newest > first + kStreamFrames / 2) {
        stopped = true;
        std::this_thread::sleep_for(std::chrono::seconds(2));
      }
      if (watcher.newest >= first + kStreamFrames) {
        break;
      }
    }
    const auto& counters = watcher.client->counters();
    EXPECT_EQ(counters.lost, 0U);
    EXPECT_EQ(counters.crc_errors, 0U);
    EXPECT_EQ(counters.received + counters.skipped, watcher.newest - first + 1)
        << "received and announced skips account for every frame number";
    if (stops) {
      EXPECT_GT(counters.gaps, 0U);
    }
    RecordProperty(stops ? "stopped_gaps" : "gaps", static_cast<int>(counters.gaps));
  };
  std::thread stopping([&] { watch(true); });
  watch(false);
  stopping.join();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
}

}  // namespace
}  // namespace emit::server
