// SPDX-License-Identifier: Apache-2.0
#include "client/udp_frame_receiver.hpp"

#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/udp.h>
#include <sys/uio.h>

#include <algorithm>
#include <cstring>

#include "net/ip_address.hpp"
#include "rt/error_text.hpp"

namespace emit::client {
namespace {

#ifndef UDP_GRO
constexpr int UDP_GRO = 104;
#endif

using physics::ErrorCode;
using physics::make_error;

}  // namespace

UdpFrameReceiver::UdpFrameReceiver(server::UdpSocket socket, const server::SocketAddress& peer)
    : socket_(std::move(socket)),
      peer_(server::ip_of(peer)),
      data_(kBatch * kDatagramBytes),
      control_(kBatch * kControlBytes),
      messages_(kBatch),
      sources_(kBatch),
      headers_(kBatch) {}

physics::Result<UdpFrameReceiver> UdpFrameReceiver::open(const server::SocketContext& context,
                                                         const server::SocketAddress& peer,
                                                         const server::SocketAddress& local,
                                                         const SubscribeOptions& options) {
  const bool multicast = !options.multicast_group.empty();
  server::SocketAddress any;
  if (multicast) {
    any = server::numeric_address(options.multicast_group, options.udp_port);
    if (!any.is_multicast()) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("'{}' is not a multicast group", options.multicast_group));
    }
  } else {
    any = server::numeric_address(peer.storage.ss_family == AF_INET6 ? "::" : "0.0.0.0",
                                  options.udp_port);
  }
  auto socket = server::UdpSocket::open(context, any);
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
    if (const int error = socket->join_group(any, server::interface_of(local)); error != 0) {
      return make_error(ErrorCode::io, fmt::format("joining {}: {}", options.multicast_group,
                                                   server::error_text(error)));
    }
  }
  socket->set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
  socket->set_option(SOL_UDP, UDP_GRO, 1);
  return UdpFrameReceiver(std::move(*socket), peer);
}

void UdpFrameReceiver::size_buffer(std::uint64_t frame_bytes) {
  constexpr std::uint64_t kFrames = 8;  // at least 4 are needed; the rest is headroom
  buffer_bytes_ =
      socket_.set_receive_buffer(std::max<std::uint64_t>(kFrames * frame_bytes, 1u << 20));
}

/// Lays out where a message goes; returns where in the frame the one behind it begins.
std::size_t UdpFrameReceiver::plan(std::size_t index, const Expected& expected,
                                   std::size_t from) noexcept {
  Message& message = messages_[index];
  const std::size_t payload = expected.next.payload_bytes;
  const std::size_t left = expected.rest.size() - from;
  message.planned = payload == 0 ? 0 : std::min(segments_, (left + payload - 1) / payload);
  std::size_t pieces = 0;
  std::size_t bytes = 0;
  const auto add = [&](std::byte* to, std::size_t length) {
    message.iov[pieces++] = {to, length};
    bytes += length;
  };
  for (std::size_t i = 0; i < message.planned; ++i) {
    const std::size_t length = std::min(payload, expected.rest.size() - from);
    add(message.headers[i].data(), message.headers[i].size());
    add(expected.rest.data() + from, length);
    from += length;
  }
  // Datagrams that do not fit the plan go behind the room that bring_together() needs.
  add(data(index) + bytes, kDatagramBytes - bytes);
  msghdr& header = headers_[index].msg_hdr;
  header = {};
  header.msg_name = &sources_[index];
  header.msg_namelen = sizeof(sockaddr_storage);
  header.msg_iov = message.iov.data();
  header.msg_iovlen = pieces;
  header.msg_control = control_.data() + index * kControlBytes;
  header.msg_controllen = kControlBytes;
  return from;
}

void UdpFrameReceiver::read_control(std::size_t index, ReceiveCounters& counters) noexcept {
  Message& message = messages_[index];
  msghdr& header = headers_[index].msg_hdr;
  message.bytes = headers_[index].msg_len;
  message.segment_bytes = message.bytes;
  for (cmsghdr* entry = CMSG_FIRSTHDR(&header); entry != nullptr;
       entry = CMSG_NXTHDR(&header, entry)) {
    if (entry->cmsg_level == SOL_UDP && entry->cmsg_type == UDP_GRO) {
      int size = 0;
      std::memcpy(&size, CMSG_DATA(entry), sizeof(size));
      message.segment_bytes = size > 0 ? static_cast<std::size_t>(size) : message.segment_bytes;
    } else if (entry->cmsg_level == SOL_SOCKET && entry->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(entry), sizeof(drops));
      counters.os_drops += drops - drops_seen_;
      drops_seen_ = drops;
    }
  }
}

/// Every datagram of the message is the fragment that was expected at its place.
bool UdpFrameReceiver::as_planned(const Message& message, const Expected& expected,
                                  std::size_t from) const noexcept {
  std::size_t bytes = 0;
  for (std::size_t i = 0; i < message.planned && bytes < message.bytes; ++i) {
    const std::size_t datagram = std::min(message.segment_bytes, message.bytes - bytes);
    const std::size_t payload = message.iov[2 * i + 1].iov_len;
    protocol::FragmentHeader header;
    if (datagram != protocol::kFragmentHeaderBytes + payload ||
        protocol::decode_fragment_header(message.headers[i], payload, header) !=
            protocol::FragmentStatus::accepted ||
        header.stream_id != stream_id_ || header.stream_id != expected.next.stream_id ||
        header.frame_id != expected.next.frame_id ||
        header.byte_offset != expected.next.byte_offset + from) {
      return false;
    }
    bytes += datagram;
    from += payload;
  }
  return bytes > 0 && bytes == message.bytes;
}

/// The whole message in data(), as if it had been received there.
void UdpFrameReceiver::bring_together(std::size_t index) noexcept {
  Message& message = messages_[index];
  std::size_t at = 0;
  for (std::size_t i = 0; i < 2 * message.planned && at < message.bytes; ++i) {
    const std::size_t length = std::min(message.iov[i].iov_len, message.bytes - at);
    std::memcpy(data(index) + at, message.iov[i].iov_base, length);
    at += length;
  }
  message.planned = 0;
}

bool UdpFrameReceiver::from_peer(std::size_t index) const noexcept {
  // A stream to a group may be of another family than the control connection.
  const protocol::IpAddress source = server::ip_of(sources_[index]);
  return source == peer_ || source.v4 != peer_.v4;
}

void UdpFrameReceiver::count(protocol::FragmentStatus status, ReceiveCounters& counters) noexcept {
  switch (status) {
    case protocol::FragmentStatus::accepted:
    case protocol::FragmentStatus::duplicate:
    case protocol::FragmentStatus::late:
      break;
    default:
      ++counters.bad_datagrams;
      break;
  }
}

void UdpFrameReceiver::push_planned(const Message& message, protocol::Reassembler& reassembler,
                                    ReceiveCounters& counters) {
  std::size_t bytes = 0;
  for (std::size_t i = 0; bytes < message.bytes; ++i) {
    const iovec& payload = message.iov[2 * i + 1];
    count(reassembler.push(message.headers[i],
                           {static_cast<const std::byte*>(payload.iov_base), payload.iov_len}),
          counters);
    bytes += protocol::kFragmentHeaderBytes + payload.iov_len;
  }
}

void UdpFrameReceiver::push_data(std::size_t index, protocol::Reassembler& reassembler,
                                 ReceiveCounters& counters) {
  const Message& message = messages_[index];
  std::span<const std::byte> rest(data(index), message.bytes);
  do {
    const auto datagram = rest.first(std::min(message.segment_bytes, rest.size()));
    rest = rest.subspan(datagram.size());
    // Somebody else's frames on this port must not take the reassembler's places.
    const auto stream = protocol::stream_of_fragment(datagram);
    if (!from_peer(index) || (stream && *stream != stream_id_)) {
      ++counters.foreign_datagrams;
    } else {
      count(reassembler.push(datagram), counters);
    }
  } while (!rest.empty());
}

int UdpFrameReceiver::take(protocol::Reassembler& reassembler, ReceiveCounters& counters) {
  const Expected expected = reassembler.expected();
  std::array<std::size_t, kBatch + 1> from{};
  unsigned batch = 0;
  do {
    from[batch + 1] = plan(batch, expected, from[batch]);
    ++batch;
    // Expect nothing behind the frame's end: it would be received to one place and copied to
    // another. With single datagrams that is little, and the number of calls counts more.
  } while (batch < (segments_ > 1 ? kJoinedBatch : kBatch) &&
           (segments_ == 1 || from[batch] < expected.rest.size()));
  // Natively: Asio knows neither many messages per call nor control messages (drops, UDP_GRO).
  const int received = ::recvmmsg(socket_.fd(), headers_.data(), batch, MSG_DONTWAIT, nullptr);
  const auto taken = static_cast<std::size_t>(std::max(received, 0));
  for (std::size_t i = 0; i < taken; ++i) {
    read_control(i, counters);
  }
  drained_ = taken < batch;
  std::size_t in_place = 0;
  while (in_place < taken && messages_[in_place].planned > 0 && from_peer(in_place) &&
         as_planned(messages_[in_place], expected, from[in_place])) {
    ++in_place;
  }
  // Before anything is pushed: places in the frame may then be wanted for other payloads than lie
  // there.
  for (std::size_t i = in_place; i < taken; ++i) {
    bring_together(i);
  }
  misplaced_ += taken - in_place;
  for (std::size_t i = 0; i < taken; ++i) {
    if (i < in_place) {
      push_planned(messages_[i], reassembler, counters);
    } else {
      push_data(i, reassembler, counters);
    }
  }
  std::size_t joined = 0;
  for (std::size_t i = 0; i < taken; ++i) {
    // The rest of a frame's last message says nothing about the messages to come.
    if (i < in_place && from[i + 1] == expected.rest.size()) continue;
    const Message& message = messages_[i];
    const std::size_t bytes = std::max<std::size_t>(message.segment_bytes, 1);
    joined = std::max(joined, (message.bytes + bytes - 1) / bytes);
  }
  if (joined > 0) {
    segments_ = std::min(joined, kMaxSegments);
  }
  return std::max(received, 0);
}

}  // namespace emit::client
