// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>

#include "emit/protocol/cigi/common.hpp"

/// Packets by which a host asks the image generator. Units, axes and ranges are those of
/// host_packets.hpp.
namespace emit::protocol::cigi {

enum class HatHotType : std::uint8_t { height_above = 0, height_of = 1, extended = 2 };

/// Question for the terrain below a point (id 24).
struct HatHotRequest {
  static constexpr WireForms kWire{{24, 32}, {0x0017, 40}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t request_id = 0;
  HatHotType type = HatHotType::height_above;
  bool relative_to_entity = false;        ///< `place` is an offset in the frame of `entity_id`
  std::uint8_t update_period_frames = 0;  ///< 0: one answer, else one every so many frames
  std::uint16_t entity_id = 0;
  Place place{};
  bool operator==(const HatHotRequest&) const = default;
};

/// Question whether something stands between two points (id 25).
struct LosSegmentRequest {
  static constexpr WireForms kWire{{25, 64}, {0x0018, 72}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t request_id = 0;
  bool extended = false;
  bool source_relative = false;           ///< in the frame of `entity_id`
  bool destination_relative = false;      ///< in the frame of an entity, see below
  bool response_relative = false;         ///< the answer is in the frame of the entity that was hit
  bool destination_entity_valid = false;  ///< `destination_entity_id` holds the destination
  std::uint8_t alpha_threshold = 0;
  std::uint16_t entity_id = 0;
  Place source{};
  Place destination{};
  std::uint32_t material_mask = 0;
  std::uint8_t update_period_frames = 0;  ///< 0: one answer
  std::uint16_t destination_entity_id = 0;
  bool operator==(const LosSegmentRequest&) const = default;
};

/// Question what a ray meets (id 26).
struct LosVectorRequest {
  static constexpr WireForms kWire{{26, 56}, {0x0019, 64}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t request_id = 0;
  bool extended = false;
  bool source_relative = false;  ///< source and angles are in the frame of `entity_id`
  bool response_relative = false;
  std::uint8_t alpha_threshold = 0;
  std::uint16_t entity_id = 0;
  float azimuth_deg = 0.0f;    ///< -180 to 180
  float elevation_deg = 0.0f;  ///< -90 to 90
  float min_range_m = 0.0f;    ///< not negative
  float max_range_m = 0.0f;    ///< not negative
  Place source{};
  std::uint32_t material_mask = 0;
  std::uint8_t update_period_frames = 0;  ///< 0: one answer
  bool operator==(const LosVectorRequest&) const = default;
};

enum class ObjectClass : std::uint8_t {
  entity = 0,
  articulated_part = 1,
  view = 2,
  view_group = 3,
  motion_tracker = 4,
};
enum class PositionFrame : std::uint8_t { geodetic = 0, parent = 1, submodel = 2 };

/// Question for the position of an object (id 27).
struct PositionRequest {
  static constexpr WireForms kWire{{27, 8}, {0x001A, 8}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t object_id = 0;
  std::uint8_t part_id = 0;
  bool continuous = false;  ///< an answer with every frame, otherwise one
  ObjectClass object_class = ObjectClass::entity;
  PositionFrame frame = PositionFrame::geodetic;
  bool operator==(const PositionRequest&) const = default;
};

/// Question for the environment at a point (id 28).
struct EnvironmentalConditionsRequest {
  static constexpr WireForms kWire{{28, 32}, {0x001B, 32}};
  static constexpr Sender kSender = Sender::host;
  bool maritime = false;
  bool terrestrial = false;
  bool weather = false;
  bool aerosol = false;
  std::uint8_t request_id = 0;
  double latitude_deg = 0.0;   ///< -90 to 90
  double longitude_deg = 0.0;  ///< -180 to 180
  double altitude_m = 0.0;
  bool operator==(const EnvironmentalConditionsRequest&) const = default;
};

}  // namespace emit::protocol::cigi
