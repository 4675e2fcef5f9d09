// SPDX-License-Identifier: Apache-2.0
// Frames in shared memory, between real processes.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <map>
#include <string>
#include <thread>

#include "emit/client/client.hpp"
#include "support/daemon_process.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;

using emit::test::kLongNs;

std::string own_name(const char* what) {
  return std::string("system-") + what + "-" + std::to_string(::getpid());
}

std::string with_shm(const std::string& name, const std::string& pacing) {
  return canned_config(640, 512, pacing, "[stream]\nshm = \"" + name + "\"\n");
}

std::unique_ptr<client::FrameClient> subscribe(const std::string& url, bool in_place = false) {
  auto client = client::FrameClient::connect(url);
  EXPECT_TRUE(client.has_value()) << client.error().text;
  if (!client) {
    return nullptr;
  }
  client::SubscribeOptions options;
  options.in_place = in_place;
  const auto channel = (*client)->subscribe(options);
  EXPECT_TRUE(channel.has_value()) << channel.error().text;
  return std::move(*client);
}

/// A process that reads frames in place until it is killed.
class ReaderProcess {
 public:
  explicit ReaderProcess(const std::string& name) {
    int pair[2] = {-1, -1};
    EXPECT_EQ(::pipe(pair), 0);
    fd_ = pair[0];
    pid_ = ::fork();
    if (pid_ == 0) {
      const auto client = subscribe("shm://" + name, true);
      while (client != nullptr) {
        const auto frame = client->receive(kLongNs);
        if (!frame || *frame == nullptr) {
          break;
        }
        const char read = 'f';
        [[maybe_unused]] const auto told = ::write(pair[1], &read, 1);
      }
      ::_exit(1);
    }
    ::close(pair[1]);
  }
  ~ReaderProcess() {
    kill();
    ::close(fd_);
  }
  void wait_for_a_frame() const {
    char read = 0;
    EXPECT_EQ(::read(fd_, &read, 1), 1);
  }
  void stop() const { ::kill(pid_, SIGSTOP); }
  void kill() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
      pid_ = -1;
    }
  }

 private:
  pid_t pid_ = -1;
  int fd_ = -1;
};

TEST(DaemonShm, EveryTransportCarriesTheSameFramesWhileReadersStopAndCrash) {
  ScratchFolder folder;
  const std::string name = own_name("mixed");
  const std::string config = folder.write("emitd.toml", with_shm(name, "mode = \"host-step\""));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  ReaderProcess crashes(name);
  const ReaderProcess stops(name);
  const auto shm = subscribe("shm://" + name, true);
  const auto copying = subscribe("shm://" + name);
  const auto tcp = subscribe("tcp://" + daemon.control());
  const auto udp = subscribe("udp://" + daemon.control());
  ASSERT_TRUE(shm && copying && tcp && udp);
  EXPECT_EQ(shm->server().device, tcp->server().device);
  auto host = client::HostClient::connect("udp://" + daemon.host_udp());
  ASSERT_TRUE(host.has_value());

  // Every frame is taken before the next is requested, so missing frames were lost by emitd.
  constexpr std::uint64_t kFrames = 120;
  for (std::uint64_t k = 1; k <= kFrames; ++k) {
    protocol::HostFrameData pose;
    pose.frame_number = k;
    pose.run_id = 1;
    pose.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
    ASSERT_TRUE((*host)->send(pose).has_value());
    std::uint32_t crc32c = 0;
    for (client::FrameClient* client : {tcp.get(), shm.get(), copying.get(), udp.get()}) {
      if (client == udp.get() && !udp->receive_buffer_advice().empty()) {
        continue;
      }
      const auto frame = client->receive(kLongNs);
      ASSERT_TRUE(frame.has_value()) << frame.error().text;
      ASSERT_NE(*frame, nullptr) << "frame " << k << folder.read("stderr");
      EXPECT_EQ((*frame)->header.frame_number, k);
      EXPECT_EQ((*frame)->header.flags & ~protocol::kFlagTimeUnset,
                static_cast<std::uint32_t>(protocol::kFlagCanned));
      const std::uint32_t own = protocol::crc32c(std::as_bytes((*frame)->pixels));
      EXPECT_EQ(own, (*frame)->header.payload_crc32c);
      EXPECT_TRUE(client->intact());
      crc32c = client == tcp.get() ? own : crc32c;
      EXPECT_EQ(own, crc32c);
    }
    if (k == kFrames / 3) {
      crashes.wait_for_a_frame();
      crashes.kill();
      stops.wait_for_a_frame();
      stops.stop();
    }
  }
  for (const client::FrameClient* client : {shm.get(), copying.get(), tcp.get()}) {
    EXPECT_EQ(client->counters().received, kFrames);
    EXPECT_EQ(client->counters().lost + client->counters().gaps + client->counters().crc_errors,
              0U);
  }
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
  EXPECT_FALSE(shm->receive(kLongNs).has_value()) << "closed in order";
}

TEST(DaemonShm, AtItsOwn200HzWhatAReaderMissedIsAnnounced) {
  ScratchFolder folder;
  const std::string name = own_name("pace");
  const std::string config =
      folder.write("emitd.toml", with_shm(name, "mode = \"ig-clock\"\nrate_hz = 200.0"));
  DaemonProcess daemon(folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  const auto reader = subscribe("shm://" + name, true);
  ASSERT_NE(reader, nullptr);
  std::uint64_t first = 0;
  std::uint64_t newest = 0;
  for (int i = 0; i < 200; ++i) {
    const auto frame = reader->receive(kLongNs);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_NE(*frame, nullptr);
    newest = (*frame)->header.frame_number;
    first = first == 0 ? newest : first;
    if (i == 100) {
      std::this_thread::sleep_for(std::chrono::milliseconds(200));
    }
  }
  const auto& counters = reader->counters();
  EXPECT_EQ(counters.lost + counters.crc_errors, 0U);
  EXPECT_GT(counters.gaps, 0U) << "40 frames were overwritten while it slept";
  EXPECT_EQ(counters.received + counters.skipped, newest - first + 1)
      << "received and announced skips account for every frame number";
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
}

TEST(DaemonShm, AKilledDaemonIsNoticedAndItsSuccessorTakesTheNameOver) {
  ScratchFolder folder;
  const std::string name = own_name("kill");
  const std::string config =
      folder.write("emitd.toml", with_shm(name, "mode = \"ig-clock\"\nrate_hz = 100.0"));
  std::uint64_t run_id = 0;
  {
    DaemonProcess daemon(folder, {"--config", config});
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    const auto reader = subscribe("shm://" + name);
    ASSERT_NE(reader, nullptr);
    const auto frame = reader->receive(kLongNs);
    ASSERT_TRUE(frame.has_value() && *frame != nullptr);
    run_id = (*frame)->header.run_id;

    ScratchFolder second_folder;
    DaemonProcess second(second_folder, {"--config", config});
    EXPECT_EQ(second.wait(), 1);
    EXPECT_NE(second_folder.read("stderr").find("stream.shm"), std::string::npos)
        << second_folder.read("stderr");

    daemon.signal(SIGKILL);
    EXPECT_EQ(daemon.wait(), 128 + SIGKILL);
    for (;;) {
      const auto rest = reader->receive(kLongNs);
      if (!rest) {
        EXPECT_NE(rest.error().text.find("gone"), std::string::npos) << rest.error().text;
        break;
      }
      ASSERT_NE(*rest, nullptr);
    }
    EXPECT_FALSE(client::FrameClient::connect("shm://" + name).has_value());
  }
  ScratchFolder next_folder;
  DaemonProcess daemon(next_folder, {"--config", config});
  ASSERT_TRUE(daemon.wait_ready()) << next_folder.read("stderr");
  const auto reader = subscribe("shm://" + name);
  ASSERT_NE(reader, nullptr);
  const auto frame = reader->receive(kLongNs);
  ASSERT_TRUE(frame.has_value() && *frame != nullptr);
  EXPECT_NE((*frame)->header.run_id, run_id);
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0);
}

}  // namespace
}  // namespace emit::server
