// SPDX-License-Identifier: Apache-2.0
// What the daemon does about its own machine: journal, device, clock. On a fake clock, step by
// step.
#include <gtest/gtest.h>

#include <memory>
#include <string>

#include "agents/render_agent.hpp"
#include "app/daemon.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "support/conductor_rig.hpp"
#include "support/daemon_process.hpp"

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
