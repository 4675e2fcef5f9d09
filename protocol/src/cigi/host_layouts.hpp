// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>

#include "emit/protocol/cigi/host_packets.hpp"
#include "emit/protocol/cigi/host_requests.hpp"

/// Layouts of the host's packets: offset, and for parts of a byte the first bit and the number of
/// bits. Bits are counted from the least significant one. Fields that are not named are reserved.
/// `Io` is FieldReader or FieldWriter.
namespace emit::protocol::cigi {

/// Offset of the version's minor part: the upper half of this byte.
inline constexpr std::size_t kHostMinorAt = 4;

template <class Io>
void layout_place(Io& io, std::size_t offset, Place& p) {
  io.number(offset, p.latitude_deg_or_x_m);
  io.number(offset + 8, p.longitude_deg_or_y_m);
  io.number(offset + 16, p.altitude_m_or_z_m);
}

/// Layout of three lengths and three angles as float32.
template <class Io, class P>
void layout_pose(Io& io, std::size_t offset, P& p) {
  io.number(offset, p.x_m);
  io.number(offset + 4, p.y_m);
  io.number(offset + 8, p.z_m);
  io.number(offset + 12, p.roll_deg);
  io.number(offset + 16, p.pitch_deg);
  io.number(offset + 20, p.yaw_deg);
}

template <class Io>
void layout(Io& io, IgControl& p) {
  // Major version (2), minor version (4, bits 4 to 7) and magic number (6) belong to the message.
  io.number(3, p.database);
  io.bits(4, 0, 2, p.mode);
  io.bits(4, 2, 1, p.timestamp_valid);
  io.bits(4, 3, 1, p.smoothing_enabled);
  io.number(8, p.host_frame);
  io.number(12, p.timestamp_ticks);
  io.number(16, p.last_ig_frame);
}

template <class Io>
void layout(Io& io, EntityControl& p) {
  io.number(2, p.entity_id);
  io.bits(4, 0, 2, p.state);
  io.bits(4, 2, 1, p.attached);
  io.bits(4, 3, 1, p.collision_detection);
  io.bits(4, 4, 1, p.inherit_alpha);
  io.bits(4, 5, 2, p.clamp);
  io.bits(5, 0, 1, p.animation_backward);
  io.bits(5, 1, 1, p.animation_loop);
  io.bits(5, 2, 2, p.animation);
  io.bits(5, 4, 1, p.extrapolation_enabled);
  io.number(6, p.alpha);
  io.number(8, p.entity_type);
  io.number(10, p.parent_id);
  io.number(12, p.roll_deg);
  io.number(16, p.pitch_deg);
  io.number(20, p.yaw_deg);
  layout_place(io, 24, p.place);
}

/// Layout of both component packets, which differ in the number of words.
template <class Io, class P>
void layout_component(Io& io, P& p) {
  io.number(2, p.component_id);
  io.number(4, p.instance_id);
  io.bits(6, 0, 6, p.component_class);
  io.number(7, p.component_state);
  for (std::size_t i = 0; i < p.data.size(); ++i) io.number(8 + 4 * i, p.data[i]);
}
template <class Io>
void layout(Io& io, ComponentControl& p) {
  layout_component(io, p);
}
template <class Io>
void layout(Io& io, ShortComponentControl& p) {
  layout_component(io, p);
}

template <class Io>
void layout(Io& io, ArticulatedPartControl& p) {
  io.number(2, p.entity_id);
  io.number(4, p.part_id);
  io.bits(5, 0, 1, p.part_enabled);
  io.bits(5, 1, 1, p.x_enabled);
  io.bits(5, 2, 1, p.y_enabled);
  io.bits(5, 3, 1, p.z_enabled);
  io.bits(5, 4, 1, p.roll_enabled);
  io.bits(5, 5, 1, p.pitch_enabled);
  io.bits(5, 6, 1, p.yaw_enabled);
  layout_pose(io, 8, p);
}

template <class Io>
void layout(Io& io, ShortArticulatedPartControl& p) {
  io.number(2, p.entity_id);
  io.number(4, p.motions[0].part_id);
  io.number(5, p.motions[1].part_id);
  io.bits(6, 0, 3, p.motions[0].axis);
  io.bits(6, 3, 3, p.motions[1].axis);
  io.bits(6, 6, 1, p.motions[0].part_enabled);
  io.bits(6, 7, 1, p.motions[1].part_enabled);
  io.number(8, p.motions[0].value_m_or_deg);
  io.number(12, p.motions[1].value_m_or_deg);
}

template <class Io>
void layout(Io& io, RateControl& p) {
  io.number(2, p.entity_id);
  io.number(4, p.part_id);
  io.bits(5, 0, 1, p.applies_to_part);
  io.bits(5, 1, 1, p.local);
  io.number(8, p.x_m_s);
  io.number(12, p.y_m_s);
  io.number(16, p.z_m_s);
  io.number(20, p.roll_deg_s);
  io.number(24, p.pitch_deg_s);
  io.number(28, p.yaw_deg_s);
}

template <class Io>
void layout(Io& io, CelestialSphereControl& p) {
  io.number(2, p.hour_utc);
  io.number(3, p.minute_utc);
  io.bits(4, 0, 1, p.ephemeris_enabled);
  io.bits(4, 1, 1, p.sun_enabled);
  io.bits(4, 2, 1, p.moon_enabled);
  io.bits(4, 3, 1, p.stars_enabled);
  io.bits(4, 4, 1, p.date_valid);
  io.number(8, p.date_mmddyyyy);
  io.number(12, p.star_intensity_percent);
}

template <class Io>
void layout(Io& io, AtmosphereControl& p) {
  io.bits(2, 0, 1, p.model_enabled);
  io.number(3, p.humidity_percent);
  io.number(4, p.air_temperature_c);
  io.number(8, p.visibility_m);
  io.number(12, p.horizontal_wind_m_s);
  io.number(16, p.vertical_wind_m_s);
  io.number(20, p.wind_from_deg);
  io.number(24, p.pressure_hpa);
}

template <class Io>
void layout(Io& io, EnvironmentalRegionControl& p) {
  io.number(2, p.region_id);
  io.bits(4, 0, 2, p.state);
  io.bits(4, 2, 1, p.merge_weather);
  io.bits(4, 3, 1, p.merge_aerosol);
  io.bits(4, 4, 1, p.merge_maritime);
  io.bits(4, 5, 1, p.merge_terrestrial);
  io.number(8, p.latitude_deg);
  io.number(16, p.longitude_deg);
  io.number(24, p.size_x_m);
  io.number(28, p.size_y_m);
  io.number(32, p.corner_radius_m);
  io.number(36, p.rotation_deg);
  io.number(40, p.transition_m);
}

template <class Io>
void layout(Io& io, WeatherControl& p) {
  io.number(2, p.entity_or_region_id);
  io.number(4, p.layer_id);
  io.number(5, p.humidity_percent);
  io.bits(6, 0, 1, p.enabled);
  io.bits(6, 1, 1, p.scud_enabled);
  io.bits(6, 2, 1, p.random_winds);
  io.bits(6, 3, 1, p.random_lightning);
  io.bits(6, 4, 4, p.cloud_type);
  io.bits(7, 0, 2, p.scope);
  io.bits(7, 2, 3, p.severity);
  io.number(8, p.air_temperature_c);
  io.number(12, p.visibility_m);
  io.number(16, p.scud_percent);
  io.number(20, p.coverage_percent);
  io.number(24, p.base_m);
  io.number(28, p.thickness_m);
  io.number(32, p.transition_m);
  io.number(36, p.horizontal_wind_m_s);
  io.number(40, p.vertical_wind_m_s);
  io.number(44, p.wind_from_deg);
  io.number(48, p.pressure_hpa);
  io.number(52, p.aerosol_g_m3);
}

template <class Io>
void layout(Io& io, ViewControl& p) {
  io.number(2, p.view_id);
  io.number(4, p.group_id);
  io.bits(5, 0, 1, p.x_enabled);
  io.bits(5, 1, 1, p.y_enabled);
  io.bits(5, 2, 1, p.z_enabled);
  io.bits(5, 3, 1, p.roll_enabled);
  io.bits(5, 4, 1, p.pitch_enabled);
  io.bits(5, 5, 1, p.yaw_enabled);
  io.number(6, p.entity_id);
  layout_pose(io, 8, p);
}

template <class Io>
void layout(Io& io, SensorControl& p) {
  io.number(2, p.view_id);
  io.number(4, p.sensor_id);
  io.bits(5, 0, 1, p.on);
  io.bits(5, 1, 1, p.black_hot);
  io.bits(5, 2, 1, p.line_dropout);
  io.bits(5, 3, 1, p.automatic_gain);
  io.bits(5, 4, 1, p.track_black);
  io.bits(5, 5, 3, p.track_mode);
  io.bits(6, 0, 1, p.extended_response);
  io.number(8, p.gain);
  io.number(12, p.level);
  io.number(16, p.ac_coupling_us);
  io.number(20, p.noise);
}

template <class Io>
void layout(Io& io, EarthReferenceModel& p) {
  io.bits(2, 0, 1, p.custom_enabled);
  io.number(8, p.equatorial_radius_m);
  io.number(16, p.flattening);
}

template <class Io>
void layout(Io& io, ViewDefinition& p) {
  io.number(2, p.view_id);
  io.number(4, p.group_id);
  io.bits(5, 0, 1, p.near_enabled);
  io.bits(5, 1, 1, p.far_enabled);
  io.bits(5, 2, 1, p.left_enabled);
  io.bits(5, 3, 1, p.right_enabled);
  io.bits(5, 4, 1, p.top_enabled);
  io.bits(5, 5, 1, p.bottom_enabled);
  io.bits(5, 6, 2, p.mirror);
  io.bits(6, 0, 3, p.pixel_replication);
  io.bits(6, 3, 1, p.orthographic);
  io.bits(6, 4, 1, p.bring_to_top);
  io.bits(6, 5, 3, p.view_type);
  io.number(8, p.near_m);
  io.number(12, p.far_m);
  io.number(16, p.left_deg);
  io.number(20, p.right_deg);
  io.number(24, p.top_deg);
  io.number(28, p.bottom_deg);
}

template <class Io>
void layout(Io& io, HatHotRequest& p) {
  io.number(2, p.request_id);
  io.bits(4, 0, 2, p.type);
  io.bits(4, 2, 1, p.relative_to_entity);
  io.number(5, p.update_period_frames);
  io.number(6, p.entity_id);
  layout_place(io, 8, p.place);
}

template <class Io>
void layout(Io& io, LosSegmentRequest& p) {
  io.number(2, p.request_id);
  io.bits(4, 0, 1, p.extended);
  io.bits(4, 1, 1, p.source_relative);
  io.bits(4, 2, 1, p.destination_relative);
  io.bits(4, 3, 1, p.response_relative);
  io.bits(4, 4, 1, p.destination_entity_valid);
  io.number(5, p.alpha_threshold);
  io.number(6, p.entity_id);
  layout_place(io, 8, p.source);
  layout_place(io, 32, p.destination);
  io.number(56, p.material_mask);
  io.number(60, p.update_period_frames);
  io.number(62, p.destination_entity_id);
}

template <class Io>
void layout(Io& io, LosVectorRequest& p) {
  io.number(2, p.request_id);
  io.bits(4, 0, 1, p.extended);
  io.bits(4, 1, 1, p.source_relative);
  io.bits(4, 2, 1, p.response_relative);
  io.number(5, p.alpha_threshold);
  io.number(6, p.entity_id);
  io.number(8, p.azimuth_deg);
  io.number(12, p.elevation_deg);
  io.number(16, p.min_range_m);
  io.number(20, p.max_range_m);
  layout_place(io, 24, p.source);
  io.number(48, p.material_mask);
  io.number(52, p.update_period_frames);
}

template <class Io>
void layout(Io& io, PositionRequest& p) {
  io.number(2, p.object_id);
  io.number(4, p.part_id);
  io.bits(5, 0, 1, p.continuous);
  io.bits(5, 1, 3, p.object_class);
  io.bits(5, 4, 2, p.frame);
}

template <class Io>
void layout(Io& io, EnvironmentalConditionsRequest& p) {
  io.bits(2, 0, 1, p.maritime);
  io.bits(2, 1, 1, p.terrestrial);
  io.bits(2, 2, 1, p.weather);
  io.bits(2, 3, 1, p.aerosol);
  io.number(3, p.request_id);
  io.number(8, p.latitude_deg);
  io.number(16, p.longitude_deg);
  io.number(24, p.altitude_m);
}

}  // namespace emit::protocol::cigi
