// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/client/client.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/protocol/host_session.hpp"
#include "net/socket.hpp"
#include "net/tls_session.hpp"

namespace emit::v1 {
class ChannelInfo;
class ControlRecord;
class Status;
class Welcome;
}  // namespace emit::v1

namespace emit::client {

[[nodiscard]] std::int64_t monotonic_now_ns() noexcept;
/// Waits for `events` on a descriptor until `end_ns` (monotonic). False: the time is up.
[[nodiscard]] bool wait_for(int fd, short events, std::int64_t end_ns) noexcept;
[[nodiscard]] ServerStatus to_status(const v1::Status& status);
[[nodiscard]] ChannelDescription describe_channel(const v1::ChannelInfo& info);
[[nodiscard]] ServerInfo to_server_info(const v1::Welcome& welcome);

/// Control connection of a client: hello on opening, then records both ways.
class ClientConnection {
 public:
  /// Hello and Welcome. Errors: io, protocol (what the daemon answered instead).
  [[nodiscard]] static physics::Result<ClientConnection> open(const Url& url,
                                                              protocol::PeerRole role,
                                                              std::int64_t timeout_ns,
                                                              const Security& security = {});
  /// The same over a stream that is connected already, until `end_ns` (monotonic). `limits`: of
  /// what the daemon may send.
  [[nodiscard]] static physics::Result<ClientConnection> greet(
      server::SocketContext context, server::TcpSocket socket, server::SocketAddress peer,
      protocol::PeerRole role, std::int64_t end_ns, const protocol::RecordLimits& limits = {});

  [[nodiscard]] int fd() const noexcept { return socket_.fd(); }
  [[nodiscard]] const server::SocketContext& context() const noexcept { return context_; }
  [[nodiscard]] const ServerInfo& server() const noexcept { return info_; }
  [[nodiscard]] const server::SocketAddress& peer() const noexcept { return peer_; }
  [[nodiscard]] server::SocketAddress local_address() const noexcept {
    return socket_.local_address();
  }
  /// Null: plain.
  [[nodiscard]] server::TlsSession* tls() const noexcept { return socket_.tls(); }
  /// True after the peer closed in order, between two records.
  [[nodiscard]] bool closed() const noexcept { return closed_; }

  /// Replaces the parser by one that takes records this large. Only between records.
  void allow_frames(std::uint32_t max_frame_bytes);

  /// Next record; false when the time is up. The body lives until the next call.
  /// Errors: io (closed), protocol (framing).
  [[nodiscard]] physics::Result<bool> receive(protocol::Record& record, std::int64_t end_ns);
  [[nodiscard]] physics::Result<void> send(std::span<const std::byte> bytes, std::int64_t end_ns);
  [[nodiscard]] physics::Result<void> send(const v1::ControlRecord& record, std::int64_t end_ns);

 private:
  ClientConnection(server::SocketContext context, server::TcpSocket socket,
                   server::SocketAddress peer, const protocol::RecordLimits& limits);
  void wake_at(std::size_t bytes) noexcept;

  server::SocketContext context_;
  server::TcpSocket socket_;
  server::SocketAddress peer_;
  protocol::RecordLimits limits_;
  protocol::RecordParser parser_;
  ServerInfo info_;
  std::vector<std::byte> out_;
  bool closed_ = false;
  std::size_t low_water_bytes_ = 1;
};

/// Why SubscribeOptions::every_nth is refused.
[[nodiscard]] std::string every_nth_error(std::uint32_t every_nth);
/// Host datagrams with a MAC by `key`; `control`: the connection over which it was agreed, if any.
/// Waits up to `timeout_ns` for the daemon's challenge. Errors: io, internal.
[[nodiscard]] physics::Result<std::unique_ptr<HostClient>> make_session_host(
    server::UdpSocket socket, const server::SocketAddress& peer, const protocol::SessionKey& key,
    std::optional<ClientConnection> control, std::int64_t timeout_ns);

/// Makes the client of client.hpp over a connection that is open in that role.
[[nodiscard]] std::unique_ptr<FrameClient> make_frame_client(ClientConnection connection, bool udp);
[[nodiscard]] std::unique_ptr<HostClient> make_tcp_host(ClientConnection connection);
[[nodiscard]] std::unique_ptr<RecorderClient> make_recorder(ClientConnection connection);

}  // namespace emit::client
