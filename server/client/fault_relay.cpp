// SPDX-License-Identifier: Apache-2.0
#include "client/fault_relay.hpp"

#include <poll.h>
#include <sys/socket.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>

#include "client/client_connection.hpp"

namespace emit::client {
namespace {

constexpr std::size_t kBatch = 32;
constexpr std::size_t kDatagramBytes = 65536;
constexpr std::uint64_t kBufferBytes = 64u << 20;

}  // namespace

physics::Result<std::unique_ptr<FaultRelay>> FaultRelay::start(
    const server::NetworkFaults& faults) {
  server::SocketContext context;
  const server::SocketAddress here = server::numeric_address("127.0.0.1", 0);
  auto in = server::UdpSocket::open_bound(context, here);
  if (!in) return tl::unexpected<physics::Error>(std::move(in.error()));
  auto out = server::UdpSocket::open_bound(context, here);
  if (!out) return tl::unexpected<physics::Error>(std::move(out.error()));
  in->set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
  in->set_receive_buffer(kBufferBytes);
  out->set_send_buffer(kBufferBytes);
  return std::unique_ptr<FaultRelay>(
      new FaultRelay(faults, std::move(context), std::move(*in), std::move(*out)));
}

FaultRelay::FaultRelay(const server::NetworkFaults& faults, server::SocketContext context,
                       server::UdpSocket in, server::UdpSocket out)
    : injector_(faults),
      context_(std::move(context)),
      in_(std::move(in)),
      out_(std::move(out)),
      port_(in_.local_address().port()),
      data_(kBatch * kDatagramBytes) {
  thread_ = std::thread([this] { run(); });
}

FaultRelay::~FaultRelay() {
  stop();
}

void FaultRelay::stop() {
  stop_.store(true);
  if (thread_.joinable()) thread_.join();
}

void FaultRelay::run() {
  while (!stop_.load()) {
    if (receive() + pass_on() > 0) continue;
    constexpr std::int64_t kLongestNs = 20'000'000;
    const std::int64_t now_ns = monotonic_now_ns();
    const std::int64_t end_ns =
        std::min(injector_.due_ns().value_or(now_ns + kLongestNs), now_ns + kLongestNs);
    const timespec timeout{0, static_cast<long>(std::max<std::int64_t>(end_ns - now_ns, 0))};
    pollfd fd{in_.fd(), POLLIN, 0};
    ::ppoll(&fd, 1, &timeout, nullptr);
  }
}

int FaultRelay::receive() {
  std::array<mmsghdr, kBatch> messages{};
  std::array<iovec, kBatch> iov{};
  struct alignas(cmsghdr) Control {
    std::array<std::byte, 64> bytes;
  };
  std::array<Control, kBatch> control{};
  for (std::size_t i = 0; i < kBatch; ++i) {
    iov[i] = {data_.data() + i * kDatagramBytes, kDatagramBytes};
    messages[i].msg_hdr.msg_iov = &iov[i];
    messages[i].msg_hdr.msg_iovlen = 1;
    messages[i].msg_hdr.msg_control = &control[i];
    messages[i].msg_hdr.msg_controllen = sizeof(Control);
  }
  const int count = ::recvmmsg(in_.fd(), messages.data(), kBatch, MSG_DONTWAIT, nullptr);
  const std::int64_t now_ns = monotonic_now_ns();
  for (int i = 0; i < count; ++i) {
    mmsghdr& message = messages[static_cast<std::size_t>(i)];
    for (cmsghdr* entry = CMSG_FIRSTHDR(&message.msg_hdr); entry != nullptr;
         entry = CMSG_NXTHDR(&message.msg_hdr, entry)) {
      if (entry->cmsg_level != SOL_SOCKET || entry->cmsg_type != SO_RXQ_OVFL) continue;
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(entry), sizeof(drops));
      own_losses_.fetch_add(drops - drops_seen_);
      drops_seen_ = drops;
    }
    injector_.push(
        {static_cast<const std::byte*>(iov[static_cast<std::size_t>(i)].iov_base), message.msg_len},
        now_ns);
  }
  return std::max(count, 0);
}

int FaultRelay::pass_on() {
  const std::uint16_t port = to_port_.load();
  if (port == 0) return 0;
  const server::SocketAddress target = server::numeric_address("127.0.0.1", port);
  const std::int64_t now_ns = monotonic_now_ns();
  std::array<std::vector<std::byte>, kBatch> held;
  std::array<mmsghdr, kBatch> messages{};
  std::array<iovec, kBatch> iov{};
  std::size_t count = 0;
  while (count < kBatch) {
    auto datagram = injector_.pop(now_ns);
    if (!datagram) break;
    held[count] = std::move(*datagram);
    iov[count] = {held[count].data(), held[count].size()};
    msghdr& header = messages[count].msg_hdr;
    header.msg_iov = &iov[count];
    header.msg_iovlen = 1;
    // sendmmsg only reads the name.
    header.msg_name = const_cast<sockaddr*>(target.get());
    header.msg_namelen = target.length;
    ++count;
  }
  for (std::size_t sent = 0; sent < count;) {
    const int done = ::sendmmsg(out_.fd(), messages.data() + sent,
                                static_cast<unsigned>(count - sent), MSG_NOSIGNAL);
    if (done > 0) {
      sent += static_cast<std::size_t>(done);
      continue;
    }
    pollfd fd{out_.fd(), POLLOUT, 0};
    if ((errno == EAGAIN || errno == EWOULDBLOCK) && ::poll(&fd, 1, 100) > 0) continue;
    // Nobody at the port, for example: this one is lost.
    own_losses_.fetch_add(1);
    ++sent;
  }
  return static_cast<int>(count);
}

}  // namespace emit::client
