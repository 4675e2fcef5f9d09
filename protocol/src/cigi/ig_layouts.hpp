// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>

#include "cigi/host_layouts.hpp"
#include "emit/protocol/cigi/ig_packets.hpp"

/// Layouts of the image generator's packets, in the form of host_layouts.hpp.
namespace emit::protocol::cigi {

/// Offset of the version's minor part: the upper half of this byte.
inline constexpr std::size_t kIgMinorAt = 5;

template <class Io>
void layout(Io& io, StartOfFrame& p) {
  // Major version (2), minor version (5, bits 4 to 7) and magic number (6) belong to the message.
  io.number(3, p.database);
  io.number(4, p.ig_status);
  io.bits(5, 0, 2, p.mode);
  io.bits(5, 2, 1, p.timestamp_valid);
  io.bits(5, 3, 1, p.custom_earth);
  io.number(8, p.ig_frame);
  io.number(12, p.timestamp_ticks);
  io.number(16, p.last_host_frame);
}

template <class Io>
void layout(Io& io, HatHotResponse& p) {
  io.number(2, p.request_id);
  io.bits(4, 0, 1, p.valid);
  io.bits(4, 1, 1, p.height_of_terrain);
  io.bits(4, 4, 4, p.host_frame_lsn);
  io.number(8, p.height_m);
}

template <class Io>
void layout(Io& io, HatHotExtendedResponse& p) {
  io.number(2, p.request_id);
  io.bits(4, 0, 1, p.valid);
  io.bits(4, 4, 4, p.host_frame_lsn);
  io.number(8, p.height_above_terrain_m);
  io.number(16, p.height_of_terrain_m);
  io.number(24, p.material_code);
  io.number(28, p.normal_azimuth_deg);
  io.number(32, p.normal_elevation_deg);
}

template <class Io>
void layout(Io& io, LosResponse& p) {
  io.number(2, p.request_id);
  io.bits(4, 0, 1, p.valid);
  io.bits(4, 1, 1, p.entity_valid);
  io.bits(4, 2, 1, p.visible);
  io.bits(4, 4, 4, p.host_frame_lsn);
  io.number(5, p.response_count);
  io.number(6, p.entity_id);
  io.number(8, p.range_m);
}

template <class Io>
void layout(Io& io, LosExtendedResponse& p) {
  io.number(2, p.request_id);
  io.bits(4, 0, 1, p.valid);
  io.bits(4, 1, 1, p.entity_valid);
  io.bits(4, 2, 1, p.range_valid);
  io.bits(4, 3, 1, p.visible);
  io.bits(4, 4, 4, p.host_frame_lsn);
  io.number(5, p.response_count);
  io.number(6, p.entity_id);
  io.number(8, p.range_m);
  layout_place(io, 16, p.place);
  io.number(40, p.red);
  io.number(41, p.green);
  io.number(42, p.blue);
  io.number(43, p.alpha);
  io.number(44, p.material_code);
  io.number(48, p.normal_azimuth_deg);
  io.number(52, p.normal_elevation_deg);
}

/// Layout of the fields that both sensor responses have at the same offsets.
template <class Io, class P>
void layout_gate(Io& io, P& p) {
  io.number(2, p.view_id);
  io.number(4, p.sensor_id);
  io.bits(5, 0, 2, p.state);
  io.number(8, p.gate_x_px);
  io.number(10, p.gate_y_px);
  io.number(12, p.gate_azimuth_deg);
  io.number(16, p.gate_elevation_deg);
  io.number(20, p.ig_frame);
}
template <class Io>
void layout(Io& io, SensorResponse& p) {
  layout_gate(io, p);
}
template <class Io>
void layout(Io& io, SensorExtendedResponse& p) {
  layout_gate(io, p);
  io.bits(5, 2, 1, p.entity_valid);
  io.number(6, p.entity_id);
  io.number(24, p.latitude_deg);
  io.number(32, p.longitude_deg);
  io.number(40, p.altitude_m);
}

template <class Io>
void layout(Io& io, PositionResponse& p) {
  io.number(2, p.object_id);
  io.number(4, p.part_id);
  io.bits(5, 0, 3, p.object_class);
  io.bits(5, 3, 2, p.frame);
  layout_place(io, 8, p.place);
  io.number(32, p.roll_deg);
  io.number(36, p.pitch_deg);
  io.number(40, p.yaw_deg);
}

template <class Io>
void layout(Io& io, WeatherConditionsResponse& p) {
  io.number(2, p.request_id);
  io.number(3, p.humidity_percent);
  io.number(4, p.air_temperature_c);
  io.number(8, p.visibility_m);
  io.number(12, p.horizontal_wind_m_s);
  io.number(16, p.vertical_wind_m_s);
  io.number(20, p.wind_from_deg);
  io.number(24, p.pressure_hpa);
}

template <class Io>
void layout(Io& io, EventNotification& p) {
  io.number(2, p.event_id);
  for (std::size_t i = 0; i < p.data.size(); ++i) io.number(4 + 4 * i, p.data[i]);
}

template <class Io>
void layout(Io& io, ImageGeneratorMessage& p) {
  io.number(2, p.message_id);
  io.text(4, p.text);
}

}  // namespace emit::protocol::cigi
