// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {

/// The real emitd as a child process, found beside this executable. Single thread, setup only.
class DaemonProcess {
 public:
  /// Writes `config` to directory/emitd.toml, starts emitd with it and the overrides `set`, and
  /// waits until it reports that it is ready. Its output goes to directory/emitd.log. Errors:
  /// not_found (no emitd), config (it refused the configuration), io (ended or not ready in time).
  /// The text carries the last lines of its log.
  [[nodiscard]] static physics::Result<DaemonProcess> start(const config::DaemonConfig& config,
                                                            const std::vector<std::string>& set,
                                                            const std::filesystem::path& directory,
                                                            std::chrono::milliseconds timeout);

  [[nodiscard]] const std::string& control_address() const noexcept { return control_; }
  [[nodiscard]] const std::string& host_udp_address() const noexcept { return host_udp_; }
  /// Returns an error when the process has ended by itself.
  [[nodiscard]] physics::Result<void> check_alive();
  /// Returns the CPU time of all its threads so far, s.
  [[nodiscard]] double cpu_seconds() const;
  /// Sends SIGTERM and waits. Errors: the process does not end in time (it is killed), or not with
  /// 0.
  [[nodiscard]] physics::Result<void> stop(std::chrono::milliseconds timeout);

 private:
  DaemonProcess(Subprocess process, std::filesystem::path log)
      : process_(std::move(process)), log_(std::move(log)) {}
  [[nodiscard]] std::string log_tail() const;

  Subprocess process_;
  std::filesystem::path log_;
  std::string control_;
  std::string host_udp_;
};

}  // namespace emit::tool
