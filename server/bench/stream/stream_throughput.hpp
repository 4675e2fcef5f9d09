// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "bench/stream/stream_yardstick.hpp"
#include "emit/client/client.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "tool/support/daemon_process.hpp"

namespace emit::tool {

/// Returns a configuration that serves canned frames of this size, as `emit bench stream` uses it.
/// `shm` names the ring; empty: there is none.
[[nodiscard]] config::DaemonConfig canned_daemon(std::uint32_t width_px, std::uint32_t height_px,
                                                 const std::string& shm);
/// Returns a name for shared memory that no other process uses.
[[nodiscard]] std::string own_shm_name();

/// Makes a certificate for 127.0.0.1 that is its own authority, and its key, in `directory` by
/// openssl(1). Both ends use it. Errors: not_found (no such program), io.
[[nodiscard]] physics::Result<client::Security> make_certificate(
    const std::filesystem::path& directory);

/// Measurement of the largest frame rate that one client takes. The host requests frames as soon as
/// half of `window` are under way, up to all of it, so that nothing is ever skipped or dropped and
/// only the client limits the transport. Owns a daemon. Thread: one owner.
class StreamThroughput {
 public:
  /// Starts the daemon. `security` is that of host and clients, where the daemon has certificates.
  /// Errors: those of DaemonProcess::start() and HostClient::connect().
  [[nodiscard]] static physics::Result<StreamThroughput> start(
      const config::DaemonConfig& config, const std::filesystem::path& directory,
      const client::Security& security = {});

  /// Makes one measurement with a client of its own. `scheme` is tcp, tls, udp or shm. Errors: io
  /// (the stream ended or stood still).
  [[nodiscard]] physics::Result<YardstickResult> measure(const std::string& scheme,
                                                         std::uint64_t frames,
                                                         std::uint32_t window);
  [[nodiscard]] physics::Result<void> stop();
  /// Device name that the daemon reports. It is known once something has been measured.
  [[nodiscard]] const std::string& device() const { return device_; }

 private:
  StreamThroughput(DaemonProcess daemon, std::unique_ptr<client::HostClient> host, std::string shm,
                   client::Security security)
      : daemon_(std::move(daemon)),
        host_(std::move(host)),
        shm_(std::move(shm)),
        security_(std::move(security)) {}

  DaemonProcess daemon_;
  std::unique_ptr<client::HostClient> host_;
  std::string shm_;
  client::Security security_;
  std::uint64_t last_host_frame_ = 0;
  std::string device_;
};

}  // namespace emit::tool
