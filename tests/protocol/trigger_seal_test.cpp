// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/trigger_seal.hpp"

#include <gtest/gtest.h>

#include <array>

#include "support/heap_counter.hpp"

namespace emit::protocol {
namespace {

using Verdict = TriggerSeal::Verdict;
using Sealed = std::array<std::byte, kSealedTriggerBytes>;

constexpr Trigger kTrigger{0x1122334455667788, 1000, 1'800'000'000'000'000'005};

SessionKey key_of(unsigned char seed) {
  SessionKey key;
  key.fill(std::byte{seed});
  return key;
}

TriggerSeal with_keys(std::vector<SessionKey> keys) {
  return std::move(*TriggerSeal::create(keys));
}

Sealed sealed(TriggerSeal& seal, const Trigger& trigger = kTrigger) {
  Sealed out;
  EXPECT_TRUE(seal.seal(trigger, out));
  return out;
}

Verdict verdict_of(TriggerSeal& seal, std::span<const std::byte> bytes) {
  Trigger trigger{3, 4, 5};
  const Verdict verdict = seal.open(bytes, trigger);
  EXPECT_EQ(trigger.run_id, verdict == Verdict::genuine ? kTrigger.run_id : 3U);
  EXPECT_EQ(trigger.number, verdict == Verdict::genuine ? kTrigger.number : 4U);
  EXPECT_EQ(trigger.edge_ns, verdict == Verdict::genuine ? kTrigger.edge_ns : 5);
  return verdict;
}

TEST(TriggerSeal, OpensWhatAnyOfItsKeysSealed) {
  auto source = with_keys({key_of(1)});
  auto daemon = with_keys({key_of(2), key_of(1)});
  EXPECT_EQ(verdict_of(daemon, sealed(source)), Verdict::genuine);
  EXPECT_EQ(verdict_of(source, sealed(daemon)), Verdict::unknown_key) << "the first key seals";
  EXPECT_FALSE(TriggerSeal::create({}).has_value());
}

TEST(TriggerSeal, NoByteCanBeChanged) {
  auto seal = with_keys({key_of(1)});
  const Sealed good = sealed(seal);
  for (std::size_t at = 0; at < good.size(); ++at) {
    Sealed forged = good;
    forged[at] ^= std::byte{0x10};
    const bool of_key_id = at >= kTriggerBytes && at < kTriggerBytes + 8;
    EXPECT_EQ(verdict_of(seal, forged), of_key_id ? Verdict::unknown_key : Verdict::bad_mac) << at;
  }
  std::array<std::byte, kTriggerBytes> bare;
  encode(kTrigger, bare);
  EXPECT_EQ(verdict_of(seal, bare), Verdict::bare);
  EXPECT_EQ(verdict_of(seal, std::span(good).first(63)), Verdict::bare);
  EXPECT_EQ(verdict_of(seal, sealed(seal, {1, 0, 0})), Verdict::malformed);
}

/// The key of triggers differs from all others: a MAC made for one purpose is of no use for
/// another.
TEST(TriggerSeal, HasAKeyOfItsOwn) {
  auto mac = std::move(*SessionMac::create());
  const SharedKey shared = make_shared_key(key_of(1), mac);
  auto seal = with_keys({key_of(1)});
  const Sealed good = sealed(seal);
  for (const SessionKey& key : {shared.key, shared.open_key}) {
    mac.set_key(key);
    EXPECT_FALSE(mac.verify(good));
  }
}

TEST(TriggerSeal, TakesNoMemoryPerTrigger) {
  auto seal = with_keys({key_of(1)});
  Sealed bytes = sealed(seal);
  Trigger read;
  static_cast<void>(seal.open(bytes, read));
  const std::uint64_t before = test::heap_request_count();
  ASSERT_TRUE(seal.seal(kTrigger, bytes));
  ASSERT_EQ(seal.open(bytes, read), Verdict::genuine);
  EXPECT_EQ(test::heap_request_count(), before);
}

}  // namespace
}  // namespace emit::protocol
