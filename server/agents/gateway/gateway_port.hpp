// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/ip_address.hpp"
#include "net/socket.hpp"
#include "net/stamped_receive.hpp"
#include "rt/clock.hpp"
#include "rt/counters.hpp"

namespace emit::server {

/// UDP port of hosts that do not speak emitd's own messages.
///
/// Thread: the gateway agent's after open(). Real time: RT-safe after open().
class GatewayPort {
 public:
  /// Place of the port, and senders whose datagrams it takes.
  struct Options {
    std::string section;  ///< of the configuration, for messages
    std::string listen;   ///< address:port of this end
    /// address:port of the other end, from whose address alone datagrams are taken, from any of its
    /// ports. Empty: nobody is answered, and `allow` says whose datagrams are taken.
    std::string host;
    std::vector<protocol::Network> allow;  ///< beside loopback; empty: every host
    std::string group;                     ///< multicast group to join; empty: none
  };
  /// Errors (config, io), naming the key.
  [[nodiscard]] static physics::Result<GatewayPort> open(const Options& options, const Clock& clock,
                                                         Counters& counters);

  /// Returns the next datagram of the host that has arrived, without waiting. It is valid until the
  /// next call.
  [[nodiscard]] std::optional<StampedDatagram> receive() noexcept;
  /// Sends a message to the host. What the kernel refuses is counted.
  void send(std::span<const std::byte> message) noexcept;

  [[nodiscard]] int fd() const noexcept { return socket_.fd(); }
  [[nodiscard]] SocketAddress address() const noexcept { return socket_.local_address(); }

 private:
  GatewayPort(UdpSocket socket, const SocketAddress& host, std::vector<protocol::Network> allow,
              const Clock& clock, Counters& counters);
  [[nodiscard]] bool admits(const protocol::IpAddress& peer) const noexcept;

  static constexpr std::size_t kDatagramBytes = 65536;

  UdpSocket socket_;
  StampedReceiver receiver_;
  SocketAddress host_;  ///< length 0: nobody is answered
  std::vector<protocol::Network> allow_;
  const Clock* clock_;
  Counters* counters_;
  std::unique_ptr<std::array<std::byte, kDatagramBytes>> space_;
};

}  // namespace emit::server
