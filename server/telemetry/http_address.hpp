// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "net/socket_address.hpp"

namespace emit::server {

/// Returns the address at which a server of HTTP listens.
/// Errors: config (other hosts may reach it, and nothing protects the port), io (no such address).
[[nodiscard]] physics::Result<SocketAddress> http_address(const config::DaemonConfig& config,
                                                          const std::string& listen,
                                                          config::Port port);

}  // namespace emit::server
