// SPDX-License-Identifier: Apache-2.0
#include "telemetry/http_address.hpp"

#include <fmt/format.h>

#include "net/ip_address.hpp"

namespace emit::server {

physics::Result<SocketAddress> http_address(const config::DaemonConfig& config,
                                            const std::string& listen, config::Port port) {
  const auto where = parse_host_port(listen);
  if (!where) {
    return tl::unexpected<physics::Error>(where.error());
  }
  auto address = resolve(*where, Transport::tcp, true);
  if (!address) {
    return address;
  }
  if (!ip_of(*address).is_loopback() && !config::is_protected(config, port)) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("{}: other hosts may reach it: that needs {}",
                                           to_string(*address), config::protections_of(port)));
  }
  return address;
}

}  // namespace emit::server
