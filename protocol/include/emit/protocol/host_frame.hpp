// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "emit/physics/frames.hpp"

/// Host frames as plain structs of fixed size: what travels on rings between agents.
namespace emit::protocol {

inline constexpr std::size_t kMaxEntitiesPerFrame = 128;

struct PoseRates {
  glm::dvec3 velocity_world_m_s{0.0};
  glm::dvec3 angular_rate_body_rad_s{0.0};
};

struct EntityStateData {
  std::uint32_t entity_id = 0;
  physics::Pose pose;
  bool has_pose = false;  ///< false: stays where it is, only on/off changes
  std::optional<PoseRates> rates;
  bool on = true;
  bool teleport = false;
};

struct EnvironmentData {
  double direct_normal_w_m2 = 0.0;
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double wind_m_s = 0.0;
  double cloud_frac = 0.0;
  std::optional<double> environment_k;
  std::optional<double> film_w_m2_k;
};

struct HostFrameData {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::uint64_t run_id = 0;
  std::int64_t received_ns = 0;  ///< wall, TAI; not on the wire
  physics::Pose seeker;
  std::optional<PoseRates> seeker_rates;
  std::array<EntityStateData, kMaxEntitiesPerFrame> entities;
  std::uint32_t entity_count = 0;
  std::optional<EnvironmentData> environment;

  [[nodiscard]] std::span<const EntityStateData> entity_span() const noexcept {
    return {entities.data(), entity_count};
  }
};

}  // namespace emit::protocol
