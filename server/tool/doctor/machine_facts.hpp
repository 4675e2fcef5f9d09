// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/renderer/devices.hpp"

namespace emit::tool {

/// State of a machine, as far as emitd depends on it. What a container hides is empty.
struct MachineFacts {
  std::vector<renderer::GraphicsDevice> graphics;  ///< in the order of device.gpu_index
  std::vector<std::filesystem::path> data;         ///< folders with shipped data that exist
  unsigned int cores = 0;
  std::optional<std::uint64_t> memory_bytes;      ///< available
  std::optional<std::uint64_t> shm_bytes;         ///< free in /dev/shm
  bool may_use_fifo = false;                      ///< SCHED_FIFO is granted
  std::optional<std::uint64_t> memlock_bytes;     ///< none: unlimited
  std::uint64_t open_files = 0;                   ///< limit
  std::optional<std::int64_t> rt_runtime_us;      ///< kernel.sched_rt_runtime_us
  std::optional<std::uint64_t> rmem_max_bytes;    ///< net.core.rmem_max
  std::optional<std::uint64_t> wmem_max_bytes;    ///< net.core.wmem_max
  std::optional<std::string> congestion_control;  ///< of TCP
  std::string chosen_congestion;                  ///< that emitd may choose for its clients
  std::vector<std::string> networks;              ///< interfaces that are up, loopback excepted
  std::vector<std::string> governors;             ///< of the processor's frequency, each once
  std::string isolated_cores;
  int slow_sleep_states = 0;  ///< enabled sleep states that take more than 20 us to leave
  bool preempt_rt = false;
  std::string kernel;
  std::string huge_pages;  ///< transparent ones: always, madvise, never
  int swaps = 0;
  bool irqbalance = false;
  bool ptp4l = false;
  std::string clock_source;
  int tai_offset_s = 0;
};

/// Looks at the machine. `root` stands for the folder in which /proc, /sys and /dev are, so that
/// tests bring their own; limits, clocks and sockets are those of this process. Graphics and data
/// stay empty.
[[nodiscard]] MachineFacts look_at_machine(const std::filesystem::path& root);

}  // namespace emit::tool
