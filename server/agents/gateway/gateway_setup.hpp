// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <optional>

#include "agents/gateway/gateway_agent.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Makes the agent of a host that speaks CIGI, with the scene that its questions are about. The
/// arguments outlive the agent.
/// Errors: config, io (cigi.listen, cigi.host, a glTF file), internal (Embree).
[[nodiscard]] physics::Result<std::unique_ptr<GatewayAgent>> make_cigi_agent(
    Context& context, const config::DaemonConfig& config,
    const std::optional<scene::ScenarioDesc>& scenario);

}  // namespace emit::server
