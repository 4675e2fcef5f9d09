// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <optional>

#include "agents/gateway/gateway_agent.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Makes the agent of a host that does not speak emitd's own messages; null: the configuration has
/// none. The arguments outlive the agent.
/// Errors: config, io (an address, a glTF file), internal (Embree).
[[nodiscard]] physics::Result<std::unique_ptr<GatewayAgent>> make_gateway_agent(
    Context& context, const config::DaemonConfig& config,
    const std::optional<scene::ScenarioDesc>& scenario);

}  // namespace emit::server
