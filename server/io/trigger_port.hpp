// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "emit/config/network.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/trigger.hpp"
#include "io/socket.hpp"
#include "rt/clock.hpp"
#include "rt/counters.hpp"

namespace emit::server {

struct ReceivedTrigger {
  protocol::Trigger trigger;
  std::int64_t received_ns = 0;  ///< kernel stamp, wall ns
};

/// Where the conductor gets its triggers from; tests put one of their own in its place.
class TriggerInput {
 public:
  TriggerInput() = default;
  TriggerInput(const TriggerInput&) = delete;
  TriggerInput& operator=(const TriggerInput&) = delete;
  virtual ~TriggerInput() = default;

  /// The next sound trigger that has arrived, without waiting. RT-safe.
  [[nodiscard]] virtual std::optional<ReceivedTrigger> next() noexcept = 0;
  /// Readable when there may be one; -1 = none.
  [[nodiscard]] virtual int fd() const noexcept { return -1; }
};

/// The UDP port of trigger datagrams. What is no trigger, or not from the one sender that is
/// allowed, is counted (triggers_refused) and dropped unanswered.
/// Thread: the conductor's after open().
class TriggerPort final : public TriggerInput {
 public:
  /// `udp` is address:port; `peer` the only address datagrams are taken from, empty: any. A port
  /// beyond loopback needs a peer. Errors: config (addresses), io (in use).
  [[nodiscard]] static physics::Result<std::unique_ptr<TriggerPort>> open(const std::string& udp,
                                                                          const std::string& peer,
                                                                          const Clock& clock,
                                                                          Counters& counters);

  [[nodiscard]] std::optional<ReceivedTrigger> next() noexcept override;
  [[nodiscard]] int fd() const noexcept override { return socket_.fd(); }
  [[nodiscard]] SocketAddress address() const noexcept { return socket_.local_address(); }

 private:
  TriggerPort(UdpSocket socket, const std::optional<config::IpAddress>& peer, const Clock& clock,
              Counters& counters)
      : socket_(std::move(socket)), peer_(peer), clock_(clock), counters_(counters) {}

  UdpSocket socket_;
  std::optional<config::IpAddress> peer_;  // none: any
  const Clock& clock_;
  Counters& counters_;
  std::uint32_t os_drops_seen_ = 0;
};

}  // namespace emit::server
