// SPDX-License-Identifier: Apache-2.0
#include "gnss/gnss_formats.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/constants.hpp"
#include "gnss/gps_time.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using emit::test::kSecondNs;

/// A row with a number of its own in every field.
GnssRow example_row() {
  GnssRow row;
  row.elapsed_ns = 180'010'000'000;
  row.posix_utc_ns = 100'000'000;
  row.motion.position_ecef_m = {-3586533.227, 4113884.878, 3289817.367};
  row.motion.velocity_ecef_m_s = {1.5, -2.25, 3.0};
  row.motion.acceleration_ecef_m_s2 = {0.1, 0.2, 0.3};
  row.motion.jerk_ecef_m_s3 = {-0.01, -0.02, -0.03};
  row.motion.place = {physics::degrees(38.0 + 12.345678 / 60.0),
                      physics::degrees(-(90.0 + 30.123456 / 60.0)), physics::Metres(1205.2)};
  row.motion.attitude = {0.5, -0.25, 3.0};
  row.motion.angular_rate_rad_s = {1.0, 2.0, 3.0};
  row.motion.angular_acceleration_rad_s2 = {4.0, 5.0, 6.0};
  row.motion.angular_jerk_rad_s3 = {7.0, 8.0, 9.0};
  return row;
}

TEST(GnssFormats, ecef_rows_are_those_of_gps_sdr_sim) {
  GnssRow row = example_row();
  EXPECT_EQ(ecef_csv_row(row), "180.010,-3586533.2270,4113884.8780,3289817.3670\n");
  row.elapsed_ns = 0;
  EXPECT_EQ(ecef_csv_row(row), "0.0,-3586533.2270,4113884.8780,3289817.3670\n");
  row.elapsed_ns = 12'300'000'000;
  EXPECT_EQ(ecef_csv_row(row).substr(0, 5), "12.3,");
}

TEST(GnssFormats, geodetic_rows_are_degrees_and_metres) {
  GnssRow row = example_row();
  row.elapsed_ns = 100'000'000;
  row.motion.place = {physics::degrees(-12.5), physics::degrees(179.25), physics::Metres(-3.5)};
  EXPECT_EQ(llh_csv_row(row), "0.1,-12.5000000000,179.2500000000,-3.5000\n");
}

TEST(GnssFormats, the_sentence_and_its_checksum_are_those_of_the_example) {
  EXPECT_EQ(gga_sentence(example_row(), -29.3),
            "$GPGGA,000000.10,3812.34567800,N,09030.12345600,W,1,12,0.80,1234.500,M,-29.300,M,,*5E"
            "\r\n");
  EXPECT_EQ(nmea_checksum("GPGGA,000000.10,3812.34567800,N,09030.12345600,W,1,12,0.80,1234.500,M,"
                          "-29.300,M,,"),
            0x5EU);
}

TEST(GnssFormats, minutes_carry_and_days_turn) {
  GnssRow row = example_row();
  row.motion.place = {physics::degrees(-(4.0 + 59.999999999 / 60.0)), physics::degrees(7.0),
                      physics::Metres(0.0)};
  row.posix_utc_ns = std::int64_t{86'399} * kSecondNs + 990'000'000;
  EXPECT_EQ(gga_sentence(row, 0.0).substr(0, 47),
            "$GPGGA,235959.99,0500.00000000,S,00700.00000000");
  row.posix_utc_ns = std::int64_t{172'800} * kSecondNs;
  EXPECT_EQ(gga_sentence(row, 0.0).substr(0, 17), "$GPGGA,000000.00,");
  row.posix_utc_ns = -kSecondNs;
  EXPECT_EQ(gga_sentence(row, 0.0).substr(0, 17), "$GPGGA,235959.00,");
}

TEST(GnssFormats, motion_rows_have_24_numbers_behind_time_and_vehicle) {
  EXPECT_EQ(mot_row(example_row(), "v1_m1"),
            "0 00:03:00.010,mot,v1_m1"
            ",-3586533.227000,4113884.878000,3289817.367000"
            ",1.500000,-2.250000,3.000000"
            ",0.100000,0.200000,0.300000"
            ",-0.010000,-0.020000,-0.030000"
            ",0.500000000,-0.250000000,3.000000000"
            ",1.000000000,2.000000000,3.000000000"
            ",4.000000000,5.000000000,6.000000000"
            ",7.000000000,8.000000000,9.000000000\n");
  GnssRow row = example_row();
  row.elapsed_ns = 90'061 * kSecondNs + 999'000'000;
  EXPECT_EQ(mot_row(row, "v2_m1").substr(0, 25), "1 01:01:01.999,mot,v2_m1,");
}

double number_at(const std::string& bytes, std::size_t offset) {
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < 8; ++i) {
    bits |= static_cast<std::uint64_t>(static_cast<unsigned char>(bytes.at(offset + i))) << (8 * i);
  }
  return std::bit_cast<double>(bits);
}

TEST(GnssFormats, datagrams_have_the_layout_of_skydel) {
  const std::vector<double> numbers = {180010.0,                                // ms
                                       -3586533.227, 4113884.878, 3289817.367,  // position
                                       0.5,          -0.25,       3.0,          // yaw, pitch, roll
                                       1.5,          -2.25,       3.0,          // velocity
                                       3.0,          2.0,         1.0,    // its turn about z, y, x
                                       0.1,          0.2,         0.3,    // acceleration
                                       6.0,          5.0,         4.0,    //
                                       -0.01,        -0.02,       -0.03,  // jerk
                                       9.0,          8.0,         7.0};
  for (const std::size_t level : {std::size_t{0}, std::size_t{1}, std::size_t{2}}) {
    const std::string bytes =
        skydel_datagram(example_row(), static_cast<SkydelDynamics>(level), "jammer");
    ASSERT_EQ(bytes.size(), 110U + 48U * level + 6U);
    EXPECT_EQ(bytes[0], 8);
    EXPECT_EQ(bytes[1], static_cast<char>(level));
    const std::size_t count = 13 + 6 * level;
    for (std::size_t i = 0; i < count; ++i) {
      EXPECT_DOUBLE_EQ(number_at(bytes, 2 + 8 * i), numbers[i]) << i;
    }
    const std::size_t end = 2 + 8 * count;
    EXPECT_EQ(bytes.substr(end), std::string("\6\0\0\0jammer", 10));
  }
  EXPECT_EQ(skydel_datagram(example_row(), SkydelDynamics::jerk, "").size(), 206U);
}

/// A vehicle a thousand kilometres east of the origin that is level in its own place is not level
/// at the origin.
TEST(EarthMotion, attitude_is_relative_to_the_vehicles_own_place) {
  const physics::GeoPlace origin{physics::degrees(0.0), physics::degrees(10.0),
                                 physics::Metres(0.0)};
  const physics::GeoPlace away{physics::degrees(0.0), physics::degrees(19.0),
                               physics::Metres(5000.0)};
  const glm::dmat3 world_from_ecef = glm::transpose(physics::ecef_from_enu(origin));
  TruthState state;
  state.pose.position_world_m = world_from_ecef * (physics::ecef_m(away) - physics::ecef_m(origin));
  const glm::dmat3 world_from_local = world_from_ecef * physics::ecef_from_enu(away);
  state.pose.world_from_body =
      glm::quat_cast(world_from_local *
                     glm::mat3_cast(physics::world_from_body_heading_pitch_roll(1.0, 0.1, -0.2)));
  state.velocity_m_s = world_from_local * glm::dvec3(0.0, 0.0, 7.0);  // straight up there
  const EarthMotion motion = EarthFrame(origin).motion(state);
  EXPECT_NEAR(motion.attitude.heading_rad, 1.0, 1e-9);
  EXPECT_NEAR(motion.attitude.pitch_rad, 0.1, 1e-9);
  EXPECT_NEAR(motion.attitude.roll_rad, -0.2, 1e-9);
  EXPECT_NEAR(physics::to_degrees(motion.place.longitude), 19.0, 1e-9);
  EXPECT_NEAR(motion.place.height.value(), 5000.0, 1e-6);
  // East of Greenwich at the equator, up is in the plane of x and y.
  EXPECT_NEAR(motion.velocity_ecef_m_s.x, 7.0 * std::cos(19.0 * physics::kDegree), 1e-9);
  EXPECT_NEAR(motion.velocity_ecef_m_s.y, 7.0 * std::sin(19.0 * physics::kDegree), 1e-9);
  EXPECT_NEAR(motion.velocity_ecef_m_s.z, 0.0, 1e-9);
}

TEST(EarthMotion, a_level_flight_to_the_north_at_the_origin_has_no_angles) {
  const physics::GeoPlace origin{physics::degrees(48.56), physics::degrees(11.26),
                                 physics::Metres(400.0)};
  TruthState state;
  state.pose.world_from_body = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  const EarthMotion motion = EarthFrame(origin).motion(state);
  EXPECT_NEAR(motion.attitude.heading_rad, 0.0, 1e-12);
  EXPECT_NEAR(motion.attitude.pitch_rad, 0.0, 1e-12);
  EXPECT_NEAR(motion.attitude.roll_rad, 0.0, 1e-12);
  EXPECT_NEAR(motion.place.height.value(), 400.0, 1e-8);
}

TEST(GpsTime, weeks_and_leap_seconds_of_known_instants) {
  // GPS time began at 1980-01-06 00:00:00 UTC.
  constexpr std::int64_t kBegin = 315'964'800 * kSecondNs;
  EXPECT_FALSE(gps_instant(kBegin - 1));
  EXPECT_EQ(gps_instant(kBegin)->week, 0);
  EXPECT_EQ(gps_instant(kBegin)->second_of_week, 0.0);
  // The week counter of ten bits first overflowed at 1999-08-22 00:00:00 GPS, 13 s ahead of UTC.
  constexpr std::int64_t kOverflow = 935'280'000 * kSecondNs;
  const auto before = gps_instant(kOverflow - 14 * kSecondNs);
  EXPECT_EQ(before->week, 1023);
  EXPECT_EQ(before->second_of_week, 604799.0);
  const auto after = gps_instant(kOverflow - 13 * kSecondNs);
  EXPECT_EQ(after->week, 1024);
  EXPECT_EQ(after->second_of_week, 0.0);
  EXPECT_EQ(after->leap_seconds, 13);
  // The latest leap second came before 2017-01-01.
  constexpr std::int64_t kLatest = 1'483'228'800 * kSecondNs;
  EXPECT_EQ(gps_instant(kLatest - 1)->leap_seconds, 17);
  EXPECT_EQ(gps_instant(kLatest)->leap_seconds, 18);
  EXPECT_EQ(utc_text(kLatest - 1'000'000), "2016-12-31 23:59:59.999 UTC");
}

}  // namespace
}  // namespace emit::server
