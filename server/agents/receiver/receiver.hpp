// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "agents/receiver/host_sessions.hpp"
#include "agents/receiver/peer_limits.hpp"
#include "agents/sender/socket_client.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/protocol/codec.hpp"
#include "emit/protocol/framing.hpp"
#include "net/socket.hpp"
#include "net/tls_session.hpp"
#include "rt/fd.hpp"

namespace emit::v1 {
class ControlRecord;
class Subscribe;
class Welcome;
}  // namespace emit::v1

namespace emit::server {

/// Takes host frames from the UDP port and everything that arrives over TCP; checks what a message
/// alone can tell, answers refusals with a Status, hands the rest to the conductor in order of
/// arrival. When the conductor's ring is full it stops reading, so that the kernel's buffers fill;
/// so it does with a connection that sends more than its pace.
///
/// Owns every connection. Frames and journal are written by sender and recorder, which are lent the
/// descriptor and give it back before it is closed.
/// Real time: host frames are RT-safe; connecting, subscribing and leaving allocate.
class Receiver final : public Agent {
 public:
  /// What Welcome says beside channels and run id.
  struct Identity {
    std::string software;
    std::string scenario;
    std::string pacing;
    std::string device;
  };
  Receiver(Context& context, const config::DaemonConfig& config);
  ~Receiver() override;

  /// Opens the ports. Errors (config, io).
  [[nodiscard]] physics::Result<void> open();
  /// Before start.
  void set_identity(Identity identity) { identity_ = std::move(identity); }
  /// Serialised emit.v1.Welcome, as a client would get it now.
  [[nodiscard]] std::vector<std::byte> welcome() const;
  [[nodiscard]] SocketAddress control_address() const noexcept;
  /// Of TCP clients, see TcpListener. After open().
  [[nodiscard]] CongestionControl congestion_control() const {
    return listener_.congestion_control();
  }
  /// length 0: no host port.
  [[nodiscard]] SocketAddress host_address() const noexcept;

  [[nodiscard]] std::string_view name() const noexcept override { return "receiver"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  void on_stop() noexcept override;
  [[nodiscard]] int wait_fd() const noexcept override { return epoll_.get(); }
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return wake_at_ns_; }

  /// Whether access.allow lets this address in. Any thread.
  [[nodiscard]] bool may_connect(const protocol::IpAddress& peer) const noexcept;
  /// Any thread: takes no further host frames, commands or connections.
  void drain() noexcept { draining_.store(true, std::memory_order_release); }

 private:
  struct Connection;
  struct UdpMemory;
  using Role = protocol::PeerRole;

  // Who may connect (receiver_access.cpp).
  [[nodiscard]] physics::Result<void> open_security();
  void turn_away(PeerRefusal why, Counter counter, const protocol::IpAddress& peer,
                 const std::string& detail = {});
  [[nodiscard]] std::size_t connections_from(const protocol::IpAddress& peer) const noexcept;
  [[nodiscard]] std::size_t handshakes() const noexcept;
  int handshake(Connection& connection, std::int64_t now_ns);
  void agree_on_key(Connection& connection);
  [[nodiscard]] std::optional<std::span<const std::byte>> authenticate(
      std::span<const std::byte> datagram, const protocol::IpAddress& peer, Origin& origin);

  // UDP host port (receiver_udp.cpp).
  int receive_datagrams(std::int64_t now_ns) noexcept;
  void take_datagram(std::size_t index, std::size_t bytes, std::int64_t now_ns) noexcept;
  void send_udp_status(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
                       std::uint64_t count, const std::string& text) noexcept;

  // TCP (receiver.cpp, receiver_session.cpp).
  [[nodiscard]] bool watch_listener() noexcept;
  void pause_accepting(std::int64_t now_ns, int error) noexcept;
  void resume_accepting(std::int64_t now_ns) noexcept;
  int accept_connections(std::int64_t now_ns);
  int read(Connection& connection, std::int64_t now_ns);
  int parse(Connection& connection, std::int64_t now_ns);
  /// Whether what a connection waits for has come.
  [[nodiscard]] bool may_go_on(const Connection& connection) noexcept;
  void take_record(Connection& connection, const protocol::Record& record, std::int64_t now_ns);
  void take_host_frame(Connection& connection, std::span<const std::byte> bytes,
                       std::int64_t now_ns);
  void take_control(Connection& connection, std::span<const std::byte> body);
  [[nodiscard]] physics::Result<SocketAddress> listen_address(std::string_view key,
                                                              const std::string& endpoint,
                                                              Transport transport,
                                                              config::Port port) const;
  /// True when the connection was taken into the table.
  bool admit(TcpSocket socket, const SocketAddress& peer);
  void fill_welcome(v1::Welcome& welcome) const;
  void take_hello(Connection& connection, const v1::ControlRecord& record);
  void take_subscribe(Connection& connection, const v1::ControlRecord& record);
  void take_resend(Connection& connection, std::span<const std::byte> body);
  [[nodiscard]] physics::Result<protocol::FecParams> error_correction_for(
      const v1::Subscribe& subscribe, const Channel& channel,
      std::uint32_t fragment_payload_bytes) const;
  [[nodiscard]] physics::Result<UdpSocket> open_stream_socket(const Connection& connection,
                                                              std::uint32_t port,
                                                              const std::string& group) const;
  void refuse(Connection& connection, StatusCode code, const std::string& text,
              std::uint64_t host_frame_number = 0);
  void send_status(Connection& connection, StatusCode code, const std::string& text,
                   std::uint64_t host_frame_number, std::uint64_t count);
  void queue(Connection& connection, const v1::ControlRecord& record);
  void flush(Connection& connection) noexcept;
  void close(Connection& connection, std::string_view why) noexcept;
  void finish_close(Connection& connection) noexcept;
  int take_replies();
  int take_released() noexcept;
  /// 0: the conductor rings when there is some.
  [[nodiscard]] std::size_t room_for_inputs() noexcept;
  void check_timeouts(std::int64_t now_ns) noexcept;
  void watch(Connection& connection) noexcept;

  Context& context_;
  const config::DaemonConfig& config_;
  Identity identity_;
  Fd epoll_;
  SocketContext sockets_;
  TcpListener listener_;
  UdpSocket udp_;
  std::unique_ptr<UdpMemory> udp_memory_;
  bool udp_watched_ = false;
  std::int64_t accept_again_ns_ = 0;  // monotonic; 0: the listener is watched
  std::uint32_t os_drops_seen_ = 0;
  std::optional<TlsContext> tls_;
  std::unique_ptr<HostSessions> sessions_;  // null: bare datagrams are taken
  PeerLimits limits_;
  std::int64_t warned_ns_ = 0;  // of datagrams dropped unread
  protocol::HostFrameDecoder decoder_;
  protocol::HostFrameData refused_;  // what a refused frame decodes into
  std::vector<std::unique_ptr<Connection>> connections_;
  std::uint16_t next_stream_id_ = 1;
  std::int64_t wake_at_ns_ = kNeverNs;
  std::int64_t status_window_ns_ = 0;  // rate limit of answers over UDP
  std::uint32_t statuses_in_window_ = 0;
  std::atomic<bool> draining_{false};
};

/// Certificates and keys of files that `config` names. Errors as a start would have them.
[[nodiscard]] physics::Result<void> check_security(const config::DaemonConfig& config);

}  // namespace emit::server
