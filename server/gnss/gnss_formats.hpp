// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "gnss/earth_motion.hpp"

/// Rows of the files that GNSS simulators read (deploy/docs/gnss.md). Text has its line ends.
/// Thread: any. Real time: not RT-safe.
namespace emit::server {

/// Motion at an instant of an output.
struct GnssRow {
  std::int64_t elapsed_ns = 0;    ///< since the first row
  std::int64_t posix_utc_ns = 0;  ///< POSIX time, no leap seconds
  EarthMotion motion;
};

/// Returns "t,x,y,z" for gps-sdr-sim -u: s, m ECEF.
[[nodiscard]] std::string ecef_csv_row(const GnssRow& row);

/// Returns "t,latitude,longitude,height" for gps-sdr-sim -x: s, deg, deg, m above the ellipsoid.
[[nodiscard]] std::string llh_csv_row(const GnssRow& row);

/// Returns the NMEA checksum of the text between '$' and '*': the exclusive or of its characters.
[[nodiscard]] unsigned nmea_checksum(std::string_view text) noexcept;

/// Returns a GGA sentence with UTC to hundredths of a second, minutes with eight decimals, a fix of
/// quality 1 with twelve satellites and a dilution of 0.80.
/// @param geoid_separation_m  height of the geoid above the ellipsoid; the altitude is the height
///   above the ellipsoid less this
[[nodiscard]] std::string gga_sentence(const GnssRow& row, double geoid_separation_m);

/// Returns a MOT line of Spirent SimGEN: time, "mot", vehicle, and 24 numbers.
[[nodiscard]] std::string mot_row(const GnssRow& row, std::string_view vehicle);

/// Number of derivatives that a datagram of Skydel carries besides the position.
enum class SkydelDynamics : std::uint8_t { velocity, acceleration, jerk };

/// Returns a datagram of Skydel's hardware-in-the-loop port (PushEcefNedDynamics), of
/// 110 + 48 bytes for each level above velocity, and the name.
[[nodiscard]] std::string skydel_datagram(const GnssRow& row, SkydelDynamics dynamics,
                                          std::string_view name);
/// Datagrams by which Skydel's own client begins and ends.
inline constexpr char kSkydelHello = 1;
inline constexpr char kSkydelBye = 2;

}  // namespace emit::server
