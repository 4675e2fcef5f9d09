// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "agents/context.hpp"
#include "agents/receiver/peer_limits.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/host_session.hpp"
#include "net/tls_session.hpp"

namespace emit::server {

/// Decides who may connect and how much a peer may send: addresses, certificates, rates.
/// Thread: the receiver's, except may_connect(). Real time: the rates are RT-safe.
class Admission {
 public:
  Admission(Context& context, const config::DaemonConfig& config)
      : context_(context), config_(config), limits_(config.access) {}

  /// Loads the certificates. Errors: those of the files, naming `tls`.
  [[nodiscard]] physics::Result<void> open();
  /// Returns the TLS context of new connections; null: they are plain.
  [[nodiscard]] const TlsContext* tls() const noexcept { return tls_ ? &*tls_ : nullptr; }

  /// Returns whether access.allow lets this address in. Thread: any.
  [[nodiscard]] bool may_connect(const protocol::IpAddress& peer) const noexcept;
  /// Returns whether tls.allow_names lets in a certificate with these names.
  [[nodiscard]] bool may_connect(const std::vector<std::string>& certificate_names) const noexcept;
  [[nodiscard]] PeerLimits& limits() noexcept { return limits_; }

  /// Counts a peer that is turned away before anything it says is looked at, and logs it, at most
  /// every 100 ms.
  void turn_away(PeerRefusal why, Counter counter, const protocol::IpAddress& peer,
                 const std::string& detail = {});

 private:
  Context& context_;
  const config::DaemonConfig& config_;
  std::optional<TlsContext> tls_;
  PeerLimits limits_;
  std::int64_t warned_ns_ = 0;  // monotonic
};

/// Loads the keys of host.key_file. Returns none where no file is named. Errors: those of the file,
/// naming the key of the configuration.
[[nodiscard]] physics::Result<std::vector<protocol::SessionKey>> load_host_keys(
    const config::DaemonConfig& config);

/// Checks the certificates and keys of files that `config` names. Errors: those of a start.
[[nodiscard]] physics::Result<void> check_security(const config::DaemonConfig& config);

}  // namespace emit::server
