// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "emit/config/motion_controller.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/axes.hpp"
#include "motion/table_simulator.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {

/// Counts of what a simulated controller took, lost and did.
struct FmsSimFigures {
  std::uint64_t commands = 0;  ///< lines where they are ACUTROL commands
  std::uint64_t missing = 0;   ///< gaps of the commands' counter
  std::uint64_t dropped = 0;   ///< older than the latest one, or for another number of axes
  std::uint64_t malformed = 0;
  std::uint64_t torn = 0;  ///< looks at memory while the host wrote
  std::uint64_t timeouts = 0;
  std::uint64_t failed_sends = 0;
  std::uint64_t last_counter = 0;
  std::uint64_t following_steps = 0;
  Samples late_us{std::size_t{1} << 16U};
  std::array<double, protocol::kMaxAxes> squares_rad2{};
  std::array<double, protocol::kMaxAxes> most_rad{};
};

/// A simulated controller's way to its host. Thread: one owner.
class FmsSimPort {
 public:
  FmsSimPort() = default;
  FmsSimPort(const FmsSimPort&) = delete;
  FmsSimPort& operator=(const FmsSimPort&) = delete;
  virtual ~FmsSimPort() = default;

  /// Returns what scripts read when it is ready, such as "axes_udp=127.0.0.1:7010".
  [[nodiscard]] virtual std::string name() const = 0;
  /// Hands commands that have arrived to the table, before its step that ends at `now_ns`. There
  /// are only so many at a time that a flood does not stop the axes.
  virtual void take(server::TableSimulator& table, std::int64_t now_ns, FmsSimFigures& figures) = 0;
  /// Tells the host what the axes did in that step.
  virtual void report(const protocol::AxesMonitor& monitor, std::int64_t now_ns,
                      FmsSimFigures& figures) = 0;
};

/// Messages by UDP (docs/wire.md section 12). Errors: invalid_argument (the address), io.
[[nodiscard]] physics::Result<std::unique_ptr<FmsSimPort>> open_udp_port(const std::string& listen);
/// Blocks of memory (docs/wire.md section 13); the file is made where there is none. Errors: io.
[[nodiscard]] physics::Result<std::unique_ptr<FmsSimPort>> open_memory_port(
    const config::MemoryPlace& place);
/// ACUTROL command language over TCP (docs/motion.md). A new connection replaces an older one.
/// Errors: invalid_argument (the address), io.
[[nodiscard]] physics::Result<std::unique_ptr<FmsSimPort>> open_acutrol_port(
    const std::string& listen, std::size_t axes);

}  // namespace emit::tool
