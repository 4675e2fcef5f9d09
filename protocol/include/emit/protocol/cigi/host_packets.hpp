// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>

#include "emit/protocol/cigi/common.hpp"

/// Packets of the host that version 3.3 has; host_packets4.hpp holds those that 4.0 adds. `kWire`
/// says the ids and sizes of a packet in both versions, and the ids of the comments are those of
/// 3.3. A member that one version does not have is marked with the other one: it is at its default
/// when a message of that version is read, and a writer of that version refuses other values.
///
/// Every packet has the numbers of the interface control document, in its units. Angles of attitude
/// are degrees, applied in the order yaw, pitch, roll: yaw clockwise from true north, pitch nose
/// up, roll right wing down. They have the ranges yaw -180 to 360, pitch -90 to 90, roll -180 to
/// 180. The document allows yaw from 0 only; hosts send negative yaw too. Numbers that are not
/// finite or out of range are refused, whether a flag enables them or not.
namespace emit::protocol::cigi {

/// First packet of each message of a host (id 1).
struct IgControl {
  static constexpr WireForms kWire{{1, 24}, {0x0000, 24}};
  static constexpr Sender kSender = Sender::host;
  IgMode mode = IgMode::standby;   ///< demanded mode: standby, operate or debug
  bool timestamp_valid = false;    ///< must be set in asynchronous operation
  bool smoothing_enabled = false;  ///< extrapolation and interpolation are allowed
  /// 4.0: an entity type that is not known may be shown by one that resembles it.
  bool type_substitution_enabled = false;
  std::int8_t database = 0;           ///< database to load, 1 to 127; 0: none
  std::uint32_t host_frame = 0;       ///< counts up by one with each message of the host
  std::uint32_t timestamp_ticks = 0;  ///< ticks of 10 us since any epoch; it wraps
  std::uint32_t last_ig_frame = 0;    ///< StartOfFrame::ig_frame that the host received last
  bool operator==(const IgControl&) const = default;
};

enum class EntityState : std::uint8_t { standby = 0, active = 1, destroyed = 2 };
enum class Clamp : std::uint8_t { none = 0, non_conformal = 1, conformal = 2 };
enum class Animation : std::uint8_t { stop = 0, pause = 1, play = 2, proceed = 3 };

/// State and pose of an entity (id 2). Version 4.0 splits it into EntityPosition, EntityControl40
/// and AnimationControl.
struct EntityControl {
  static constexpr WireForms kWire{{2, 48}, {0, 0}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;  ///< 0: ownship
  EntityState state = EntityState::standby;
  bool attached = false;  ///< child of `parent_id`: place and angles are relative to the parent
  bool collision_detection = false;
  bool inherit_alpha = false;
  Clamp clamp = Clamp::none;
  bool animation_backward = false;
  bool animation_loop = false;
  Animation animation = Animation::stop;
  bool extrapolation_enabled = false;
  std::uint8_t alpha = 0;  ///< 0: transparent, 255: opaque
  std::uint16_t entity_type = 0;
  std::uint16_t parent_id = 0;
  float roll_deg = 0.0f;
  float pitch_deg = 0.0f;
  float yaw_deg = 0.0f;
  Place place{};  ///< offset from the parent's reference point if attached, else geodetic
  bool operator==(const EntityControl&) const = default;
};

/// Classes of components. A packet holds a number of 0 to 63, so that values beyond these pass.
enum class ComponentClass : std::uint8_t {
  entity = 0,
  view = 1,
  view_group = 2,
  sensor = 3,
  regional_sea_surface = 4,
  regional_terrain_surface = 5,
  regional_layered_weather = 6,
  global_sea_surface = 7,
  global_terrain_surface = 8,
  global_layered_weather = 9,
  atmosphere = 10,
  celestial_sphere = 11,
  event = 12,
  system = 13,
  symbol_surface = 14,
  symbol = 15,
};

/// State and data of a component of an entity, a view, a sensor and so on (id 4).
struct ComponentControl {
  static constexpr WireForms kWire{{4, 32}, {0x0003, 40}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t component_id = 0;
  std::uint16_t instance_id = 0;  ///< id of the entity, view and so on that the class names
  ComponentClass component_class = ComponentClass::entity;
  std::uint8_t component_state = 0;
  /// Words whose meaning the component defines. They are swapped as words of 32 bits, so that a
  /// double or a byte in them needs the sender's byte order.
  std::array<std::uint32_t, 6> data{};
  bool operator==(const ComponentControl&) const = default;
};

/// Component Control with two words (id 5).
struct ShortComponentControl {
  static constexpr WireForms kWire{{5, 16}, {0x0004, 24}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t component_id = 0;
  std::uint16_t instance_id = 0;
  ComponentClass component_class = ComponentClass::entity;
  std::uint8_t component_state = 0;
  std::array<std::uint32_t, 2> data{};
  bool operator==(const ShortComponentControl&) const = default;
};

/// Pose of an articulated part of an entity (id 6). Values whose flag is not set keep their last
/// value.
struct ArticulatedPartControl {
  static constexpr WireForms kWire{{6, 32}, {0x0005, 32}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;
  std::uint8_t part_id = 0;
  bool part_enabled = false;
  bool x_enabled = false;
  bool y_enabled = false;
  bool z_enabled = false;
  bool roll_enabled = false;
  bool pitch_enabled = false;
  bool yaw_enabled = false;
  float x_m = 0.0f;
  float y_m = 0.0f;
  float z_m = 0.0f;
  float roll_deg = 0.0f;
  float pitch_deg = 0.0f;
  float yaw_deg = 0.0f;
  bool operator==(const ArticulatedPartControl&) const = default;
};

enum class PartAxis : std::uint8_t { none = 0, x = 1, y = 2, z = 3, yaw = 4, pitch = 5, roll = 6 };

/// One degree of freedom of an articulated part.
struct PartMotion {
  std::uint8_t part_id = 0;
  PartAxis axis = PartAxis::none;
  bool part_enabled = false;
  float value_m_or_deg = 0.0f;  ///< metres for x, y and z, else degrees
  bool operator==(const PartMotion&) const = default;
};

/// Up to two degrees of freedom of articulated parts of one entity (id 7).
struct ShortArticulatedPartControl {
  static constexpr WireForms kWire{{7, 16}, {0x0006, 24}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;
  std::array<PartMotion, 2> motions{};
  bool operator==(const ShortArticulatedPartControl&) const = default;
};

/// Velocity of an entity or of an articulated part (id 8). Version 4.0 calls it Velocity Control.
struct RateControl {
  static constexpr WireForms kWire{{8, 32}, {0x0007, 32}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_id = 0;
  std::uint8_t part_id = 0;
  bool applies_to_part = false;
  bool local = false;  ///< rates along the body's own axes, else in the frame of world or parent
  float x_m_s = 0.0f;
  float y_m_s = 0.0f;
  float z_m_s = 0.0f;
  float roll_deg_s = 0.0f;
  float pitch_deg_s = 0.0f;
  float yaw_deg_s = 0.0f;
  bool operator==(const RateControl&) const = default;
};

/// Date, time of day and bodies of the sky (id 9).
struct CelestialSphereControl {
  static constexpr WireForms kWire{{9, 16}, {0x0008, 24}};
  static constexpr Sender kSender = Sender::host;
  std::uint8_t hour_utc = 0;       ///< 0 to 23; not checked without `date_valid`
  std::uint8_t minute_utc = 0;     ///< 0 to 59; not checked without `date_valid`
  float second_utc = 0.0f;         ///< 4.0: 0 to 60; must be finite without `date_valid`
  bool ephemeris_enabled = false;  ///< time of day goes on; otherwise it stands still
  bool sun_enabled = false;
  bool moon_enabled = false;
  bool stars_enabled = false;
  bool date_valid = false;  ///< hour, minute and date hold
  /// Decimal digits MMDDYYYY, for example 6152024 for 15 June 2024. It must be a day of the
  /// calendar; it is not checked without `date_valid`.
  std::uint32_t date_mmddyyyy = 0;
  float star_intensity_percent = 0.0f;  ///< 0 to 100
  bool operator==(const CelestialSphereControl&) const = default;
};

/// Atmosphere where no layer or region says otherwise (id 10).
struct AtmosphereControl {
  static constexpr WireForms kWire{{10, 32}, {0x0009, 32}};
  static constexpr Sender kSender = Sender::host;
  bool model_enabled = false;         ///< radiance and transmission come from an atmospheric model
  std::uint8_t humidity_percent = 0;  ///< 0 to 100
  float air_temperature_c = 0.0f;
  float visibility_m = 0.0f;         ///< not negative
  float horizontal_wind_m_s = 0.0f;  ///< not negative
  float vertical_wind_m_s = 0.0f;    ///< the sign of up is not in our sources
  /// Direction that the wind comes from, -180 to 360. Hosts count from -180 or from 0.
  float wind_from_deg = 0.0f;
  float pressure_hpa = 0.0f;  ///< not negative
  bool operator==(const AtmosphereControl&) const = default;
};

enum class RegionState : std::uint8_t { inactive = 0, active = 1, destroyed = 2 };

/// Rounded rectangle on the ground with an environment of its own (id 11).
struct EnvironmentalRegionControl {
  static constexpr WireForms kWire{{11, 48}, {0x000A, 48}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t region_id = 0;
  RegionState state = RegionState::inactive;
  bool merge_weather = false;  ///< where regions overlap; otherwise the last one wins
  bool merge_aerosol = false;
  bool merge_maritime = false;
  bool merge_terrestrial = false;
  double latitude_deg = 0.0;     ///< centre, -90 to 90
  double longitude_deg = 0.0;    ///< centre, -180 to 180
  float size_x_m = 0.0f;         ///< not negative
  float size_y_m = 0.0f;         ///< not negative
  float corner_radius_m = 0.0f;  ///< not negative
  float rotation_deg = 0.0f;     ///< yaw of the rectangle, -180 to 180
  float transition_m = 0.0f;     ///< width of the transition around it, not negative
  bool operator==(const EnvironmentalRegionControl&) const = default;
};

enum class WeatherScope : std::uint8_t { global = 0, regional = 1, entity = 2 };

/// One weather layer, or the weather of an entity (id 12).
struct WeatherControl {
  static constexpr WireForms kWire{{12, 56}, {0x000B, 72}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t entity_or_region_id = 0;  ///< after `scope`
  /// 0 ground fog, 1 to 3 cloud layers, 4 rain, 5 snow, 6 sleet, 7 hail, 8 sand, 9 dust; the image
  /// generator defines larger ones.
  std::uint8_t layer_id = 0;
  std::uint8_t humidity_percent = 0;  ///< 0 to 100
  bool enabled = false;
  bool scud_enabled = false;
  bool random_winds = false;
  bool random_lightning = false;
  bool top_scud_enabled = false;  ///< 4.0: scud at the top of the layer
  std::uint8_t cloud_type = 0;    ///< 0 none to 10 stratus; 11 to 15 are free. At most 15.
  WeatherScope scope = WeatherScope::global;
  /// The field holds 0 to 7. A narrower range of the document is not in our sources.
  std::uint8_t severity = 0;
  float air_temperature_c = 0.0f;
  float visibility_m = 0.0f;         ///< not negative
  float scud_percent = 0.0f;         ///< 0 to 100
  float coverage_percent = 0.0f;     ///< 0 to 100
  float base_m = 0.0f;               ///< altitude of the layer's base
  float thickness_m = 0.0f;          ///< not negative
  float transition_m = 0.0f;         ///< bands above and below the layer, not negative
  float horizontal_wind_m_s = 0.0f;  ///< not negative
  float vertical_wind_m_s = 0.0f;
  float wind_from_deg = 0.0f;     ///< -180 to 360
  float pressure_hpa = 0.0f;      ///< not negative
  float aerosol_g_m3 = 0.0f;      ///< not negative
  float top_scud_percent = 0.0f;  ///< 4.0: 0 to 100
  float top_transition_m = 0.0f;  ///< 4.0: band above the layer alone, not negative
  bool operator==(const WeatherControl&) const = default;
};

/// Place of a view, or of all views of a group, on its entity (id 16). Values whose flag is not set
/// keep their last value.
struct ViewControl {
  static constexpr WireForms kWire{{16, 32}, {0x000F, 40}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t view_id = 0;  ///< counts if `group_id` is 0
  std::uint8_t group_id = 0;  ///< 0: the packet is for one view
  bool x_enabled = false;
  bool y_enabled = false;
  bool z_enabled = false;
  bool roll_enabled = false;
  bool pitch_enabled = false;
  bool yaw_enabled = false;
  std::uint16_t entity_id = 0;
  float x_m = 0.0f;
  float y_m = 0.0f;
  float z_m = 0.0f;
  float roll_deg = 0.0f;
  float pitch_deg = 0.0f;
  float yaw_deg = 0.0f;
  bool operator==(const ViewControl&) const = default;
};

/// Modes of a tracker. A packet holds a number of 0 to 7; the image generator defines 5 to 7.
enum class TrackMode : std::uint8_t {
  off = 0,
  force_correlate = 1,
  scene = 2,
  target = 3,
  ship = 4,
};

/// Settings of a sensor (id 17).
struct SensorControl {
  static constexpr WireForms kWire{{17, 24}, {0x0010, 32}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t view_id = 0;
  std::uint8_t sensor_id = 0;
  bool on = false;
  bool black_hot = false;  ///< otherwise white hot
  bool line_dropout = false;
  bool automatic_gain = false;
  bool track_black = false;  ///< otherwise the tracker follows white
  TrackMode track_mode = TrackMode::off;
  bool extended_response = false;
  float gain = 0.0f;            ///< 0 to 1
  float level = 0.0f;           ///< 0 to 1
  float ac_coupling_us = 0.0f;  ///< decay constant, not negative
  float noise = 0.0f;           ///< 0 to 1
  bool operator==(const SensorControl&) const = default;
};

/// Ellipsoid to which geodetic positions refer (id 19).
struct EarthReferenceModel {
  static constexpr WireForms kWire{{19, 24}, {0x0012, 24}};
  static constexpr Sender kSender = Sender::host;
  bool custom_enabled = false;       ///< otherwise WGS 84
  double equatorial_radius_m = 0.0;  ///< not negative
  double flattening = 0.0;           ///< 0 to 1; other limits are not in our sources
  bool operator==(const EarthReferenceModel&) const = default;
};

enum class Mirror : std::uint8_t { none = 0, horizontal = 1, vertical = 2, both = 3 };

/// Projection of a view (id 21). Values whose flag is not set keep their last value.
struct ViewDefinition {
  static constexpr WireForms kWire{{21, 32}, {0x0014, 40}};
  static constexpr Sender kSender = Sender::host;
  std::uint16_t view_id = 0;
  std::uint8_t group_id = 0;
  bool near_enabled = false;
  bool far_enabled = false;
  bool left_enabled = false;
  bool right_enabled = false;
  bool top_enabled = false;
  bool bottom_enabled = false;
  Mirror mirror = Mirror::none;
  /// 0 none, 1 1x2, 2 2x1, 3 2x2; the image generator defines 4 to 7. At most 7.
  std::uint8_t pixel_replication = 0;
  bool orthographic = false;
  bool bring_to_top = false;
  std::uint8_t view_type = 0;  ///< at most 7; the image generator defines it
  float near_m = 0.0f;         ///< not negative
  float far_m = 0.0f;          ///< not negative
  /// Half-angles of a perspective view, -90 to 90: left and bottom are negative as a rule. Their
  /// unit in an orthographic view is not in our sources, so that they need only be finite there.
  float left_deg = 0.0f;
  float right_deg = 0.0f;
  float top_deg = 0.0f;
  float bottom_deg = 0.0f;
  bool operator==(const ViewDefinition&) const = default;
};

}  // namespace emit::protocol::cigi
