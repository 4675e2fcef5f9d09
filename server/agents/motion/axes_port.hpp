// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "emit/physics/error.hpp"
#include "emit/protocol/axes.hpp"
#include "net/socket.hpp"
#include "rt/counters.hpp"

namespace emit::server {

/// UDP socket to the controller of a motion simulator (docs/wire.md section 12). It takes datagrams
/// of the controller alone: the kernel drops those of others.
///
/// Thread: the motion agent's after open(). Real time: RT-safe after open().
class AxesPort {
 public:
  /// Errors (config, io), naming motion.controller.
  [[nodiscard]] static physics::Result<AxesPort> open(const std::string& controller,
                                                      Counters& counters);

  /// Returns the next message of the controller that has arrived, without waiting. Datagrams that
  /// are none are counted (axes_reports_refused) and dropped.
  [[nodiscard]] std::optional<protocol::AxesMonitor> receive() noexcept;
  /// Sends a command. What the kernel refuses is counted (axes_send_errors).
  void send(const protocol::AxesCommand& command) noexcept;

  [[nodiscard]] int fd() const noexcept { return socket_.fd(); }

 private:
  AxesPort(UdpSocket socket, Counters& counters)
      : socket_(std::move(socket)), counters_(&counters) {}

  UdpSocket socket_;
  Counters* counters_;
  protocol::AxesCodec codec_;
};

}  // namespace emit::server
