// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "emit/physics/error.hpp"
#include "net/io_result.hpp"
#include "net/socket_address.hpp"

namespace boost::asio {
class io_context;
}

/// Sockets as emitd uses them: Boost.Asio's, non-blocking and close-on-exec, used synchronously.
/// Nothing here starts a thread or throws. Who has to wait does so with poll or epoll on fd(), so
/// that one wait covers sockets and doorbells alike and allocates nothing.
///
/// Boost's headers stay in the .cpp files. Opening, accepting and closing allocate; reading,
/// writing and the options are RT-safe.
namespace emit::server {

/// State that Asio keeps beside the sockets; each socket keeps it alive. Thread: any.
class SocketContext {
 public:
  SocketContext();
  [[nodiscard]] const std::shared_ptr<boost::asio::io_context>& get() const noexcept {
    return context_;
  }

 private:
  std::shared_ptr<boost::asio::io_context> context_;
};

class TlsContext;
class TlsSession;

/// Connected stream, plain or through TLS. Thread: one owner; in addition, another thread may write
/// while the owner reads: Asio's synchronous send and receive only read what the object holds, and
/// a TLS session says `busy` to whoever meets the other inside.
class TcpSocket {
 public:
  TcpSocket() noexcept;  ///< closed
  TcpSocket(TcpSocket&& other) noexcept;
  TcpSocket& operator=(TcpSocket&& other) noexcept;
  ~TcpSocket();

  /// Waits up to `timeout_ns` for the connection. Errors: io, naming the address. No other socket
  /// of `context` may be connecting.
  [[nodiscard]] static physics::Result<TcpSocket> connect(const SocketContext& context,
                                                          const SocketAddress& address,
                                                          std::int64_t timeout_ns);
  /// Takes over a connected stream descriptor. Errors: io; the descriptor stays the
  /// caller's then.
  [[nodiscard]] static physics::Result<TcpSocket> adopt(const SocketContext& context, int fd);

  [[nodiscard]] explicit operator bool() const noexcept { return impl_ != nullptr; }
  /// -1 when closed.
  [[nodiscard]] int fd() const noexcept;
  [[nodiscard]] SocketAddress local_address() const noexcept;
  /// Returns the address of the other end. It differs from the address that was asked for where
  /// that was "any address".
  [[nodiscard]] SocketAddress peer_address() const noexcept;
  void close() noexcept;
  void shutdown_send() noexcept;

  /// The kernel may refuse. 0: the system goes on choosing.
  void set_send_buffer(std::uint64_t bytes) noexcept;
  /// Makes the socket readable only when this many bytes wait, or the end. The kernel may refuse.
  void set_receive_low_water(std::size_t bytes) noexcept;

  /// Sends everything through TLS from here on; the caller drives the handshake by tls(). Errors:
  /// io.
  /// @param name  name of the server, for clients
  [[nodiscard]] physics::Result<void> start_tls(const TlsContext& context, const std::string& name);
  /// Null: plain.
  [[nodiscard]] TlsSession* tls() const noexcept;
  /// More was received than the descriptor shows: read before waiting for it.
  [[nodiscard]] bool has_buffered() const noexcept;

  [[nodiscard]] IoResult read_some(std::span<std::byte> space) noexcept;
  [[nodiscard]] IoResult write_some(std::span<const std::byte> bytes) noexcept;
  /// Up to kMaxPieces pieces in one system call.
  [[nodiscard]] IoResult write_some(std::span<const std::span<const std::byte>> pieces) noexcept;
  static constexpr std::size_t kMaxPieces = 4;

 private:
  friend class TcpListener;
  struct Impl;
  explicit TcpSocket(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Up to kMaxLentPieces pieces to a stream that another agent owns and has lent; in one system call
/// where it is plain. RT-safe.
[[nodiscard]] IoResult write_lent(TcpSocket& socket,
                                  std::span<const std::span<const std::byte>> pieces) noexcept;
inline constexpr std::size_t kMaxLentPieces = 64;

/// Who decides how fast TCP sends, as the kernel names it; empty: unknown.
struct CongestionControl {
  std::string chosen;
  std::string system;  ///< what it would have been
};
/// Returns the congestion control that new sockets have; empty: unknown.
[[nodiscard]] std::string system_congestion_control();

/// Thread: one owner.
class TcpListener {
 public:
  TcpListener() noexcept;  ///< closed
  TcpListener(TcpListener&& other) noexcept;
  TcpListener& operator=(TcpListener&& other) noexcept;
  ~TcpListener();

  /// Its connections have the congestion control that the system has now; where that is BBR, which
  /// paces, cubic, or reno where cubic is not allowed. A route's own (`congctl`) goes before both.
  /// Errors (io): address in use and so on, naming the address.
  [[nodiscard]] static physics::Result<TcpListener> open(const SocketContext& context,
                                                         const SocketAddress& address);
  [[nodiscard]] int fd() const noexcept;
  [[nodiscard]] SocketAddress local_address() const noexcept;
  /// Returns the congestion control of its connections.
  [[nodiscard]] CongestionControl congestion_control() const;
  /// Next connection; closed when there is none now, or one cannot be taken: `error_number`, else
  /// 0. It waits in the kernel then, and the listener stays readable. Throws std::bad_alloc.
  [[nodiscard]] TcpSocket accept(SocketAddress& peer, int& error_number);

 private:
  struct Impl;
  explicit TcpListener(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

/// Thread: one owner.
class UdpSocket {
 public:
  UdpSocket() noexcept;  ///< closed
  UdpSocket(UdpSocket&& other) noexcept;
  UdpSocket& operator=(UdpSocket&& other) noexcept;
  ~UdpSocket();

  /// Opens a socket of the family of `address`. Errors: io.
  [[nodiscard]] static physics::Result<UdpSocket> open(const SocketContext& context,
                                                       const SocketAddress& address);
  /// open() and bind().
  [[nodiscard]] static physics::Result<UdpSocket> open_bound(const SocketContext& context,
                                                             const SocketAddress& address);
  /// Errors (io), naming the address.
  [[nodiscard]] physics::Result<void> bind(const SocketAddress& address);
  /// Fixes the peer. Errors (io), naming the address.
  [[nodiscard]] physics::Result<void> connect(const SocketAddress& address);

  [[nodiscard]] explicit operator bool() const noexcept { return impl_ != nullptr; }
  /// Returns the descriptor, for the calls with control messages that Asio has no functions for; -1
  /// when closed.
  [[nodiscard]] int fd() const noexcept;
  [[nodiscard]] SocketAddress local_address() const noexcept;

  [[nodiscard]] IoResult receive(std::span<std::byte> space) noexcept;
  [[nodiscard]] IoResult send(std::span<const std::byte> bytes) noexcept;
  [[nodiscard]] IoResult send_to(std::span<const std::byte> bytes,
                                 const SocketAddress& target) noexcept;

  /// Several sockets may bind the port: wanted for multicast.
  void allow_shared_port() noexcept;
  /// Joins on an interface (interface_of(); 0: the system's choice). Returns 0 or an errno.
  [[nodiscard]] int join_group(const SocketAddress& group, unsigned interface) noexcept;
  /// Sets the interface by which multicast of this socket leaves. Returns 0 or an errno.
  [[nodiscard]] int set_multicast_interface(const SocketAddress& group,
                                            unsigned interface) noexcept;
  /// 0 to 255.
  void set_multicast_hops(int hops) noexcept;
  /// Asks for a receive buffer; past the system's limit where privileges allow. Returns the bytes
  /// granted, in the unit of net.core.rmem_max (the kernel books twice that).
  std::uint64_t set_receive_buffer(std::uint64_t bytes) noexcept;
  void set_send_buffer(std::uint64_t bytes) noexcept;
  /// An option of the system that Asio has no name for. A wish: what the kernel refuses shows in
  /// what the caller reads back.
  void set_option(int level, int name, int value) noexcept;

 private:
  struct Impl;
  explicit UdpSocket(std::unique_ptr<Impl> impl) noexcept;
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::server
