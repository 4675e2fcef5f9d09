// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emit/config/daemon_config.hpp"

namespace emit::server {

/// Real-time settings that one agent's thread asks of the host.
struct ThreadRealtime {
  bool fifo = false;
  int priority = 0;                 ///< 1..99, with fifo
  std::vector<std::uint32_t> cpus;  ///< empty: wherever the kernel likes
  bool touch_stack = false;
};
/// Returns the settings of an agent by its name. The conductor has realtime.priority; receiver,
/// sender and render lie one, two and three below; the recorder, which writes files, is never
/// real-time.
/// @pre realtime.cpus has been checked
[[nodiscard]] ThreadRealtime thread_realtime(const config::RealtimeConfig& config,
                                             std::string_view agent);

/// Applies what must come before the thread makes anything: threads that it starts later run on the
/// same cores. Call it on the thread itself. Returns 0 when granted, an errno when refused; absent
/// when nothing was asked for.
[[nodiscard]] std::optional<int> apply_before_start(const ThreadRealtime& wish) noexcept;
/// Applies the scheduler, when the thread is ready to serve; threads that it starts are not
/// real-time. Call it on the thread itself. Returns as apply_before_start() does.
[[nodiscard]] std::optional<int> apply_after_start(const ThreadRealtime& wish) noexcept;

/// Keeps everything that the process has and will have in memory, and touches `heap_mib` of heap
/// that is not given back. Empty: done; else why not, and nothing was done.
[[nodiscard]] std::string lock_memory(std::uint32_t heap_mib);

/// Real-time settings that were asked for, with the answers of the host.
class RealtimeReport {
 public:
  struct Item {
    std::string setting;  ///< "fifo", "cpus" or "lock_memory"
    std::string agent;    ///< empty: the process
    bool granted = false;
    std::string why;  ///< not granted: reason and remedy
  };
  void add(Item item) { items_.push_back(std::move(item)); }
  [[nodiscard]] const std::vector<Item>& items() const noexcept { return items_; }
  /// Returns the settings that the host refused, in one line; empty when there are none.
  [[nodiscard]] std::string refusals() const;

 private:
  std::vector<Item> items_;
};

/// Locks memory where that is asked for, and tries what the agents' threads will ask for on a
/// thread that ends again, so that a start can be given up before anything serves. Allocates.
[[nodiscard]] RealtimeReport ask_for_realtime(const config::RealtimeConfig& config,
                                              std::span<const std::string_view> more_agents = {});

}  // namespace emit::server
