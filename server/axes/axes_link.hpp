// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>

#include "emit/protocol/axes.hpp"

namespace emit::server {

/// Interface of the ways to the controller of a motion simulator.
///
/// Thread: the motion agent's after it was opened. Real time: RT-safe after it was opened.
class AxesLink {
 public:
  AxesLink() = default;
  AxesLink(const AxesLink&) = delete;
  AxesLink& operator=(const AxesLink&) = delete;
  virtual ~AxesLink() = default;

  /// Returns the next message of the controller that has arrived by `now_ns`, without waiting. What
  /// is none is counted (axes_reports_refused) and dropped.
  [[nodiscard]] virtual std::optional<protocol::AxesMonitor> receive(
      std::int64_t now_ns) noexcept = 0;
  /// Sends a command, or counts it where it cannot be sent now.
  virtual void send(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept = 0;
  /// Returns a descriptor that is readable when something has arrived. It may be another one after
  /// each call. -1: there is none, so look once a period.
  [[nodiscard]] virtual int fd() const noexcept = 0;
};

}  // namespace emit::server
