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

/// Triggers with a MAC (docs/wire.md, "Triggers"): the datagram without, the key's id, the MAC of
/// both. Nothing comes back to a sync source, so nothing is agreed on: one key for all its runs,
/// and the trigger's own instant tells what was recorded.
namespace emit::protocol {

inline constexpr std::size_t kSealedTriggerBytes = kTriggerBytes + 8 + kSessionTagBytes;

/// Makes and checks them. Thread: one owner. Real time: create() allocates, the rest is RT-safe.
class TriggerSeal {
 public:
  enum class Verdict : std::uint8_t {
    genuine,
    bare,         ///< not of a sealed trigger's size
    unknown_key,  ///< no key has this id
    bad_mac,
    malformed,  ///< genuine, but no trigger inside
  };

  /// `keys`: shared ones, at least one; the first seals. Errors (internal): no cryptography.
  [[nodiscard]] static physics::Result<TriggerSeal> create(std::span<const SessionKey> keys);

  /// False: the cryptographic library failed.
  [[nodiscard]] bool seal(const Trigger& trigger,
                          std::span<std::byte, kSealedTriggerBytes> out) noexcept;
  /// `trigger` is left alone unless the answer is genuine.
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
