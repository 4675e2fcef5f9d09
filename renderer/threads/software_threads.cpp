// SPDX-License-Identifier: Apache-2.0
#include "threads/software_threads.hpp"

#include <sys/prctl.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>

namespace emit::threads {
namespace {

/// Prefix of the names of Mesa's raster threads. Their number follows.
constexpr std::string_view kRasterName = "llvmpipe-";
/// Name that the threads inherit which Mesa leaves unnamed.
constexpr const char* kComputeName = "mesa-compute";

/// Gives each thread a core of its own, in ascending order.
void spread_over(const CoreSet& cores, const std::vector<pid_t>& threads) noexcept {
  for (std::size_t i = 0; i < threads.size(); ++i) {
    cores.only(i).give_to(threads[i]);
  }
}

/// Returns the decimal number that the text consists of, or -1.
int number_in(std::string_view digits) noexcept {
  int number = -1;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return error == std::errc() && end == digits.data() + digits.size() ? number : -1;
}

}  // namespace

SoftwareThreads::Naming::Naming() noexcept {
  ::prctl(PR_GET_NAME, before_.data());
  ::prctl(PR_SET_NAME, kComputeName);
}

SoftwareThreads::Naming::~Naming() {
  ::prctl(PR_SET_NAME, before_.data());
}

SoftwareThreads SoftwareThreads::find() {
  SoftwareThreads found;
  found.cores_ = CoreSet::of(0);
  const auto cores = static_cast<std::size_t>(found.cores_.count());
  if (cores < 2) return found;
  // Raster threads take their names when they first run, like other threads of Mesa. On a busy host
  // that happens after this call began.
  constexpr int kMaxAttempts = 500;
  const auto fit = [&] { return found.raster_.size() == cores && found.compute_.size() == cores; };
  for (int attempt = 0; attempt < kMaxAttempts; ++attempt) {
    found.list_threads();
    if (fit() || found.raster_.size() + found.compute_.size() < 2 * cores) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  if (found.raster_.size() != cores) found.raster_.clear();
  if (found.compute_.size() != cores) found.compute_.clear();
  spread_over(found.cores_, found.compute_);
  return found;
}

void SoftwareThreads::list_threads() {
  raster_.clear();
  compute_.clear();
  std::vector<std::pair<int, pid_t>> raster;  // number of the thread, id of the thread
  std::error_code error;
  for (std::filesystem::directory_iterator task("/proc/self/task", error), end;
       !error && task != end; task.increment(error)) {
    const pid_t thread = number_in(task->path().filename().string());
    std::string name;
    if (thread <= 0 || !std::getline(std::ifstream(task->path() / "comm"), name)) continue;
    if (name == kComputeName) compute_.push_back(thread);
    if (!name.starts_with(kRasterName)) continue;
    raster.emplace_back(number_in(std::string_view(name).substr(kRasterName.size())), thread);
  }
  std::ranges::sort(raster);
  for (const auto& [number, thread] : raster) raster_.push_back(thread);
  std::ranges::sort(compute_);
}

void SoftwareThreads::leave_core_to_caller() const noexcept {
  if (raster_.empty()) return;
  const CoreSet others = cores_.without(::sched_getcpu());
  for (const pid_t thread : raster_) others.give_to(thread);
}

void SoftwareThreads::spread() const noexcept {
  spread_over(cores_, raster_);
}

}  // namespace emit::threads
