// SPDX-License-Identifier: Apache-2.0
// `emit doctor` judges a good machine, the same with one thing wrong at a time, and files of a
// kernel that the test writes.
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "support/emit_process.hpp"
#include "tool/doctor/findings.hpp"

namespace emit::tool {
namespace {

using test::TemporaryFolder;
using test::write_text;

MachineFacts good_machine() {
  MachineFacts facts;
  facts.graphics = {{"GPU / 4.6", true, false}, {"llvmpipe / 4.5", true, true}};
  facts.data = {"/usr/share/emit"};
  facts.cores = 16;
  facts.memory_bytes = 16ULL << 30;
  facts.shm_bytes = 8ULL << 30;
  facts.may_use_fifo = true;
  facts.open_files = 8192;
  facts.rt_runtime_us = 950'000;
  facts.rmem_max_bytes = facts.wmem_max_bytes = 64ULL << 20;
  facts.congestion_control = "cubic";
  facts.networks = {"eth0"};
  facts.governors = {"performance"};
  facts.isolated_cores = "2-3";
  facts.preempt_rt = true;
  facts.kernel = "6.1.0-rt";
  facts.huge_pages = "madvise";
  facts.ptp4l = true;
  facts.clock_source = "tsc";
  facts.tai_offset_s = 37;
  return facts;
}

/// Items that do not pass.
std::vector<std::string> wrong_in(const MachineFacts& facts, Severity least,
                                  const DoctorNeeds& needs = {}) {
  std::vector<std::string> out;
  for (const Finding& each : findings_of(facts, needs)) {
    EXPECT_EQ(each.remedy.empty(), each.severity == Severity::pass) << each.item;
    EXPECT_FALSE(each.found.empty()) << each.item;
    if (each.severity >= least) out.push_back(each.item);
  }
  return out;
}

using Items = std::vector<std::string>;

TEST(DoctorFindings, AGoodMachinePasses) {
  EXPECT_EQ(wrong_in(good_machine(), Severity::warn, {.real_time = true}), Items{});
}

TEST(DoctorFindings, EveryFaultIsFoundAloneWithItsRemedy) {
  struct Fault {
    const char* item;
    Severity usual;
    Severity real_time;
    std::function<void(MachineFacts&)> make;
  };
  constexpr Severity kWarn = Severity::warn;
  constexpr Severity kFail = Severity::fail;
  const std::vector<Fault> faults{
      {"EGL device", kFail, kFail, [](MachineFacts& m) { m.graphics.clear(); }},
      {"device.gpu_index 0", kWarn, kWarn,
       [](MachineFacts& m) {
         m.graphics = {{"llvmpipe / 4.5", true, true}};
       }},
      {"device.gpu_index 0", kWarn, kWarn,
       [](MachineFacts& m) {
         m.graphics[0] = {"no 4.5 context", false, false};
         m.graphics.push_back({"other / 4.6", true, false});
       }},
      {"device.gpu_index 0", kFail, kFail,
       [](MachineFacts& m) {
         m.graphics = {{"no 4.5 context", false, false}};
       }},
      {"shipped data", kFail, kFail, [](MachineFacts& m) { m.data.clear(); }},
      {"memory", kWarn, kWarn, [](MachineFacts& m) { m.memory_bytes = 1ULL << 30; }},
      {"/dev/shm", kWarn, kWarn, [](MachineFacts& m) { m.shm_bytes = 1ULL << 20; }},
      {"/dev/shm", kWarn, kWarn, [](MachineFacts& m) { m.shm_bytes.reset(); }},
      {"RLIMIT_NOFILE", kWarn, kWarn, [](MachineFacts& m) { m.open_files = 256; }},
      {"RLIMIT_RTPRIO", kWarn, kFail, [](MachineFacts& m) { m.may_use_fifo = false; }},
      {"RLIMIT_MEMLOCK", kWarn, kFail, [](MachineFacts& m) { m.memlock_bytes = 65536; }},
      {"sched_rt_runtime_us", kWarn, kFail, [](MachineFacts& m) { m.rt_runtime_us = 0; }},
      {"network", kWarn, kWarn, [](MachineFacts& m) { m.networks.clear(); }},
      {"net.core.rmem_max", kWarn, kWarn, [](MachineFacts& m) { m.rmem_max_bytes = 212'992; }},
      {"net.core.wmem_max", kWarn, kWarn, [](MachineFacts& m) { m.wmem_max_bytes.reset(); }},
      {"TCP congestion control", kWarn, kWarn,
       [](MachineFacts& m) { m.congestion_control = "bbr"; }},
      {"cores", kWarn, kWarn, [](MachineFacts& m) { m.cores = 2; }},
      {"CPU governor", kWarn, kWarn, [](MachineFacts& m) { m.governors.push_back("powersave"); }},
      {"isolated cores", kWarn, kWarn, [](MachineFacts& m) { m.isolated_cores.clear(); }},
      {"C-states", kWarn, kWarn, [](MachineFacts& m) { m.slow_sleep_states = 2; }},
      {"PREEMPT_RT", kWarn, kWarn, [](MachineFacts& m) { m.preempt_rt = false; }},
      {"transparent huge pages", kWarn, kWarn, [](MachineFacts& m) { m.huge_pages = "always"; }},
      {"swap", kWarn, kWarn, [](MachineFacts& m) { m.swaps = 1; }},
      {"IRQ affinity", kWarn, kWarn, [](MachineFacts& m) { m.irqbalance = true; }},
      {"clock source", kWarn, kWarn, [](MachineFacts& m) { m.clock_source = "hpet"; }},
      {"PTP daemon", kWarn, kWarn, [](MachineFacts& m) { m.ptp4l = false; }},
      {"TAI offset", kWarn, kFail, [](MachineFacts& m) { m.tai_offset_s = 0; }},
  };
  for (const Fault& fault : faults) {
    MachineFacts facts = good_machine();
    fault.make(facts);
    EXPECT_EQ(wrong_in(facts, Severity::warn), Items{fault.item});
    EXPECT_EQ(wrong_in(facts, Severity::fail).size(), fault.usual == kFail ? 1U : 0U) << fault.item;
    EXPECT_EQ(wrong_in(facts, Severity::fail, {.real_time = true}).size(),
              fault.real_time == kFail ? 1U : 0U)
        << fault.item;
  }
  // A finding that no fault above brings would be one that is not tested.
  for (const Finding& each : findings_of(good_machine(), {})) {
    EXPECT_TRUE(each.item == "device.gpu_index 1" ||
                std::ranges::any_of(faults, [&](const Fault& f) { return f.item == each.item; }))
        << each.item;
  }
}

TEST(DoctorFindings, LargerFramesWantLargerBuffers) {
  const MachineFacts facts = good_machine();
  EXPECT_EQ(wrong_in(facts, Severity::warn, {.frame_mib = 16}), Items{});
  EXPECT_EQ(wrong_in(facts, Severity::warn, {.frame_mib = 32}),
            (Items{"net.core.rmem_max", "net.core.wmem_max"}));
}

TEST(DoctorFindings, BbrIsNoFaultWhereClientsMayHaveAnother) {
  MachineFacts facts = good_machine();
  facts.congestion_control = "bbr";
  facts.chosen_congestion = "reno";
  EXPECT_EQ(wrong_in(facts, Severity::warn), Items{});
}

TEST(DoctorFacts, FilesOfTheKernelAreRead) {
  const TemporaryFolder folder;
  const auto file = [&](const std::string& name, const std::string& text) {
    std::filesystem::create_directories(std::filesystem::path(folder.file(name)).parent_path());
    write_text(folder.file(name), text);
  };
  file("proc/meminfo", "MemTotal: 9 kB\nMemAvailable:    2048 kB\n");
  file("proc/sys/net/core/rmem_max", "212992\n");
  file("proc/sys/net/ipv4/tcp_congestion_control", "bbr\n");
  file("proc/sys/kernel/sched_rt_runtime_us", "-1\n");
  file("proc/swaps", "Filename Type\n/dev/sda2 partition\n/dev/sdb2 partition\n");
  file("proc/12/comm", "irqbalance\n");
  file("proc/13/comm", "ptp4l\n");
  file("proc/self/comm", "other\n");
  file("sys/class/net/lo/operstate", "unknown\n");
  file("sys/class/net/eth0/operstate", "up\n");
  file("sys/class/net/eth1/operstate", "down\n");
  file("sys/devices/system/cpu/cpu0/cpufreq/scaling_governor", "powersave\n");
  file("sys/devices/system/cpu/cpu1/cpufreq/scaling_governor", "powersave\n");
  file("sys/devices/system/cpu/isolated", "2-3\n");
  file("sys/devices/system/cpu/cpu0/cpuidle/state1/latency", "2\n");
  file("sys/devices/system/cpu/cpu0/cpuidle/state1/disable", "0\n");
  file("sys/devices/system/cpu/cpu0/cpuidle/state2/latency", "133\n");
  file("sys/devices/system/cpu/cpu0/cpuidle/state2/disable", "0\n");
  file("sys/devices/system/cpu/cpu0/cpuidle/state3/latency", "890\n");
  file("sys/devices/system/cpu/cpu0/cpuidle/state3/disable", "1\n");
  file("sys/kernel/realtime", "1\n");
  file("sys/kernel/mm/transparent_hugepage/enabled", "always [madvise] never\n");
  file("sys/devices/system/clocksource/clocksource0/current_clocksource", "tsc\n");
  const MachineFacts facts = look_at_machine(folder.path());
  EXPECT_EQ(facts.memory_bytes, 2048U * 1024);
  EXPECT_EQ(facts.rmem_max_bytes, 212'992U);
  EXPECT_EQ(facts.wmem_max_bytes, std::nullopt);
  EXPECT_EQ(facts.congestion_control, "bbr");
  EXPECT_EQ(facts.rt_runtime_us, -1);
  EXPECT_EQ(facts.swaps, 2);
  EXPECT_TRUE(facts.irqbalance);
  EXPECT_TRUE(facts.ptp4l);
  EXPECT_EQ(facts.networks, Items{"eth0"});
  EXPECT_EQ(facts.governors, Items{"powersave"});
  EXPECT_EQ(facts.isolated_cores, "2-3");
  EXPECT_EQ(facts.slow_sleep_states, 1);
  EXPECT_TRUE(facts.preempt_rt);
  EXPECT_EQ(facts.huge_pages, "madvise");
  EXPECT_EQ(facts.clock_source, "tsc");
  EXPECT_EQ(facts.shm_bytes, std::nullopt);
}

TEST(DoctorFacts, AnEmptyRootIsAMachineThatHidesAll) {
  const TemporaryFolder folder;
  const MachineFacts facts = look_at_machine(folder.path());
  EXPECT_EQ(facts.memory_bytes, std::nullopt);
  EXPECT_EQ(facts.swaps, 0);
  EXPECT_TRUE(facts.networks.empty());
  EXPECT_GE(facts.cores, 1U);
}

}  // namespace
}  // namespace emit::tool
