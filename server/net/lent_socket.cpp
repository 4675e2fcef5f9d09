// SPDX-License-Identifier: Apache-2.0
#include <sys/socket.h>
#include <sys/uio.h>

#include <algorithm>
#include <array>
#include <cerrno>

#include "net/socket.hpp"
#include "net/tls_session.hpp"

namespace emit::server {

IoResult write_lent(TcpSocket& socket,
                    std::span<const std::span<const std::byte>> pieces) noexcept {
  if (TlsSession* tls = socket.tls()) {
    return tls->write(pieces);
  }
  std::array<iovec, kMaxLentPieces> iov{};
  const std::size_t count = std::min(pieces.size(), iov.size());
  for (std::size_t i = 0; i < count; ++i) {
    // The kernel only reads what is sent.
    iov[i] = {const_cast<std::byte*>(pieces[i].data()), pieces[i].size()};
  }
  msghdr message{};
  message.msg_iov = iov.data();
  message.msg_iovlen = count;
  const ssize_t sent = ::sendmsg(socket.fd(), &message, MSG_DONTWAIT | MSG_NOSIGNAL);
  if (sent >= 0) {
    return {IoStatus::done, static_cast<std::size_t>(sent), 0};
  }
  const bool again = errno == EAGAIN || errno == EWOULDBLOCK || errno == EINTR;
  return {again ? IoStatus::would_block : IoStatus::failed, 0, errno};
}

}  // namespace emit::server
