// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>

/// Constants and small types that packets of both directions share.
namespace emit::protocol::cigi {

/// Version of the interface. A message has one, which its first packet says.
enum class Version : std::uint8_t { v3_3, v4_0 };
/// Byte Swap Magic Number of IG Control and Start Of Frame of version 3.3, in the sender's byte
/// order. Version 4.0 has none: its size word of 24 shows the order.
inline constexpr std::uint16_t kByteSwapMagic = 0x8000;
/// Length of a tick of the time stamps, ns.
inline constexpr std::int64_t kTimestampTickNs = 10'000;

/// Side of the interface that sends a message.
enum class Sender : std::uint8_t { host, ig };
/// Byte order of a sender. A message has one order from its first packet to its last.
enum class ByteOrder : std::uint8_t { little, big };

/// Id and smallest size of a packet in one version.
struct WireForm {
  std::uint16_t id;
  std::uint16_t bytes;  ///< 0: the version has no such packet
};
/// Forms of a packet in both versions.
struct WireForms {
  WireForm v3_3;
  WireForm v4_0;
  /// Returns the form in a version. RT-safe.
  [[nodiscard]] constexpr const WireForm& of(Version version) const noexcept {
    return version == Version::v3_3 ? v3_3 : v4_0;
  }
  /// Returns whether a version has the packet. RT-safe.
  [[nodiscard]] constexpr bool exists(Version version) const noexcept {
    return of(version).bytes > 0;
  }
};

/// Operational mode of the image generator. Only an image generator says `maintenance`.
enum class IgMode : std::uint8_t { standby = 0, operate = 1, debug = 2, maintenance = 3 };

/// Position whose meaning depends on a flag of its packet: geodetic, or an offset in the body frame
/// of an entity (X to the nose, Y to the right, Z down).
struct Place {
  double latitude_deg_or_x_m = 0.0;   ///< north +, -90 to 90; as an offset any finite number
  double longitude_deg_or_y_m = 0.0;  ///< east +, -180 to 180; as an offset any finite number
  double altitude_m_or_z_m = 0.0;     ///< above the reference ellipsoid; as an offset along Z
  bool operator==(const Place&) const = default;
};

/// Returns the ticks of a time stamp for a time. They wrap after 2^32 ticks, about 11.9 hours.
/// RT-safe.
[[nodiscard]] constexpr std::uint32_t timestamp_ticks(std::int64_t time_ns) noexcept {
  const std::int64_t down = time_ns % kTimestampTickNs < 0 ? 1 : 0;  // rounds down below zero too
  return static_cast<std::uint32_t>(static_cast<std::uint64_t>(time_ns / kTimestampTickNs - down) &
                                    0xFFFF'FFFFu);
}

}  // namespace emit::protocol::cigi
