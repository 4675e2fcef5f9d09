// SPDX-License-Identifier: Apache-2.0
#include "io/udp_frame_receiver.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/uio.h>

#include <algorithm>
#include <cstring>

namespace emit::server {
namespace {

#ifndef UDP_GRO
constexpr int UDP_GRO = 104;
#endif

using physics::ErrorCode;
using physics::make_error;

}  // namespace

UdpFrameReceiver::UdpFrameReceiver(UdpSocket socket)
    : socket_(std::move(socket)),
      data_(kBatch * kDatagramBytes),
      control_(kBatch * kControlBytes) {}

physics::Result<UdpFrameReceiver> UdpFrameReceiver::open(const SocketContext& context,
                                                         const SocketAddress& peer,
                                                         const SocketAddress& local,
                                                         const SubscribeOptions& options) {
  const bool multicast = !options.multicast_group.empty();
  SocketAddress any;
  if (multicast) {
    any = numeric_address(options.multicast_group, options.udp_port);
    if (!any.is_multicast()) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("'{}' is not a multicast group", options.multicast_group));
    }
  } else {
    any = numeric_address(peer.storage.ss_family == AF_INET6 ? "::" : "0.0.0.0", options.udp_port);
  }
  auto socket = UdpSocket::open(context, any);
  if (!socket) {
    return tl::unexpected<physics::Error>(std::move(socket.error()));
  }
  if (multicast) {
    socket->allow_shared_port();
  }
  if (auto bound = socket->bind(any); !bound) {
    return tl::unexpected<physics::Error>(std::move(bound.error()));
  }
  if (multicast) {
    if (const int error = socket->join_group(any, interface_of(local)); error != 0) {
      return make_error(ErrorCode::io,
                        fmt::format("joining {}: {}", options.multicast_group, error_text(error)));
    }
  }
  socket->set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
  socket->set_option(SOL_UDP, UDP_GRO, 1);
  return UdpFrameReceiver(std::move(*socket));
}

void UdpFrameReceiver::size_buffer(std::uint64_t frame_bytes) {
  constexpr std::uint64_t kFrames = 8;  // at least 4 are needed; the rest is headroom
  buffer_bytes_ =
      socket_.set_receive_buffer(std::max<std::uint64_t>(kFrames * frame_bytes, 1u << 20));
}

int UdpFrameReceiver::take(protocol::Reassembler& reassembler, ReceiveCounters& counters) {
  std::array<mmsghdr, kBatch> messages{};
  std::array<iovec, kBatch> iov{};
  for (std::size_t i = 0; i < kBatch; ++i) {
    iov[i] = {data_.data() + i * kDatagramBytes, kDatagramBytes};
    messages[i].msg_hdr.msg_iov = &iov[i];
    messages[i].msg_hdr.msg_iovlen = 1;
    messages[i].msg_hdr.msg_control = control_.data() + i * kControlBytes;
    messages[i].msg_hdr.msg_controllen = kControlBytes;
  }
  // Natively: Asio knows neither many messages per call nor control messages (drops, UDP_GRO).
  const int count = ::recvmmsg(socket_.fd(), messages.data(), kBatch, MSG_DONTWAIT, nullptr);
  for (int i = 0; i < count; ++i) {
    const auto index = static_cast<std::size_t>(i);
    msghdr& message = messages[index].msg_hdr;
    std::size_t segment = messages[index].msg_len;
    for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr;
         header = CMSG_NXTHDR(&message, header)) {
      if (header->cmsg_level == SOL_UDP && header->cmsg_type == UDP_GRO) {
        int size = 0;
        std::memcpy(&size, CMSG_DATA(header), sizeof(size));
        segment = size > 0 ? static_cast<std::size_t>(size) : segment;
      } else if (header->cmsg_level == SOL_SOCKET && header->cmsg_type == SO_RXQ_OVFL) {
        std::uint32_t drops = 0;
        std::memcpy(&drops, CMSG_DATA(header), sizeof(drops));
        counters.os_drops += drops - drops_seen_;
        drops_seen_ = drops;
      }
    }
    std::span<const std::byte> rest(data_.data() + index * kDatagramBytes, messages[index].msg_len);
    do {
      const auto datagram = rest.first(std::min(segment, rest.size()));
      rest = rest.subspan(datagram.size());
      switch (reassembler.push(datagram)) {
        case protocol::FragmentStatus::accepted:
        case protocol::FragmentStatus::duplicate:
        case protocol::FragmentStatus::late:
          break;
        default:
          ++counters.bad_datagrams;
          break;
      }
    } while (!rest.empty());
  }
  return std::max(count, 0);
}

}  // namespace emit::server
