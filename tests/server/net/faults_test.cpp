// SPDX-License-Identifier: Apache-2.0
// Faults of the daemon's own machine: journal, device, clock. The tests run on a fake clock, step
// by step.
#include <gtest/gtest.h>

#include <fcntl.h>
#include <poll.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "agents/recorder/older_journal.hpp"
#include "agents/render/render_agent.hpp"
#include "app/daemon.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/host.pb.h"
#include "emit/v1/status.pb.h"
#include "net/socket.hpp"
#include "rt/fd.hpp"
#include "support/conductor_rig.hpp"
#include "support/daemon_process.hpp"
#include "telemetry/log.hpp"

namespace emit::server {
namespace {

using test::FakeClock;
using test::kMs;
using test::ScratchFolder;

std::uint64_t entries_of(const std::string& file) {
  auto log = protocol::LogReader::open(file);
  EXPECT_TRUE(log.has_value()) << log.error().text;
  std::uint64_t count = 0;
  while (log) {
    const auto more = log->next();
    EXPECT_TRUE(more.has_value()) << more.error().text;
    if (!more || !*more) {
      break;
    }
    ++count;
  }
  return count;
}

struct SteppedDaemon {
  explicit SteppedDaemon(const std::string& journal = {}) {
    config::DaemonConfig config;
    config.host.udp = "127.0.0.1:0";
    config.control.tcp = "127.0.0.1:0";
    config.journal.file = journal;
    DaemonOptions options;
    options.clock = &clock;
    options.stepped = true;
    options.source_factory = [this] {
      return physics::Result<std::unique_ptr<FrameSource>>(
          std::make_unique<test::ScriptedSource>(script, 8, 4, 7));
    };
    options.on_log = [this](const std::string& line) { log += line + "\n"; };
    auto created = Daemon::create(config, std::nullopt, options);
    EXPECT_TRUE(created.has_value()) << created.error().text;
    daemon = std::move(*created);
  }
  void settle() {
    while (daemon->step() > 0) {
    }
  }
  FakeClock clock;
  test::SourceScript script;
  std::string log;
  std::unique_ptr<Daemon> daemon;
};

TEST(Journal, IsInTheKernelsHandsSoonAfterItsLastLineThoughNothingMoreComes) {
  ScratchFolder folder;
  const std::string file = folder.file("journal.mcap");
  SteppedDaemon stepped(file);
  stepped.settle();
  EXPECT_EQ(entries_of(file), 0U) << "lines are collected";
  stepped.clock.advance(49 * kMs);
  stepped.settle();
  EXPECT_EQ(entries_of(file), 0U);
  stepped.clock.advance(1 * kMs);
  stepped.settle();
  EXPECT_EQ(entries_of(file), 1U) << "the start of the run";
}

TEST(Journal, AWallClockThatIsSetBackDoesNotStretchTheTimeItCollects) {
  ScratchFolder folder;
  const std::string file = folder.file("journal.mcap");
  SteppedDaemon stepped(file);
  stepped.settle();
  stepped.clock.step_wall(-500 * 1000 * kMs);
  stepped.clock.advance(50 * kMs);
  stepped.settle();
  EXPECT_EQ(entries_of(file), 1U);
}

TEST(Journal, OfAnEarlierProcessIsKept) {
  ScratchFolder folder;
  const std::string file = folder.file("journal.mcap");
  for (int process = 0; process < 3; ++process) {
    SteppedDaemon stepped(file);
    stepped.settle();
    EXPECT_EQ(stepped.log.find("event=journal_kept") != std::string::npos, process == 2)
        << "of the first there is nothing, of the second only the start of a run";
    if (process == 2) {
      break;
    }
    stepped.clock.advance(50 * kMs);
    stepped.settle();
    if (process == 1) {
      auto host = client::HostClient::connect("udp://127.0.0.1:" +
                                              std::to_string(stepped.daemon->host_udp_port()));
      ASSERT_TRUE(host.has_value()) << host.error().text;
      protocol::HostFrameData pose;
      pose.run_id = pose.frame_number = 1;
      ASSERT_TRUE((*host)->send(pose).has_value());
      for (int turn = 0; turn < 1000 && entries_of(file) < 3; ++turn) {
        stepped.settle();
        stepped.clock.advance(50 * kMs);
      }
      ASSERT_GE(entries_of(file), 3U);
    }
  }
  std::size_t kept = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path())) {
    if (entry.path() == file) {
      continue;
    }
    ++kept;
    const std::string name = entry.path().filename().string();
    EXPECT_TRUE(name.starts_with("journal.2") && name.ends_with("Z.mcap")) << name;
    EXPECT_GE(entries_of(entry.path()), 3U);
  }
  EXPECT_EQ(kept, 1U);
}

TEST(Journal, WhatIsNoLogIsKeptAsWell) {
  ScratchFolder folder;
  const std::filesystem::path file = folder.write("notes.txt", "not to be lost\n");
  const auto first = keep_older_journal(file);
  ASSERT_TRUE(first.has_value()) << first.error().text;
  EXPECT_FALSE(std::filesystem::exists(file));
  // A second journal has a change time in the same second.
  std::filesystem::copy_file(*first, file);
  std::filesystem::last_write_time(file, std::filesystem::last_write_time(*first));
  const auto second = keep_older_journal(file);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  EXPECT_EQ(second->filename(), first->stem().string() + "-2.txt");
  // A link leads to the log: its target is renamed, and the next one will be written beside it.
  const std::string link = folder.file("link.txt");
  std::filesystem::create_directory(folder.file("target"));
  folder.write("target/notes.txt", "nor this\n");
  std::filesystem::create_symlink("target/notes.txt", link);
  const auto third = keep_older_journal(link);
  ASSERT_TRUE(third.has_value()) << third.error().text;
  EXPECT_EQ(third->parent_path().filename(), "target");
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_FALSE(std::filesystem::exists(link));
  EXPECT_EQ(*keep_older_journal(link), "");
  EXPECT_EQ(*keep_older_journal(folder.file("none")), "");
  EXPECT_EQ(*keep_older_journal("/dev/null"), "");
}

TEST(Listener, OutOfDescriptorsIsToldAndAskedAgainAfterAWhile) {
  SteppedDaemon stepped;
  stepped.settle();
  SocketContext sockets;
  auto waiting = TcpSocket::connect(
      sockets, numeric_address("127.0.0.1", stepped.daemon->control_port()), 20'000'000'000);
  ASSERT_TRUE(waiting.has_value()) << waiting.error().text;
  rlimit before{};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const int next = ::dup(0);
  ASSERT_GE(next, 0);
  ::close(next);
  const rlimit none{static_cast<rlim_t>(next), before.rlim_max};
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const auto refused = [&] { return stepped.daemon->counter(Counter::refused_overloaded); };
  for (int turn = 0; turn < 5; ++turn) {
    stepped.settle();
    EXPECT_EQ(refused(), 1U) << "not asked while nothing can have changed";
  }
  stepped.clock.advance(100 * kMs);
  stepped.settle();
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_EQ(refused(), 2U);
  EXPECT_NE(stepped.log.find("Too many open files"), std::string::npos) << stepped.log;
  stepped.clock.advance(100 * kMs);
  stepped.settle();
  EXPECT_EQ(refused(), 2U);
  // The connection is served now. It has to end without a hello.
  stepped.clock.advance(5000 * kMs);
  stepped.settle();
  EXPECT_NE(stepped.log.find("no hello within 5 s"), std::string::npos) << stepped.log;
}

TEST(HostPort, AnswersNobodysAnswers) {
  SteppedDaemon stepped;
  stepped.settle();
  SocketContext sockets;
  auto socket = UdpSocket::open_bound(sockets, numeric_address("127.0.0.1", 0));
  ASSERT_TRUE(socket.has_value()) << socket.error().text;
  ASSERT_TRUE(
      socket->connect(numeric_address("127.0.0.1", stepped.daemon->host_udp_port())).has_value());
  const auto answered = [&](const std::string& said) {
    EXPECT_EQ(socket->send(std::as_bytes(std::span(said))).status, IoStatus::done);
    stepped.settle();
    std::array<char, 1024> answer{};
    return ::recv(socket->fd(), answer.data(), answer.size(), MSG_DONTWAIT) > 0;
  };
  EXPECT_TRUE(answered("x"));
  EXPECT_TRUE(answered(v1::HostFrame().SerializeAsString())) << "nothing filled in";
  for (int code = 1; code <= v1::Status::Code_MAX; ++code) {
    v1::Status status;
    status.set_code(static_cast<v1::Status::Code>(code));
    status.set_text("malformed message");
    status.set_host_frame_number(code % 2 == 0 ? 12 : 0);
    status.set_count(3);
    EXPECT_FALSE(answered(status.SerializeAsString())) << code;
  }
  EXPECT_EQ(stepped.daemon->counter(Counter::statuses_suppressed),
            static_cast<std::uint64_t>(v1::Status::Code_MAX));
  v1::HostFrame newer;
  newer.set_protocol_version(2);
  newer.set_frame_number(1);
  EXPECT_TRUE(answered(newer.SerializeAsString()));
}

std::unique_ptr<Log> log_to(const std::string& file) {
  config::LogConfig config;
  config.file = file;
  auto log = make_log(config);
  EXPECT_TRUE(log.has_value()) << log.error().text;
  return log ? std::move(*log) : nullptr;
}

TEST(Log, IsWrittenWhenItIsFinished) {
  ScratchFolder folder;
  const auto log = log_to(folder.file("log"));
  ASSERT_NE(log, nullptr);
  constexpr std::ptrdiff_t kLines = 2000;
  for (std::ptrdiff_t i = 0; i < kLines; ++i) {
    log->write(LogLevel::info, "event=test");
  }
  EXPECT_TRUE(log->finish(60'000 * kMs));
  EXPECT_EQ(std::ranges::count(folder.read("log"), '\n'), kLines);
  log->write(LogLevel::info, "event=late");
  EXPECT_TRUE(log->finish(0));
  EXPECT_EQ(std::ranges::count(folder.read("log"), '\n'), kLines);
}

TEST(Log, ThatNobodyReadsKeepsNobody) {
  ScratchFolder folder;
  const std::string pipe = folder.file("pipe");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const Fd reader(::open(pipe.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  ASSERT_TRUE(reader);
  auto log = log_to(pipe);
  ASSERT_NE(log, nullptr);
  constexpr std::ptrdiff_t kLines = 1000;
  for (std::ptrdiff_t i = 0; i < kLines; ++i) {
    log->write(LogLevel::info, std::string(4096, '.'));  // a pipe holds 1 MiB at most
  }
  EXPECT_FALSE(log->finish(10 * kMs));
  // The recorder's thread goes on until it closes the pipe, so the test reads until then.
  log.reset();
  std::array<char, 65536> bytes{};
  std::ptrdiff_t lines = 0;
  for (ssize_t count = 1; count > 0;) {
    pollfd wait{reader.get(), POLLIN, 0};
    ASSERT_EQ(::poll(&wait, 1, 20'000), 1);
    count = ::read(reader.get(), bytes.data(), bytes.size());
    ASSERT_GE(count, 0);
    lines += std::count(bytes.begin(), bytes.begin() + count, '\n');
  }
  EXPECT_EQ(lines, kLines);
}

TEST(ClockSteps, CostNoQuality) {
  test::ConductorRig rig([] {
    config::PacingConfig pacing;
    pacing.budget_ns = 12 * kMs;
    return pacing;
  }());
  rig.script.quality_levels = {{8.0, 0.0}, {3.0, 0.2}};
  for (std::uint64_t n = 1; n <= 60; ++n) {
    rig.script.ready = false;
    rig.send(n, static_cast<std::int64_t>(n) * kMs);
    rig.settle();
    if (n == 20) rig.clock.step_wall(1000 * kMs);
    if (n == 40) rig.clock.step_wall(-1000 * kMs);
    rig.clock.advance(8 * kMs);
    rig.script.ready = true;
    rig.settle();
    ASSERT_EQ(rig.frames.size(), n);
    EXPECT_EQ(rig.frames.back().header.quality_rung, 0U) << n;
  }
}

TEST(ClockSteps, AreCountedAndToldWithTheirSize) {
  SteppedDaemon stepped;
  stepped.settle();
  stepped.clock.advance(5000 * kMs);
  stepped.settle();
  EXPECT_EQ(stepped.daemon->counter(Counter::clock_steps), 0U) << "time passes";
  stepped.clock.step_wall(2500 * kMs);
  stepped.settle();
  stepped.clock.step_wall(-20 * kMs);
  stepped.settle();
  EXPECT_EQ(stepped.daemon->counter(Counter::clock_steps), 2U);
  EXPECT_NE(stepped.log.find("event=clock_step by_ms=2500.000"), std::string::npos) << stepped.log;
  EXPECT_NE(stepped.log.find("event=clock_step by_ms=-20.000"), std::string::npos);
}

TEST(Device, AFrameThatIsNeverDoneIsALostDeviceWhateverTheWallClockSays) {
  test::ConductorRig rig;
  rig.script.ready = false;
  rig.send(1, 0);
  rig.settle();
  rig.clock.step_wall(120'000 * kMs);
  rig.settle();
  EXPECT_FALSE(rig.context().device_lost.load()) << "no time has passed";
  rig.clock.advance(60'000 * kMs);
  rig.settle();
  EXPECT_FALSE(rig.context().device_lost.load()) << "a software renderer may take a minute";
  rig.clock.advance(1 * kMs);
  rig.settle();
  EXPECT_TRUE(rig.context().device_lost.load());
  rig.script.ready = true;
  rig.settle();
  EXPECT_TRUE(rig.frames.empty()) << "nothing is asked of a device that is lost";
}

}  // namespace
}  // namespace emit::server
