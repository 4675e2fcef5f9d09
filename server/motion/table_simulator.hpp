// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/axes.hpp"
#include "motion/axis_model.hpp"

namespace emit::server {

/// A motion simulator with its controller, simulated. The controller starts softly, follows the
/// host's demands within the limits of the axes, parks when it is told to or when the host is
/// silent, and opens its interlock when an axis does not follow.
///
/// Thread: one owner.  Real time: RT-safe after create().
class TableSimulator {
 public:
  struct Axis {
    AxisDynamics dynamics;
    double park_rad = 0.0;
  };
  struct Options {
    std::vector<Axis> axes;
    std::int64_t step_ns = 1'000'000;
    /// Share of rate and acceleration that parking uses. A soft start begins with it and grows to
    /// all of them within three seconds.
    double soft_share = 0.2;
    /// An axis farther than this from what the controller asks of it opens the interlock.
    double most_error_rad = 0.1;
    std::uint64_t seed = 1;
  };

  /// Errors: invalid_argument (no axis or more than protocol::kMaxAxes, an axis that AxisModel
  /// refuses, or a park position outside of the travel).
  [[nodiscard]] static physics::Result<TableSimulator> create(const Options& options);

  /// Takes a command that arrived at `now_ns`. Returns false and drops it if its counter is not
  /// larger than that of the latest one, unless the host was silent for longer than its timeout. A
  /// command to follow with another number of axes is dropped too.
  bool take(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept;

  /// Moves on by one step, which ends at `now_ns`, and returns what the controller reports.
  const protocol::AxesMonitor& step(std::int64_t now_ns) noexcept;

  /// @pre axis < number of axes
  void set_fault(std::size_t axis, AxisFault fault) noexcept;

 private:
  TableSimulator(const Options& options, std::vector<AxisProfile> profiles,
                 std::vector<AxisModel> models) noexcept;
  /// Chooses the state from the command, the silence of the host and what the axes did.
  void choose_state(std::int64_t now_ns) noexcept;
  /// Returns true if the latest command is older than its timeout.
  [[nodiscard]] bool silent(std::int64_t now_ns) const noexcept;
  /// Returns the share of rate and acceleration that the axes use now.
  [[nodiscard]] double share(std::int64_t now_ns) const noexcept;
  /// Returns what an axis is to do at `now_ns`.
  [[nodiscard]] AxisMotion demand(std::size_t axis, std::int64_t now_ns) const noexcept;

  Options options_;
  std::vector<AxisProfile> profiles_;
  std::vector<AxisModel> models_;
  protocol::AxesCommand command_;
  std::int64_t command_ns_ = 0;  ///< when command_ arrived
  std::int64_t capture_ns_ = 0;  ///< when the state became capturing
  bool off_ = false;             ///< a command switched the motors off since the latest step
  protocol::AxesMonitor monitor_;
};

}  // namespace emit::server
