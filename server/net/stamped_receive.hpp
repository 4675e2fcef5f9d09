// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/socket.h>

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "net/socket.hpp"
#include "rt/clock.hpp"

namespace emit::server {

/// A datagram with its sender and the kernel's instant of its arrival.
struct StampedDatagram {
  std::span<const std::byte> bytes;  ///< in the caller's space; a longer datagram is cut off
  sockaddr_storage from{};
  std::int64_t received_ns = 0;  ///< wall
  std::uint32_t os_drops = 0;    ///< datagrams that the kernel has dropped since the latest one
};

/// Receives datagrams one by one. It works on the native descriptor, because Asio knows neither
/// stamps nor drops.
/// Thread: one owner. Real time: RT-safe.
class StampedReceiver {
 public:
  /// Asks the kernel for stamps and drops.
  static void prepare(UdpSocket& socket) noexcept;

  /// Takes the next datagram that has arrived, without waiting; none: there is none.
  [[nodiscard]] std::optional<StampedDatagram> receive(const UdpSocket& socket,
                                                       std::span<std::byte> space,
                                                       const Clock& clock) noexcept;

 private:
  std::uint32_t os_drops_seen_ = 0;
};

}  // namespace emit::server
