// SPDX-License-Identifier: Apache-2.0
#include "host/realtime.hpp"

#include <fmt/format.h>
#include <linux/capability.h>
#include <malloc.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <thread>

#include "emit/physics/check.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

/// Difference between the conductor's priority and that of an agent. An agent without an entry is
/// not real-time.
constexpr std::array<std::pair<std::string_view, int>, 6> kBelow{{{"conductor", 0},
                                                                  {"motion", 0},
                                                                  {"receiver", 1},
                                                                  {"gateway", 1},
                                                                  {"sender", 2},
                                                                  {"render", 3}}};

constexpr std::size_t kPageBytes = 4096;
/// Deeper than any agent's loop goes.
constexpr std::size_t kStackBytes = std::size_t{256} << 10U;

[[gnu::noinline]] void touch_stack() noexcept {
  std::array<volatile char, kStackBytes> stack;
  for (std::size_t i = 0; i < stack.size(); i += kPageBytes) stack[i] = 0;
}

bool has_capability(unsigned capability) noexcept {
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> data{};
  return ::syscall(SYS_capget, &header, data.data()) == 0 &&
         (data[capability / 32].effective >> (capability % 32) & 1U) != 0;
}

std::string remedy(std::string_view setting, int error) {
  const std::string text = error_text(error);
  if (setting == "fifo") return text + ": LimitRTPRIO= of the unit, or ulimit -r";
  return text + ": cores that this process may use show in taskset -p";
}

}  // namespace

ThreadRealtime thread_realtime(const config::RealtimeConfig& config, std::string_view agent) {
  ThreadRealtime out;
  out.touch_stack = config.lock_memory;
  const auto cpus = config::parse_agent_cpus(config.cpus);
  EMIT_CHECK(cpus.has_value());
  const auto found = std::ranges::find(*cpus, agent, &config::AgentCpus::agent);
  if (found != cpus->end()) out.cpus = found->cpus;
  const auto* const below =
      std::ranges::find(kBelow, agent, &std::pair<std::string_view, int>::first);
  if (config.scheduler == config::SchedulerKind::fifo && below != kBelow.end()) {
    out.fifo = true;
    out.priority = std::max(static_cast<int>(config.priority) - below->second, 1);
  }
  return out;
}

std::optional<int> apply_before_start(const ThreadRealtime& wish) noexcept {
  if (wish.touch_stack) touch_stack();
  if (wish.cpus.empty()) return std::nullopt;
  alignas(cpu_set_t) std::array<unsigned long, config::kMaxCpus / (8 * sizeof(unsigned long))>
      set{};
  for (const std::uint32_t cpu : wish.cpus) {
    constexpr std::uint32_t kBits = 8 * sizeof(unsigned long);
    set[cpu / kBits] |= 1UL << (cpu % kBits);
  }
  const bool done =
      ::sched_setaffinity(0, sizeof set, reinterpret_cast<const cpu_set_t*>(set.data())) == 0;
  return done ? 0 : errno;
}

std::optional<int> apply_after_start(const ThreadRealtime& wish) noexcept {
  if (!wish.fifo) return std::nullopt;
  const sched_param param{wish.priority};
  return ::sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &param) == 0 ? 0 : errno;
}

std::string lock_memory(std::uint32_t heap_mib) {
  rlimit limit{};
  ::getrlimit(RLIMIT_MEMLOCK, &limit);
  if (limit.rlim_cur != RLIM_INFINITY && !has_capability(CAP_IPC_LOCK)) {
    // The lock itself might succeed now; the first allocation beyond the limit would fail later.
    return fmt::format(
        "RLIMIT_MEMLOCK is {} KiB: LimitMEMLOCK=infinity of the unit, or ulimit -l "
        "unlimited",
        limit.rlim_cur / 1024);
  }
  if (::mlockall(MCL_CURRENT | MCL_FUTURE) != 0) {
    return fmt::format("mlockall: {}", error_text(errno));
  }
  // Freed heap stays, and large blocks come from it as well: no page faults and no mmap later on.
  const std::size_t heap_bytes = std::size_t{heap_mib} << 20U;
  ::mallopt(M_TRIM_THRESHOLD, -1);
  ::mallopt(M_TOP_PAD, static_cast<int>(std::min<std::size_t>(heap_bytes, 1U << 30U)));
  ::mallopt(M_MMAP_THRESHOLD, 32 << 20);
  constexpr std::size_t kPiece = std::size_t{1} << 20U;
  std::vector<void*> pieces(heap_mib, nullptr);
  for (void*& piece : pieces) {
    piece = std::malloc(kPiece);
    if (piece == nullptr) break;
    for (std::size_t i = 0; i < kPiece; i += kPageBytes) {
      static_cast<volatile char*>(piece)[i] = 0;
    }
  }
  for (void* piece : pieces) std::free(piece);
  return {};
}

std::string RealtimeReport::refusals() const {
  std::string out;
  for (const Item& item : items_) {
    if (item.granted) continue;
    if (!out.empty()) out += "; ";
    out += item.agent.empty() ? item.setting : fmt::format("{} of {}", item.setting, item.agent);
    out += ": " + item.why;
  }
  return out;
}

RealtimeReport ask_for_realtime(const config::RealtimeConfig& config,
                                std::span<const std::string_view> more_agents) {
  RealtimeReport report;
  if (config.lock_memory) {
    std::string why = lock_memory(config.heap_touch_mib);
    const bool granted = why.empty();
    report.add({"lock_memory", "", granted, std::move(why)});
  }
  std::vector<std::string_view> agents{"conductor", "receiver", "sender", "render", "recorder"};
  agents.insert(agents.end(), more_agents.begin(), more_agents.end());
  for (const std::string_view agent : agents) {
    const ThreadRealtime wish = thread_realtime(config, agent);
    if (!wish.fifo && wish.cpus.empty()) continue;
    std::optional<int> cpus;
    std::optional<int> fifo;
    std::thread([&] {
      cpus = apply_before_start(wish);
      fifo = apply_after_start(wish);
    }).join();
    for (const auto& [setting, error] : {std::pair("cpus", cpus), std::pair("fifo", fifo)}) {
      if (!error) continue;
      report.add(
          {setting, std::string(agent), *error == 0, *error == 0 ? "" : remedy(setting, *error)});
    }
  }
  return report;
}

}  // namespace emit::server
