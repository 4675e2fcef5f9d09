// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "emit/physics/check.hpp"
#include "emit/physics/frames.hpp"

/// Host frames as plain structs of fixed size, which the rings between agents carry (docs/wire.md
/// section 5).
namespace emit::protocol {

/// Largest number of entities in one host frame.
inline constexpr std::size_t kMaxEntitiesPerFrame = 128;

/// Rates of a pose, for prediction.
struct PoseRates {
  glm::dvec3 velocity_world_m_s{0.0};
  glm::dvec3 angular_rate_body_rad_s{0.0};
};

/// State of one entity.
struct EntityStateData {
  std::uint32_t entity_id = 0;
  physics::Pose pose;
  bool has_pose = false;  ///< false: the entity stays where it is, and only on/off changes
  std::optional<PoseRates> rates;
  bool on = true;         ///< false: the entity is hidden
  bool teleport = false;  ///< true: the entity jumps to the pose without motion in between
};

/// Weather from a host frame's simulation time on. The ranges are in docs/wire.md section 5.
struct EnvironmentData {
  double direct_normal_w_m2 = 0.0;
  double diffuse_horizontal_w_m2 = 0.0;
  double longwave_down_w_m2 = 0.0;
  double air_k = 0.0;
  double wind_m_s = 0.0;
  double cloud_frac = 0.0;
  std::optional<double> environment_k;
  std::optional<double> film_w_m2_k;
  std::optional<double> wind_from_deg;           ///< clockwise from north
  std::optional<double> relative_humidity_frac;  ///< over water
  double rain_mm_h = 0.0;
};

/// Largest number of commands to parts in one host frame.
inline constexpr std::size_t kMaxPartsPerFrame = 32;

/// Drive of a part of an entity from a host frame's simulation time on.
struct PartCommandData {
  enum class Kind : std::uint8_t {
    off,
    temperature,  ///< value: temperature of the skin, K
    power,        ///< value: power into the skin, W/m2
    throttle,     ///< value: 0 idle to 1 full
  };
  std::uint32_t entity_id = 0;
  std::uint32_t part_id = 0;
  Kind kind = Kind::off;
  double value = 0.0;
};

/// One host frame.
struct HostFrameData {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::uint64_t run_id = 0;
  std::int64_t received_ns = 0;  ///< wall instant of receipt, ns TAI; it is not on the wire
  physics::Pose seeker;
  std::optional<PoseRates> seeker_rates;
  std::array<EntityStateData, kMaxEntitiesPerFrame> entities;
  std::uint32_t entity_count = 0;
  std::optional<EnvironmentData> environment;
  /// Yaw, pitch and roll of the detector against the seeker's body, rad; none: unchanged.
  std::optional<glm::dvec3> gimbal_rad;
  std::optional<double> fov_h_rad;  ///< horizontal field of view from here on; none: unchanged
  std::array<PartCommandData, kMaxPartsPerFrame> parts;
  std::uint32_t part_count = 0;

  /// Returns the entities in use.
  /// @pre entity_count <= kMaxEntitiesPerFrame
  [[nodiscard]] std::span<const EntityStateData> entity_span() const noexcept {
    EMIT_CHECK_OP(entity_count, <=, kMaxEntitiesPerFrame);
    return {entities.data(), entity_count};
  }
  /// Returns the commands to parts in use.
  /// @pre part_count <= kMaxPartsPerFrame
  [[nodiscard]] std::span<const PartCommandData> part_span() const noexcept {
    EMIT_CHECK_OP(part_count, <=, kMaxPartsPerFrame);
    return {parts.data(), part_count};
  }
};

}  // namespace emit::protocol
