// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <mutex>
#include <optional>
#include <utility>

#include "emit/physics/error.hpp"
#include "rt/fd.hpp"
#include "telemetry/ptp_status.hpp"

namespace emit::server {

/// Asks linuxptp's ptp4l once a second, over its management socket, how its clock is. turn() is
/// main's; never for agents. Nothing blocks: who does not answer within 3 s is not up.
class PtpMonitor {
 public:
  /// @param path  "/var/run/ptp4lro", which everybody may ask, or "/var/run/ptp4l".
  /// Errors: config (longer than a socket's path may be), io (no socket). ptp4l need not run yet.
  [[nodiscard]] static physics::Result<std::unique_ptr<PtpMonitor>> open(
      const std::filesystem::path& path, std::uint8_t domain);

  /// Change that the log reports; mostly none.
  enum class Change : std::uint8_t { none, went_up, went_down, state };
  [[nodiscard]] Change turn(std::int64_t monotonic_ns);

  /// Thread: any.
  [[nodiscard]] PtpStatus status() const {
    const std::lock_guard lock(mutex_);
    return shown_;
  }

 private:
  PtpMonitor(Fd socket, std::filesystem::path path, std::uint8_t domain)
      : socket_(std::move(socket)), path_(std::move(path)), domain_(domain) {}
  void ask();
  void take_answers(std::int64_t monotonic_ns);

  Fd socket_;
  std::filesystem::path path_;
  std::uint8_t domain_;
  std::uint16_t sequence_ = 0;
  std::optional<std::int64_t> asked_ns_;
  std::optional<std::int64_t> answered_ns_;
  PtpStatus asked_for_;  // of the round under way
  mutable std::mutex mutex_;
  PtpStatus shown_;
};

}  // namespace emit::server
