// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <span>
#include <utility>

#include "emit/protocol/convert.hpp"
#include "emit/protocol/framing.hpp"
#include "emit/v1/control.pb.h"
#include "fuzz/fuzz_input.hpp"
#include "client/client_connection.hpp"

/// A daemon at the other end of a client's connection that says what the input holds and hangs up.
namespace emit::fuzz {

/// More is left out: the socket has to hold it all.
inline constexpr std::size_t kMaxSaidBytes = 64u << 10;
/// Small, because taking the usual megabytes costs more than all else.
inline constexpr protocol::RecordLimits kLimits{8192, 0};

/// The client after the welcome; empty when it did not like it.
[[nodiscard]] inline std::optional<client::ClientConnection> connect_to(
    std::span<const std::byte> said, protocol::PeerRole role) {
  static const server::SocketContext context;
  int pair[2] = {-1, -1};
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, pair) != 0) std::abort();
  said = said.first(std::min(said.size(), kMaxSaidBytes));
  require(::send(pair[1], said.data(), said.size(), MSG_DONTWAIT | MSG_NOSIGNAL) ==
              static_cast<ssize_t>(said.size()),
          "the socket holds what the daemon says");
  // Closed for sending alone: the client may still speak.
  ::shutdown(pair[1], SHUT_WR);
  static int held = -1;  // until the next input
  if (held >= 0) ::close(held);
  held = pair[1];
  auto socket = server::TcpSocket::adopt(context, pair[0]);
  if (!socket) std::abort();
  auto connection = client::ClientConnection::greet(context, std::move(*socket), {}, role,
                                                    client::monotonic_now_ns(), kLimits);
  if (!connection) return std::nullopt;
  return std::move(*connection);
}

/// True when every channel of the welcome is small: the client takes memory for frames of the size
/// that the daemon announces, which is its right and says nothing about the decoder.
[[nodiscard]] inline bool announces_small_frames(const client::ServerInfo& info) {
  constexpr std::uint32_t kMaxPx = 64;
  return std::ranges::all_of(info.channels, [](const client::ChannelDescription& channel) {
    return channel.width_px <= kMaxPx && channel.height_px <= kMaxPx;
  });
}

}  // namespace emit::fuzz
