// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "emit/physics/frames.hpp"
#include "emit/protocol/cigi/host_packets.hpp"

namespace emit::server {

/// Returns the pose of a body that is fixed to another one.
[[nodiscard]] physics::Pose attached(const physics::Pose& parent, const glm::dvec3& offset_body_m,
                                     const glm::dquat& turn) noexcept;

/// Articulated part of an entity of a CIGI host: three ways and three turns about its joint, each
/// with a rate.
///
/// Thread: one owner. Real time: RT-safe.
class CigiPart {
 public:
  /// The place that the part sits at, and the entity of the scenario that it is.
  struct Joint {
    std::uint16_t entity_id = 0;  ///< the host's
    std::uint8_t part_id = 0;
    std::uint32_t scenario_id = 0;
    std::optional<std::uint8_t> on_part;  ///< part that carries it; none: the entity does
    glm::dvec3 place_m{0.0};              ///< in the axes of what carries it
    glm::dvec3 yaw_pitch_roll_rad{0.0};   ///< axes of the joint against those of what carries it
  };
  explicit CigiPart(const Joint& joint) noexcept : joint_(joint) {}

  /// Sets what the packet enables, from this time on. Rates go on.
  void set(const protocol::cigi::ArticulatedPartControl& packet, std::int64_t time_ns) noexcept;
  void set(const protocol::cigi::PartMotion& motion, std::int64_t time_ns) noexcept;
  /// Sets all rates from this time on.
  void set(const protocol::cigi::RateControl& packet, std::int64_t time_ns) noexcept;
  void shift(std::int64_t by_ns) noexcept { time_ns_ += by_ns; }

  [[nodiscard]] const Joint& joint() const noexcept { return joint_; }
  [[nodiscard]] bool is_shown() const noexcept { return is_shown_; }
  [[nodiscard]] bool is_moving(std::int64_t time_ns) const noexcept;
  /// Returns the pose of the part at a time.
  /// @param carrier  pose of what carries it
  [[nodiscard]] physics::Pose pose(const physics::Pose& carrier,
                                   std::int64_t time_ns) const noexcept;

 private:
  /// Ways along x, y and z in metres, then yaw, pitch and roll in radians: the order of PartAxis.
  using Freedoms = std::array<double, 6>;
  [[nodiscard]] Freedoms at(std::int64_t time_ns) const noexcept;
  /// Moves by the rates up to a time.
  void move_on(std::int64_t time_ns) noexcept;

  Joint joint_;
  Freedoms values_{};
  Freedoms rates_per_s_{};
  std::int64_t time_ns_ = 0;  ///< of the values
  bool is_shown_ = true;
  bool is_local_ = false;  ///< the rates of the ways are along the part's own axes
};

}  // namespace emit::server
