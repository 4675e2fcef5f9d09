// SPDX-License-Identifier: Apache-2.0
// Messages to the service manager, and settings that are asked of the host.
#include <gtest/gtest.h>
#include <sched.h>

#include <string>
#include <thread>
#include <vector>

#include "app/service_health.hpp"
#include "host/realtime.hpp"
#include "support/daemon_process.hpp"
#include "support/notify_socket.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using emit::test::kSecondNs;
using test::NotifySocket;

TEST(ServiceNotifier, TellsByPathAndByAbstractName) {
  test::ScratchFolder folder;
  for (const std::string& address :
       {folder.file("notify"), "@emitd-test-" + std::to_string(::getpid())}) {
    NotifySocket manager(address);
    ASSERT_TRUE(manager.bound()) << address;
    const ServiceNotifier notifier(address, 0);
    EXPECT_TRUE(notifier.active());
    notifier.status("warming\nup", 5);
    notifier.ready("ready");
    notifier.stopping();
    EXPECT_EQ(manager.next(), "STATUS=warming up\nEXTEND_TIMEOUT_USEC=5000000");
    EXPECT_EQ(manager.next(), "STATUS=ready");
    EXPECT_EQ(manager.next(), "READY=1");
    EXPECT_EQ(manager.next(), "STOPPING=1\nSTATUS=stopping");
    EXPECT_EQ(manager.next(), "");
  }
}

TEST(ServiceNotifier, IsSilentWithoutASoundAddress) {
  for (const std::string& address : {std::string(), std::string("/"), std::string("relative"),
                                     std::string("/absent/notify"), "/" + std::string(200, 'x')}) {
    const ServiceNotifier notifier(address, kSecondNs);
    EXPECT_FALSE(notifier.active()) << address;
    EXPECT_EQ(notifier.watchdog_ns(), 0);
    notifier.ready("nobody hears");
  }
}

TEST(ServiceHealth, TellsThatItLivesWhileEveryAgentTurns) {
  test::ScratchFolder folder;
  NotifySocket manager(folder.file("notify"));
  const ServiceNotifier notifier(folder.file("notify"), 20 * kSecondNs);
  ServiceHealth health(notifier);
  DutyCycle sender;
  DutyCycle render;
  const NamedDutyCycles agents{{"sender", &sender}, {"render", &render}};
  std::int64_t now_ns = 100 * kSecondNs;
  const auto turn = [&](std::int64_t after_ns) {
    now_ns += after_ns;
    return std::string(health.turn(agents, now_ns));
  };
  EXPECT_EQ(turn(0), "") << "no agent has begun: nothing is expected of it";
  EXPECT_EQ(manager.next(), "WATCHDOG=1");
  sender.beat(now_ns);
  render.beat(now_ns);
  EXPECT_EQ(turn(kSecondNs), "");
  EXPECT_EQ(manager.next(), "") << "a quarter of the time is soon enough";
  EXPECT_EQ(turn(5 * kSecondNs), "");
  EXPECT_EQ(manager.next(), "WATCHDOG=1");
  sender.beat(now_ns);
  EXPECT_EQ(turn(14 * kSecondNs), "");
  EXPECT_EQ(manager.next(), "WATCHDOG=1");
  EXPECT_EQ(turn(kSecondNs), "render") << "not heard of for 21 s, although the sender turns";
  EXPECT_EQ(turn(5 * kSecondNs), "") << "said once";
  EXPECT_EQ(manager.next(), "") << "the manager is left to act";
  sender.beat(now_ns);
  render.beat(now_ns);
  EXPECT_EQ(turn(kSecondNs), "");
  EXPECT_EQ(manager.next(), "WATCHDOG=1");
}

TEST(ServiceHealth, TellsEachPercentOfTheWarmUpOnce) {
  test::ScratchFolder folder;
  NotifySocket manager(folder.file("notify"));
  const ServiceNotifier notifier(folder.file("notify"), 0);
  ServiceHealth health(notifier);
  for (const double done : {0.0, 0.004, 0.5, 0.501}) EXPECT_TRUE(health.warming_up(done));
  EXPECT_EQ(manager.next(), "STATUS=warming up: 0 %\nEXTEND_TIMEOUT_USEC=300000000");
  EXPECT_EQ(manager.next(), "STATUS=warming up: 50 %\nEXTEND_TIMEOUT_USEC=300000000");
  EXPECT_EQ(manager.next(), "");
}

TEST(AgentCpus, AreReadStrictly) {
  const auto cpus = config::parse_agent_cpus(" conductor=2, render=4-7 ,sender=0");
  ASSERT_TRUE(cpus.has_value()) << cpus.error().text;
  ASSERT_EQ(cpus->size(), 3U);
  EXPECT_EQ((*cpus)[1].agent, "render");
  EXPECT_EQ((*cpus)[1].cpus, (std::vector<std::uint32_t>{4, 5, 6, 7}));
  EXPECT_EQ((*cpus)[2].cpus, std::vector<std::uint32_t>{0});
  EXPECT_TRUE(config::parse_agent_cpus("")->empty());
  for (const char* bad :
       {"conductor", "pilot=1", "conductor=", "conductor=x", "conductor=3-2", "conductor=1024",
        "conductor=1,conductor=2", "conductor=1-", "conductor=-1", "conductor=99999999999"}) {
    const auto refused = config::parse_agent_cpus(bad);
    ASSERT_FALSE(refused.has_value()) << bad;
    EXPECT_EQ(refused.error().code, physics::ErrorCode::config);
  }
}

TEST(Realtime, PlansAgentsByTheOneKey) {
  config::RealtimeConfig config;
  EXPECT_FALSE(thread_realtime(config, "conductor").fifo) << "off by default";
  EXPECT_TRUE(ask_for_realtime(config).items().empty()) << "nothing asked, nothing told";
  config.scheduler = config::SchedulerKind::fifo;
  config.priority = 20;
  config.cpus = "recorder=1, sender=0";
  EXPECT_EQ(thread_realtime(config, "conductor").priority, 20);
  EXPECT_EQ(thread_realtime(config, "receiver").priority, 19);
  EXPECT_EQ(thread_realtime(config, "sender").priority, 18);
  EXPECT_EQ(thread_realtime(config, "render").priority, 17);
  EXPECT_FALSE(thread_realtime(config, "recorder").fifo) << "it writes files";
  EXPECT_EQ(thread_realtime(config, "recorder").cpus, std::vector<std::uint32_t>{1});
  EXPECT_TRUE(thread_realtime(config, "render").cpus.empty());
}

TEST(Realtime, PinsAThreadAndTellsWhatIsRefused) {
  cpu_set_t allowed;
  CPU_ZERO(&allowed);
  ASSERT_EQ(::sched_getaffinity(0, sizeof allowed, &allowed), 0);
  std::uint32_t first = 0;
  while (CPU_ISSET(first, &allowed) == 0) ++first;
  config::RealtimeConfig config;
  config.cpus = "sender=" + std::to_string(first) + ", render=1023";
  std::thread([&] {
    ASSERT_EQ(apply_before_start(thread_realtime(config, "sender")), 0);
    cpu_set_t mine;
    CPU_ZERO(&mine);
    ASSERT_EQ(::sched_getaffinity(0, sizeof mine, &mine), 0);
    EXPECT_EQ(CPU_COUNT(&mine), 1);
    EXPECT_NE(CPU_ISSET(first, &mine), 0);
  }).join();
  const RealtimeReport report = ask_for_realtime(config);
  ASSERT_EQ(report.items().size(), 2U);
  EXPECT_TRUE(report.items()[0].granted);
  EXPECT_EQ(report.items()[0].agent, "sender");
  EXPECT_FALSE(report.items()[1].granted);
  EXPECT_NE(report.refusals().find("cpus of render: "), std::string::npos) << report.refusals();
  EXPECT_EQ(report.refusals().find("sender"), std::string::npos);
}

}  // namespace
}  // namespace emit::server
