// SPDX-License-Identifier: Apache-2.0
#include "axes/open_axes_link.hpp"

#include "axes/acutrol_axes_link.hpp"
#include "axes/memory_axes_link.hpp"
#include "axes/udp_axes_link.hpp"
#include "emit/config/motion_controller.hpp"

namespace emit::server {
namespace {

using config::MotionController;

/// Returns the link as what all of them are, or the error with the name of the key.
template <class Link>
physics::Result<std::unique_ptr<AxesLink>> as_link(physics::Result<std::unique_ptr<Link>> opened) {
  if (opened) return std::unique_ptr<AxesLink>(std::move(*opened));
  return tl::unexpected<physics::Error>(
      std::move(opened.error()).with_context("motion.controller"));
}

}  // namespace

physics::Result<std::unique_ptr<AxesLink>> open_axes_link(const config::MotionConfig& motion,
                                                          Counters& counters, EventLog& events) {
  const auto controller = config::parse_motion_controller(motion.controller);
  if (!controller) {
    return tl::unexpected<physics::Error>(
        physics::Error(controller.error()).with_context("motion.controller"));
  }
  switch (controller->kind) {
    case MotionController::Kind::udp:
      return as_link(UdpAxesLink::open(controller->address, counters));
    case MotionController::Kind::memory:
      return as_link(MemoryAxesLink::open(controller->memory, counters));
    case MotionController::Kind::acutrol:
      break;
  }
  std::vector<AcutrolHost::Axis> axes;
  for (const config::MotionAxisConfig& axis : motion.axes) {
    axes.push_back(
        {{axis.min_rad, axis.max_rad, axis.rate_rad_s, axis.acceleration_rad_s2}, axis.park_rad});
  }
  return as_link(AcutrolAxesLink::open(controller->address, axes, counters, events));
}

}  // namespace emit::server
