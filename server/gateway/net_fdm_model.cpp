// SPDX-License-Identifier: Apache-2.0
#include "gateway/net_fdm_model.hpp"

#include <array>
#include <glm/vec3.hpp>
#include <utility>

#include "emit/protocol/convert.hpp"

namespace emit::server {

namespace net_fdm = protocol::net_fdm;

NetFdmModel::NetFdmModel(std::int64_t first_time_ns, const scene::ScenarioDesc* scenario,
                         Counters& counters, EventLog& events)
    : counters_(counters),
      events_(events),
      earth_(origin_of(scenario)),
      first_time_ns_(first_time_ns) {}

void NetFdmModel::take(std::span<const std::byte> datagram, std::int64_t received_ns) noexcept {
  const net_fdm::Fault fault = net_fdm::decode(datagram, state_);
  if (fault) {
    counters_.add(Counter::gateway_messages_refused);
    std::array<char, net_fdm::kFaultTextBytes> buffer;
    events_.push(EventKind::gateway_refused, 0, static_cast<std::uint64_t>(fault.kind),
                 net_fdm::fault_text(fault, buffer));
    return;
  }
  if (number_ == 0) {
    begin_ns_ = received_ns;
    run_id_ = static_cast<std::uint64_t>(received_ns);
  } else if (received_ns < received_ns_) {
    // Somebody has set the clock back. Simulation time stands for this datagram and goes on.
    begin_ns_ += received_ns - received_ns_;
  }
  received_ns_ = received_ns;
  ++number_;
  pending_ = true;
}

bool NetFdmModel::next(protocol::HostFrameData& frame, std::int64_t /*now_ns*/) noexcept {
  if (!std::exchange(pending_, false)) return false;
  frame.frame_number = number_;
  frame.sim_time_ns = first_time_ns_ + (received_ns_ - begin_ns_);
  frame.run_id = run_id_;
  frame.received_ns = received_ns_;
  frame.entity_count = 0;
  frame.environment.reset();
  frame.fov_h_rad.reset();
  frame.gimbal_rad.reset();
  frame.part_count = 0;
  const physics::GeoPlace place = {physics::Radians(state_.latitude_rad),
                                   physics::Radians(state_.longitude_rad),
                                   physics::Metres(state_.altitude_m)};
  frame.seeker = earth_.world_pose(place, {state_.heading_rad, state_.pitch_rad, state_.roll_rad});
  const glm::dvec3& ned = state_.velocity_ned_m_s;
  frame.seeker_rates =
      protocol::PoseRates{earth_.world_from_enu(place) * glm::dvec3{ned.y, ned.x, -ned.z},
                          net_fdm::body_rates_rad_s(state_)};
  if (protocol::check_pose(frame.seeker, frame.seeker_rates) == protocol::DecodeStatus::ok) {
    return true;
  }
  counters_.add(Counter::gateway_packets_refused);
  events_.push(EventKind::gateway_refused, 0, 0,
               "the aircraft is too far from the scenario, or too fast");
  return false;
}

}  // namespace emit::server
