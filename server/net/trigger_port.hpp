// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "emit/physics/error.hpp"
#include "emit/protocol/ip_address.hpp"
#include "emit/protocol/trigger.hpp"
#include "emit/protocol/trigger_seal.hpp"
#include "net/socket.hpp"
#include "net/stamped_receive.hpp"
#include "rt/clock.hpp"
#include "rt/counters.hpp"

namespace emit::server {

struct ReceivedTrigger {
  protocol::Trigger trigger;
  std::int64_t received_ns = 0;  ///< kernel stamp, wall ns
};

/// Source of the conductor's triggers; tests put one of their own in its place.
class TriggerInput {
 public:
  TriggerInput() = default;
  TriggerInput(const TriggerInput&) = delete;
  TriggerInput& operator=(const TriggerInput&) = delete;
  virtual ~TriggerInput() = default;

  /// The next sound trigger that has arrived, without waiting. RT-safe.
  [[nodiscard]] virtual std::optional<ReceivedTrigger> next() noexcept = 0;
  /// Address of the newest sender without a valid MAC; empty: none since the last call. Valid until
  /// next(). RT-safe.
  [[nodiscard]] virtual std::string_view take_unauthenticated() noexcept { return {}; }
  /// Readable when there may be one; -1 = none.
  [[nodiscard]] virtual int fd() const noexcept { return -1; }
};

/// The UDP port of trigger datagrams. What is no trigger, or not from the one sender that is
/// allowed, is counted (triggers_refused) and dropped unanswered. With keys, so is what none of
/// them sealed (triggers_unauthenticated) or was sealed more than kMaxAgeNs ago (triggers_stale).
/// Thread: the conductor's after open().
class TriggerPort final : public TriggerInput {
 public:
  /// Between a sealed trigger's own instant and its arrival, either way.
  static constexpr std::int64_t kMaxAgeNs = 1'000'000'000;

  /// `udp` is address:port; `peer` the only address datagrams are taken from, empty: any. A port
  /// beyond loopback needs a peer. `keys`: one of them has sealed every trigger; empty: none is
  /// sealed. Errors: config (addresses), io (in use), internal (no cryptography).
  [[nodiscard]] static physics::Result<std::unique_ptr<TriggerPort>> open(
      const std::string& udp, const std::string& peer, std::span<const protocol::SessionKey> keys,
      const Clock& clock, Counters& counters);

  [[nodiscard]] std::optional<ReceivedTrigger> next() noexcept override;
  [[nodiscard]] std::string_view take_unauthenticated() noexcept override;
  [[nodiscard]] int fd() const noexcept override { return socket_.fd(); }
  [[nodiscard]] SocketAddress address() const noexcept { return socket_.local_address(); }

 private:
  TriggerPort(UdpSocket socket, const std::optional<protocol::IpAddress>& peer,
              std::optional<protocol::TriggerSeal> seal, const Clock& clock, Counters& counters)
      : socket_(std::move(socket)),
        peer_(peer),
        seal_(std::move(seal)),
        clock_(clock),
        counters_(counters) {}
  bool accept(std::span<const std::byte> datagram, const protocol::IpAddress& from,
              ReceivedTrigger& out) noexcept;

  UdpSocket socket_;
  StampedReceiver receiver_;
  std::optional<protocol::IpAddress> peer_;  // none: any
  std::optional<protocol::TriggerSeal> seal_;
  std::optional<protocol::IpAddress> unauthenticated_;
  std::array<char, 46> text_{};  // what take_unauthenticated() gave away
  const Clock& clock_;
  Counters& counters_;
};

}  // namespace emit::server
