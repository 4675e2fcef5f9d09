// SPDX-License-Identifier: Apache-2.0
// Processes that end without a word, disks that are full, devices that are lost.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <filesystem>
#include <memory>
#include <mutex>
#include <random>
#include <set>
#include <thread>
#include <vector>

#include "app/daemon.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "rt/clock.hpp"
#include "support/daemon_process.hpp"
#include "support/emit_process.hpp"
#include "support/scripted_source.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::canned_config;
using test::DaemonProcess;
using test::ScratchFolder;
using test::ToolProcess;
using namespace std::chrono_literals;

using emit::test::kLongNs;
constexpr std::int64_t kMayBeLostNs = 100'000'000;
constexpr int kKills = 20;

/// Receives frames of a daemon and answers each with a pose. It notes each frame with its instant
/// of arrival.
class Witness {
 public:
  explicit Witness(const DaemonProcess& daemon) {
    auto client = client::FrameClient::connect("tcp://" + daemon.control());
    auto host = client::HostClient::connect("udp://" + daemon.host_udp());
    EXPECT_TRUE(client.has_value() && host.has_value());
    client_ = std::move(*client);
    host_ = std::move(*host);
    EXPECT_TRUE(client_->subscribe({}).has_value());
    thread_ = std::thread([this] { run(); });
  }
  ~Witness() {
    over_.store(true);
    thread_.join();
  }
  Witness(const Witness&) = delete;
  Witness& operator=(const Witness&) = delete;

  [[nodiscard]] bool wait_for(std::size_t frames) {
    for (int i = 0; i < 3000 && count() < frames; ++i) std::this_thread::sleep_for(10ms);
    return count() >= frames;
  }
  /// Returns the numbers of the newest run's frames that had arrived by then.
  [[nodiscard]] std::vector<std::uint64_t> seen_by(std::int64_t tai_ns) {
    const std::lock_guard lock(mutex_);
    std::vector<std::uint64_t> out;
    for (const auto& frame : frames_) {
      if (frame.run_id == frames_.back().run_id && frame.here_ns <= tai_ns) {
        out.push_back(frame.number);
      }
    }
    return out;
  }

 private:
  struct Frame {
    std::uint64_t run_id = 0;
    std::uint64_t number = 0;
    std::int64_t here_ns = 0;
  };
  [[nodiscard]] std::size_t count() {
    const std::lock_guard lock(mutex_);
    return frames_.size();
  }
  void run() {
    std::uint64_t poses = 0;
    while (!over_.load()) {
      const auto frame = client_->receive(50'000'000);
      if (!frame) return;  // killed
      if (*frame == nullptr) continue;
      {
        const std::lock_guard lock(mutex_);
        frames_.push_back(
            {(*frame)->header.run_id, (*frame)->header.frame_number, (*frame)->last_byte_ns});
      }
      protocol::HostFrameData pose;
      pose.run_id = 1;
      pose.frame_number = ++poses;
      pose.sim_time_ns = static_cast<std::int64_t>(poses) * 5'000'000;
      static_cast<void>(host_->send(pose));
    }
  }

  std::unique_ptr<client::FrameClient> client_;
  std::unique_ptr<client::HostClient> host_;
  std::atomic<bool> over_{false};
  std::mutex mutex_;
  std::vector<Frame> frames_;
  std::thread thread_;
};

/// Waits. It returns false when this machine stood still meanwhile, so that the instant proves
/// nothing.
bool wait_evenly(std::chrono::milliseconds time) {
  const auto end = std::chrono::steady_clock::now() + time;
  auto last = std::chrono::steady_clock::now();
  auto longest = std::chrono::steady_clock::duration::zero();
  while (last < end) {
    std::this_thread::sleep_for(2ms);
    const auto now = std::chrono::steady_clock::now();
    longest = std::max(longest, now - last);
    last = now;
  }
  return longest < 25ms;
}

/// Contents of a log: frames of the newest run, and whether the lines before the cut are complete.
struct LogContents {
  std::set<std::uint64_t> frames;
  std::uint64_t entries = 0;
  std::uint64_t host_frames = 0;
  std::string fault;
};

LogContents read_log(const std::string& file) {
  LogContents out;
  auto log = protocol::LogReader::open(file);
  if (!log) {
    out.fault = log.error().text;
    return out;
  }
  std::uint64_t sequence = 0;
  for (;;) {
    const auto more = log->next();
    if (!more) {
      out.fault = more.error().text;
      return out;
    }
    if (!*more) {
      return out;
    }
    const v1::JournalEntry& entry = log->journal();
    if (sequence != 0 && entry.sequence() != sequence + 1) {
      out.fault = "a hole behind entry " + std::to_string(sequence);
    }
    sequence = entry.sequence();
    ++out.entries;
    out.host_frames += entry.has_host_frame() ? 1U : 0U;
    if (entry.has_run_start()) {
      out.frames.clear();
    } else if (entry.has_frame()) {
      out.frames.insert(entry.frame().frame_number());
    }
  }
}

void expect_complete(const LogContents& log, const std::vector<std::uint64_t>& published) {
  EXPECT_EQ(log.fault, "");
  ASSERT_FALSE(published.empty());
  for (const std::uint64_t number : published) {
    ASSERT_TRUE(log.frames.count(number) != 0)
        << "frame " << number << " of " << published.back() << " is missing; the log ends with "
        << (log.frames.empty() ? 0 : *log.frames.rbegin());
  }
}

TEST(Crash, AKilledDaemonLeavesAJournalWithAllButTheLast100Ms) {
  constexpr std::uint32_t kSeed = 20260705;
  std::mt19937 random(kSeed);
  std::uniform_int_distribution<int> wait_ms(120, 420);
  SystemClock clock;
  int judged = 0;
  for (int attempt = 0; attempt < 4 * kKills && judged < kKills; ++attempt) {
    ScratchFolder folder;
    const std::string journal = folder.file("journal.mcap");
    DaemonProcess daemon(
        folder,
        {"--config",
         folder.write("emitd.toml", canned_config(64, 48, "mode = \"ig-clock\"\nrate_hz = 200",
                                                  "[journal]\nfile = \"" + journal + "\"\n"))});
    ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
    Witness witness(daemon);
    ASSERT_TRUE(witness.wait_for(5));
    const int instant_ms = wait_ms(random);
    SCOPED_TRACE("seed " + std::to_string(kSeed) + ", killed after " + std::to_string(instant_ms) +
                 " ms");
    const bool even = wait_evenly(std::chrono::milliseconds(instant_ms));
    const std::int64_t killed_ns = clock.tai_ns();
    daemon.signal(SIGKILL);
    ASSERT_EQ(daemon.wait(), 128 + SIGKILL);
    const LogContents log = read_log(journal);
    EXPECT_EQ(log.fault, "");
    if (!even) continue;
    ++judged;
    ASSERT_NO_FATAL_FAILURE(expect_complete(log, witness.seen_by(killed_ns - kMayBeLostNs)));
    EXPECT_GT(log.host_frames, 0U);
  }
  EXPECT_EQ(judged, kKills) << "this machine stands still too often";
}

TEST(Crash, AKilledRecorderLeavesALogWithAllButTheLast100Ms) {
  constexpr std::uint32_t kSeed = 20260706;
  std::mt19937 random(kSeed);
  std::uniform_int_distribution<int> wait_ms(120, 420);
  SystemClock clock;
  ScratchFolder folder;
  DaemonProcess daemon(folder,
                       {"--config", folder.write("emitd.toml", canned_config(64, 48,
                                                                             "mode = \"ig-clock\"\n"
                                                                             "rate_hz = 200"))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  Witness witness(daemon);
  ASSERT_TRUE(witness.wait_for(5));
  int judged = 0;
  for (int attempt = 0; attempt < 4 * kKills && judged < kKills; ++attempt) {
    const std::string out = folder.file("log" + std::to_string(attempt) + ".mcap");
    ToolProcess recorder(folder, "record",
                         {"record", "--from", "tcp://" + daemon.control(), "--out", out});
    const auto begun = [&] {
      std::error_code error;
      const auto bytes = std::filesystem::file_size(out, error);
      return !error && bytes > 16384;  // more than what stands in front of the first entry
    };
    for (int i = 0; i < 6000 && !begun(); ++i) std::this_thread::sleep_for(5ms);
    ASSERT_TRUE(begun()) << recorder.err();
    const int instant_ms = wait_ms(random);
    SCOPED_TRACE("seed " + std::to_string(kSeed) + ", killed after " + std::to_string(instant_ms) +
                 " ms");
    const bool even = wait_evenly(std::chrono::milliseconds(instant_ms));
    const std::int64_t killed_ns = clock.tai_ns();
    recorder.signal(SIGKILL);
    ASSERT_EQ(recorder.wait(), 128 + SIGKILL);
    const LogContents log = read_log(out);
    EXPECT_EQ(log.fault, "");
    if (!even) continue;
    ++judged;
    ASSERT_NO_FATAL_FAILURE(expect_complete(log, witness.seen_by(killed_ns - kMayBeLostNs)));
    EXPECT_GT(log.host_frames, 0U);
  }
  EXPECT_EQ(judged, kKills) << "this machine stands still too often";
}

TEST(Crash, AReceiverGoesOnByItselfWithTheNextDaemon) {
  ScratchFolder first_folder;
  const std::string name = "crash-" + std::to_string(::getpid());
  const std::string text = canned_config(64, 48, "mode = \"ig-clock\"\nrate_hz = 100",
                                         "[stream]\nshm = \"" + name + "\"\n");
  auto first = std::make_unique<DaemonProcess>(
      first_folder, std::vector<std::string>{"--config", first_folder.write("emitd.toml", text)});
  ASSERT_TRUE(first->wait_ready()) << first_folder.read("stderr");
  const std::string control = first->control();
  ScratchFolder folder;
  std::vector<std::unique_ptr<ToolProcess>> receivers;
  for (const std::string& url : {"tcp://" + control, "udp://" + control, "shm://" + name}) {
    const std::string label = url.substr(0, 3);
    receivers.push_back(std::make_unique<ToolProcess>(
        folder, label,
        std::vector<std::string>{"receive", url, "--reconnect", "--timeout-s", "60", "--json",
                                 folder.file(label + ".json")}));
    ASSERT_TRUE(receivers.back()->says("channel 0")) << receivers.back()->err();
  }
  {
    Witness witness(*first);
    ASSERT_TRUE(witness.wait_for(30));  // so that the receivers had some too
    first->signal(SIGKILL);
    ASSERT_EQ(first->wait(), 128 + SIGKILL);
  }
  ScratchFolder second_folder;
  DaemonProcess second(second_folder, {"--config", second_folder.write("emitd.toml", text), "--set",
                                       "control.tcp=\"" + control + "\""});
  ASSERT_TRUE(second.wait_ready()) << second_folder.read("stderr");
  for (auto& receiver : receivers) {
    ASSERT_TRUE(receiver->says("channel 0", 2)) << receiver->err();
  }
  Witness witness(second);
  ASSERT_TRUE(witness.wait_for(30));
  for (auto& receiver : receivers) {
    receiver->signal(SIGINT);
    // A frame that the end of the first daemon cuts off may be partial over UDP, and is counted.
    const int code = receiver->wait();
    EXPECT_TRUE(code == 0 || (code == 1 && &receiver == &receivers[1])) << receiver->err();
  }
  for (const char* label : {"tcp", "udp", "shm"}) {
    const std::string json = folder.read(std::string(label) + ".json");
    EXPECT_EQ(test::json_value(json, "reconnects"), "1") << label << json;
    EXPECT_EQ(test::json_value(json, "runs"), "2") << label;
    EXPECT_EQ(test::json_value(json, "lost"), "0") << label;
    EXPECT_EQ(test::json_value(json, "unflagged_gaps"), "0") << label;
  }
  second.signal(SIGTERM);
  EXPECT_EQ(second.wait(), 0);
}

TEST(Crash, WithoutReconnectTheEndOfTheDaemonIsTheEnd) {
  ScratchFolder folder;
  DaemonProcess daemon(folder,
                       {"--config", folder.write("emitd.toml", canned_config(64, 48,
                                                                             "mode = \"ig-clock\"\n"
                                                                             "rate_hz = 100"))});
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  ToolProcess receiver(folder, "receive",
                       {"receive", "tcp://" + daemon.control(), "--frames", "1000000"});
  ASSERT_TRUE(receiver.says("channel 0")) << receiver.err();
  daemon.signal(SIGKILL);
  EXPECT_EQ(receiver.wait(), 1);
  EXPECT_NE(receiver.err().find("of 1000000 frames received"), std::string::npos) << receiver.err();
}

TEST(Crash, AFullDiskEndsTheJournalLoudlyAndNoFrame) {
  constexpr rlim_t kDiskBytes = 600 << 10;  // some chunks, which hold 256 KiB at most
  constexpr std::uint64_t kFrames = 3000;
  ScratchFolder folder;
  const std::string journal = folder.file("journal.mcap");
  DaemonProcess daemon(
      folder,
      {"--config",
       folder.write("emitd.toml", canned_config(64, 48, "mode = \"host-step\"",
                                                "[journal]\nfile = \"" + journal + "\"\n"))},
      kDiskBytes);
  ASSERT_TRUE(daemon.wait_ready()) << folder.read("stderr");
  ToolProcess recorder(
      folder, "record",
      {"record", "--from", "tcp://" + daemon.control(), "--out", folder.file("record.mcap")},
      kDiskBytes);
  for (int i = 0; i < 6000 && !std::filesystem::exists(folder.file("record.mcap")); ++i) {
    std::this_thread::sleep_for(5ms);  // it is made once the recorder is connected
  }
  auto client = client::FrameClient::connect("tcp://" + daemon.control());
  auto host = client::HostClient::connect("tcp://" + daemon.control());
  ASSERT_TRUE(client.has_value() && host.has_value());
  ASSERT_TRUE((*client)->subscribe({}).has_value());
  for (std::uint64_t k = 1; k <= kFrames; ++k) {
    protocol::HostFrameData frame;
    frame.run_id = 1;
    frame.frame_number = k;
    frame.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
    ASSERT_TRUE((*host)->send(frame).has_value());
    const auto received = (*client)->receive(kLongNs);
    ASSERT_TRUE(received.has_value() && *received != nullptr) << k;
    ASSERT_EQ((*received)->header.frame_number, k);
  }
  EXPECT_EQ(recorder.wait(), 1);
  EXPECT_NE(recorder.err().find("record.mcap"), std::string::npos) << recorder.err();
  daemon.signal(SIGTERM);
  EXPECT_EQ(daemon.wait(), 0) << folder.read("stderr");
  const std::string log = folder.read("stderr");
  EXPECT_NE(log.find("event=journal_failed"), std::string::npos) << log;
  EXPECT_NE(log.find("journal.mcap"), std::string::npos) << "names the file";
  EXPECT_NE(log.find(" journal_errors=1"), std::string::npos) << log;
  const auto counted = [&](const std::string& name) {
    const std::size_t at = log.find(" " + name + "=");
    return at == std::string::npos ? 0 : std::stoull(log.substr(at + name.size() + 2));
  };
  constexpr std::uint64_t kEntries = 1 + 2 * kFrames;  // the start, host frames and frames
  EXPECT_EQ(counted("journal_entries"), read_log(journal).entries);
  EXPECT_EQ(counted("journal_entries") + counted("journal_dropped"), kEntries);
  for (const char* name : {"journal.mcap", "record.mcap"}) {
    const LogContents contents = read_log(folder.file(name));
    EXPECT_EQ(contents.fault, "") << name;
    EXPECT_GT(contents.frames.size(), 20U) << name;
    EXPECT_LT(contents.frames.size(), kFrames) << name;
  }
}

/// A daemon in this process whose device is the test's.
class LostDevice : public ::testing::Test {
 protected:
  void start(const std::string& journal = {}) {
    config::DaemonConfig config;
    config.host.udp = "127.0.0.1:0";
    config.control.tcp = "127.0.0.1:0";
    config.journal.file = journal;
    DaemonOptions options;
    options.source_factory = [this] {
      return physics::Result<std::unique_ptr<FrameSource>>(
          std::make_unique<test::ScriptedSource>(script_, 32, 16, 7));
    };
    options.on_log = [this](const std::string& line) { log_ += line + "\n"; };
    auto created = Daemon::create(config, std::nullopt, options);
    ASSERT_TRUE(created.has_value()) << created.error().text;
    daemon_ = std::move(*created);
    thread_ = std::thread([this] { code_ = daemon_->run(); });
    const std::string url = "tcp://127.0.0.1:" + std::to_string(daemon_->control_port());
    auto client = client::FrameClient::connect(url);
    auto host = client::HostClient::connect(url);
    ASSERT_TRUE(client.has_value() && host.has_value());
    client_ = std::move(*client);
    host_ = std::move(*host);
    ASSERT_TRUE(client_->subscribe({}).has_value());
  }
  void TearDown() override {
    if (thread_.joinable()) {
      daemon_->request_stop();
      thread_.join();
    }
  }
  /// Returns the next frame; null: the stream ended.
  const client::ReceivedFrame* step() {
    protocol::HostFrameData frame;
    frame.run_id = 1;
    frame.frame_number = ++number_;
    frame.sim_time_ns = static_cast<std::int64_t>(number_) * 5'000'000;
    if (!host_->send(frame)) {
      return nullptr;
    }
    const auto received = client_->receive(kLongNs);
    return received ? *received : nullptr;
  }

  test::SourceScript script_;
  std::string log_;
  std::unique_ptr<Daemon> daemon_;
  std::thread thread_;
  int code_ = -1;
  std::unique_ptr<client::FrameClient> client_;
  std::unique_ptr<client::HostClient> host_;
  std::uint64_t number_ = 0;
};

TEST_F(LostDevice, EndsTheDaemonWithACodeOfItsOwnAfterWhatWasRenderedIsSentAndInTheJournal) {
  ScratchFolder folder;
  ASSERT_NO_FATAL_FAILURE(start(folder.file("journal.mcap")));
  for (int i = 0; i < 5; ++i) {
    ASSERT_NE(step(), nullptr);
  }
  script_.device_lost.store(true);
  const client::ReceivedFrame* last = step();
  ASSERT_NE(last, nullptr) << "the frame whose device is lost goes out, flagged";
  EXPECT_NE(last->header.flags & protocol::kFlagDegraded, 0U);
  thread_.join();
  EXPECT_EQ(code_, kExitDeviceLost);
  EXPECT_FALSE(client_->receive(kLongNs).has_value()) << "clients see the end";
  EXPECT_NE(log_.find("event=device_lost"), std::string::npos) << log_;
  const LogContents journal = read_log(folder.file("journal.mcap"));
  EXPECT_EQ(journal.fault, "");
  EXPECT_EQ(journal.frames.size(), 6U);
}

TEST_F(LostDevice, IsNotTheSameAsErrorsThatPass) {
  ASSERT_NO_FATAL_FAILURE(start());
  for (int round = 0; round < 3; ++round) {
    script_.device_failed.store(true);
    for (int i = 0; i < 29; ++i) {
      const client::ReceivedFrame* frame = step();
      ASSERT_NE(frame, nullptr);
      EXPECT_NE(frame->header.flags & protocol::kFlagDegraded, 0U);
    }
    script_.device_failed.store(false);
    const client::ReceivedFrame* good = step();
    ASSERT_NE(good, nullptr);
    EXPECT_EQ(good->header.flags & protocol::kFlagDegraded, 0U);
  }
  EXPECT_EQ(daemon_->counter(Counter::device_failures), 87U);
  script_.device_failed.store(true);
  for (int i = 0; i < 30; ++i) {
    static_cast<void>(step());
  }
  thread_.join();
  EXPECT_EQ(code_, kExitDeviceLost) << "errors that do not pass are a lost device";
}

}  // namespace
}  // namespace emit::server
