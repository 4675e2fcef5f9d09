// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/trigger_seal.hpp"

#include <algorithm>

#include "wire_bytes.hpp"

namespace emit::protocol {
namespace {

constexpr std::size_t kKeyIdAt = kTriggerBytes;
constexpr std::size_t kCovered = kSealedTriggerBytes - kSessionTagBytes;

}  // namespace

physics::Result<TriggerSeal> TriggerSeal::create(std::span<const SessionKey> keys) {
  auto mac = SessionMac::create();
  if (!mac) return tl::unexpected(std::move(mac.error()));
  if (keys.empty()) {
    return physics::make_error(physics::ErrorCode::internal, "triggers are sealed by no key");
  }
  std::vector<Key> made;
  for (const SessionKey& key : keys) {
    const std::uint64_t id = make_shared_key(key, *mac).id;
    mac->set_key(key);
    made.push_back({id, mac->derive("emitd trigger", {})});
  }
  return TriggerSeal(std::move(*mac), std::move(made));
}

bool TriggerSeal::seal(const Trigger& trigger,
                       std::span<std::byte, kSealedTriggerBytes> out) noexcept {
  const std::span<std::byte> to = out;
  encode(trigger, out.first<kTriggerBytes>());
  wire::put(to, kKeyIdAt, keys_.front().id);
  mac_.set_key(keys_.front().key);
  return mac_.tag(to.first(kCovered), out.last<kSessionTagBytes>());
}

TriggerSeal::Verdict TriggerSeal::open(std::span<const std::byte> datagram,
                                       Trigger& trigger) noexcept {
  if (datagram.size() != kSealedTriggerBytes) return Verdict::bare;
  const auto id = wire::get<std::uint64_t>(datagram, kKeyIdAt);
  const auto key = std::ranges::find(keys_, id, &Key::id);
  if (key == keys_.end()) return Verdict::unknown_key;
  mac_.set_key(key->key);
  if (!mac_.verify(datagram)) return Verdict::bad_mac;
  return decode_trigger(datagram.first(kTriggerBytes), trigger) == TriggerFault::none
             ? Verdict::genuine
             : Verdict::malformed;
}

}  // namespace emit::protocol
