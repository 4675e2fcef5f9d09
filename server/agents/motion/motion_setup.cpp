// SPDX-License-Identifier: Apache-2.0
#include "agents/motion/motion_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <string_view>

namespace emit::server {
namespace {

using config::MotionConfig;
using physics::ErrorCode;
using physics::make_error;

/// Returns the rotation about z, then y, then x: from the turned frame to the one it stands in.
glm::dmat3 rotation_of(const std::array<double, 3>& yaw_pitch_roll_rad) {
  const auto about = [&](std::size_t i, const glm::dvec3& axis) {
    return glm::angleAxis(yaw_pitch_roll_rad[i], axis);
  };
  return glm::mat3_cast(about(0, {0, 0, 1}) * about(1, {0, 1, 0}) * about(2, {1, 0, 0}));
}

TableAlignment alignment_of(const MotionConfig& motion) {
  TableAlignment out;
  out.lab_from_world = glm::transpose(rotation_of(motion.lab_rad)) * out.lab_from_world;
  out.lab_from_unit_base = rotation_of(motion.unit_base_rad);
  out.unit_payload_from_seeker = rotation_of(motion.unit_mount_rad);
  out.lab_from_target_base = rotation_of(motion.target_base_rad);
  out.target_payload_from_projector = rotation_of(motion.target_mount_rad);
  return out;
}

physics::Result<ThreeAxisGimbal> unit_of(std::string_view rings) {
  std::array<GimbalAxis, 3> order{};
  for (GimbalAxis& axis : order) {
    const std::size_t dash = std::min(rings.find('-'), rings.size());
    const std::string_view name = rings.substr(0, dash);
    axis = name == "yaw" ? GimbalAxis::yaw : name == "pitch" ? GimbalAxis::pitch : GimbalAxis::roll;
    rings = rings.substr(std::min(dash + 1, rings.size()));
  }
  return ThreeAxisGimbal::create(order);
}

std::optional<TwoAxisGimbal> target_of(config::TargetRings rings) {
  switch (rings) {
    case config::TargetRings::azimuth_elevation:
      return TwoAxisGimbal(TwoAxisGimbal::Outer::azimuth);
    case config::TargetRings::elevation_azimuth:
      return TwoAxisGimbal(TwoAxisGimbal::Outer::elevation);
    case config::TargetRings::none:
      break;
  }
  return std::nullopt;
}

/// Errors (config): the projector channels are not all of one view along the projector.
physics::Result<void> check_projectors(const scene::ScenarioDesc& scenario,
                                       const scene::ChannelDesc& first) {
  scene::ChannelCamera along;
  along.fov_h_rad = first.camera.fov_h_rad;
  for (const scene::ChannelDesc& channel : scenario.channels) {
    if (channel.kind != scene::ChannelKind::projector || channel.camera == along) continue;
    return make_error(
        ErrorCode::config,
        fmt::format("{}: channel '{}': with [motion] projector channels look along the "
                    "projector, all with one field of view: 'fov_h_deg' alone may be "
                    "set, alike for all",
                    scenario.file.string(), channel.name));
  }
  return {};
}

}  // namespace

physics::Result<MotionPlan> make_motion_plan(const config::DaemonConfig& config,
                                             const std::optional<scene::ScenarioDesc>& scenario,
                                             const std::vector<Channel>& channels) {
  const MotionConfig& motion = config.motion;
  auto unit = unit_of(motion.unit_rings);
  if (!unit) return tl::unexpected(std::move(unit.error()).with_context("motion.unit_rings"));
  const auto is_projector = [](const Channel& channel) {
    return channel.kind == scene::ChannelKind::projector;
  };
  const bool projects = std::ranges::any_of(channels, is_projector);
  if (projects && !scenario) {
    return make_error(ErrorCode::config, "[motion]: a projector channel needs a scenario");
  }
  MotionPlan plan(MotionTable(*unit, target_of(motion.target_rings), alignment_of(motion)));
  for (const config::MotionAxisConfig& axis : motion.axes) {
    plan.follower.axes.push_back(
        {{axis.min_rad, axis.max_rad, axis.rate_rad_s, axis.acceleration_rad_s2}, axis.park_rad});
  }
  plan.follower.period_ns = static_cast<std::int64_t>(std::llround(1e9 / motion.rate_hz));
  plan.follower.feedback_timeout_ns = motion.feedback_timeout_ns;
  plan.follower.host_timeout_ns = motion.host_timeout_ns;
  plan.follower.controller_timeout_ms = motion.controller_timeout_ms;
  plan.follower.soft_frac = motion.soft_frac;
  if (motion.target_rings != config::TargetRings::none) {
    plan.target_entity = motion.target_entity;
    const auto is_target = [&](const scene::ObjectDesc& object) {
      return object.entity_id == plan.target_entity;
    };
    if (scenario && !std::ranges::any_of(scenario->objects, is_target)) {
      return make_error(
          ErrorCode::config,
          fmt::format("motion.target_entity: the scenario has no entity {}", *plan.target_entity));
    }
  }
  plan.projects = projects;
  plan.follower.horizon_ns = config.pacing.horizon_ns;
  if (scenario) {
    plan.size_px = {scenario->sensor.width_px, scenario->sensor.height_px};
    double fov_h_rad = scenario->sensor.fov_h_rad;
    const auto projecting =
        std::ranges::find_if(scenario->channels, [](const scene::ChannelDesc& channel) {
          return channel.kind == scene::ChannelKind::projector;
        });
    if (projecting != scenario->channels.end()) {
      if (auto checked = check_projectors(*scenario, *projecting); !checked) {
        return tl::unexpected<physics::Error>(std::move(checked.error()));
      }
      if (projecting->camera.fov_h_rad > 0.0) fov_h_rad = projecting->camera.fov_h_rad;
    }
    plan.focal_px = 0.5 * plan.size_px.x / std::tan(0.5 * fov_h_rad);
  }
  return plan;
}

}  // namespace emit::server
