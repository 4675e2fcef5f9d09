// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <string_view>

/// Codec of FlightGear's "native FDM" datagram: what a flight dynamics model such as JSBSim sends
/// so that another program shows its aircraft. Versions 24 and 25 are read, and 24 is written.
/// docs/net_fdm.md has the offsets. Any thread. RT-safe.
namespace emit::protocol::net_fdm {

inline constexpr std::uint32_t kVersion = 24;
inline constexpr std::size_t kBytes = 408;
/// Version of FlightGear 2020.3 and later, which has more about fuel tanks.
inline constexpr std::uint32_t kTankVersion = 25;
inline constexpr std::size_t kTankBytes = 552;
/// Offset of what version 25 has more, and where the rest goes on as in version 24.
inline constexpr std::size_t kTanksAt = 304;

/// Fields of a datagram that a source of poses needs, in SI units. The wire has feet for velocities
/// and accelerations.
struct State {
  double longitude_rad = 0.0;  ///< east +, -6.2832 to 6.2832
  double latitude_rad = 0.0;   ///< geodetic, north +, -1.5708 to 1.5708
  /// Above sea level by the format; senders mean the WGS-84 ellipsoid, since they have no geoid.
  /// -1e4 to 1e8.
  double altitude_m = 0.0;
  float roll_rad = 0.0f;     ///< right wing down, -6.2832 to 6.2832
  float pitch_rad = 0.0f;    ///< nose up, -1.5708 to 1.5708
  float heading_rad = 0.0f;  ///< clockwise from true north, -6.2832 to 6.2832
  /// Rates of the three angles above, not turns about the body's axes: see body_rates_rad_s().
  float roll_rate_rad_s = 0.0f;
  float pitch_rate_rad_s = 0.0f;
  float heading_rate_rad_s = 0.0f;
  glm::dvec3 velocity_ned_m_s{0.0};  ///< along north, east and down, over the ground
  /// Acceleration without gravity at the pilot's seat, as an accelerometer shows it, along the
  /// body's axes (x forward, y right, z down). At rest z is about -9.8.
  glm::dvec3 pilot_specific_force_m_s2{0.0};
  /// Seconds since 1970-01-01 by the format. It is no simulation time to rely on: FlightGear sends
  /// the seconds of its computer's clock, and JSBSim a constant, or its simulation time in units
  /// that the datagram does not say.
  std::uint32_t unix_time_s = 0;
  std::int32_t warp_s = 0;  ///< added to `unix_time_s` for the time of day of the scene
  bool operator==(const State&) const = default;
};

/// A reason why a datagram was refused. A plain struct: filling it allocates nothing.
struct Fault {
  enum class Kind : std::uint8_t {
    none,
    too_short,   ///< `value` bytes hold no version
    byte_order,  ///< the version is 24 or 25 in little-endian order
    version,     ///< `value` is the version, which is not 24 or 25
    size,        ///< `value` bytes; the datagram's version has `lowest`
    field,       ///< `field` is `value`, outside `lowest` to `highest`, or not finite
  };
  Kind kind = Kind::none;
  const char* field = "";  ///< name of the struct's member, static storage
  double value = 0.0;
  double lowest = 0.0;
  double highest = 0.0;
  [[nodiscard]] explicit operator bool() const noexcept { return kind != Kind::none; }
};

/// Reads a datagram. `state` is written only when the fault is of kind none.
[[nodiscard]] Fault decode(std::span<const std::byte> datagram, State& state) noexcept;

/// Writes a datagram of version 24 whose other fields are 0, for tests and tools. Velocities and
/// accelerations are rounded to float32.
void encode(const State& state, std::span<std::byte, kBytes> datagram) noexcept;

/// Returns the rates about the body's x, y and z axes that the rates of the angles make:
/// p = roll' - heading' sin(pitch), q = pitch' cos(roll) + heading' cos(pitch) sin(roll),
/// r = heading' cos(pitch) cos(roll) - pitch' sin(roll).
[[nodiscard]] glm::dvec3 body_rates_rad_s(const State& state) noexcept;

/// Length that is enough for every text of fault_text(), bytes.
inline constexpr std::size_t kFaultTextBytes = 128;
/// Writes for example "latitude_rad is 47.1, must be -1.5708 to 1.5708". Returns the part of
/// `buffer` that it used; a text that is too long is cut off.
[[nodiscard]] std::string_view fault_text(const Fault& fault, std::span<char> buffer) noexcept;

}  // namespace emit::protocol::net_fdm
