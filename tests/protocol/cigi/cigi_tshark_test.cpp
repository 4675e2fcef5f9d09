// SPDX-License-Identifier: Apache-2.0
// A capture of messages from the writer is read by tshark, whose CIGI dissector is not ours.
#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <span>
#include <sstream>
#include <string>
#include <vector>

#include "emit/protocol/cigi.hpp"
#include "protocol/capture.hpp"
#include "protocol/cigi/cigi_samples.hpp"
#include "support/emit_process.hpp"

namespace emit::protocol::cigi {
namespace {

constexpr std::uint16_t kHostPort = 8001;
constexpr std::uint16_t kIgPort = 8000;

/// A field of tshark (after "cigi.") and the value that the sample packets have there. The words of
/// Component Control and Event Notification are missing: tshark shows their bytes as they came.
/// tshark calls time stamps microseconds; the number is that of ticks of 10 us.
struct NamedValue {
  const char* name;
  const char* value;
};
constexpr NamedValue kHostFields[] = {
    {"ig_control.db_number", "5"},
    {"ig_control.ig_mode", "1"},
    {"ig_control.timestamp_valid", "1"},
    {"ig_control.extrapolation_enable", "1"},
    {"ig_control.minor_version", "3"},
    {"ig_control.host_frame_number", "16909060"},
    {"ig_control.timestamp", "84281096"},
    {"ig_control.last_ig_frame_number", "151653132"},
    {"entity_control.entity_id", "4386"},
    {"entity_control.entity_state", "1"},
    {"entity_control.attach_state", "1"},
    {"entity_control.coll_det_request", "1"},
    {"entity_control.inherit_alpha", "0"},
    {"entity_control.ground_ocean_clamp", "1"},
    {"entity_control.animation_dir", "0"},
    {"entity_control.animation_loop_mode", "1"},
    {"entity_control.animation_state", "2"},
    {"entity_control.extrapolation_enable", "1"},
    {"entity_control.alpha", "200"},
    {"entity_control.entity_type", "13124"},
    {"entity_control.parent_id", "21862"},
    {"entity_control.roll", "-12.5"},
    {"entity_control.pitch", "7.25"},
    {"entity_control.yaw", "271.5"},
    {"entity_control.lat_xoff", "-1.5"},
    {"entity_control.lon_yoff", "2000.25"},
    {"entity_control.alt_zoff", "-3.75"},
    {"component_control.component_id", "258"},
    {"component_control.instance_id", "772"},
    {"component_control.component_class", "13"},
    {"component_control.component_state", "9"},
    {"short_component_control.component_id", "1286"},
    {"short_component_control.instance_id", "1800"},
    {"short_component_control.component_class", "3"},
    {"short_component_control.component_state", "8"},
    {"art_part_control.entity_id", "515"},
    {"art_part_control.part_id", "4"},
    {"art_part_control.part_enable", "1"},
    {"art_part_control.xoff_enable", "0"},
    {"art_part_control.yoff_enable", "1"},
    {"art_part_control.zoff_enable", "0"},
    {"art_part_control.roll_enable", "0"},
    {"art_part_control.pitch_enable", "1"},
    {"art_part_control.yaw_enable", "0"},
    {"art_part_control.xoff", "1.5"},
    {"art_part_control.yoff", "-2.5"},
    {"art_part_control.zoff", "3.5"},
    {"art_part_control.roll", "-170"},
    {"art_part_control.pitch", "80"},
    {"art_part_control.yaw", "350"},
    {"short_art_part_control.entity_id", "1029"},
    {"short_art_part_control.part_id_1", "6"},
    {"short_art_part_control.part_id_2", "7"},
    {"short_art_part_control.dof_select_1", "3"},
    {"short_art_part_control.dof_select_2", "5"},
    {"short_art_part_control.part_enable_1", "1"},
    {"short_art_part_control.part_enable_2", "0"},
    {"short_art_part_control.dof_1", "-4.5"},
    {"short_art_part_control.dof_2", "45"},
    {"rate_control.entity_id", "1543"},
    {"rate_control.part_id", "8"},
    {"rate_control.apply_to_part", "0"},
    {"rate_control.coordinate_system", "1"},
    {"rate_control.x_rate", "100.5"},
    {"rate_control.y_rate", "-200.5"},
    {"rate_control.z_rate", "300.5"},
    {"rate_control.roll_rate", "-10.25"},
    {"rate_control.pitch_rate", "20.25"},
    {"rate_control.yaw_rate", "-30.25"},
    {"celestial_sphere_control.hour", "13"},
    {"celestial_sphere_control.minute", "47"},
    {"celestial_sphere_control.ephemeris_enable", "0"},
    {"celestial_sphere_control.sun_enable", "1"},
    {"celestial_sphere_control.moon_enable", "1"},
    {"celestial_sphere_control.star_enable", "0"},
    {"celestial_sphere_control.date_time_valid", "1"},
    {"celestial_sphere_control.date", "2292024"},
    {"celestial_sphere_control.star_intensity", "62.5"},
    {"atmosphere_control.atmospheric_model_enable", "1"},
    {"atmosphere_control.humidity", "55"},
    {"atmosphere_control.air_temp", "-12.5"},
    {"atmosphere_control.visibility_range", "23000"},
    {"atmosphere_control.horiz_wind", "8.5"},
    {"atmosphere_control.vert_wind", "-0.5"},
    {"atmosphere_control.wind_direction", "275"},
    {"atmosphere_control.barometric_pressure", "1013.25"},
    {"env_region_control.region_id", "1800"},
    {"env_region_control.region_state", "1"},
    {"env_region_control.merge_weather", "0"},
    {"env_region_control.merge_aerosol", "1"},
    {"env_region_control.merge_maritime", "1"},
    {"env_region_control.merge_terrestrial", "0"},
    {"env_region_control.lat", "47.5"},
    {"env_region_control.lon", "-122.25"},
    {"env_region_control.size_x", "5000"},
    {"env_region_control.size_y", "6000"},
    {"env_region_control.corner_radius", "700"},
    {"env_region_control.rotation", "-45"},
    {"env_region_control.transition_perimeter", "80.5"},
    {"weather_control.entity_region_id", "2314"},
    {"weather_control.layer_id", "2"},
    {"weather_control.humidity", "90"},
    {"weather_control.weather_enable", "1"},
    {"weather_control.scud_enable", "0"},
    {"weather_control.random_winds_enable", "1"},
    {"weather_control.random_lightning_enable", "0"},
    {"weather_control.cloud_type", "7"},
    {"weather_control.scope", "1"},
    {"weather_control.severity", "4"},
    {"weather_control.air_temp", "-5.5"},
    {"weather_control.visibility_range", "1500"},
    {"weather_control.scud_frequency", "12.5"},
    {"weather_control.coverage", "87.5"},
    {"weather_control.base_elevation", "1200"},
    {"weather_control.thickness", "400"},
    {"weather_control.transition_band", "50"},
    {"weather_control.horiz_wind", "9.5"},
    {"weather_control.vert_wind", "-1.5"},
    {"weather_control.wind_direction", "310"},
    {"weather_control.barometric_pressure", "850.5"},
    {"weather_control.aerosol_concentration", "0.25"},
    {"view_control.view_id", "2828"},
    {"view_control.group_id", "13"},
    {"view_control.xoff_enable", "1"},
    {"view_control.yoff_enable", "0"},
    {"view_control.zoff_enable", "0"},
    {"view_control.roll_enable", "1"},
    {"view_control.pitch_enable", "0"},
    {"view_control.yaw_enable", "1"},
    {"view_control.entity_id", "3599"},
    {"view_control.xoff", "0.5"},
    {"view_control.yoff", "-0.25"},
    {"view_control.zoff", "0.125"},
    {"view_control.roll", "1.5"},
    {"view_control.pitch", "-2.5"},
    {"view_control.yaw", "-3.5"},
    {"sensor_control.view_id", "4113"},
    {"sensor_control.sensor_id", "18"},
    {"sensor_control.sensor_on_off", "1"},
    {"sensor_control.polarity", "1"},
    {"sensor_control.line_dropout_enable", "0"},
    {"sensor_control.auto_gain", "1"},
    {"sensor_control.track_white_black", "0"},
    {"sensor_control.track_mode", "3"},
    {"sensor_control.response_type", "1"},
    {"sensor_control.gain", "0.75"},
    {"sensor_control.level", "0.25"},
    {"sensor_control.ac_coupling", "16.5"},
    {"sensor_control.noise", "0.125"},
    {"earth_ref_model_def.erm_enable", "1"},
    {"earth_ref_model_def.equatorial_radius", "6378137"},
    {"earth_ref_model_def.flattening", "0.00335281066474748"},
    {"view_def.view_id", "4627"},
    {"view_def.group_id", "20"},
    {"view_def.near_enable", "1"},
    {"view_def.far_enable", "0"},
    {"view_def.left_enable", "1"},
    {"view_def.right_enable", "1"},
    {"view_def.top_enable", "0"},
    {"view_def.bottom_enable", "1"},
    {"view_def.mirror_mode", "2"},
    {"view_def.pixel_replication", "2"},
    {"view_def.projection_type", "0"},
    {"view_def.reorder", "1"},
    {"view_def.view_type", "2"},
    {"view_def.near", "0.5"},
    {"view_def.far", "40000"},
    {"view_def.left", "-1.5"},
    {"view_def.right", "1.25"},
    {"view_def.top", "0.75"},
    {"view_def.bottom", "-0.625"},
    {"hat_hot_request.hat_hot_id", "5141"},
    {"hat_hot_request.type", "2"},
    {"hat_hot_request.coordinate_system", "1"},
    {"hat_hot_request.update_period", "22"},
    {"hat_hot_request.entity_id", "5912"},
    {"hat_hot_request.lat_xoff", "10.5"},
    {"hat_hot_request.lon_yoff", "-20.5"},
    {"hat_hot_request.alt_zoff", "30.5"},
    {"los_segment_request.los_id", "6426"},
    {"los_segment_request.type", "1"},
    {"los_segment_request.source_coord", "0"},
    {"los_segment_request.destination_coord", "1"},
    {"los_segment_request.response_coord", "0"},
    {"los_segment_request.destination_entity_id_valid", "1"},
    {"los_segment_request.alpha_threshold", "27"},
    {"los_segment_request.entity_id", "7197"},
    {"los_segment_request.source_lat_xoff", "1.25"},
    {"los_segment_request.source_lon_yoff", "-2.25"},
    {"los_segment_request.source_alt_zoff", "3000.25"},
    {"los_segment_request.destination_lat_xoff", "400.5"},
    {"los_segment_request.destination_lon_yoff", "-500.5"},
    {"los_segment_request.destination_alt_zoff", "600.5"},
    {"los_segment_request.material_mask", "505356321"},
    {"los_segment_request.update_period", "34"},
    {"los_segment_request.destination_entity_id", "8996"},
    {"los_vector_request.los_id", "9510"},
    {"los_vector_request.type", "1"},
    {"los_vector_request.source_coord", "0"},
    {"los_vector_request.response_coord", "1"},
    {"los_vector_request.alpha", "39"},
    {"los_vector_request.entity_id", "10281"},
    {"los_vector_request.azimuth", "-120.5"},
    {"los_vector_request.elevation", "33.25"},
    {"los_vector_request.min_range", "10"},
    {"los_vector_request.max_range", "9000"},
    {"los_vector_request.source_lat_xoff", "51.5"},
    {"los_vector_request.source_lon_yoff", "7.75"},
    {"los_vector_request.source_alt_zoff", "88.125"},
    {"los_vector_request.material_mask", "707472429"},
    {"los_vector_request.update_period", "46"},
    {"pos_request.object_id", "12080"},
    {"pos_request.part_id", "49"},
    {"pos_request.update_mode", "1"},
    {"pos_request.object_class", "1"},
    {"pos_request.coord_system", "2"},
    {"env_cond_request.type", "6"},
    {"env_cond_request.id", "50"},
    {"env_cond_request.lat", "-33.5"},
    {"env_cond_request.lon", "151.25"},
    {"env_cond_request.alt", "20.75"},
};
constexpr NamedValue kIgFields[] = {
    {"sof.db_number", "-5"},
    {"sof.ig_status", "51"},
    {"sof.ig_mode", "1"},
    {"sof.timestamp_valid", "1"},
    {"sof.earth_reference_model", "1"},
    {"sof.minor_version", "3"},
    {"sof.ig_frame_number", "875902519"},
    {"sof.timestamp", "943274555"},
    {"sof.last_host_frame_number", "1010646591"},
    {"hat_hot_response.hat_hot_id", "16449"},
    {"hat_hot_response.valid", "1"},
    {"hat_hot_response.type", "1"},
    {"hat_hot_response.host_frame_number_lsn", "10"},
    {"hat_hot_response.height", "-42.5"},
    {"hat_hot_ext_response.hat_hot_id", "16963"},
    {"hat_hot_ext_response.valid", "1"},
    {"hat_hot_ext_response.host_frame_number_lsn", "11"},
    {"hat_hot_ext_response.hat", "120.25"},
    {"hat_hot_ext_response.hot", "-7.5"},
    {"hat_hot_ext_response.material_code", "1145390663"},
    {"hat_hot_ext_response.normal_vector_azimuth", "-90.5"},
    {"hat_hot_ext_response.normal_vector_elevation", "89.5"},
    {"los_response.los_id", "18505"},
    {"los_response.valid", "1"},
    {"los_response.entity_id_valid", "0"},
    {"los_response.visible", "1"},
    {"los_response.host_frame_number_lsn", "12"},
    {"los_response.count", "74"},
    {"los_response.entity_id", "19276"},
    {"los_response.range", "1234.5"},
    {"3_2_los_ext_response.los_id", "19790"},
    {"3_2_los_ext_response.valid", "1"},
    {"3_2_los_ext_response.entity_id_valid", "1"},
    {"3_2_los_ext_response.range_valid", "1"},
    {"3_2_los_ext_response.visible", "0"},
    {"3_2_los_ext_response.host_frame_number_lsn", "13"},
    {"3_2_los_ext_response.response_count", "79"},
    {"3_2_los_ext_response.entity_id", "20561"},
    {"3_2_los_ext_response.range", "4321.5"},
    {"3_2_los_ext_response.lat_xoff", "-11.25"},
    {"3_2_los_ext_response.lon_yoff", "222.5"},
    {"3_2_los_ext_response.alt_zoff", "-3.125"},
    {"3_2_los_ext_response.red", "82"},
    {"3_2_los_ext_response.green", "83"},
    {"3_2_los_ext_response.blue", "84"},
    {"3_2_los_ext_response.alpha", "85"},
    {"3_2_los_ext_response.material_code", "1448564825"},
    {"3_2_los_ext_response.normal_vector_azimuth", "170.25"},
    {"3_2_los_ext_response.normal_vector_elevation", "-45.75"},
    {"sensor_response.view_id", "23131"},
    {"sensor_response.sensor_id", "92"},
    {"sensor_response.sensor_status", "1"},
    {"sensor_response.gate_x_size", "23902"},
    {"sensor_response.gate_y_size", "24416"},
    {"sensor_response.gate_x_pos", "-0.375"},
    {"sensor_response.gate_y_pos", "0.875"},
    {"sensor_response.frame_ctr", "1633837924"},
    {"sensor_ext_response.view_id", "25958"},
    {"sensor_ext_response.sensor_id", "103"},
    {"sensor_ext_response.sensor_status", "2"},
    {"sensor_ext_response.entity_id_valid", "1"},
    {"sensor_ext_response.entity_id", "26729"},
    {"sensor_ext_response.gate_x_size", "27243"},
    {"sensor_ext_response.gate_y_size", "27757"},
    {"sensor_ext_response.gate_x_pos", "1.375"},
    {"sensor_ext_response.gate_y_pos", "-1.875"},
    {"sensor_ext_response.frame_ctr", "1852797041"},
    {"sensor_ext_response.track_lat", "60.5"},
    {"sensor_ext_response.track_lon", "-170.5"},
    {"sensor_ext_response.track_alt", "9000.5"},
    {"pos_response.object_id", "29299"},
    {"pos_response.part_id", "116"},
    {"pos_response.object_class", "2"},
    {"pos_response.coord_system", "1"},
    {"pos_response.lat_xoff", "1.5"},
    {"pos_response.lon_yoff", "-2.5"},
    {"pos_response.alt_zoff", "3.5"},
    {"pos_response.roll", "-4.5"},
    {"pos_response.pitch", "5.5"},
    {"pos_response.yaw", "65.5"},
    {"wea_cond_response.request_id", "117"},
    {"wea_cond_response.humidity", "44"},
    {"wea_cond_response.air_temp", "21.5"},
    {"wea_cond_response.visibility_range", "18000"},
    {"wea_cond_response.horiz_speed", "3.5"},
    {"wea_cond_response.vert_speed", "0.75"},
    {"wea_cond_response.wind_direction", "185"},
    {"wea_cond_response.barometric_pressure", "998.5"},
    {"event_notification.event_id", "30327"},
    {"image_generator_message.message_id", "33925"},
    {"image_generator_message.message", "hello, host"},
};

/// Returns the lines that tshark prints with these fields, one per message.
std::vector<std::string> dissected(const std::string& file, std::span<const NamedValue> fields) {
  std::vector<std::string> command = {
      "tshark", "-n",          "-r", file,          "-d", "udp.port==8000,cigi",
      "-T",     "fields",      "-E", "separator=|", "-e", "_ws.malformed",
      "-e",     "cigi.version"};
  for (const NamedValue& field : fields) {
    command.emplace_back("-e");
    command.emplace_back(std::string("cigi.") + field.name);
  }
  const auto result = test::run_process(command);
  EXPECT_EQ(result.exit_code, 0) << result.err;
  std::vector<std::string> lines;
  std::istringstream text(result.out);
  for (std::string line; std::getline(text, line);) lines.push_back(line);
  return lines;
}

void expect_fields(std::span<const Packet> packets, std::uint16_t from, std::uint16_t to,
                   std::span<const NamedValue> fields) {
  const test::TemporaryFolder folder;
  const std::string file = folder.file("cigi.pcap");
  std::ofstream out(file, std::ios::binary);
  out << test::capture_head();
  for (const ByteOrder order : {ByteOrder::big, ByteOrder::little}) {
    out << test::capture_record(test::cigi_message(packets, order), from, to);
  }
  out.close();
  const auto lines = dissected(file, fields);
  ASSERT_EQ(lines.size(), 2U);
  for (const std::string& line : lines) {
    std::istringstream values(line + '|');
    std::string value;
    ASSERT_TRUE(std::getline(values, value, '|'));
    EXPECT_EQ(value, "") << "malformed";
    ASSERT_TRUE(std::getline(values, value, '|'));
    EXPECT_EQ(value, "3");
    for (const NamedValue& field : fields) {
      ASSERT_TRUE(std::getline(values, value, '|')) << field.name;
      EXPECT_EQ(value, field.value) << field.name;
    }
  }
}

TEST(CigiTshark, ReadsTheMessagesOfBothSidesInBothOrders) {
  if (!test::tshark_is_here()) GTEST_SKIP() << "tshark is not installed";
  expect_fields(test::sample_host_packets(), kHostPort, kIgPort, kHostFields);
  expect_fields(test::sample_ig_packets(), kIgPort, kHostPort, kIgFields);
}

}  // namespace
}  // namespace emit::protocol::cigi
