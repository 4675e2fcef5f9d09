// SPDX-License-Identifier: Apache-2.0
// Fuzz target: one datagram to the trigger port, bare and with a MAC.
#include <algorithm>
#include <array>

#include "emit/protocol/trigger.hpp"
#include "emit/protocol/trigger_seal.hpp"
#include "fuzz/fuzz_input.hpp"

namespace {

using namespace emit;

/// Checks that a datagram with these bytes before its MAC is accepted with the right MAC and
/// refused with any other.
void check_sealed(std::span<const std::byte> bytes, protocol::TriggerFault inside) {
  using Verdict = protocol::TriggerSeal::Verdict;
  static const protocol::SessionKey key{};
  static auto seal = std::move(*protocol::TriggerSeal::create(std::span(&key, 1)));
  protocol::Trigger trigger{1, 2, 3};
  fuzz::require(
      seal.open(bytes, trigger) != Verdict::genuine || inside == protocol::TriggerFault::size,
      "a bare trigger is not genuine");
  if (bytes.size() < protocol::kTriggerBytes) return;
  std::array<std::byte, protocol::kSealedTriggerBytes> sealed;
  fuzz::require(seal.seal({7, 8, 9}, sealed), "sealing works");
  fuzz::require(seal.open(sealed, trigger) == Verdict::genuine && trigger.number == 8,
                "what was sealed is genuine");
  std::ranges::copy(bytes.first(protocol::kTriggerBytes), sealed.begin());
  const Verdict verdict = seal.open(sealed, trigger);
  fuzz::require(verdict == Verdict::bad_mac || (verdict == Verdict::genuine && trigger.run_id == 7),
                "no other trigger fits the MAC");
}

}  // namespace

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  protocol::Trigger trigger{1, 2, 3};
  const auto bytes = fuzz::as_bytes(data, size);
  const protocol::TriggerFault fault = protocol::decode_trigger(bytes, trigger);
  check_sealed(bytes, fault);
  if (fault != protocol::TriggerFault::none) {
    fuzz::require(trigger.run_id == 1 && trigger.number == 2 && trigger.edge_ns == 3,
                  "what is refused changes nothing");
    return 0;
  }
  fuzz::require(trigger.run_id != 0 && trigger.number != 0 && trigger.edge_ns >= 0,
                "an accepted trigger is sound");
  std::array<std::byte, protocol::kTriggerBytes> again;
  protocol::encode(trigger, again);
  protocol::Trigger read;
  fuzz::require(protocol::decode_trigger(again, read) == protocol::TriggerFault::none &&
                    read.run_id == trigger.run_id && read.number == trigger.number &&
                    read.edge_ns == trigger.edge_ns,
                "an accepted trigger can be said again");
  return 0;
}
