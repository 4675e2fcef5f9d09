// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/admission.hpp"

#include <algorithm>
#include <utility>

#include "net/key_file.hpp"

namespace emit::server {
namespace {

/// Shortest time between two warnings of peers that are turned away, so that a flood does not fill
/// the log.
constexpr std::int64_t kWarningGapNs = 100'000'000;

/// Loads the certificates. The result is empty without TLS.
physics::Result<std::optional<TlsContext>> load_tls(const config::TlsConfig& tls) {
  if (!tls.enabled()) {
    return std::nullopt;
  }
  auto context = TlsContext::server({tls.client_ca, tls.certificate, tls.key});
  if (!context) {
    return tl::unexpected<physics::Error>(std::move(context.error()).with_context("tls"));
  }
  return std::optional(std::move(*context));
}

}  // namespace

physics::Result<std::vector<protocol::SessionKey>> load_host_keys(
    const config::DaemonConfig& config) {
  if (config.host.key_file.empty()) {
    return std::vector<protocol::SessionKey>();
  }
  auto keys = read_key_file(config.host.key_file);
  if (!keys) {
    return tl::unexpected<physics::Error>(std::move(keys.error()).with_context("host.key_file"));
  }
  return keys;
}

physics::Result<void> check_security(const config::DaemonConfig& config) {
  if (auto tls = load_tls(config.tls); !tls) {
    return tl::unexpected<physics::Error>(std::move(tls.error()));
  }
  if (auto keys = load_host_keys(config); !keys) {
    return tl::unexpected<physics::Error>(std::move(keys.error()));
  }
  return {};
}

physics::Result<void> Admission::open() {
  auto tls = load_tls(config_.tls);
  if (!tls) {
    return tl::unexpected<physics::Error>(std::move(tls.error()));
  }
  tls_ = std::move(*tls);
  return {};
}

bool Admission::may_connect(const protocol::IpAddress& peer) const noexcept {
  return config_.access.allow.empty() || peer.is_loopback() ||
         protocol::any_contains(config_.access.allow, peer);
}

bool Admission::may_connect(const std::vector<std::string>& certificate_names) const noexcept {
  const std::vector<std::string>& allowed = config_.tls.allow_names;
  return allowed.empty() || std::ranges::any_of(certificate_names, [&](const std::string& name) {
           return std::ranges::find(allowed, name) != allowed.end();
         });
}

void Admission::turn_away(PeerRefusal why, Counter counter, const protocol::IpAddress& peer,
                          const std::string& detail) {
  context_.counters.add(counter);
  const std::int64_t now_ns = context_.clock.monotonic_ns();
  if (now_ns - warned_ns_ < kWarningGapNs) {
    return;
  }
  warned_ns_ = now_ns;
  context_.receiver_events.push(EventKind::peer_refused, static_cast<std::uint64_t>(why), 0,
                                to_string(peer) + (detail.empty() ? "" : ": " + detail));
}

}  // namespace emit::server
