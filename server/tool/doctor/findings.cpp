// SPDX-License-Identifier: Apache-2.0
#include "tool/doctor/findings.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <string_view>
#include <utility>

namespace emit::tool {
namespace {

constexpr std::uint64_t kMib = 1024 * 1024;

/// Findings in the order of the report.
class Report {
 public:
  explicit Report(bool real_time) : real_time_(real_time) {}

  void pass(std::string item, std::string found) {
    findings_.push_back({Severity::pass, std::move(item), std::move(found), {}});
  }
  void warn(std::string item, std::string found, std::string remedy) {
    findings_.push_back({Severity::warn, std::move(item), std::move(found), std::move(remedy)});
  }
  void fail(std::string item, std::string found, std::string remedy) {
    findings_.push_back({Severity::fail, std::move(item), std::move(found), std::move(remedy)});
  }
  /// Adds what is a failure in real time, and otherwise a warning.
  void refuse(std::string item, std::string found, std::string remedy) {
    findings_.push_back({real_time_ ? Severity::fail : Severity::warn, std::move(item),
                         std::move(found), std::move(remedy)});
  }
  [[nodiscard]] std::vector<Finding> take() { return std::move(findings_); }

 private:
  bool real_time_;
  std::vector<Finding> findings_;
};

void judge_graphics(const MachineFacts& facts, Report& report) {
  const bool usable = std::ranges::any_of(facts.graphics, &renderer::GraphicsDevice::usable);
  const bool hardware = std::ranges::any_of(
      facts.graphics,
      [](const renderer::GraphicsDevice& device) { return device.usable && !device.software; });
  if (facts.graphics.empty()) {
    report.fail(
        "EGL device", "none",
        "a GPU's driver with EGL, or Mesa: apt-get install libegl1 libopengl0 libgl1-mesa-dri");
  }
  for (std::size_t i = 0; i < facts.graphics.size(); ++i) {
    const renderer::GraphicsDevice& device = facts.graphics[i];
    const std::string item = fmt::format("device.gpu_index {}", i);
    if (!device.usable) {
      constexpr const char* kRemedy = "a driver with OpenGL 4.5; groups render and video";
      usable ? report.warn(item, device.name, kRemedy) : report.fail(item, device.name, kRemedy);
    } else if (device.software && !hardware) {
      report.warn(item, device.name,
                  "frames are drawn on the processor; a GPU is many times faster");
    } else {
      report.pass(item, device.name);
    }
  }
}

void judge_files(const MachineFacts& facts, const DoctorNeeds& needs, Report& report) {
  if (facts.data.empty()) {
    report.fail("shipped data", "not found", "EMIT_DATA_DIR=PREFIX/share/emit");
  } else {
    report.pass("shipped data", facts.data.front().string());
  }
  constexpr std::uint64_t kMemoryBytes = 2048 * kMib;
  if (facts.memory_bytes && *facts.memory_bytes < kMemoryBytes) {
    report.warn("memory", fmt::format("{} MiB available", *facts.memory_bytes / kMib),
                "scenes of a million triangles take about 2 GiB");
  } else if (facts.memory_bytes) {
    report.pass("memory", fmt::format("{} MiB available", *facts.memory_bytes / kMib));
  }
  // A ring of sixteen frames for a client on this machine.
  const std::uint64_t ring_bytes = 16 * needs.frame_mib * kMib;
  if (!facts.shm_bytes) {
    report.warn("/dev/shm", "not there",
                "shared-memory clients need it: mount -t tmpfs shm /dev/shm");
  } else if (*facts.shm_bytes < ring_bytes) {
    report.warn("/dev/shm", fmt::format("{} MiB free", *facts.shm_bytes / kMib),
                fmt::format("shared-memory clients: {} MiB, e.g. docker run --shm-size",
                            ring_bytes / kMib));
  } else {
    report.pass("/dev/shm", fmt::format("{} MiB free", *facts.shm_bytes / kMib));
  }
  constexpr std::uint64_t kOpenFiles = 1024;
  if (facts.open_files < kOpenFiles) {
    report.warn("RLIMIT_NOFILE", fmt::format("{}", facts.open_files),
                "LimitNOFILE=8192 in the unit");
  } else {
    report.pass("RLIMIT_NOFILE", fmt::format("{}", facts.open_files));
  }
}

void judge_limits(const MachineFacts& facts, Report& report) {
  if (facts.may_use_fifo) {
    report.pass("RLIMIT_RTPRIO", "SCHED_FIFO is granted");
  } else {
    report.refuse("RLIMIT_RTPRIO", "SCHED_FIFO is refused",
                  "LimitRTPRIO=60 in the unit, or /etc/security/limits.conf: USER - rtprio 60");
  }
  if (facts.memlock_bytes) {
    report.refuse("RLIMIT_MEMLOCK", fmt::format("{} KiB", *facts.memlock_bytes / 1024),
                  "LimitMEMLOCK=infinity in the unit, or limits.conf: USER - memlock unlimited");
  } else {
    report.pass("RLIMIT_MEMLOCK", "unlimited");
  }
  if (facts.rt_runtime_us && *facts.rt_runtime_us == 0) {
    report.refuse("sched_rt_runtime_us", "0", "sysctl -w kernel.sched_rt_runtime_us=950000");
  } else if (facts.rt_runtime_us) {
    report.pass("sched_rt_runtime_us", fmt::format("{}", *facts.rt_runtime_us));
  }
}

void judge_network(const MachineFacts& facts, const DoctorNeeds& needs, Report& report) {
  if (facts.networks.empty()) {
    report.warn("network", "no interface is up but loopback", "ip link set IFACE up");
  } else {
    report.pass("network", fmt::format("{}", fmt::join(facts.networks, ", ")));
  }
  // Four frames in, a burst of frames out. A container's namespace may hide these files.
  const std::uint64_t need_bytes = 4 * needs.frame_mib * kMib;
  for (const auto& [name, have_bytes] : {std::pair{"net.core.rmem_max", facts.rmem_max_bytes},
                                         std::pair{"net.core.wmem_max", facts.wmem_max_bytes}}) {
    if (!have_bytes) {
      report.warn(name, "not visible here", "look in the host's own network namespace");
    } else if (*have_bytes < need_bytes) {
      report.warn(name, fmt::format("{}, {} wanted", *have_bytes, need_bytes),
                  fmt::format("sysctl -w {}={}", name, need_bytes));
    } else {
      report.pass(name, fmt::format("{}", *have_bytes));
    }
  }
  // BBR spreads frames out: emitd's TCP clients have cubic or reno where it may choose.
  if (!facts.congestion_control) {
    report.warn("TCP congestion control", "not visible here",
                "look in the host's own network namespace");
  } else if (!facts.congestion_control->starts_with("bbr")) {
    report.pass("TCP congestion control", *facts.congestion_control);
  } else if (!facts.chosen_congestion.empty()) {
    report.pass("TCP congestion control",
                fmt::format("{} (emitd's clients: {})", *facts.congestion_control,
                            facts.chosen_congestion));
  } else {
    report.warn("TCP congestion control", *facts.congestion_control,
                "sysctl -w net.ipv4.tcp_allowed_congestion_control=\"$(sysctl -n "
                "net.ipv4.tcp_allowed_congestion_control) reno\"");
  }
}

void judge_processor(const MachineFacts& facts, Report& report) {
  constexpr unsigned int kCores = 4;
  if (facts.cores < kCores) {
    report.warn("cores", fmt::format("{}", facts.cores),
                "the render agent, the senders and the host port share them");
  } else {
    report.pass("cores", fmt::format("{}", facts.cores));
  }
  if (facts.governors.empty()) {
    report.pass("CPU governor", "none: the frequency is not scaled here");
  } else if (facts.governors == std::vector<std::string>{"performance"}) {
    report.pass("CPU governor", "performance");
  } else {
    report.warn("CPU governor", fmt::format("{}", fmt::join(facts.governors, ", ")),
                "cpupower frequency-set -g performance");
  }
  if (facts.isolated_cores.empty()) {
    report.warn("isolated cores", "none",
                "kernel command line: isolcpus=managed_irq,domain,2-3 nohz_full=2-3 "
                "rcu_nocbs=2-3, then realtime.cpus");
  } else {
    report.pass("isolated cores", facts.isolated_cores);
  }
  if (facts.slow_sleep_states == 0) {
    report.pass("C-states", "none slower than 20 us to leave");
  } else {
    report.warn("C-states", fmt::format("{} slower than 20 us to leave", facts.slow_sleep_states),
                "cpupower idle-set -D 20");
  }
}

void judge_kernel(const MachineFacts& facts, Report& report) {
  if (facts.preempt_rt) {
    report.pass("PREEMPT_RT", facts.kernel);
  } else {
    report.warn("PREEMPT_RT", fmt::format("no ({})", facts.kernel),
                "apt-get install linux-image-rt-amd64");
  }
  if (facts.huge_pages == "always") {
    report.warn("transparent huge pages", "always",
                "echo madvise > /sys/kernel/mm/transparent_hugepage/enabled");
  } else {
    report.pass("transparent huge pages", facts.huge_pages.empty() ? "none" : facts.huge_pages);
  }
  if (facts.swaps == 0) {
    report.pass("swap", "none");
  } else {
    report.warn("swap", fmt::format("{} in use", facts.swaps),
                "swapoff -a, or realtime.lock_memory = true");
  }
  // A balancer moves interrupts onto isolated cores again.
  if (facts.irqbalance) {
    report.warn("IRQ affinity", "irqbalance runs",
                "IRQBALANCE_BANNED_CPULIST=2-3 in /etc/default/irqbalance");
  } else {
    report.pass("IRQ affinity", "no irqbalance");
  }
}

void judge_time(const MachineFacts& facts, Report& report) {
  // Other sources cost a system call per reading.
  if (facts.clock_source.empty() || facts.clock_source == "tsc" ||
      facts.clock_source == "kvm-clock" || facts.clock_source == "arch_sys_counter") {
    report.pass("clock source", facts.clock_source.empty() ? "not visible" : facts.clock_source);
  } else {
    report.warn("clock source", facts.clock_source, "kernel command line: tsc=reliable");
  }
  if (facts.ptp4l) {
    report.pass("PTP daemon", "ptp4l runs");
  } else {
    report.warn("PTP daemon", "no ptp4l",
                "apt-get install linuxptp; systemctl enable --now ptp4l@IFACE phc2sys@IFACE");
  }
  if (facts.tai_offset_s == 0) {
    report.refuse("TAI offset", "0: instants are UTC",
                  "phc2sys -w, or chrony with 'leapsectz right/UTC'");
  } else {
    report.pass("TAI offset", fmt::format("{} s", facts.tai_offset_s));
  }
}

}  // namespace

std::vector<Finding> findings_of(const MachineFacts& facts, const DoctorNeeds& needs) {
  Report report(needs.real_time);
  judge_graphics(facts, report);
  judge_files(facts, needs, report);
  judge_limits(facts, report);
  judge_network(facts, needs, report);
  judge_processor(facts, report);
  judge_kernel(facts, report);
  judge_time(facts, report);
  return report.take();
}

}  // namespace emit::tool
