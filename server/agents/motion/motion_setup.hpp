// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <vector>

#include "agents/channel_table.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "motion/motion_plan.hpp"

namespace emit::server {

/// Returns the motion simulator of a configuration. It projects if the channels are those of a
/// projector.
/// Errors (config): the channels are of both kinds, which need two cameras in a frame; a projector
/// without a scenario; or what TableFollower refuses.
[[nodiscard]] physics::Result<MotionPlan> make_motion_plan(
    const config::DaemonConfig& config, const std::optional<scene::ScenarioDesc>& scenario,
    const std::vector<Channel>& channels);

}  // namespace emit::server
