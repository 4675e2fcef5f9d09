// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>

#include "emit/protocol/cigi/common.hpp"
#include "emit/protocol/cigi/host_packets.hpp"

/// Packets of the host that only version 4.0 has. Units, axes and ranges are those of
/// host_packets.hpp, and the ids of the comments are those of 4.0.
///
/// Version 4.0 says the pose of an entity and its kind in two packets, which need not come in one
/// message. They stay two structs here, because a merged one could not say which half of it the
/// host sent: what is not sent keeps its last value.
namespace emit::protocol::cigi {

/// Pose of an entity (id 0x0001).
struct EntityPosition {
  static constexpr WireForms kWire{{0, 0}, {0x0001, 48}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;  ///< 0: ownship
  bool attached = false;  ///< child of `parent_id`: place and angles are relative to the parent
  Clamp clamp = Clamp::none;
  std::uint16_t parent_id = 0;
  float roll_deg = 0.0f;
  float pitch_deg = 0.0f;
  float yaw_deg = 0.0f;
  Place place{};  ///< offset from the parent's reference point if attached, else geodetic
  bool operator==(const EntityPosition&) const = default;
};

/// Type of an entity as in DIS (IEEE 1278.1, enumerations of SISO-REF-010), or a short number.
struct EntityType {
  /// The seven numbers of DIS hold. Otherwise only `country_or_type` holds, the number of a type as
  /// in version 3.3.
  bool extended = false;
  std::uint8_t kind = 0;
  std::uint8_t domain = 0;
  std::uint16_t country_or_type = 0;
  std::uint8_t category = 0;
  std::uint8_t subcategory = 0;
  std::uint8_t specific = 0;
  std::uint8_t extra = 0;
  bool operator==(const EntityType&) const = default;
};

/// State and type of an entity (id 0x0025, Entity Control).
struct EntityControl40 {
  static constexpr WireForms kWire{{0, 0}, {0x0025, 16}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;  ///< 0: ownship
  EntityState state = EntityState::standby;
  bool collision_detection = false;
  bool inherit_alpha = false;
  bool smoothing_enabled = false;  ///< extrapolation of this entity is allowed
  std::uint8_t alpha = 0;          ///< 0: transparent, 255: opaque
  EntityType type{};
  bool operator==(const EntityControl40&) const = default;
};

/// State of one animation of an entity (id 0x0026).
struct AnimationControl {
  static constexpr WireForms kWire{{0, 0}, {0x0026, 16}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;
  std::uint16_t animation_id = 0;
  bool playing = false;  ///< otherwise stopped
  bool reset = false;    ///< begins at the first frame of the animation, otherwise goes on
  bool loop = false;     ///< begins again at the end, otherwise it runs once
  bool inherit_alpha = false;
  std::uint8_t alpha = 0;
  float speed = 0.0f;  ///< finite; its scale is not in our sources
  bool operator==(const AnimationControl&) const = default;
};

/// Acceleration of an entity or of an articulated part (id 0x0013).
struct AccelerationControl {
  static constexpr WireForms kWire{{0, 0}, {0x0013, 32}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;
  std::uint8_t part_id = 0;
  bool applies_to_part = false;
  bool local = false;  ///< along the body's own axes, else in the frame of world or parent
  float x_m_s2 = 0.0f;
  float y_m_s2 = 0.0f;
  float z_m_s2 = 0.0f;
  float roll_deg_s2 = 0.0f;
  float pitch_deg_s2 = 0.0f;
  float yaw_deg_s2 = 0.0f;
  bool operator==(const AccelerationControl&) const = default;
};

}  // namespace emit::protocol::cigi
