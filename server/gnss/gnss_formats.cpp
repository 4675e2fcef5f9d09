// SPDX-License-Identifier: Apache-2.0
#include "gnss/gnss_formats.hpp"

#include <fmt/format.h>

#include <bit>
#include <cmath>

#include "emit/physics/constants.hpp"

namespace emit::server {
namespace {

constexpr std::int64_t kSecondNs = 1'000'000'000;
constexpr std::int64_t kDayNs = 86'400 * kSecondNs;

/// Returns the elapsed seconds with one decimal where they are whole tenths, else with three.
std::string elapsed_text(std::int64_t elapsed_ns) {
  constexpr std::int64_t kTenthNs = kSecondNs / 10;
  return fmt::format(elapsed_ns % kTenthNs == 0 ? fmt::runtime("{:.1f}") : fmt::runtime("{:.3f}"),
                     1e-9 * static_cast<double>(elapsed_ns));
}

/// Returns "ddmm.mmmmmmmm" of an angle with two or three digits of degrees. Whole numbers of
/// 1e-8 minutes carry into the degrees, so that minutes never read 60.
std::string nmea_angle(double angle_deg, int degree_digits) {
  constexpr std::int64_t kUnitsPerMinute = 100'000'000;
  const auto units =
      std::llround(std::abs(angle_deg) * 60.0 * static_cast<double>(kUnitsPerMinute));
  const auto minutes = units / kUnitsPerMinute;
  return fmt::format("{:0{}}{:02}.{:08}", minutes / 60, degree_digits, minutes % 60,
                     units % kUnitsPerMinute);
}

/// Returns the time as "D HH:MM:SS.sss".
std::string mot_time(std::int64_t elapsed_ns) {
  constexpr std::int64_t kMillisecondNs = 1'000'000;
  const std::int64_t of_day_ms = elapsed_ns % kDayNs / kMillisecondNs;
  return fmt::format("{} {:02}:{:02}:{:02}.{:03}", elapsed_ns / kDayNs, of_day_ms / 3'600'000,
                     of_day_ms / 60'000 % 60, of_day_ms / 1000 % 60, of_day_ms % 1000);
}

/// Returns three numbers, each behind a comma. One that rounds to zero has no sign.
std::string comma_vector(const glm::dvec3& v, int decimals) {
  std::string out;
  for (glm::length_t i = 0; i < 3; ++i) {
    const bool zero = std::abs(v[i]) < 0.5 * std::pow(10.0, -decimals);
    out += fmt::format(",{:.{}f}", zero ? 0.0 : v[i], decimals);
  }
  return out;
}

void append(std::string& out, std::uint64_t value, int bytes) {
  for (int i = 0; i < bytes; ++i) out += static_cast<char>(value >> (8 * i) & 0xFFU);
}
void append(std::string& out, double value) {
  append(out, std::bit_cast<std::uint64_t>(value), 8);
}
void append(std::string& out, const glm::dvec3& v) {
  for (glm::length_t i = 0; i < 3; ++i) append(out, v[i]);
}
/// Skydel has rotations in the order yaw, pitch, roll: those about z, y and x.
void append_turn(std::string& out, const glm::dvec3& about_body_axes) {
  append(out, glm::dvec3(about_body_axes.z, about_body_axes.y, about_body_axes.x));
}

}  // namespace

std::string ecef_csv_row(const GnssRow& row) {
  const glm::dvec3& p = row.motion.position_ecef_m;
  return fmt::format("{},{:.4f},{:.4f},{:.4f}\n", elapsed_text(row.elapsed_ns), p.x, p.y, p.z);
}

std::string llh_csv_row(const GnssRow& row) {
  const physics::GeoPlace& place = row.motion.place;
  return fmt::format("{},{:.10f},{:.10f},{:.4f}\n", elapsed_text(row.elapsed_ns),
                     physics::to_degrees(place.latitude), physics::to_degrees(place.longitude),
                     place.height.value());
}

unsigned nmea_checksum(std::string_view text) noexcept {
  unsigned sum = 0;
  for (const char c : text) sum ^= static_cast<unsigned char>(c);
  return sum;
}

std::string gga_sentence(const GnssRow& row, double geoid_separation_m) {
  constexpr std::int64_t kHundredthNs = kSecondNs / 100;
  const physics::GeoPlace& place = row.motion.place;
  // Instants before 1970 are negative, and their time of day is not.
  const std::int64_t of_day = (row.posix_utc_ns % kDayNs + kDayNs) % kDayNs / kHundredthNs;
  const double latitude_deg = physics::to_degrees(place.latitude);
  const double longitude_deg = physics::to_degrees(place.longitude);
  const std::string text = fmt::format(
      "GPGGA,{:02}{:02}{:02}.{:02},{},{},{},{},1,12,0.80,{:.3f},M,{:.3f},M,,", of_day / 360'000,
      of_day / 6'000 % 60, of_day / 100 % 60, of_day % 100, nmea_angle(latitude_deg, 2),
      latitude_deg < 0.0 ? 'S' : 'N', nmea_angle(longitude_deg, 3), longitude_deg < 0.0 ? 'W' : 'E',
      place.height.value() - geoid_separation_m, geoid_separation_m);
  return fmt::format("${}*{:02X}\r\n", text, nmea_checksum(text));
}

std::string mot_row(const GnssRow& row, std::string_view vehicle) {
  const EarthMotion& motion = row.motion;
  std::string out = fmt::format("{},mot,{}", mot_time(row.elapsed_ns), vehicle);
  constexpr int kMetreDecimals = 6;
  constexpr int kAngleDecimals = 9;
  for (const glm::dvec3& v : {motion.position_ecef_m, motion.velocity_ecef_m_s,
                              motion.acceleration_ecef_m_s2, motion.jerk_ecef_m_s3}) {
    out += comma_vector(v, kMetreDecimals);
  }
  const physics::HeadingPitchRoll& attitude = motion.attitude;
  for (const glm::dvec3& v :
       {glm::dvec3(attitude.heading_rad, attitude.pitch_rad, attitude.roll_rad),
        motion.angular_rate_rad_s, motion.angular_acceleration_rad_s2,
        motion.angular_jerk_rad_s3}) {
    out += comma_vector(v, kAngleDecimals);
  }
  out += '\n';
  return out;
}

std::string skydel_datagram(const GnssRow& row, SkydelDynamics dynamics, std::string_view name) {
  constexpr std::uint64_t kPushEcefNedDynamics = 8;
  const EarthMotion& motion = row.motion;
  std::string out;
  append(out, kPushEcefNedDynamics, 1);
  append(out, static_cast<std::uint64_t>(dynamics), 1);
  append(out, 1e-6 * static_cast<double>(row.elapsed_ns));
  append(out, motion.position_ecef_m);
  append(out, glm::dvec3(motion.attitude.heading_rad, motion.attitude.pitch_rad,
                         motion.attitude.roll_rad));
  append(out, motion.velocity_ecef_m_s);
  append_turn(out, motion.angular_rate_rad_s);
  if (dynamics >= SkydelDynamics::acceleration) {
    append(out, motion.acceleration_ecef_m_s2);
    append_turn(out, motion.angular_acceleration_rad_s2);
  }
  if (dynamics >= SkydelDynamics::jerk) {
    append(out, motion.jerk_ecef_m_s3);
    append_turn(out, motion.angular_jerk_rad_s3);
  }
  append(out, name.size(), 4);
  out += name;
  return out;
}

}  // namespace emit::server
