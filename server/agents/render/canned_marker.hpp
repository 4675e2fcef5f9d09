// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>

namespace emit::server {

/// An entity that the canned test pattern knows: while a host has it on, the upper left eighth of
/// the image is at kCannedMarkerRadiance. The pixels alone then show when a pose was received.
inline constexpr std::uint32_t kCannedMarkerEntity = 0xFFFFFFFFU;
inline constexpr float kCannedMarkerRadiance = 200.0F;  ///< W m-2 sr-1

}  // namespace emit::server
