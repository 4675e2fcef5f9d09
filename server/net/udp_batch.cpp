// SPDX-License-Identifier: Apache-2.0
#include "net/udp_batch.hpp"

#include <netinet/in.h>
#include <netinet/udp.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace emit::server {
namespace {

#ifndef UDP_SEGMENT
constexpr int UDP_SEGMENT = 103;
#endif
constexpr std::uint64_t kMaxDatagramBytes = 65507;

UdpBatch::Result failure(int error) noexcept {
  switch (error) {
    case EAGAIN:
      return {UdpBatch::Status::would_block, 0, 0, error};
    case ENOBUFS:
    case ENOMEM:
      return {UdpBatch::Status::no_buffers, 0, 0, error};
    default:
      return {UdpBatch::Status::failed, 0, 0, error};
  }
}

}  // namespace

UdpBatch::UdpBatch() : memory_(std::make_unique<Memory>()) {}

UdpBatch::Result UdpBatch::send(int fd, const protocol::Fragmenter& fragments, std::uint32_t first,
                                bool segmentation) noexcept {
  const std::uint32_t left = fragments.fragment_count() - first;
  std::uint32_t count = std::min<std::uint32_t>(left, kMaxBatch);
  if (segmentation) {
    count = std::min<std::uint32_t>(
        count, static_cast<std::uint32_t>(kMaxDatagramBytes / fragments.datagram_bytes()));
    count = std::max(count, 1U);
  }
  std::size_t iov_count = 0;
  std::uint64_t bytes = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto pieces = fragments.pieces(first + i, memory_->headers[i]);
    add_message(i, pieces, iov_count);
    bytes += pieces.bytes;
  }
  if (segmentation && count > 1) {
    return send_segmented(fd, count, iov_count, bytes, fragments.datagram_bytes());
  }
  return send_many(fd, count);
}

UdpBatch::Result UdpBatch::send_some(int fd, const protocol::Fragmenter& fragments,
                                     std::span<const std::uint32_t> indices,
                                     std::uint8_t more_flags) noexcept {
  const auto count = static_cast<std::uint32_t>(std::min(indices.size(), kMaxBatch));
  std::size_t iov_count = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    add_message(i, fragments.pieces(indices[i], memory_->headers[i], more_flags), iov_count);
  }
  return send_many(fd, count);
}

UdpBatch::Result UdpBatch::send_datagrams(int fd, std::span<const std::byte> datagrams,
                                          std::uint32_t datagram_bytes,
                                          bool segmentation) noexcept {
  std::size_t most = kMaxBatch;
  if (segmentation) {
    most = std::clamp<std::size_t>(kMaxDatagramBytes / datagram_bytes, 1, kMaxBatch);
  }
  const auto count = static_cast<std::uint32_t>(std::min(datagrams.size() / datagram_bytes, most));
  std::size_t iov_count = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    protocol::Fragmenter::Pieces whole;
    whole.piece[0] = datagrams.subspan(std::size_t{i} * datagram_bytes, datagram_bytes);
    whole.count = 1;
    whole.bytes = datagram_bytes;
    add_message(i, whole, iov_count);
  }
  if (segmentation && count > 1) {
    memory_->iov[0].iov_len = std::size_t{count} * datagram_bytes;  // they lie in one piece
    return send_segmented(fd, count, 1, memory_->iov[0].iov_len, datagram_bytes);
  }
  return send_many(fd, count);
}

void UdpBatch::add_message(std::uint32_t index, const protocol::Fragmenter::Pieces& pieces,
                           std::size_t& iov_count) noexcept {
  msghdr& message = memory_->messages[index].msg_hdr;
  message = {};
  message.msg_iov = &memory_->iov[iov_count];
  message.msg_iovlen = pieces.count;
  for (std::uint32_t piece = 0; piece < pieces.count; ++piece) {
    // sendmsg only reads what iov_base points at.
    memory_->iov[iov_count++] = {const_cast<std::byte*>(pieces.piece[piece].data()),
                                 pieces.piece[piece].size()};
  }
  memory_->sizes[index] = pieces.bytes;
}

UdpBatch::Result UdpBatch::send_segmented(int fd, std::uint32_t count, std::size_t iov_count,
                                          std::uint64_t bytes,
                                          std::uint32_t segment_bytes) noexcept {
  alignas(cmsghdr) std::array<std::byte, CMSG_SPACE(sizeof(std::uint16_t))> control{};
  msghdr message{};
  message.msg_iov = memory_->iov.data();
  message.msg_iovlen = iov_count;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  cmsghdr* header = CMSG_FIRSTHDR(&message);
  header->cmsg_level = SOL_UDP;
  header->cmsg_type = UDP_SEGMENT;
  header->cmsg_len = CMSG_LEN(sizeof(std::uint16_t));
  const auto segment = static_cast<std::uint16_t>(segment_bytes);
  std::memcpy(CMSG_DATA(header), &segment, sizeof(segment));
  if (::sendmsg(fd, &message, MSG_DONTWAIT | MSG_NOSIGNAL) < 0) {
    const int error = errno;
    if (error == EINVAL || error == EMSGSIZE || error == EIO || error == EOPNOTSUPP) {
      // A path MTU under the fragment size, or a device without checksum offload.
      return {Status::no_segmentation, 0, 0, error};
    }
    return failure(error);
  }
  return {Status::sent, count, bytes, 0};
}

UdpBatch::Result UdpBatch::send_many(int fd, std::uint32_t count) noexcept {
  const int sent = ::sendmmsg(fd, memory_->messages.data(), count, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent < 0) {
    return failure(errno);
  }
  std::uint64_t bytes = 0;
  for (int i = 0; i < sent; ++i) {
    bytes += memory_->sizes[static_cast<std::size_t>(i)];
  }
  return {Status::sent, static_cast<std::uint32_t>(sent), bytes, 0};
}

bool udp_segmentation_supported(int fd) noexcept {
  int value = 0;
  socklen_t length = sizeof(value);
  return ::getsockopt(fd, SOL_UDP, UDP_SEGMENT, &value, &length) == 0;
}

}  // namespace emit::server
