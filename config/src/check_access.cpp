// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include "resolve/resolve.hpp"

/// Protection that the daemon's configuration needs before other hosts may reach a port.
namespace emit::config {

namespace {

/// True when "address:port" is on loopback. A name other than localhost may be any host's.
bool is_loopback_endpoint(std::string_view endpoint) {
  std::string_view host = endpoint.substr(0, endpoint.rfind(':'));
  if (host.size() > 2 && host.front() == '[' && host.back() == ']') {
    host = host.substr(1, host.size() - 2);
  }
  const auto address = protocol::parse_ip(host);
  return address ? address->is_loopback() : host == "localhost";
}

}  // namespace

bool is_protected(const DaemonConfig& daemon, Port port) noexcept {
  if (!daemon.access.allow.empty()) return true;
  switch (port) {
    case Port::control:
      return daemon.tls.enabled();
    case Port::host:
      return daemon.authenticated_host();
    case Port::metrics:
    case Port::console:
    case Port::gateway:
      break;
  }
  return false;
}

std::string_view protections_of(Port port) noexcept {
  switch (port) {
    case Port::control:
      return "'access.allow' or '[tls]'";
    case Port::host:
      return "'access.allow', 'host.key_file' or '[tls]'";
    case Port::metrics:
    case Port::console:
    case Port::gateway:
      break;
  }
  return "'access.allow'";
}

void check_access(const Node& root, const DaemonConfig& daemon, Diagnostics& diagnostics) {
  Diagnostics reported_before;  // section() has reported wrong kinds
  const auto check = [&](Port port, std::string_view table, std::string_view key,
                         const std::string& endpoint) {
    if (!is_endpoint(endpoint) || is_loopback_endpoint(endpoint) || is_protected(daemon, port))
      return;
    diagnostics.add(key_location(section(root, table, reported_before), key),
                    fmt::format("'{}.{}' is '{}', which other hosts may reach: that needs {}",
                                table, key, endpoint, protections_of(port)));
  };
  check(Port::control, "control", "tcp", daemon.control.tcp);
  check(Port::host, "host", "udp", daemon.host.udp);
  check(Port::metrics, "metrics", "listen", daemon.metrics.listen);
  check(Port::console, "console", "listen", daemon.console.listen);
  // The port of a CIGI host takes messages from the address of that host alone.
  check(Port::gateway, "dis", "listen", daemon.dis.listen);
  check(Port::gateway, "net_fdm", "listen", daemon.net_fdm.listen);

  const TlsConfig& tls = daemon.tls;
  const Node& table = section(root, "tls", reported_before);
  const bool any = tls.enabled() || !tls.key.empty() || !tls.client_ca.empty();
  const auto need = [&](std::string_view key, bool given) {
    if (any && !given) {
      diagnostics.add(table.at, fmt::format("'tls.{}' is missing: mutual TLS needs 'certificate', "
                                            "'key' and 'client_ca'",
                                            key));
    }
  };
  need("certificate", tls.enabled());
  need("key", !tls.key.empty());
  need("client_ca", !tls.client_ca.empty());
}

}  // namespace emit::config
