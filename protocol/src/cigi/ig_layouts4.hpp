// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>

#include "cigi/host_layouts4.hpp"
#include "cigi/ig_layouts.hpp"

/// Layouts of the image generator's packets in version 4.0, in the form of host_layouts4.hpp.
namespace emit::protocol::cigi {

template <class Io>
void layout_v4(Io& io, StartOfFrame& p) {
  // Major version (4) and minor version (7, bits 4 to 7) belong to the message. IG Control has the
  // time stamp and the repeated frame number the other way round.
  io.number(5, p.database);
  io.bits(7, 0, 2, p.mode);
  io.bits(7, 2, 1, p.timestamp_valid);
  io.bits(7, 3, 1, p.custom_earth);
  io.number(8, p.ig_frame);
  io.number(12, p.timestamp_ticks);
  io.number(16, p.last_host_frame);
  // The three conditions are bits 8 to 10 of a word of 16 bits in the sender's order.
  io.bits(io.high_byte(20), 0, 1, p.overframing);
  io.bits(io.high_byte(20), 1, 1, p.paging);
  io.bits(io.high_byte(20), 2, 1, p.excessive_variable_data);
}

template <class Io>
void layout_v4(Io& io, HatHotResponse& p) {
  io.bits(4, 0, 1, p.valid);
  io.bits(4, 1, 1, p.height_of_terrain);
  io.bits(4, 4, 4, p.host_frame_lsn);
  io.number(6, p.request_id);
  io.number(8, p.height_m);
}

template <class Io>
void layout_v4(Io& io, HatHotExtendedResponse& p) {
  io.bits(4, 0, 1, p.valid);
  io.bits(4, 4, 4, p.host_frame_lsn);
  io.number(6, p.request_id);
  io.number(8, p.height_above_terrain_m);
  io.number(16, p.height_of_terrain_m);
  io.number(24, p.material_code);
  io.number(28, p.normal_azimuth_deg);
  io.number(32, p.normal_elevation_deg);
}

template <class Io>
void layout_v4(Io& io, LosResponse& p) {
  io.number(4, p.request_id);
  io.number(6, p.entity_id);
  io.bits(8, 0, 1, p.valid);
  io.bits(8, 1, 1, p.entity_valid);
  io.bits(8, 2, 1, p.visible);
  io.bits(8, 4, 4, p.host_frame_lsn);
  io.number(9, p.response_count);
  io.number(16, p.range_m);
}

template <class Io>
void layout_v4(Io& io, LosExtendedResponse& p) {
  io.number(4, p.request_id);
  io.number(6, p.entity_id);
  io.bits(8, 0, 1, p.valid);
  io.bits(8, 1, 1, p.entity_valid);
  io.bits(8, 2, 1, p.range_valid);
  io.bits(8, 3, 1, p.visible);
  io.bits(8, 4, 4, p.host_frame_lsn);
  io.number(9, p.response_count);
  io.number(16, p.range_m);
  layout_place(io, 24, p.place);
  io.number(48, p.red);
  io.number(49, p.green);
  io.number(50, p.blue);
  io.number(51, p.alpha);
  io.number(52, p.material_code);
  io.number(56, p.normal_azimuth_deg);
  io.number(60, p.normal_elevation_deg);
}

template <class Io>
void layout_v4(Io& io, SensorResponse& p) {
  io.number(4, p.sensor_id);
  io.bits(5, 0, 2, p.state);
  io.number(6, p.view_id);
  io.number(8, p.gate_x_px);
  io.number(10, p.gate_y_px);
  io.number(12, p.gate_azimuth_deg);
  io.number(16, p.gate_elevation_deg);
  io.number(20, p.ig_frame);
}

template <class Io>
void layout_v4(Io& io, SensorExtendedResponse& p) {
  io.number(4, p.view_id);
  io.number(6, p.entity_id);
  io.number(8, p.sensor_id);
  io.bits(9, 0, 2, p.state);
  io.bits(9, 2, 1, p.entity_valid);
  io.number(12, p.gate_x_px);
  io.number(14, p.gate_y_px);
  io.number(16, p.gate_azimuth_deg);
  io.number(20, p.gate_elevation_deg);
  io.number(24, p.ig_frame);
  io.number(32, p.latitude_deg);
  io.number(40, p.longitude_deg);
  io.number(48, p.altitude_m);
}

template <class Io>
void layout_v4(Io& io, PositionResponse& p) {
  io.number(4, p.part_id);
  io.bits(5, 0, 3, p.object_class);
  io.bits(5, 3, 2, p.frame);
  io.number(6, p.object_id);
  layout_place(io, 8, p.place);
  io.number(32, p.roll_deg);
  io.number(36, p.pitch_deg);
  io.number(40, p.yaw_deg);
}

template <class Io>
void layout_v4(Io& io, WeatherConditionsResponse& p) {
  io.number(4, p.request_id);
  io.number(5, p.humidity_percent);
  io.number(8, p.air_temperature_c);
  io.number(12, p.visibility_m);
  io.number(16, p.horizontal_wind_m_s);
  io.number(20, p.vertical_wind_m_s);
  io.number(24, p.wind_from_deg);
  io.number(28, p.pressure_hpa);
}

template <class Io>
void layout_v4(Io& io, EventNotification& p) {
  io.number(4, p.event_id);
  for (std::size_t i = 0; i < p.data.size(); ++i) io.number(8 + 4 * i, p.data[i]);
}

template <class Io>
void layout_v4(Io& io, ImageGeneratorMessage& p) {
  io.number(4, p.message_id);
  io.text(8, p.text);
}

}  // namespace emit::protocol::cigi
