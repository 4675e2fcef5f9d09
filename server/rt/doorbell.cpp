// SPDX-License-Identifier: Apache-2.0
#include "rt/doorbell.hpp"

#include <sys/eventfd.h>

#include <cstdint>

namespace emit::server {

Doorbell::Doorbell() : fd_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {}

void Doorbell::ring() noexcept {
  if (armed_.exchange(false, std::memory_order_acq_rel)) {
    const std::uint64_t one = 1;
    // Cannot fail but by a full counter, which wakes as well.
    [[maybe_unused]] const auto written = ::write(fd_.get(), &one, sizeof(one));
  }
}

void Doorbell::disarm() noexcept {
  if (!armed_.exchange(false, std::memory_order_acq_rel)) {
    std::uint64_t rings = 0;
    [[maybe_unused]] const auto count = ::read(fd_.get(), &rings, sizeof(rings));
  }
}

}  // namespace emit::server
