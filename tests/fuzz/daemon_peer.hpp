// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "client/client_connection.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/v1/control.pb.h"
#include "fuzz/fuzz_input.hpp"

/// Peer of a client's connection: a daemon that sends the fuzz input and then closes its side.
namespace emit::fuzz {

/// Largest number of bytes sent; the rest of an input is left out, because the socket has to hold
/// all of it.
inline constexpr std::size_t kMaxSaidBytes = 64u << 10;
/// Limits of the client. They are small, because allocating the usual megabytes would take most of
/// the time.
inline constexpr protocol::RecordLimits kLimits{8192, 0};

/// Returns the client after the welcome, or nothing when it refused the welcome.
[[nodiscard]] inline std::optional<client::ClientConnection> connect_to(
    std::span<const std::byte> said, protocol::PeerRole role) {
  static const server::SocketContext context;
  int pair[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0) std::abort();
  said = said.first(std::min(said.size(), kMaxSaidBytes));
  require(::send(pair[1], said.data(), said.size(), MSG_DONTWAIT | MSG_NOSIGNAL) ==
              static_cast<ssize_t>(said.size()),
          "the socket holds what the daemon says");
  // Only the sending side is closed, so the client may still send.
  ::shutdown(pair[1], SHUT_WR);
  static int held = -1;  // open until the next input
  if (held >= 0) ::close(held);
  held = pair[1];
  auto socket = server::TcpSocket::adopt(context, pair[0]);
  if (!socket) std::abort();
  auto connection = client::ClientConnection::greet(context, std::move(*socket), {}, role,
                                                    client::monotonic_now_ns(), kLimits);
  if (!connection) return std::nullopt;
  return std::move(*connection);
}

/// Returns true when every channel of the welcome is small. A client rightly allocates memory for
/// frames of the announced size, which is no finding about the decoder.
[[nodiscard]] inline bool announces_small_frames(const client::ServerInfo& info) {
  constexpr std::uint32_t kMaxPx = 64;
  return std::ranges::all_of(info.channels, [](const client::ChannelDescription& channel) {
    return channel.width_px <= kMaxPx && channel.height_px <= kMaxPx;
  });
}

}  // namespace emit::fuzz
