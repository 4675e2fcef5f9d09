// SPDX-License-Identifier: Apache-2.0
#include "tool/doctor/machine_facts.hpp"

#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/statvfs.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <ctime>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <thread>

namespace emit::tool {
namespace {

namespace fs = std::filesystem;

/// Returns a file of the kernel as text without the white space at its end; none: not readable.
std::optional<std::string> text_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::nullopt;
  std::string text{std::istreambuf_iterator<char>(file), {}};
  while (!text.empty() && (text.back() == '\n' || text.back() == ' ' || text.back() == '\0')) {
    text.pop_back();
  }
  return text;
}

template <class Number>
std::optional<Number> number_of(const fs::path& path) {
  const std::optional<std::string> text = text_of(path);
  if (!text) return std::nullopt;
  Number value{};
  const auto result = std::from_chars(text->data(), text->data() + text->size(), value);
  if (result.ec != std::errc{}) return std::nullopt;
  return value;
}

/// Returns the entries of a folder, sorted; empty if there is none.
std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> out;
  std::error_code ignored;
  for (fs::directory_iterator at(folder, ignored), end; !ignored && at != end;
       at.increment(ignored)) {
    out.push_back(at->path());
  }
  std::ranges::sort(out);
  return out;
}

bool is_number(std::string_view text) {
  return !text.empty() && std::ranges::all_of(text, [](char c) { return c >= '0' && c <= '9'; });
}

/// Tries SCHED_FIFO on a thread that ends at once.
bool fifo_is_granted() {
  bool granted = false;
  std::thread([&granted] {
    sched_param param{};
    param.sched_priority = 50;
    granted = ::sched_setscheduler(0, SCHED_FIFO, &param) == 0;
  }).join();
  return granted;
}

/// Returns the first congestion control that a socket of this user may have in place of BBR.
std::string congestion_that_may_be_chosen() {
  std::string out;
  const int socket = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (socket < 0) return out;
  for (const char* name : {"cubic", "reno"}) {
    if (::setsockopt(socket, IPPROTO_TCP, TCP_CONGESTION, name,
                     static_cast<socklen_t>(std::strlen(name))) == 0) {
      out = name;
      break;
    }
  }
  ::close(socket);
  return out;
}

/// Returns the number before "kB" of a row of /proc/meminfo, in bytes.
std::optional<std::uint64_t> memory_row(const fs::path& path, std::string_view name) {
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(name)) continue;
    const std::size_t digit = line.find_first_of("0123456789");
    if (digit == std::string::npos) return std::nullopt;
    std::uint64_t kib = 0;
    std::from_chars(line.data() + digit, line.data() + line.size(), kib);
    return kib * 1024;
  }
  return std::nullopt;
}

void look_at_processor(const fs::path& root, MachineFacts& facts) {
  for (const fs::path& cpu : entries_of(root / "sys/devices/system/cpu")) {
    const auto governor = text_of(cpu / "cpufreq/scaling_governor");
    if (governor && std::ranges::find(facts.governors, *governor) == facts.governors.end()) {
      facts.governors.push_back(*governor);
    }
  }
  facts.isolated_cores = text_of(root / "sys/devices/system/cpu/isolated").value_or("");
  for (const fs::path& state : entries_of(root / "sys/devices/system/cpu/cpu0/cpuidle")) {
    const auto latency_us = number_of<long>(state / "latency");
    const auto disabled = number_of<int>(state / "disable");
    constexpr long kSlowUs = 20;
    if (latency_us && disabled && *latency_us > kSlowUs && *disabled == 0) {
      ++facts.slow_sleep_states;
    }
  }
}

void look_at_processes(const fs::path& root, MachineFacts& facts) {
  for (const fs::path& process : entries_of(root / "proc")) {
    if (!is_number(process.filename().string())) continue;
    const std::string name = text_of(process / "comm").value_or("");
    facts.irqbalance = facts.irqbalance || name == "irqbalance";
    facts.ptp4l = facts.ptp4l || name == "ptp4l";
  }
}

void look_at_network(const fs::path& root, MachineFacts& facts) {
  facts.rmem_max_bytes = number_of<std::uint64_t>(root / "proc/sys/net/core/rmem_max");
  facts.wmem_max_bytes = number_of<std::uint64_t>(root / "proc/sys/net/core/wmem_max");
  facts.congestion_control = text_of(root / "proc/sys/net/ipv4/tcp_congestion_control");
  facts.chosen_congestion = congestion_that_may_be_chosen();
  for (const fs::path& interface : entries_of(root / "sys/class/net")) {
    const std::string name = interface.filename().string();
    const std::string state = text_of(interface / "operstate").value_or("");
    if (name != "lo" && (state == "up" || state == "unknown")) facts.networks.push_back(name);
  }
}

}  // namespace

MachineFacts look_at_machine(const fs::path& root) {
  MachineFacts facts;
  facts.cores = std::max(1U, std::thread::hardware_concurrency());
  facts.memory_bytes = memory_row(root / "proc/meminfo", "MemAvailable:");
  struct statvfs shm {};
  if (::statvfs((root / "dev/shm").c_str(), &shm) == 0) {
    facts.shm_bytes = static_cast<std::uint64_t>(shm.f_bavail) * shm.f_frsize;
  }
  // Limits of this user.
  facts.may_use_fifo = fifo_is_granted();
  rlimit limit{};
  if (::getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur != RLIM_INFINITY &&
      ::geteuid() != 0) {
    facts.memlock_bytes = limit.rlim_cur;
  }
  if (::getrlimit(RLIMIT_NOFILE, &limit) == 0) facts.open_files = limit.rlim_cur;
  facts.rt_runtime_us = number_of<std::int64_t>(root / "proc/sys/kernel/sched_rt_runtime_us");
  look_at_network(root, facts);
  look_at_processor(root, facts);
  // Kernel.
  utsname kernel{};
  if (::uname(&kernel) == 0) facts.kernel = kernel.release;
  facts.preempt_rt = text_of(root / "sys/kernel/realtime").value_or("") == "1" ||
                     std::string_view(kernel.version).find("PREEMPT_RT") != std::string_view::npos;
  const std::string pages =
      text_of(root / "sys/kernel/mm/transparent_hugepage/enabled").value_or("");
  if (const std::size_t open = pages.find('['); open != std::string::npos) {
    facts.huge_pages = pages.substr(open + 1, pages.find(']') - open - 1);
  }
  if (const auto swaps = text_of(root / "proc/swaps")) {
    facts.swaps = static_cast<int>(std::ranges::count(*swaps, '\n'));
  }
  look_at_processes(root, facts);
  // Time.
  facts.clock_source =
      text_of(root / "sys/devices/system/clocksource/clocksource0/current_clocksource")
          .value_or("");
  timespec tai{};
  timespec utc{};
  if (::clock_gettime(CLOCK_TAI, &tai) == 0 && ::clock_gettime(CLOCK_REALTIME, &utc) == 0) {
    // Round, because some time has passed between the two readings.
    const double offset_s = static_cast<double>(tai.tv_sec - utc.tv_sec) +
                            1e-9 * static_cast<double>(tai.tv_nsec - utc.tv_nsec);
    facts.tai_offset_s = static_cast<int>(std::lround(offset_s));
  }
  return facts;
}

}  // namespace emit::tool
