// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_part.hpp"

#include <algorithm>

#include "emit/physics/constants.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;
using physics::kDegree;
using physics::Pose;

Pose attached(const Pose& parent, const glm::dvec3& offset_body_m,
              const glm::dquat& turn) noexcept {
  return {parent.position_world_m + parent.world_from_body * offset_body_m,
          glm::normalize(parent.world_from_body * turn)};
}

void CigiPart::set(const cigi::ArticulatedPartControl& packet, std::int64_t time_ns) noexcept {
  move_on(time_ns);
  is_shown_ = packet.part_enabled;
  const auto take = [this](bool enabled, std::size_t freedom, double value) {
    if (enabled) values_[freedom] = value;
  };
  take(packet.x_enabled, 0, packet.x_m);
  take(packet.y_enabled, 1, packet.y_m);
  take(packet.z_enabled, 2, packet.z_m);
  take(packet.yaw_enabled, 3, packet.yaw_deg * kDegree);
  take(packet.pitch_enabled, 4, packet.pitch_deg * kDegree);
  take(packet.roll_enabled, 5, packet.roll_deg * kDegree);
}

void CigiPart::set(const cigi::PartMotion& motion, std::int64_t time_ns) noexcept {
  move_on(time_ns);
  is_shown_ = motion.part_enabled;
  if (motion.axis == cigi::PartAxis::none) return;
  const auto freedom = static_cast<std::size_t>(motion.axis) - 1;
  values_[freedom] = freedom < 3 ? motion.value_m_or_deg : motion.value_m_or_deg * kDegree;
}

void CigiPart::set(const cigi::RateControl& packet, std::int64_t time_ns) noexcept {
  move_on(time_ns);
  is_local_ = packet.local;
  rates_per_s_ = {packet.x_m_s,
                  packet.y_m_s,
                  packet.z_m_s,
                  packet.yaw_deg_s * kDegree,
                  packet.pitch_deg_s * kDegree,
                  packet.roll_deg_s * kDegree};
}

bool CigiPart::is_moving(std::int64_t time_ns) const noexcept {
  return time_ns != time_ns_ &&
         std::any_of(rates_per_s_.begin(), rates_per_s_.end(), [](double r) { return r != 0.0; });
}

CigiPart::Freedoms CigiPart::at(std::int64_t time_ns) const noexcept {
  Freedoms out = values_;
  const double for_s = 1e-9 * static_cast<double>(time_ns - time_ns_);
  const auto moved = [&](std::size_t i) { return rates_per_s_[i] * for_s; };
  glm::dvec3 way_m{moved(0), moved(1), moved(2)};
  // The part's own axes are taken as they were when the rates were set.
  if (is_local_) way_m = physics::body_from_turned({values_[3], values_[4], values_[5]}) * way_m;
  for (std::size_t i = 0; i < 3; ++i) out[i] += way_m[static_cast<glm::length_t>(i)];
  for (std::size_t i = 3; i < 6; ++i) out[i] += moved(i);
  return out;
}

void CigiPart::move_on(std::int64_t time_ns) noexcept {
  values_ = at(time_ns);
  time_ns_ = time_ns;
}

Pose CigiPart::pose(const Pose& carrier, std::int64_t time_ns) const noexcept {
  const Freedoms f = at(time_ns);
  const Pose rest =
      attached(carrier, joint_.place_m, physics::body_from_turned(joint_.yaw_pitch_roll_rad));
  return attached(rest, {f[0], f[1], f[2]}, physics::body_from_turned({f[3], f[4], f[5]}));
}

}  // namespace emit::server
