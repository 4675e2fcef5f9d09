// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <atomic>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "agents/receiver/admission.hpp"
#include "agents/receiver/connection_table.hpp"
#include "agents/receiver/control_session.hpp"
#include "agents/receiver/host_frame_port.hpp"
#include "emit/config/daemon_config.hpp"
#include "net/socket.hpp"

namespace emit::server {

/// Takes host frames from the UDP port and everything that arrives over TCP, and hands both to the
/// conductor in order of arrival. Its parts are the admission of peers, the table of connections,
/// the conversation on them, and the host port; this class is the loop that turns them.
///
/// The receiver stops reading when the conductor's ring is full, so that the kernel's buffers fill.
/// It also stops reading a connection that sends more than its pace.
/// Real time: host frames are RT-safe; connecting, subscribing and leaving allocate.
class Receiver final : public Agent {
 public:
  using Identity = ControlSession::Identity;

  Receiver(Context& context, const config::DaemonConfig& config);

  /// Opens the ports. Errors (config, io).
  [[nodiscard]] physics::Result<void> open();
  /// Sets the fields of Welcome. Call it before start.
  void set_identity(Identity identity) { session_.set_identity(std::move(identity)); }
  /// Returns the serialised emit.v1.Welcome that a client would get now.
  [[nodiscard]] std::vector<std::byte> welcome() const { return session_.welcome(); }
  [[nodiscard]] SocketAddress control_address() const noexcept { return listener_.local_address(); }
  /// Congestion control of TCP clients, see TcpListener. Call it after open().
  [[nodiscard]] CongestionControl congestion_control() const {
    return listener_.congestion_control();
  }
  /// Returns the address of the host port; length 0: there is no host port.
  [[nodiscard]] SocketAddress host_address() const noexcept { return host_port_.address(); }

  [[nodiscard]] std::string_view name() const noexcept override { return "receiver"; }
  [[nodiscard]] bool on_start() noexcept override;
  int do_work(std::int64_t now_ns) noexcept override;
  void on_stop() noexcept override;
  [[nodiscard]] int wait_fd() const noexcept override { return connections_.epoll_fd(); }
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override { return wake_at_ns_; }

  /// Returns whether access.allow lets this address in. Thread: any.
  [[nodiscard]] bool may_connect(const protocol::IpAddress& peer) const noexcept {
    return admission_.may_connect(peer);
  }
  /// Takes no further host frames, commands or connections. Thread: any.
  void drain() noexcept { drain_.store(true, std::memory_order_release); }

 private:
  /// Returns the address that a key of the configuration states. Errors (config, io) name the key.
  /// An address that other hosts reach without the protection that the port needs is an error too.
  [[nodiscard]] physics::Result<SocketAddress> listen_address(std::string_view key,
                                                              const std::string& endpoint,
                                                              Transport transport,
                                                              config::Port port) const;

  // The functions below handle new connections.
  [[nodiscard]] bool watch_listener() noexcept;
  void pause_accepting(std::int64_t now_ns, int error) noexcept;
  void resume_accepting(std::int64_t now_ns) noexcept;
  int accept_connections(std::int64_t now_ns);
  void admit(TcpSocket socket, const SocketAddress& peer);
  /// Turns away a connection for which there is no place, with an answer where it may have one.
  void refuse_place(TcpSocket socket, bool crowded);
  int handshake(Connection& connection, std::int64_t now_ns);

  // The functions below read from connections.
  int take_events(std::int64_t now_ns);
  int take_connection_event(std::uint64_t key, std::uint32_t events, std::int64_t now_ns);
  /// Goes on with connections whose records waited for room or for their pace.
  int resume_connections(std::int64_t now_ns);
  int read(Connection& connection, std::int64_t now_ns);
  int parse(Connection& connection, std::int64_t now_ns);
  /// Ends a connection whose framing is lost, after an answer.
  void refuse_framing(Connection& connection, protocol::ParseStatus status);
  /// Returns true when the connection may go on, because what it waited for has come.
  [[nodiscard]] bool may_go_on(const Connection& connection) noexcept;
  int receive_datagrams(std::int64_t now_ns) noexcept;
  /// Returns the room on the conductor's ring; 0: the conductor rings when there is some.
  [[nodiscard]] std::size_t room_for_inputs() noexcept;

  int take_replies();
  void check_timeouts(std::int64_t now_ns) noexcept;
  void check_timeout(Connection& connection, std::int64_t now_ns) noexcept;

  Context& context_;
  const config::DaemonConfig& config_;
  SocketContext sockets_;
  TcpListener listener_;
  Admission admission_;
  ConnectionTable connections_;
  HostFramePort host_port_;
  ControlSession session_;
  std::int64_t accept_again_ns_ = 0;  // monotonic; 0: the listener is watched
  std::int64_t wake_at_ns_ = kNeverNs;
  std::atomic<bool> drain_{false};
  bool draining_ = false;  // drain_ as it was when the turn began, the same for the whole turn
};

}  // namespace emit::server
