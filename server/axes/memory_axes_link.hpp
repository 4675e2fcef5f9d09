// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <utility>

#include "axes/axes_link.hpp"
#include "axes/axes_memory.hpp"
#include "rt/counters.hpp"

namespace emit::server {

/// Shared or reflective memory between the host and the controller (docs/wire.md section 13).
class MemoryAxesLink final : public AxesLink {
 public:
  /// Maps an existing file or device. A report that is there already is an old one and is not read.
  /// Errors: io.
  [[nodiscard]] static physics::Result<std::unique_ptr<MemoryAxesLink>> open(
      const config::MemoryPlace& place, Counters& counters);

  /// A report that is being written is counted (axes_torn_reads) and read by a later call.
  [[nodiscard]] std::optional<protocol::AxesMonitor> receive(std::int64_t now_ns) noexcept override;
  void send(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept override;
  [[nodiscard]] int fd() const noexcept override { return -1; }

 private:
  MemoryAxesLink(AxesMemory memory, Counters& counters) noexcept
      : memory_(std::move(memory)),
        counters_(counters),
        seen_(protocol::latest_counter(memory_.monitor())) {}

  AxesMemory memory_;
  Counters& counters_;
  std::uint64_t seen_;  ///< counter of the latest report
};

}  // namespace emit::server
