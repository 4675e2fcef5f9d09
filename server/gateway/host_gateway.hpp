// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/host_frame.hpp"

namespace emit::server {

/// Report of the conductor on a host frame.
struct GatewayReport {
  /// refused: no image comes of it. unused: the run is stopped, so that none comes. published: its
  /// image was handed on. reset: a command has forgotten all that hosts have sent, and the number
  /// means nothing.
  enum class Kind : std::uint8_t { refused, unused, published, reset };
  Kind kind = Kind::published;
  std::uint64_t host_frame_number = 0;
};

/// A host that does not speak emitd's own messages: it turns datagrams of its protocol into host
/// frames, and answers in its protocol. The agent around it owns the socket and the clock.
///
/// Thread: one owner. Real time: RT-safe after construction.
class HostGateway {
 public:
  HostGateway() = default;
  HostGateway(const HostGateway&) = delete;
  HostGateway& operator=(const HostGateway&) = delete;
  virtual ~HostGateway() = default;

  /// Takes a datagram that arrived at `received_ns`, wall.
  /// @pre next() has returned false since the last call
  virtual void take(std::span<const std::byte> datagram, std::int64_t received_ns) noexcept = 0;
  /// Writes all of the next host frame. Returns false when there is none at this instant.
  [[nodiscard]] virtual bool next(protocol::HostFrameData& frame, std::int64_t now_ns) noexcept = 0;
  /// Takes a report of the conductor.
  virtual void report(const GatewayReport& report) noexcept = 0;
  /// Returns the message to send to the host now; empty: none. It is valid until the next call.
  [[nodiscard]] virtual std::span<const std::byte> message(std::int64_t now_ns) noexcept = 0;
  /// Returns the instant at which next() or message() will have something, wall; the largest
  /// number: not before the next datagram or report.
  [[nodiscard]] virtual std::int64_t wake_at_ns() const noexcept = 0;
};

}  // namespace emit::server
