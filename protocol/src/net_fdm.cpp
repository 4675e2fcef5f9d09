// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/net_fdm.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "big_endian_io.hpp"
#include "emit/physics/limits.hpp"
#include "fixed_text.hpp"

namespace emit::protocol::net_fdm {
namespace {

constexpr double kLargest = std::numeric_limits<double>::max();
constexpr double kMetresPerFoot = 0.3048;
// A quarter and a whole turn, a little more than the angles, for numbers that were rounded.
constexpr double kQuarterRad = 1.5708;
constexpr double kTurnRad = 6.2832;

/// Vector on the wire: three float32 in feet.
struct WireVector {
  float x = 0.0f;
  float y = 0.0f;
  float z = 0.0f;
};

/// Layout of the fields that are read; offsets in bytes. Others are engines, tanks, gear, airspeed
/// and control surfaces, and the velocity along body axes (88), whose meaning differs by sender.
/// @param tanks_bytes  what the version has more about tanks
template <class Io, class S>
void layout(Io& io, S& s, WireVector& velocity_ft_s, WireVector& force_ft_s2,
            std::size_t tanks_bytes) {
  io.number(8, s.longitude_rad);
  io.number(16, s.latitude_rad);
  io.number(24, s.altitude_m);
  io.number(36, s.roll_rad);
  io.number(40, s.pitch_rad);
  io.number(44, s.heading_rad);
  io.number(56, s.roll_rate_rad_s);
  io.number(60, s.pitch_rate_rad_s);
  io.number(64, s.heading_rate_rad_s);
  io.number(76, velocity_ft_s.x);
  io.number(80, velocity_ft_s.y);
  io.number(84, velocity_ft_s.z);
  io.number(100, force_ft_s2.x);
  io.number(104, force_ft_s2.y);
  io.number(108, force_ft_s2.z);
  io.number(356 + tanks_bytes, s.unix_time_s);
  io.number(360 + tanks_bytes, s.warp_s);
}

[[nodiscard]] glm::dvec3 metres_of(const WireVector& feet) noexcept {
  return glm::dvec3(feet.x, feet.y, feet.z) * kMetresPerFoot;
}
[[nodiscard]] WireVector feet_of(const glm::dvec3& metres) noexcept {
  const glm::dvec3 feet = metres / kMetresPerFoot;
  return {static_cast<float>(feet.x), static_cast<float>(feet.y), static_cast<float>(feet.z)};
}

/// Returns a fault for the first number that is out of its range. Comparisons are false for NaN.
[[nodiscard]] Fault check_state(const State& s) noexcept {
  Fault fault;
  const auto within = [&fault](const char* field, double value, double lowest, double highest) {
    if (fault || (value >= lowest && value <= highest)) return;
    fault = {.kind = Fault::Kind::field,
             .field = field,
             .value = value,
             .lowest = lowest,
             .highest = highest};
  };
  const auto finite = [&within](const char* field, double value) {
    within(field, value, -kLargest, kLargest);
  };
  within("longitude_rad", s.longitude_rad, -kTurnRad, kTurnRad);
  within("latitude_rad", s.latitude_rad, -kQuarterRad, kQuarterRad);
  within("altitude_m", s.altitude_m, -1e4, physics::limits::kMaxPositionM);
  within("roll_rad", s.roll_rad, -kTurnRad, kTurnRad);
  within("pitch_rad", s.pitch_rad, -kQuarterRad, kQuarterRad);
  within("heading_rad", s.heading_rad, -kTurnRad, kTurnRad);
  finite("roll_rate_rad_s", s.roll_rate_rad_s);
  finite("pitch_rate_rad_s", s.pitch_rate_rad_s);
  finite("heading_rate_rad_s", s.heading_rate_rad_s);
  for (int i = 0; i < 3; ++i) {
    finite("velocity_ned_m_s", s.velocity_ned_m_s[i]);
    finite("pilot_specific_force_m_s2", s.pilot_specific_force_m_s2[i]);
  }
  return fault;
}

}  // namespace

Fault decode(std::span<const std::byte> datagram, State& state) noexcept {
  const auto size = static_cast<double>(datagram.size());
  if (datagram.size() < sizeof(std::uint32_t)) {
    return {.kind = Fault::Kind::too_short, .value = size};
  }
  const BigEndianReader io(datagram);
  std::uint32_t version = 0;
  io.number(0, version);
  if (version == kVersion << 24 || version == kTankVersion << 24) {
    return {.kind = Fault::Kind::byte_order};
  }
  if (version != kVersion && version != kTankVersion) {
    return {.kind = Fault::Kind::version, .value = static_cast<double>(version)};
  }
  const std::size_t bytes = version == kVersion ? kBytes : kTankBytes;
  if (datagram.size() != bytes) {
    return {.kind = Fault::Kind::size, .value = size, .lowest = static_cast<double>(bytes)};
  }
  State read;
  WireVector velocity_ft_s;
  WireVector force_ft_s2;
  layout(io, read, velocity_ft_s, force_ft_s2, bytes - kBytes);
  read.velocity_ned_m_s = metres_of(velocity_ft_s);
  read.pilot_specific_force_m_s2 = metres_of(force_ft_s2);
  const Fault fault = check_state(read);
  if (!fault) state = read;
  return fault;
}

void encode(const State& state, std::span<std::byte, kBytes> datagram) noexcept {
  std::ranges::fill(datagram, std::byte{0});
  const BigEndianWriter io(datagram);
  io.number(0, kVersion);
  WireVector velocity_ft_s = feet_of(state.velocity_ned_m_s);
  WireVector force_ft_s2 = feet_of(state.pilot_specific_force_m_s2);
  layout(io, state, velocity_ft_s, force_ft_s2, 0);
}

glm::dvec3 body_rates_rad_s(const State& state) noexcept {
  const double sin_roll = std::sin(static_cast<double>(state.roll_rad));
  const double cos_roll = std::cos(static_cast<double>(state.roll_rad));
  const double sin_pitch = std::sin(static_cast<double>(state.pitch_rad));
  const double cos_pitch = std::cos(static_cast<double>(state.pitch_rad));
  const double roll_rate = state.roll_rate_rad_s;
  const double pitch_rate = state.pitch_rate_rad_s;
  const double heading_rate = state.heading_rate_rad_s;
  return {roll_rate - heading_rate * sin_pitch,
          pitch_rate * cos_roll + heading_rate * cos_pitch * sin_roll,
          heading_rate * cos_pitch * cos_roll - pitch_rate * sin_roll};
}

std::string_view fault_text(const Fault& fault, std::span<char> buffer) noexcept {
  FixedText out(buffer);
  switch (fault.kind) {
    case Fault::Kind::none:
      out.add("no fault");
      break;
    case Fault::Kind::too_short:
      out.add("{} bytes, must be {} or {}", fault.value, kBytes, kTankBytes);
      break;
    case Fault::Kind::byte_order:
      out.add("the sender's byte order is little endian, must be big endian");
      break;
    case Fault::Kind::version:
      out.add("version {}, must be {} or {}", fault.value, kVersion, kTankVersion);
      break;
    case Fault::Kind::size:
      out.add("{} bytes, version {} has {}", fault.value,
              fault.lowest == static_cast<double>(kTankBytes) ? kTankVersion : kVersion,
              fault.lowest);
      break;
    case Fault::Kind::field:
      out.add("{} is {}", fault.field, fault.value);
      if (fault.highest < kLargest) {
        out.add(", must be {} to {}", fault.lowest, fault.highest);
      } else {
        out.add(", must be finite");
      }
      break;
  }
  return out.text();
}

}  // namespace emit::protocol::net_fdm
