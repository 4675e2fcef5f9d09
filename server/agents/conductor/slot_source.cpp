// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/slot_source.hpp"

#include "agents/conductor/clock_slots.hpp"
#include "agents/conductor/trigger_slots.hpp"
#include "emit/physics/check.hpp"

namespace emit::server {

std::unique_ptr<SlotSource> make_slot_source(Context& context, const config::PacingConfig& pacing,
                                             TriggerInput* triggers) {
  switch (pacing.mode) {
    case config::PacingMode::host_step:
      break;
    case config::PacingMode::ig_clock:
      return std::make_unique<ClockSlots>(context, pacing.rate_hz);
    case config::PacingMode::trigger:
      EMIT_CHECK(triggers != nullptr);
      return std::make_unique<TriggerSlots>(context, pacing, *triggers);
  }
  return nullptr;
}

}  // namespace emit::server
