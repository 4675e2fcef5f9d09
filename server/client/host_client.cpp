// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <poll.h>

#include <array>
#include <cerrno>

#include "client/client_connection.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"
#include "net/key_file.hpp"
#include "rt/error_text.hpp"

namespace emit::client {
namespace {

using physics::ErrorCode;
using physics::make_error;

class TcpHost final : public HostClient {
 public:
  explicit TcpHost(ClientConnection connection) : connection_(std::move(connection)) {}

  physics::Result<void> send(const protocol::HostFrameData& frame,
                             std::int64_t timeout_ns) override {
    const auto body = encoder_.encode(frame);
    record_.resize(protocol::kRecordHeaderBytes + body.size());
    protocol::encode_record_header(protocol::RecordKind::host_frame,
                                   static_cast<std::uint32_t>(body.size()),
                                   std::span(record_).first<protocol::kRecordHeaderBytes>());
    std::copy(body.begin(), body.end(), record_.begin() + protocol::kRecordHeaderBytes);
    return connection_.send(record_, monotonic_now_ns() + timeout_ns);
  }
  physics::Result<void> command(protocol::CommandKind command, std::int64_t timeout_ns) override {
    v1::ControlRecord record;
    record.mutable_command()->set_kind(static_cast<v1::Command::Kind>(command));
    return connection_.send(record, monotonic_now_ns() + timeout_ns);
  }
  physics::Result<std::optional<ServerStatus>> receive_status(std::int64_t timeout_ns) override {
    const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
    protocol::Record record;
    for (;;) {
      auto received = connection_.receive(record, end_ns);
      if (!received) {
        return tl::unexpected<physics::Error>(std::move(received.error()));
      }
      if (!*received) {
        return std::optional<ServerStatus>();
      }
      v1::ControlRecord message;
      if (record.kind == protocol::RecordKind::control &&
          protocol::parse_control_record(record.body, message) && message.has_status()) {
        return std::optional<ServerStatus>(to_status(message.status()));
      }
    }
  }
  const ServerInfo* server() const noexcept override { return &connection_.server(); }

 private:
  ClientConnection connection_;
  protocol::HostFrameEncoder encoder_;
  std::vector<std::byte> record_;
};

class UdpHost final : public HostClient {
 public:
  UdpHost(server::UdpSocket socket, server::SocketAddress peer)
      : socket_(std::move(socket)), peer_(peer) {}

  physics::Result<void> send(const protocol::HostFrameData& frame,
                             std::int64_t timeout_ns) override {
    const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
    const auto body = encoder_.encode(frame);
    bool retried = false;
    for (;;) {
      const server::IoResult sent = socket_.send(body);
      if (sent.status == server::IoStatus::done) {
        return {};
      }
      if (sent.error == ECONNREFUSED && !retried) {
        // The report belongs to an earlier datagram and takes this call's place; if nobody listens,
        // the next call tells again.
        retried = true;
        continue;
      }
      const bool full = sent.status == server::IoStatus::would_block;
      if (!full || !wait_for(socket_.fd(), POLLOUT, end_ns)) {
        return make_error(ErrorCode::io,
                          fmt::format("udp {}: {}", to_string(peer_),
                                      server::error_text(full ? EAGAIN : sent.error)));
      }
    }
  }
  physics::Result<void> command(protocol::CommandKind /*command*/,
                                std::int64_t /*timeout_ns*/) override {
    return make_error(ErrorCode::unsupported, "commands need a tcp:// connection");
  }
  physics::Result<std::optional<ServerStatus>> receive_status(std::int64_t timeout_ns) override {
    const std::int64_t end_ns = monotonic_now_ns() + timeout_ns;
    std::array<std::byte, 2048> bytes;
    for (;;) {
      const server::IoResult got = socket_.receive(bytes);
      if (got.status == server::IoStatus::would_block) {
        if (!wait_for(socket_.fd(), POLLIN, end_ns)) {
          return std::optional<ServerStatus>();
        }
        continue;
      }
      if (got.status != server::IoStatus::done) {
        return make_error(ErrorCode::io, fmt::format("udp {}: {}", to_string(peer_),
                                                     server::error_text(got.error)));
      }
      v1::Status status;
      if (status.ParseFromArray(bytes.data(), static_cast<int>(got.bytes))) {
        return std::optional<ServerStatus>(to_status(status));
      }
    }
  }
  const ServerInfo* server() const noexcept override { return nullptr; }

 private:
  server::UdpSocket socket_;
  server::SocketAddress peer_;
  protocol::HostFrameEncoder encoder_;
};

/// The key comes from the TLS session of a connection that stays open as long as the host does.
physics::Result<std::unique_ptr<HostClient>> agree_and_connect(server::UdpSocket socket,
                                                               const server::SocketAddress& peer,
                                                               std::int64_t timeout_ns,
                                                               const Security& security) {
  const auto control = parse_url(security.control);
  if (!control || control->scheme != Url::Scheme::tcp) {
    return make_error(ErrorCode::invalid_argument,
                      "host datagrams with TLS agree on a key over tcp://host:port of the "
                      "control port, not '" +
                          security.control + "'");
  }
  auto connection =
      ClientConnection::open(*control, protocol::PeerRole::host, timeout_ns, security);
  if (!connection) {
    return tl::unexpected<physics::Error>(std::move(connection.error()));
  }
  protocol::SessionKey key;
  if (!connection->tls()->export_key(key)) {
    return make_error(ErrorCode::io, to_string(connection->peer()) + ": TLS gives no key");
  }
  return make_session_host(std::move(socket), peer, key, std::move(*connection), timeout_ns);
}

}  // namespace

std::unique_ptr<HostClient> make_tcp_host(ClientConnection connection) {
  return std::make_unique<TcpHost>(std::move(connection));
}

physics::Result<std::unique_ptr<HostClient>> HostClient::connect(const std::string& url,
                                                                 std::int64_t timeout_ns,
                                                                 const Security& security) {
  const auto parsed = parse_url(url);
  if (!parsed) {
    return tl::unexpected<physics::Error>(physics::Error(parsed.error()));
  }
  if (parsed->scheme == Url::Scheme::tcp) {
    auto connection =
        ClientConnection::open(*parsed, protocol::PeerRole::host, timeout_ns, security);
    if (!connection) {
      return tl::unexpected<physics::Error>(std::move(connection.error()));
    }
    return make_tcp_host(std::move(*connection));
  }
  const auto address = server::resolve({parsed->host, parsed->port}, server::Transport::udp, false);
  if (!address) {
    return tl::unexpected<physics::Error>(physics::Error(address.error()));
  }
  auto socket = server::UdpSocket::open(server::SocketContext(), *address);
  if (!socket) {
    return tl::unexpected<physics::Error>(std::move(socket.error()));
  }
  if (auto connected = socket->connect(*address); !connected) {
    return tl::unexpected<physics::Error>(std::move(connected.error()));
  }
  if (!security.key_file.empty()) {
    const auto keys = server::read_key_file(security.key_file);
    if (!keys) {
      return tl::unexpected<physics::Error>(physics::Error(keys.error()));
    }
    return make_session_host(std::move(*socket), *address, keys->front(), std::nullopt, timeout_ns);
  }
  if (security.tls()) {
    return agree_and_connect(std::move(*socket), *address, timeout_ns, security);
  }
  return std::make_unique<UdpHost>(std::move(*socket), *address);
}

}  // namespace emit::client
