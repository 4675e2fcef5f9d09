// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <string>
#include <utility>

#include "axes/axes_link.hpp"
#include "emit/physics/error.hpp"
#include "net/socket.hpp"
#include "rt/counters.hpp"

namespace emit::server {

/// UDP socket to the controller of a motion simulator (docs/wire.md section 12). It takes datagrams
/// of the controller alone: the kernel drops those of others.
class UdpAxesLink final : public AxesLink {
 public:
  /// @param controller  "address:port"
  /// Errors: config, io.
  [[nodiscard]] static physics::Result<std::unique_ptr<UdpAxesLink>> open(
      const std::string& controller, Counters& counters);

  [[nodiscard]] std::optional<protocol::AxesMonitor> receive(std::int64_t now_ns) noexcept override;
  /// Sends a datagram. One that the kernel refuses is counted (axes_send_errors).
  void send(const protocol::AxesCommand& command, std::int64_t now_ns) noexcept override;
  [[nodiscard]] int fd() const noexcept override { return socket_.fd(); }

 private:
  UdpAxesLink(UdpSocket socket, Counters& counters)
      : socket_(std::move(socket)), counters_(counters) {}

  UdpSocket socket_;
  Counters& counters_;
  protocol::AxesCodec codec_;
};

}  // namespace emit::server
