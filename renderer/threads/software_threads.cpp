// SPDX-License-Identifier: Apache-2.0
#include "threads/software_threads.hpp"

#include <sys/prctl.h>

#include <algorithm>
#include <charconv>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

namespace emit::threads {
namespace {

/// What Mesa calls its raster threads, followed by their numbers.
constexpr std::string_view kRasterName = "llvmpipe-";
/// Inherited by the threads that it leaves unnamed.
constexpr const char* kComputeName = "mesa-compute";

/// One thread per core, in their order.
void spread_over(const CoreSet& cores, const std::vector<pid_t>& threads) noexcept {
  for (std::size_t i = 0; i < threads.size(); ++i) {
    cores.only(i).give_to(threads[i]);
  }
}

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
  std::vector<std::pair<int, pid_t>> raster;  // number, thread
  std::error_code error;
  for (std::filesystem::directory_iterator task("/proc/self/task", error), end;
       !error && task != end; task.increment(error)) {
    const pid_t thread = number_in(task->path().filename().string());
    std::string name;
    if (thread <= 0 || !std::getline(std::ifstream(task->path() / "comm"), name)) continue;
    if (name == kComputeName) found.compute_.push_back(thread);
    if (!name.starts_with(kRasterName)) continue;
    raster.emplace_back(number_in(std::string_view(name).substr(kRasterName.size())), thread);
  }
  std::ranges::sort(raster);
  for (const auto& [number, thread] : raster) found.raster_.push_back(thread);
  std::ranges::sort(found.compute_);

  const auto cores = static_cast<std::size_t>(found.cores_.count());
  const auto fits = [cores](const std::vector<pid_t>& threads) {
    return cores > 1 && threads.size() == cores;
  };
  if (!fits(found.raster_)) found.raster_.clear();
  if (!fits(found.compute_)) found.compute_.clear();
  spread_over(found.cores_, found.compute_);
  return found;
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
