// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>

#include "cigi/host_layouts.hpp"
#include "emit/protocol/cigi/host_packets4.hpp"

/// Layouts of the host's packets in version 4.0, in the form of host_layouts.hpp. A packet begins
/// with its size and its id as words of 16 bits, and the first word of each layout is at byte 4.
namespace emit::protocol::cigi {

template <class Io>
void layout_v4(Io& io, IgControl& p) {
  // Major version (4) and minor version (7, bits 4 to 7) belong to the message. Start Of Frame has
  // the time stamp and the repeated frame number the other way round.
  io.number(5, p.database);
  io.bits(6, 0, 1, p.type_substitution_enabled);
  io.bits(7, 0, 2, p.mode);
  io.bits(7, 2, 1, p.timestamp_valid);
  io.bits(7, 3, 1, p.smoothing_enabled);
  io.number(8, p.host_frame);
  io.number(12, p.last_ig_frame);
  io.number(16, p.timestamp_ticks);
}

template <class Io>
void layout_v4(Io& io, EntityPosition& p) {
  io.bits(4, 0, 1, p.attached);
  io.bits(4, 1, 2, p.clamp);
  io.number(6, p.entity_id);
  io.number(8, p.parent_id);
  io.number(12, p.roll_deg);
  io.number(16, p.pitch_deg);
  io.number(20, p.yaw_deg);
  layout_place(io, 24, p.place);
}

template <class Io>
void layout_v4(Io& io, EntityControl40& p) {
  io.bits(4, 0, 2, p.state);
  io.bits(4, 2, 1, p.collision_detection);
  io.bits(4, 3, 1, p.inherit_alpha);
  io.bits(4, 4, 1, p.smoothing_enabled);
  io.bits(4, 5, 1, p.type.extended);
  io.number(5, p.alpha);
  io.number(6, p.entity_id);
  io.number(8, p.type.kind);
  io.number(9, p.type.domain);
  io.number(10, p.type.country_or_type);
  io.number(12, p.type.category);
  io.number(13, p.type.subcategory);
  io.number(14, p.type.specific);
  io.number(15, p.type.extra);
}

template <class Io>
void layout_v4(Io& io, AnimationControl& p) {
  io.bits(4, 0, 1, p.playing);
  io.bits(4, 1, 1, p.reset);
  io.bits(4, 2, 1, p.loop);
  io.bits(4, 3, 1, p.inherit_alpha);
  io.number(5, p.alpha);
  io.number(6, p.entity_id);
  io.number(8, p.animation_id);
  io.number(12, p.speed);
}

/// Layout of both component packets, which differ in the number of words.
template <class Io, class P>
void layout_component_v4(Io& io, P& p) {
  io.number(4, p.component_id);
  io.bits(6, 0, 6, p.component_class);
  io.number(7, p.component_state);
  io.number(8, p.instance_id);
  for (std::size_t i = 0; i < p.data.size(); ++i) io.number(16 + 4 * i, p.data[i]);
}
template <class Io>
void layout_v4(Io& io, ComponentControl& p) {
  layout_component_v4(io, p);
}
template <class Io>
void layout_v4(Io& io, ShortComponentControl& p) {
  layout_component_v4(io, p);
}

template <class Io>
void layout_v4(Io& io, ArticulatedPartControl& p) {
  io.number(4, p.entity_id);
  io.number(6, p.part_id);
  io.bits(7, 0, 1, p.part_enabled);
  io.bits(7, 1, 1, p.x_enabled);
  io.bits(7, 2, 1, p.y_enabled);
  io.bits(7, 3, 1, p.z_enabled);
  io.bits(7, 4, 1, p.roll_enabled);
  io.bits(7, 5, 1, p.pitch_enabled);
  io.bits(7, 6, 1, p.yaw_enabled);
  layout_pose(io, 8, p);
}

template <class Io>
void layout_v4(Io& io, ShortArticulatedPartControl& p) {
  io.number(4, p.entity_id);
  io.number(6, p.motions[0].part_id);
  io.number(7, p.motions[1].part_id);
  io.bits(8, 0, 3, p.motions[0].axis);
  io.bits(8, 3, 3, p.motions[1].axis);
  io.bits(8, 6, 1, p.motions[0].part_enabled);
  io.bits(8, 7, 1, p.motions[1].part_enabled);
  io.number(12, p.motions[0].value_m_or_deg);
  io.number(16, p.motions[1].value_m_or_deg);
}

template <class Io>
void layout_v4(Io& io, RateControl& p) {
  io.number(4, p.entity_id);
  io.number(6, p.part_id);
  io.bits(7, 0, 1, p.applies_to_part);
  io.bits(7, 1, 1, p.local);
  io.number(8, p.x_m_s);
  io.number(12, p.y_m_s);
  io.number(16, p.z_m_s);
  io.number(20, p.roll_deg_s);
  io.number(24, p.pitch_deg_s);
  io.number(28, p.yaw_deg_s);
}

template <class Io>
void layout_v4(Io& io, AccelerationControl& p) {
  io.number(4, p.entity_id);
  io.number(6, p.part_id);
  io.bits(7, 0, 1, p.applies_to_part);
  io.bits(7, 1, 1, p.local);
  io.number(8, p.x_m_s2);
  io.number(12, p.y_m_s2);
  io.number(16, p.z_m_s2);
  io.number(20, p.roll_deg_s2);
  io.number(24, p.pitch_deg_s2);
  io.number(28, p.yaw_deg_s2);
}

template <class Io>
void layout_v4(Io& io, CelestialSphereControl& p) {
  io.bits(4, 0, 1, p.ephemeris_enabled);
  io.bits(4, 1, 1, p.sun_enabled);
  io.bits(4, 2, 1, p.moon_enabled);
  io.bits(4, 3, 1, p.stars_enabled);
  io.bits(4, 4, 1, p.date_valid);
  io.number(6, p.hour_utc);
  io.number(7, p.minute_utc);
  io.number(8, p.second_utc);
  io.number(12, p.date_mmddyyyy);
  io.number(16, p.star_intensity_percent);
}

template <class Io>
void layout_v4(Io& io, AtmosphereControl& p) {
  io.bits(4, 0, 7, p.humidity_percent);
  io.bits(4, 7, 1, p.model_enabled);
  io.number(8, p.air_temperature_c);
  io.number(12, p.visibility_m);
  io.number(16, p.horizontal_wind_m_s);
  io.number(20, p.vertical_wind_m_s);
  io.number(24, p.wind_from_deg);
  io.number(28, p.pressure_hpa);
}

template <class Io>
void layout_v4(Io& io, EnvironmentalRegionControl& p) {
  io.bits(4, 0, 2, p.state);
  io.bits(4, 2, 1, p.merge_weather);
  io.bits(4, 3, 1, p.merge_aerosol);
  io.bits(4, 4, 1, p.merge_maritime);
  io.bits(4, 5, 1, p.merge_terrestrial);
  io.number(6, p.region_id);
  io.number(8, p.latitude_deg);
  io.number(16, p.longitude_deg);
  io.number(24, p.size_x_m);
  io.number(28, p.size_y_m);
  io.number(32, p.corner_radius_m);
  io.number(36, p.rotation_deg);
  io.number(40, p.transition_m);
}

template <class Io>
void layout_v4(Io& io, WeatherControl& p) {
  io.number(4, p.layer_id);
  io.number(5, p.humidity_percent);
  io.bits(6, 0, 1, p.enabled);
  io.bits(6, 1, 1, p.scud_enabled);
  io.bits(6, 2, 1, p.random_winds);
  io.bits(6, 3, 1, p.random_lightning);
  io.bits(6, 4, 4, p.cloud_type);
  io.bits(7, 0, 2, p.scope);
  io.bits(7, 2, 3, p.severity);
  io.bits(7, 5, 1, p.top_scud_enabled);
  io.number(8, p.entity_or_region_id);
  io.number(12, p.air_temperature_c);
  io.number(16, p.visibility_m);
  io.number(20, p.scud_percent);
  io.number(24, p.coverage_percent);
  io.number(28, p.base_m);
  io.number(32, p.thickness_m);
  io.number(36, p.transition_m);
  io.number(40, p.horizontal_wind_m_s);
  io.number(44, p.vertical_wind_m_s);
  io.number(48, p.wind_from_deg);
  io.number(52, p.pressure_hpa);
  io.number(56, p.aerosol_g_m3);
  io.number(60, p.top_scud_percent);
  io.number(64, p.top_transition_m);
}

template <class Io>
void layout_v4(Io& io, ViewControl& p) {
  io.number(4, p.group_id);
  io.bits(5, 0, 1, p.x_enabled);
  io.bits(5, 1, 1, p.y_enabled);
  io.bits(5, 2, 1, p.z_enabled);
  io.bits(5, 3, 1, p.roll_enabled);
  io.bits(5, 4, 1, p.pitch_enabled);
  io.bits(5, 5, 1, p.yaw_enabled);
  io.number(6, p.view_id);
  io.number(8, p.entity_id);
  layout_pose(io, 12, p);
}

template <class Io>
void layout_v4(Io& io, SensorControl& p) {
  io.number(4, p.sensor_id);
  io.bits(5, 0, 1, p.on);
  io.bits(5, 1, 1, p.black_hot);
  io.bits(5, 2, 1, p.line_dropout);
  io.bits(5, 3, 1, p.automatic_gain);
  io.bits(5, 4, 1, p.track_black);
  io.bits(5, 5, 3, p.track_mode);
  io.bits(6, 0, 1, p.extended_response);
  io.number(8, p.view_id);
  io.number(12, p.gain);
  io.number(16, p.level);
  io.number(20, p.ac_coupling_us);
  io.number(24, p.noise);
}

template <class Io>
void layout_v4(Io& io, EarthReferenceModel& p) {
  io.bits(4, 0, 1, p.custom_enabled);
  io.number(8, p.equatorial_radius_m);
  io.number(16, p.flattening);
}

template <class Io>
void layout_v4(Io& io, ViewDefinition& p) {
  io.number(4, p.view_id);
  io.number(6, p.group_id);
  io.bits(7, 0, 1, p.near_enabled);
  io.bits(7, 1, 1, p.far_enabled);
  io.bits(7, 2, 1, p.left_enabled);
  io.bits(7, 3, 1, p.right_enabled);
  io.bits(7, 4, 1, p.top_enabled);
  io.bits(7, 5, 1, p.bottom_enabled);
  io.bits(7, 6, 2, p.mirror);
  io.bits(8, 0, 3, p.pixel_replication);
  io.bits(8, 3, 1, p.orthographic);
  io.bits(8, 4, 1, p.bring_to_top);
  io.bits(8, 5, 3, p.view_type);
  io.number(12, p.near_m);
  io.number(16, p.far_m);
  io.number(20, p.left_deg);
  io.number(24, p.right_deg);
  io.number(28, p.top_deg);
  io.number(32, p.bottom_deg);
}

template <class Io>
void layout_v4(Io& io, HatHotRequest& p) {
  io.number(4, p.request_id);
  io.number(6, p.entity_id);
  io.bits(8, 0, 2, p.type);
  io.bits(8, 2, 1, p.relative_to_entity);
  io.number(9, p.update_period_frames);
  layout_place(io, 16, p.place);
}

template <class Io>
void layout_v4(Io& io, LosSegmentRequest& p) {
  io.number(4, p.request_id);
  io.number(6, p.entity_id);
  io.bits(8, 0, 1, p.extended);
  io.bits(8, 1, 1, p.source_relative);
  io.bits(8, 2, 1, p.destination_relative);
  io.bits(8, 3, 1, p.response_relative);
  io.bits(8, 4, 1, p.destination_entity_valid);
  io.number(9, p.alpha_threshold);
  io.number(10, p.destination_entity_id);
  io.number(12, p.update_period_frames);
  layout_place(io, 16, p.source);
  layout_place(io, 40, p.destination);
  io.number(64, p.material_mask);
}

template <class Io>
void layout_v4(Io& io, LosVectorRequest& p) {
  io.number(4, p.request_id);
  io.number(6, p.entity_id);
  io.bits(8, 0, 1, p.extended);
  io.bits(8, 1, 1, p.source_relative);
  io.bits(8, 2, 1, p.response_relative);
  io.number(9, p.alpha_threshold);
  io.number(10, p.update_period_frames);
  io.number(16, p.azimuth_deg);
  io.number(20, p.elevation_deg);
  io.number(24, p.min_range_m);
  io.number(28, p.max_range_m);
  layout_place(io, 32, p.source);
  io.number(56, p.material_mask);
}

template <class Io>
void layout_v4(Io& io, PositionRequest& p) {
  io.number(4, p.part_id);
  io.bits(5, 0, 1, p.continuous);
  io.bits(5, 1, 3, p.object_class);
  io.bits(5, 4, 2, p.frame);
  io.number(6, p.object_id);
}

template <class Io>
void layout_v4(Io& io, EnvironmentalConditionsRequest& p) {
  io.bits(4, 0, 1, p.maritime);
  io.bits(4, 1, 1, p.terrestrial);
  io.bits(4, 2, 1, p.weather);
  io.bits(4, 3, 1, p.aerosol);
  io.number(5, p.request_id);
  io.number(8, p.latitude_deg);
  io.number(16, p.longitude_deg);
  io.number(24, p.altitude_m);
}

}  // namespace emit::protocol::cigi
