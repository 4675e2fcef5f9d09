// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>

#include "axes/axes_link.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "rt/counters.hpp"
#include "telemetry/event_log.hpp"

namespace emit::server {

/// Opens the link that motion.controller names.
/// Errors (config, io, invalid_argument), naming the key.
[[nodiscard]] physics::Result<std::unique_ptr<AxesLink>> open_axes_link(
    const config::MotionConfig& motion, Counters& counters, EventLog& events);

}  // namespace emit::server
