// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/protocol/ip_address.hpp"
#include "net/socket.hpp"
#include "net/stamped_receive.hpp"
#include "rt/clock.hpp"
#include "rt/counters.hpp"

namespace emit::server {

/// UDP port of a host that does not speak emitd's own messages. It takes datagrams from the host's
/// address alone, from any of its ports.
///
/// Thread: the gateway agent's after open(). Real time: RT-safe after open().
class GatewayPort {
 public:
  /// @param section  section of the configuration, for messages
  /// @param listen  address:port of this end
  /// @param host  address:port of the other end
  /// Errors (config, io), naming the key.
  [[nodiscard]] static physics::Result<GatewayPort> open(const std::string& section,
                                                         const std::string& listen,
                                                         const std::string& host,
                                                         const Clock& clock, Counters& counters);

  /// Returns the next datagram of the host that has arrived, without waiting. It is valid until the
  /// next call.
  [[nodiscard]] std::optional<StampedDatagram> receive() noexcept;
  /// Sends a message to the host. What the kernel refuses is counted.
  void send(std::span<const std::byte> message) noexcept;

  [[nodiscard]] int fd() const noexcept { return socket_.fd(); }
  [[nodiscard]] SocketAddress address() const noexcept { return socket_.local_address(); }

 private:
  GatewayPort(UdpSocket socket, const SocketAddress& host, const Clock& clock, Counters& counters);

  static constexpr std::size_t kDatagramBytes = 65536;

  UdpSocket socket_;
  StampedReceiver receiver_;
  SocketAddress host_;
  protocol::IpAddress host_ip_;
  const Clock* clock_;
  Counters* counters_;
  std::unique_ptr<std::array<std::byte, kDatagramBytes>> space_;
};

}  // namespace emit::server
