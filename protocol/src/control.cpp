// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/control.hpp"

#include "emit/protocol/codec.hpp"
#include "fixed_text.hpp"

namespace emit::protocol {
namespace {

void add_place(DecodeStatus status, const DecodeFault& fault, FixedText& out) noexcept {
  out.add("{}", to_string(status));
  if (fault.kind == DecodeFault::Kind::none) return;
  switch (fault.part) {
    case DecodeFault::Part::message:
    case DecodeFault::Part::environment:
      break;  // the status or the field says it
    case DecodeFault::Part::seeker:
      out.add(": seeker");
      break;
    case DecodeFault::Part::entity:
      out.add(": entity {}", fault.entity_id);
      break;
    case DecodeFault::Part::part:
      out.add(": entity {}, part {}", fault.entity_id, fault.part_id);
      break;
  }
  if (fault.kind == DecodeFault::Kind::repeated) {
    out.add(" stands in the frame twice");
  } else {
    out.add(": {}", fault.field);
  }
}

}  // namespace

std::string status_text(StatusCode code, std::uint64_t detail) {
  switch (code) {
    case StatusCode::ok:
      return detail == kDetailStopped
                 ? "pose taken, but no frame: emitd is stopped, send START or STEP"
                 : "taken";
    case StatusCode::wrong_version:
      return "wrong protocol version";
    case StatusCode::oversize:
      return "message too large";
    case StatusCode::malformed:
      return "malformed message";
    case StatusCode::unknown_entity:
      return fmt::format(
          "unknown entity {}: not in the scenario, not applied; the rest of the frame is taken",
          detail);
    case StatusCode::invalid_pose:
      return "invalid pose";
    case StatusCode::time_backwards:
      return "sim time goes backwards within a run";
    case StatusCode::duplicate_frame:
      return "frame number already seen in this run";
    case StatusCode::unknown_channel:
      return "unknown channel";
    case StatusCode::not_allowed:
      if (detail == kDetailOldRun) {
        return "this host's run id belongs to a run that another host has replaced: send under a "
               "new run id that no run had before, such as a larger one, or RESET on the control "
               "port";
      }
      return detail == static_cast<std::uint64_t>(CommandKind::step)
                 ? "step needs a pose, and hold or stop before it"
                 : "not allowed now";
    case StatusCode::overloaded:
      return fmt::format("entity {}: more entities or commands to parts than emitd takes", detail);
    case StatusCode::internal:
      return "failure inside emitd";
    case StatusCode::invalid_environment:
      return "environment outside its ranges";
    case StatusCode::invalid_view:
      return "field of view outside sensor.fov_h_min_deg to sensor.fov_h_deg, or fixed by optics";
    case StatusCode::invalid_part:
      return "drive of a part outside its range";
    case StatusCode::unknown_part:
      return fmt::format(
          "entity {}, part {}: the scenario has no such part, or it takes no throttle; the rest of "
          "the frame is taken",
          detail >> 32U, detail & 0xFFFFFFFFU);
  }
  return "unknown status";
}

std::string_view fault_place(DecodeStatus status, const DecodeFault& fault,
                             std::span<char> buffer) noexcept {
  FixedText out(buffer);
  add_place(status, fault, out);
  return out.text();
}

std::string_view fault_text(DecodeStatus status, const DecodeFault& fault,
                            std::span<char> buffer) noexcept {
  FixedText out(buffer);
  add_place(status, fault, out);
  if (fault.kind == DecodeFault::Kind::missing) {
    out.add(" is missing");
  } else if (fault.kind == DecodeFault::Kind::out_of_range) {
    out.add(" is {}, must be {} to {}", fault.value, fault.lowest, fault.highest);
  }
  return out.text();
}

}  // namespace emit::protocol
