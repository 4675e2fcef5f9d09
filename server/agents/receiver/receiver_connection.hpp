// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>
#include <sys/uio.h>

#include <cstring>

#include "agents/receiver/read_pace.hpp"
#include "agents/receiver/receiver.hpp"
#include "net/tls_session.hpp"

namespace emit::server {

struct Receiver::Connection {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;
  TcpSocket socket;
  SocketAddress peer;
  protocol::IpAddress ip;
  Role role = Role::none;
  bool welcomed = false;
  bool closing = false;      ///< to be closed as soon as nobody else uses the descriptor
  bool flush_close = false;  ///< closes once what is queued went out
  bool lent = false;         ///< sender or recorder hold it (or its client) and must give it back
  bool write_lent = false;   ///< they write to the descriptor: nobody else may
  bool stuck = false;        ///< the conductor's ring is full: records wait in the parser
  bool paused = false;       ///< sent more than its pace: records wait in the parser
  bool dirty = false;        ///< watch() has to be called
  bool handshaking = false;  ///< TLS: neither side has proved itself yet
  bool reread = false;       ///< bytes wait where the descriptor does not show them
  bool agreed_key = false;   ///< sessions_ knows the key of this connection
  std::uint32_t misbehaved = 0;
  ReadPace pace;
  std::int64_t since_ns = 0;                     ///< monotonic
  std::optional<protocol::RecordParser> parser;  ///< taken on connecting: a large buffer
  std::vector<std::byte> out;
  std::size_t out_sent = 0;
  std::unique_ptr<SenderClient> client;

  [[nodiscard]] bool open() const noexcept { return static_cast<bool>(socket); }
  /// Nothing is read: what was sent waits here and in the kernel.
  [[nodiscard]] bool waits() const noexcept { return stuck || paused; }
  /// Key of the connection on rings: the place in the table and how often it was used.
  [[nodiscard]] std::uint32_t key() const noexcept {
    return generation << kConnectionPlaceBits | index;
  }
};

struct Receiver::UdpMemory {
  static constexpr std::size_t kBatch = 16;
  static constexpr std::size_t kDatagramBytes = 65536;
  static constexpr std::size_t kControlBytes = 128;
  std::vector<std::byte> data = std::vector<std::byte>(kBatch * kDatagramBytes);
  struct alignas(cmsghdr) Control {
    std::array<std::byte, kControlBytes> bytes;
  };
  std::array<Control, kBatch> control{};
  std::array<sockaddr_storage, kBatch> peers{};
  std::array<iovec, kBatch> iov{};
  std::array<mmsghdr, kBatch> messages{};
};

/// Where a datagram came from.
[[nodiscard]] inline SocketAddress address_of(const Origin& origin) noexcept {
  SocketAddress out;
  out.length = origin.address_bytes;
  std::memcpy(&out.storage, origin.address.data(), origin.address_bytes);
  return out;
}

}  // namespace emit::server
