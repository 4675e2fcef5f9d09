// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <string>

#include "agents/context.hpp"
#include "agents/sender/socket_client.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/protocol/parity.hpp"
#include "net/socket.hpp"

namespace emit::v1 {
class Subscribe;
class Subscribed;
}  // namespace emit::v1

namespace emit::server {

/// Decides on the requests of clients: channel, transport, error correction, resend, compression.
/// Thread: the receiver's. Real time: not RT-safe, because subscribing allocates.
class Subscriptions {
 public:
  Subscriptions(Context& context, const config::DaemonConfig& config, const SocketContext& sockets)
      : context_(context), config_(config), sockets_(sockets) {}

  /// The connection that subscribes.
  struct Caller {
    std::uint32_t key = 0;  ///< of the connection, on rings
    SocketAddress peer;
    TcpSocket* socket = nullptr;
  };
  /// Reason for the refusal of a subscription.
  struct Refusal {
    StatusCode code = StatusCode::not_allowed;
    std::string text;
  };
  /// Decides on a subscription and fills in the answer. The answer does not go out here, and no
  /// memory of the client is taken yet.
  [[nodiscard]] tl::expected<SocketClient::Params, Refusal> grant(const Caller& caller,
                                                                  const v1::Subscribe& subscribe,
                                                                  v1::Subscribed& answer);

 private:
  [[nodiscard]] tl::expected<const Channel*, Refusal> channel_for(
      const v1::Subscribe& subscribe) const;
  /// Fills in the terms of a subscription over UDP.
  [[nodiscard]] physics::Result<void> grant_udp(const Caller& caller,
                                                const v1::Subscribe& subscribe,
                                                SocketClient::Params& params) const;
  [[nodiscard]] physics::Result<protocol::FecParams> error_correction_for(
      const v1::Subscribe& subscribe, const Channel& channel,
      std::uint32_t fragment_payload_bytes) const;
  [[nodiscard]] physics::Result<UdpSocket> open_stream_socket(const Caller& caller,
                                                              std::uint32_t port,
                                                              const std::string& group) const;
  /// Returns the destination of frames: the caller's address, or a group that the configuration
  /// allows.
  [[nodiscard]] physics::Result<SocketAddress> target_of(const Caller& caller, std::uint32_t port,
                                                         const std::string& group) const;

  Context& context_;
  const config::DaemonConfig& config_;
  const SocketContext& sockets_;
  std::uint16_t next_stream_id_ = 1;
};

}  // namespace emit::server
