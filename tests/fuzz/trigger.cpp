// SPDX-License-Identifier: Apache-2.0
// One datagram to the trigger port.
#include <algorithm>
#include <array>

#include "emit/protocol/trigger.hpp"
#include "fuzz/fuzz_input.hpp"

int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace emit;
  protocol::Trigger trigger{1, 2, 3};
  const auto bytes = fuzz::as_bytes(data, size);
  if (protocol::decode_trigger(bytes, trigger) != protocol::TriggerFault::none) {
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
