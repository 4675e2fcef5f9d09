// SPDX-License-Identifier: Apache-2.0
#include "axes/memory_axes_link.hpp"

namespace emit::server {

using protocol::AxesLoadStatus;

physics::Result<std::unique_ptr<MemoryAxesLink>> MemoryAxesLink::open(
    const config::MemoryPlace& place, Counters& counters) {
  auto memory = AxesMemory::open(place);
  if (!memory) return tl::unexpected(std::move(memory.error()));
  return std::unique_ptr<MemoryAxesLink>(new MemoryAxesLink(std::move(*memory), counters));
}

std::optional<protocol::AxesMonitor> MemoryAxesLink::receive(std::int64_t /*now_ns*/) noexcept {
  protocol::AxesMonitor out;
  switch (protocol::load_axes(memory_.monitor(), seen_, out).status) {
    case AxesLoadStatus::done:
      return out;
    case AxesLoadStatus::torn:
      counters_.add(Counter::axes_torn_reads);
      break;
    case AxesLoadStatus::refused:
      counters_.add(Counter::axes_reports_refused);
      break;
    case AxesLoadStatus::nothing:
      break;
  }
  return std::nullopt;
}

void MemoryAxesLink::send(const protocol::AxesCommand& command, std::int64_t /*now_ns*/) noexcept {
  protocol::store_axes(memory_.command(), command);
  counters_.add(Counter::axes_commands);
}

}  // namespace emit::server
