// SPDX-License-Identifier: Apache-2.0
#include "net/stamped_receive.hpp"

#include <array>
#include <cstring>
#include <ctime>

namespace emit::server {

void StampedReceiver::prepare(UdpSocket& socket) noexcept {
  socket.set_option(SOL_SOCKET, SO_TIMESTAMPNS, 1);
  socket.set_option(SOL_SOCKET, SO_RXQ_OVFL, 1);
}

std::optional<StampedDatagram> StampedReceiver::receive(const UdpSocket& socket,
                                                        std::span<std::byte> space,
                                                        const Clock& clock) noexcept {
  StampedDatagram out;
  alignas(cmsghdr) std::array<char, 128> control;
  iovec piece{space.data(), space.size()};
  msghdr message{};
  message.msg_name = &out.from;
  message.msg_namelen = sizeof out.from;
  message.msg_iov = &piece;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  const ssize_t size = ::recvmsg(socket.fd(), &message, MSG_DONTWAIT);
  if (size < 0) return std::nullopt;
  out.bytes = space.first(static_cast<std::size_t>(size));
  out.received_ns = clock.tai_ns();
  for (cmsghdr* header = CMSG_FIRSTHDR(&message); header != nullptr;
       header = CMSG_NXTHDR(&message, header)) {
    if (header->cmsg_level != SOL_SOCKET) continue;
    if (header->cmsg_type == SCM_TIMESTAMPNS) {
      timespec stamp{};
      std::memcpy(&stamp, CMSG_DATA(header), sizeof stamp);
      out.received_ns = clock.tai_from_kernel_stamp_ns(std::int64_t{stamp.tv_sec} * 1'000'000'000 +
                                                       stamp.tv_nsec);
    } else if (header->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t drops = 0;
      std::memcpy(&drops, CMSG_DATA(header), sizeof drops);
      out.os_drops = drops - os_drops_seen_;
      os_drops_seen_ = drops;
    }
  }
  return out;
}

}  // namespace emit::server
