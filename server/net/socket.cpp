// SPDX-License-Identifier: Apache-2.0
#include "net/socket.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <boost/asio/buffer.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/multicast.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/ip/udp.hpp>
#include <cerrno>
#include <chrono>
#include <climits>
#include <exception>
#include <string>
#include <string_view>

#include "net/asio_endpoint.hpp"
#include "net/tls_session.hpp"
#include "rt/error_text.hpp"

namespace emit::server {
namespace {

namespace asio = boost::asio;
using asio::ip::tcp;
using asio::ip::udp;
using boost::system::error_code;
using physics::ErrorCode;
using physics::make_error;

constexpr int kBacklog = 32;

/// Any option with an int value, in the form that Asio's set_option() takes.
class IntOption {
 public:
  IntOption(int level, int name, int value) noexcept : level_(level), name_(name), value_(value) {}
  template <typename Protocol>
  [[nodiscard]] int level(const Protocol& /*protocol*/) const noexcept {
    return level_;
  }
  template <typename Protocol>
  [[nodiscard]] int name(const Protocol& /*protocol*/) const noexcept {
    return name_;
  }
  template <typename Protocol>
  [[nodiscard]] const void* data(const Protocol& /*protocol*/) const noexcept {
    return &value_;
  }
  template <typename Protocol>
  [[nodiscard]] std::size_t size(const Protocol& /*protocol*/) const noexcept {
    return sizeof(value_);
  }

 private:
  int level_;
  int name_;
  int value_;
};

/// Errors are dropped: an option that the kernel refuses keeps its value.
template <typename Socket, typename Option>
void wish(Socket& socket, const Option& option) noexcept {
  error_code ignored;
  socket.set_option(option, ignored);
}

int buffer_size(std::uint64_t bytes) noexcept {
  return static_cast<int>(std::min<std::uint64_t>(bytes, INT_MAX / 2));
}

/// Asio opens blocking sockets that child processes inherit.
template <typename Socket>
void make_ours(Socket& socket, error_code& error) noexcept {
  if (::fcntl(socket.native_handle(), F_SETFD, FD_CLOEXEC) != 0) {
    error.assign(errno, asio::error::get_system_category());
    return;
  }
  socket.non_blocking(true, error);
}

template <typename Socket, typename Protocol>
void open_ours(Socket& socket, const Protocol& protocol, error_code& error) noexcept {
  socket.open(protocol, error);
  if (!error) {
    make_ours(socket, error);
  }
}

/// Name of what decides how fast a connection, or those of a listener, may send; empty: unknown.
std::string congestion_control_of(int fd) {
  std::array<char, 17> name{};  // TCP_CA_NAME_MAX and an end
  socklen_t length = name.size() - 1;
  return ::getsockopt(fd, IPPROTO_TCP, TCP_CONGESTION, name.data(), &length) == 0 ? name.data()
                                                                                  : "";
}

/// BBR sends at the rate it has seen: frames that come in bursts are spread out, and every ten
/// seconds it looks for a shorter path with four packets at a time (Cardwell et al., BBR:
/// Congestion-Based Congestion Control, 2016). Before listen(): a connection that BBR paced once
/// stays so. Others are set as well, to what they are: accepted sockets have only what was set,
/// else the system's choice of then.
void choose_congestion_control(int fd, const std::string& system) noexcept {
  const bool bbr = system.starts_with("bbr");
  const std::array<std::string_view, 2> wanted{bbr ? "cubic" : std::string_view(system), "reno"};
  for (const std::string_view name : wanted) {  // not every user may have every one
    if (::setsockopt(fd, IPPROTO_TCP, TCP_CONGESTION, name.data(),
                     static_cast<socklen_t>(name.size())) == 0 ||
        !bbr) {
      return;
    }
  }
}

/// A peer whose machine is gone, or whose network, says nothing: where nothing is under way to it
/// the kernel asks, and gives up after 25 s. (What is under way is sent again as often as
/// net.ipv4.tcp_retries2 says. TCP_USER_TIMEOUT would end that sooner, but also the connections of
/// living peers that do not read.)
void notice_silence(int fd) noexcept {
  constexpr int kFirstS = 10;
  constexpr int kNextS = 5;
  constexpr int kCount = 3;
  const auto set = [fd](int level, int name, int value) {
    static_cast<void>(::setsockopt(fd, level, name, &value, sizeof value));
  };
  set(IPPROTO_TCP, TCP_KEEPIDLE, kFirstS);
  set(IPPROTO_TCP, TCP_KEEPINTVL, kNextS);
  set(IPPROTO_TCP, TCP_KEEPCNT, kCount);
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
}

IoResult to_result(const error_code& error, std::size_t bytes) noexcept {
  if (!error) {
    return {IoStatus::done, bytes, 0};
  }
  if (error == asio::error::would_block || error == asio::error::try_again ||
      error == asio::error::interrupted) {
    return {IoStatus::would_block, 0, 0};
  }
  if (error == asio::error::eof) {
    return {IoStatus::closed, 0, 0};
  }
  return {IoStatus::failed, 0, error.value()};
}

auto failure(std::string_view transport, const SocketAddress& address, const std::string& why) {
  return make_error(ErrorCode::io, fmt::format("{}{}: {}", transport, to_string(address), why));
}

/// Runs what may throw: allocation, and the first socket of a context, which opens Asio's epoll.
template <typename Work>
auto guarded(std::string_view what, const Work& work) -> decltype(work()) {
  try {
    return work();
  } catch (const std::exception& error) {
    return make_error(ErrorCode::io, fmt::format("{}: {}", what, error.what()));
  }
}

template <typename Socket>
SocketAddress local_address_of(const Socket& socket) noexcept {
  error_code error;
  const auto endpoint = socket.local_endpoint(error);
  return error ? SocketAddress{} : from_endpoint(endpoint);
}

}  // namespace

SocketContext::SocketContext() : context_(std::make_shared<asio::io_context>()) {}

// TcpSocket

struct TcpSocket::Impl {
  explicit Impl(std::shared_ptr<asio::io_context> shared)
      : context(std::move(shared)), socket(*context) {}
  std::shared_ptr<asio::io_context> context;  // outlives the socket
  tcp::socket socket;
  std::unique_ptr<TlsSession> tls;  // ends before the socket: it says goodbye
};

TcpSocket::TcpSocket() noexcept = default;
TcpSocket::TcpSocket(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
TcpSocket::TcpSocket(TcpSocket&& other) noexcept = default;
TcpSocket& TcpSocket::operator=(TcpSocket&& other) noexcept = default;
TcpSocket::~TcpSocket() = default;

physics::Result<TcpSocket> TcpSocket::connect(const SocketContext& context,
                                              const SocketAddress& address,
                                              std::int64_t timeout_ns) {
  return guarded("tcp", [&]() -> physics::Result<TcpSocket> {
    auto impl = std::make_unique<Impl>(context.get());
    const auto endpoint = to_endpoint<tcp::endpoint>(address);
    error_code error;
    open_ours(impl->socket, endpoint.protocol(), error);
    if (error) {
      return failure("", address, "socket: " + error_text(error.value()));
    }
    bool ended = false;
    impl->socket.async_connect(endpoint, [&](const error_code& result) {
      ended = true;
      error = result;
    });
    asio::io_context& reactor = *context.get();
    reactor.restart();
    reactor.run_for(std::chrono::nanoseconds(std::max<std::int64_t>(timeout_ns, 0)));
    reactor.poll();  // looks once however short the time
    if (!ended) {
      // The handler holds references to this frame: it has to have run before we leave.
      error_code ignored;
      impl->socket.close(ignored);
      reactor.restart();
      reactor.run();
      return failure("tcp ", address, "no answer within the timeout");
    }
    if (error) {
      return failure("tcp ", address, error_text(error.value()));
    }
    wish(impl->socket, tcp::no_delay(true));
    notice_silence(impl->socket.native_handle());
    return TcpSocket(std::move(impl));
  });
}

physics::Result<TcpSocket> TcpSocket::adopt(const SocketContext& context, int fd) {
  return guarded("tcp", [&]() -> physics::Result<TcpSocket> {
    auto impl = std::make_unique<Impl>(context.get());
    error_code error;
    impl->socket.assign(tcp::v4(), fd, error);
    if (!error) {
      make_ours(impl->socket, error);
    }
    if (error) {
      error_code ignored;
      impl->socket.release(ignored);
      return make_error(ErrorCode::io, "tcp: " + error_text(error.value()));
    }
    return TcpSocket(std::move(impl));
  });
}

int TcpSocket::fd() const noexcept {
  return impl_ ? impl_->socket.native_handle() : -1;
}

SocketAddress TcpSocket::local_address() const noexcept {
  return impl_ ? local_address_of(impl_->socket) : SocketAddress{};
}

SocketAddress TcpSocket::peer_address() const noexcept {
  error_code error;
  const auto endpoint = impl_ ? impl_->socket.remote_endpoint(error) : tcp::endpoint();
  return error || !impl_ ? SocketAddress{} : from_endpoint(endpoint);
}

void TcpSocket::close() noexcept {
  impl_.reset();
}

physics::Result<void> TcpSocket::start_tls(const TlsContext& context, const std::string& name) {
  auto session = TlsSession::create(context, fd(), name);
  if (!session) {
    return tl::unexpected<physics::Error>(std::move(session.error()));
  }
  impl_->tls = std::move(*session);
  return {};
}

TlsSession* TcpSocket::tls() const noexcept {
  return impl_ ? impl_->tls.get() : nullptr;
}

bool TcpSocket::has_buffered() const noexcept {
  return tls() != nullptr && tls()->has_buffered();
}

void TcpSocket::shutdown_send() noexcept {
  if (impl_->tls) {
    impl_->tls->shutdown();
  }
  error_code ignored;
  impl_->socket.shutdown(tcp::socket::shutdown_send, ignored);
}

void TcpSocket::set_send_buffer(std::uint64_t bytes) noexcept {
  if (bytes > 0) {
    wish(impl_->socket, tcp::socket::send_buffer_size(buffer_size(bytes)));
  }
}

void TcpSocket::set_receive_low_water(std::size_t bytes) noexcept {
  wish(impl_->socket, tcp::socket::receive_low_watermark(buffer_size(bytes)));
}

IoResult TcpSocket::read_some(std::span<std::byte> space) noexcept {
  if (space.empty()) {
    return {IoStatus::failed, 0, ENOBUFS};  // Asio would report success without reading
  }
  if (impl_->tls) {
    return impl_->tls->read(space);
  }
  error_code error;
  const std::size_t bytes =
      impl_->socket.read_some(asio::buffer(space.data(), space.size()), error);
  return to_result(error, bytes);
}

IoResult TcpSocket::write_some(std::span<const std::byte> bytes) noexcept {
  if (impl_->tls) {
    return impl_->tls->write(std::span(&bytes, 1));
  }
  error_code error;
  const std::size_t sent =
      impl_->socket.write_some(asio::buffer(bytes.data(), bytes.size()), error);
  return to_result(error, sent);
}

IoResult TcpSocket::write_some(std::span<const std::span<const std::byte>> pieces) noexcept {
  if (impl_->tls) {
    return impl_->tls->write(pieces);
  }
  std::array<asio::const_buffer, kMaxPieces> buffers;
  const std::size_t count = std::min(pieces.size(), buffers.size());
  for (std::size_t i = 0; i < count; ++i) {
    buffers[i] = asio::const_buffer(pieces[i].data(), pieces[i].size());
  }
  error_code error;
  const std::size_t sent =
      impl_->socket.write_some(std::span<const asio::const_buffer>(buffers.data(), count), error);
  return to_result(error, sent);
}

std::string system_congestion_control() {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  std::string name = congestion_control_of(fd);
  if (fd >= 0) {
    ::close(fd);
  }
  return name;
}

// TcpListener

struct TcpListener::Impl {
  explicit Impl(std::shared_ptr<asio::io_context> shared)
      : context(std::move(shared)), acceptor(*context) {}
  std::shared_ptr<asio::io_context> context;  // outlives the acceptor
  tcp::acceptor acceptor;
  std::string system_congestion_control;
};

TcpListener::TcpListener() noexcept = default;
TcpListener::TcpListener(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
TcpListener::TcpListener(TcpListener&& other) noexcept = default;
TcpListener& TcpListener::operator=(TcpListener&& other) noexcept = default;
TcpListener::~TcpListener() = default;

physics::Result<TcpListener> TcpListener::open(const SocketContext& context,
                                               const SocketAddress& address) {
  return guarded("tcp", [&]() -> physics::Result<TcpListener> {
    auto impl = std::make_unique<Impl>(context.get());
    const auto endpoint = to_endpoint<tcp::endpoint>(address);
    error_code error;
    open_ours(impl->acceptor, endpoint.protocol(), error);
    if (error) {
      return failure("", address, "socket: " + error_text(error.value()));
    }
    wish(impl->acceptor, tcp::acceptor::reuse_address(true));
    impl->system_congestion_control = congestion_control_of(impl->acceptor.native_handle());
    choose_congestion_control(impl->acceptor.native_handle(), impl->system_congestion_control);
    impl->acceptor.bind(endpoint, error);
    if (!error) {
      impl->acceptor.listen(kBacklog, error);
    }
    if (error) {
      return failure("tcp ", address, bind_error_text(error.value()));
    }
    return TcpListener(std::move(impl));
  });
}

int TcpListener::fd() const noexcept {
  return impl_ ? impl_->acceptor.native_handle() : -1;
}

SocketAddress TcpListener::local_address() const noexcept {
  return impl_ ? local_address_of(impl_->acceptor) : SocketAddress{};
}

CongestionControl TcpListener::congestion_control() const {
  return {congestion_control_of(fd()), impl_ ? impl_->system_congestion_control : std::string()};
}

TcpSocket TcpListener::accept(SocketAddress& peer, int& error_number) {
  error_number = 0;
  auto accepted = std::make_unique<TcpSocket::Impl>(impl_->context);
  tcp::endpoint endpoint;
  error_code error;
  impl_->acceptor.accept(accepted->socket, endpoint, error);
  if (!error) {
    make_ours(accepted->socket, error);
  }
  if (error) {
    // A peer that went while it waited is nobody's fault.
    const bool harmless = error == asio::error::would_block || error == asio::error::try_again ||
                          error == asio::error::interrupted ||
                          error == asio::error::connection_aborted;
    error_number = harmless ? 0 : error.value();
    return {};
  }
  wish(accepted->socket, tcp::no_delay(true));
  notice_silence(accepted->socket.native_handle());
  peer = from_endpoint(endpoint);
  return TcpSocket(std::move(accepted));
}

// UdpSocket

struct UdpSocket::Impl {
  explicit Impl(std::shared_ptr<asio::io_context> shared)
      : context(std::move(shared)), socket(*context) {}
  std::shared_ptr<asio::io_context> context;  // outlives the socket
  udp::socket socket;
};

UdpSocket::UdpSocket() noexcept = default;
UdpSocket::UdpSocket(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
UdpSocket::UdpSocket(UdpSocket&& other) noexcept = default;
UdpSocket& UdpSocket::operator=(UdpSocket&& other) noexcept = default;
UdpSocket::~UdpSocket() = default;

physics::Result<UdpSocket> UdpSocket::open(const SocketContext& context,
                                           const SocketAddress& address) {
  return guarded("udp socket", [&]() -> physics::Result<UdpSocket> {
    auto impl = std::make_unique<Impl>(context.get());
    error_code error;
    open_ours(impl->socket, to_endpoint<udp::endpoint>(address).protocol(), error);
    if (error) {
      return make_error(ErrorCode::io, "udp socket: " + error_text(error.value()));
    }
    return UdpSocket(std::move(impl));
  });
}

physics::Result<UdpSocket> UdpSocket::open_bound(const SocketContext& context,
                                                 const SocketAddress& address) {
  auto socket = open(context, address);
  if (socket) {
    if (auto bound = socket->bind(address); !bound) {
      return tl::unexpected<physics::Error>(std::move(bound.error()));
    }
  }
  return socket;
}

physics::Result<void> UdpSocket::bind(const SocketAddress& address) {
  error_code error;
  impl_->socket.bind(to_endpoint<udp::endpoint>(address), error);
  if (error) {
    return failure("udp ", address, bind_error_text(error.value()));
  }
  return {};
}

physics::Result<void> UdpSocket::connect(const SocketAddress& address) {
  error_code error;
  impl_->socket.connect(to_endpoint<udp::endpoint>(address), error);
  if (error) {
    return failure("udp ", address, error_text(error.value()));
  }
  return {};
}

int UdpSocket::fd() const noexcept {
  return impl_ ? impl_->socket.native_handle() : -1;
}

SocketAddress UdpSocket::local_address() const noexcept {
  return impl_ ? local_address_of(impl_->socket) : SocketAddress{};
}

IoResult UdpSocket::receive(std::span<std::byte> space) noexcept {
  error_code error;
  const std::size_t bytes =
      impl_->socket.receive(asio::buffer(space.data(), space.size()), 0, error);
  return to_result(error, bytes);
}

IoResult UdpSocket::send(std::span<const std::byte> bytes) noexcept {
  error_code error;
  const std::size_t sent = impl_->socket.send(asio::buffer(bytes.data(), bytes.size()), 0, error);
  return to_result(error, sent);
}

IoResult UdpSocket::send_to(std::span<const std::byte> bytes,
                            const SocketAddress& target) noexcept {
  error_code error;
  const std::size_t sent = impl_->socket.send_to(asio::buffer(bytes.data(), bytes.size()),
                                                 to_endpoint<udp::endpoint>(target), 0, error);
  return to_result(error, sent);
}

void UdpSocket::allow_shared_port() noexcept {
  wish(impl_->socket, udp::socket::reuse_address(true));
}

int UdpSocket::join_group(const SocketAddress& group, unsigned interface) noexcept {
  // Natively: Asio names the interface by an address for one family and by its index for the other.
  if (group.storage.ss_family == AF_INET6) {
    ipv6_mreq request{};
    request.ipv6mr_multiaddr = reinterpret_cast<const sockaddr_in6*>(group.get())->sin6_addr;
    request.ipv6mr_interface = interface;
    return ::setsockopt(fd(), IPPROTO_IPV6, IPV6_JOIN_GROUP, &request, sizeof(request)) == 0
               ? 0
               : errno;
  }
  ip_mreqn request{};
  request.imr_multiaddr = reinterpret_cast<const sockaddr_in*>(group.get())->sin_addr;
  request.imr_ifindex = static_cast<int>(interface);
  return ::setsockopt(fd(), IPPROTO_IP, IP_ADD_MEMBERSHIP, &request, sizeof(request)) == 0 ? 0
                                                                                           : errno;
}

int UdpSocket::set_multicast_interface(const SocketAddress& group, unsigned interface) noexcept {
  if (group.storage.ss_family == AF_INET6) {
    return ::setsockopt(fd(), IPPROTO_IPV6, IPV6_MULTICAST_IF, &interface, sizeof(interface)) == 0
               ? 0
               : errno;
  }
  ip_mreqn request{};
  request.imr_ifindex = static_cast<int>(interface);
  return ::setsockopt(fd(), IPPROTO_IP, IP_MULTICAST_IF, &request, sizeof(request)) == 0 ? 0
                                                                                         : errno;
}

void UdpSocket::set_multicast_hops(int hops) noexcept {
  wish(impl_->socket, asio::ip::multicast::hops(std::clamp(hops, 0, 255)));
}

std::uint64_t UdpSocket::set_receive_buffer(std::uint64_t bytes) noexcept {
  error_code error;
  impl_->socket.set_option(IntOption(SOL_SOCKET, SO_RCVBUFFORCE, buffer_size(bytes)), error);
  if (error) {
    wish(impl_->socket, udp::socket::receive_buffer_size(buffer_size(bytes)));
  }
  // Asio halves what the kernel reports.
  udp::socket::receive_buffer_size granted;
  impl_->socket.get_option(granted, error);
  return error ? 0 : static_cast<std::uint64_t>(granted.value());
}

void UdpSocket::set_send_buffer(std::uint64_t bytes) noexcept {
  error_code error;
  impl_->socket.set_option(IntOption(SOL_SOCKET, SO_SNDBUFFORCE, buffer_size(bytes)), error);
  if (error) {
    wish(impl_->socket, udp::socket::send_buffer_size(buffer_size(bytes)));
  }
}

void UdpSocket::set_option(int level, int name, int value) noexcept {
  wish(impl_->socket, IntOption(level, name, value));
}

}  // namespace emit::server
