// SPDX-License-Identifier: Apache-2.0
// View Definition and Sensor Control: what a host says of the sensor's view.
#include <algorithm>
#include <cmath>

#include "emit/physics/constants.hpp"
#include "gateway/cigi_host.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;

void CigiHost::take_view(const cigi::ViewDefinition& packet) noexcept {
  if (packet.group_id != 0 || packet.view_id != options_.cigi.view || packet.orthographic) {
    no_effect(packet, "another view than the sensor's");
    return;
  }
  if (packet.mirror != cigi::Mirror::none) no_effect(packet, "channels say how they mirror");
  if (options_.scenario == nullptr) return;
  const scene::SensorDesc& sensor = options_.scenario->sensor;
  const double aspect = static_cast<double>(sensor.height_px) / sensor.width_px;
  constexpr double kToleranceDeg = 0.01;
  const double now_rad = fov_h_rad_.value_or(sensor.fov_h_rad);
  const double now_h_deg = 0.5 * now_rad / physics::kDegree;
  const double now_v_deg = std::atan(std::tan(0.5 * now_rad) * aspect) / physics::kDegree;
  // Sides that are not enabled stay where they are.
  const double left_deg = packet.left_enabled ? packet.left_deg : -now_h_deg;
  const double right_deg = packet.right_enabled ? packet.right_deg : now_h_deg;
  const bool is_wide = packet.left_enabled || packet.right_enabled;
  const bool is_high = packet.top_enabled || packet.bottom_enabled;
  if (!is_wide && !is_high) return;
  double half_h_rad = 0.5 * (right_deg - left_deg) * physics::kDegree;
  const double square_v_deg =
      is_wide ? std::atan(std::tan(half_h_rad) * aspect) / physics::kDegree : now_v_deg;
  const double top_deg = packet.top_enabled ? packet.top_deg : square_v_deg;
  const double bottom_deg = packet.bottom_enabled ? packet.bottom_deg : -square_v_deg;
  if (std::abs(left_deg + right_deg) > kToleranceDeg ||
      std::abs(top_deg + bottom_deg) > kToleranceDeg) {
    no_effect(packet, "the optical axis is the centre of the image");
    return;
  }
  if (!is_wide) {
    half_h_rad = std::atan(std::tan(top_deg * physics::kDegree) / aspect);
  } else if (std::abs(top_deg - square_v_deg) > kToleranceDeg) {
    no_effect(packet, "pixels are square, and these angles make them oblong");
    return;
  }
  const double fov_h_rad = 2.0 * half_h_rad;
  if (options_.is_view_fixed || sensor.narrowest_fov_rad() == sensor.fov_h_rad) {
    // Hosts state again what they know of the sensor, in their own rounding.
    if (std::abs(half_h_rad / physics::kDegree - now_h_deg) <= kToleranceDeg) return;
    no_effect(packet, "another field of view is fixed here");
    return;
  }
  constexpr double kSlackRad = 1e-3 * physics::kDegree;  // float32 degrees round
  if (!(fov_h_rad >= sensor.narrowest_fov_rad() - kSlackRad &&
        fov_h_rad <= sensor.fov_h_rad + kSlackRad)) {
    no_effect(packet, "the field of view is not within sensor.fov_h_min_deg to sensor.fov_h_deg");
    return;
  }
  fov_h_rad_ = std::clamp(fov_h_rad, sensor.narrowest_fov_rad(), sensor.fov_h_rad);
}

void CigiHost::take_sensor(const cigi::SensorControl& packet) noexcept {
  if (!picture_.take(packet)) {
    no_effect(packet, "another view than the sensor's");
    return;
  }
  if (packet.track_mode != cigi::TrackMode::off) {
    no_effect(packet, "there is no tracker: answers say that it searches");
  }
  if (packet.line_dropout) no_effect(packet, "no lines of the picture drop out");
  if (packet.noise > 0.0F || packet.ac_coupling_us > 0.0F) {
    no_effect(packet, "the picture has no noise and AC coupling of its own");
  }
}

}  // namespace emit::server
