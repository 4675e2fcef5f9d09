// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <utility>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "axes/axes_link.hpp"
#include "motion/table_follower.hpp"

namespace emit::server {

/// Commands the axes of a motion simulator at a fixed rate and takes their measurements. Poses come
/// from the conductor, and measurements go there.
class MotionAgent final : public Agent {
 public:
  /// @param period_ns  time between two commands, as the follower has it
  MotionAgent(Context& context, std::unique_ptr<AxesLink> link, TableFollower follower,
              std::int64_t period_ns)
      : Agent(context.bells.motion),
        context_(context),
        link_(std::move(link)),
        follower_(std::move(follower)),
        period_ns_(period_ns) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "motion"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return due_ns_; }
  [[nodiscard]] int wait_fd() const noexcept override { return link_->fd(); }
  /// Switches the motors off, so that the axes do not wait for a timeout to stop.
  void on_stop() noexcept override;

 private:
  int take_poses(std::int64_t now_ns) noexcept;
  int take_monitors(std::int64_t now_ns) noexcept;
  void command(std::int64_t now_ns) noexcept;
  /// Shows the newest command, or measurement, to whoever displays the axes.
  void show(const protocol::AxesCommand& command) noexcept;
  void show(const AxisFeedback& feedback) noexcept;
  void report(const AxisFeedback* feedback) noexcept;
  /// Counts and logs what has begun or ended since the latest command.
  void note_status() noexcept;

  Context& context_;
  std::unique_ptr<AxesLink> link_;
  TableFollower follower_;
  std::int64_t period_ns_;
  std::int64_t due_ns_ = 0;      ///< instant of the next command, wall
  TableFollower::Status known_;  ///< as the conductor and the log know it
  std::int64_t ticked_ns_ = 0;   ///< instant of the latest AxesTick
  bool reported_ = false;        ///< since the latest command
};

}  // namespace emit::server
