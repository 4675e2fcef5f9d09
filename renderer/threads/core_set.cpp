// SPDX-License-Identifier: Apache-2.0
#include "threads/core_set.hpp"

#include "emit/physics/check.hpp"

namespace emit::threads {

CoreSet CoreSet::of(pid_t thread) noexcept {
  CoreSet set;
  if (::sched_getaffinity(thread, sizeof set.cores_, &set.cores_) != 0) CPU_ZERO(&set.cores_);
  return set;
}

CoreSet CoreSet::without(int core) const noexcept {
  CoreSet rest = *this;
  if (core >= 0) CPU_CLR(static_cast<std::size_t>(core), &rest.cores_);
  return rest;
}

CoreSet CoreSet::only(std::size_t index) const noexcept {
  EMIT_CHECK_OP(index, <, static_cast<std::size_t>(count()));
  CoreSet one;
  std::size_t core = 0;
  for (std::size_t left = index; !CPU_ISSET(core, &cores_) || left-- > 0;) ++core;
  CPU_SET(core, &one.cores_);
  return one;
}

void CoreSet::give_to(pid_t thread) const noexcept {
  if (count() == 0) return;
  ::sched_setaffinity(thread, sizeof cores_, &cores_);
}

}  // namespace emit::threads
