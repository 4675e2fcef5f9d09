// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/control.hpp"

#include <fmt/format.h>

namespace emit::protocol {

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
               "new run id, or RESET on the control port";
      }
      return detail == static_cast<std::uint64_t>(CommandKind::step)
                 ? "step needs a pose, and hold or stop before it"
                 : "not allowed now";
    case StatusCode::overloaded:
      return fmt::format("entity {}: more entities than emitd tracks", detail);
    case StatusCode::internal:
      return "failure inside emitd";
    case StatusCode::invalid_environment:
      return "environment outside its ranges";
  }
  return "unknown status";
}

}  // namespace emit::protocol
