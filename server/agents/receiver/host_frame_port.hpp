// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "agents/context.hpp"
#include "agents/receiver/admission.hpp"
#include "agents/receiver/host_sessions.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/protocol/codec.hpp"
#include "net/socket.hpp"

namespace emit::server {

/// The UDP port of host frames. It takes datagrams with their arrival times, checks their origin if
/// that is required, decodes them onto the conductor's ring, and sends the answers.
/// Thread: the receiver's. Real time: sound datagrams are RT-safe; a refused one allocates.
class HostFramePort {
 public:
  HostFramePort(Context& context, Admission& admission);
  ~HostFramePort();

  /// Opens the port. Errors: io (address in use), those of host.key_file.
  /// @param address  where to listen
  /// @param config  says whether datagrams must carry a MAC, and by which keys
  [[nodiscard]] physics::Result<void> open(const SocketContext& sockets,
                                           const SocketAddress& address,
                                           const config::DaemonConfig& config);
  [[nodiscard]] bool is_open() const noexcept { return static_cast<bool>(socket_); }
  /// Returns the address of the port; length 0: there is no host port.
  [[nodiscard]] SocketAddress address() const noexcept { return socket_.local_address(); }
  /// Returns the sessions; null: bare datagrams are accepted.
  [[nodiscard]] HostSessions* sessions() noexcept { return sessions_.get(); }

  /// Watches the port with an epoll instance, under `key`. Returns false when the kernel refuses.
  [[nodiscard]] bool watch(int epoll_fd, std::uint64_t key) noexcept;
  /// Returns true when the epoll instance reports datagrams. It does not while the ring is full;
  /// the receiver then calls receive() by itself.
  [[nodiscard]] bool watched() const noexcept { return watched_; }
  /// Takes up to `room` datagrams; 0: stops watching the port. Returns the number taken.
  int receive(std::size_t room, std::int64_t now_ns) noexcept;
  /// Answers a datagram, unless there are too many answers already.
  void send_status(const Origin& origin, StatusCode code, std::uint64_t host_frame_number,
                   std::uint64_t count, const std::string& text) noexcept;

 private:
  struct Memory;

  void take_datagram(std::size_t index, std::size_t bytes, std::int64_t now_ns) noexcept;
  /// Reads the kernel's time stamp and its count of dropped datagrams. Returns the instant of
  /// arrival, wall; `now_ns` where the kernel has none.
  [[nodiscard]] std::int64_t read_control_messages(std::size_t index, std::int64_t now_ns) noexcept;
  /// Returns the host frame in a datagram with a MAC; empty where there is none to take.
  [[nodiscard]] std::optional<std::span<const std::byte>> authenticate(
      std::span<const std::byte> datagram, const protocol::IpAddress& peer, Origin& origin);
  /// Counts, logs and answers a datagram that is refused.
  void refuse(const Origin& origin, std::span<const std::byte> datagram, StatusCode code,
              std::uint64_t host_frame_number, std::string_view text, std::string_view event_text);

  Context& context_;
  Admission& admission_;
  UdpSocket socket_;
  std::unique_ptr<Memory> memory_;
  std::unique_ptr<HostSessions> sessions_;
  protocol::HostFrameDecoder decoder_;
  int epoll_fd_ = -1;
  std::uint64_t key_ = 0;
  bool watched_ = false;
  std::uint32_t os_drops_seen_ = 0;
  std::int64_t status_window_ns_ = 0;  // rate limit of the answers
  std::uint32_t statuses_in_window_ = 0;
};

}  // namespace emit::server
