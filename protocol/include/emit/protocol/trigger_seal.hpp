// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_session.hpp"
#include "emit/protocol/trigger.hpp"

/// Triggers with a MAC (docs/wire.md section 10): the trigger, the key's id, and the MAC of both. A
/// sync source receives nothing, so no session can be agreed on. One key serves all its runs, and
/// the trigger's own instant shows when a datagram was recorded and sent again.
namespace emit::protocol {

inline constexpr std::size_t kSealedTriggerBytes = kTriggerBytes + 8 + kSessionTagBytes;

/// Makes and checks triggers with a MAC.
/// Thread: one owner.  Real time: create() allocates, everything else is RT-safe.
class TriggerSeal {
 public:
  /// Result of opening a trigger with a MAC.
  enum class Verdict : std::uint8_t {
    genuine,
    bare,         ///< the length is not that of a trigger with a MAC
    unknown_key,  ///< no key has this id
    bad_mac,
    malformed,  ///< the MAC is right, but the contents are no trigger
  };

  /// Creates an object with shared keys. The first one seals.
  /// Errors (internal): `keys` is empty, or the cryptographic library lacks the algorithm.
  [[nodiscard]] static physics::Result<TriggerSeal> create(std::span<const SessionKey> keys);

  /// Writes a trigger with its MAC. Returns false when the cryptographic library failed.
  [[nodiscard]] bool seal(const Trigger& trigger,
                          std::span<std::byte, kSealedTriggerBytes> out) noexcept;
  /// Checks the MAC and decodes the trigger. `trigger` is written only when the result is genuine.
  [[nodiscard]] Verdict open(std::span<const std::byte> datagram, Trigger& trigger) noexcept;

 private:
  struct Key {
    std::uint64_t id = 0;
    SessionKey key{};
  };
  TriggerSeal(SessionMac mac, std::vector<Key> keys)
      : mac_(std::move(mac)), keys_(std::move(keys)) {}

  SessionMac mac_;
  std::vector<Key> keys_;
};

}  // namespace emit::protocol
