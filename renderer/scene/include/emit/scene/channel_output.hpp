// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>

namespace emit::scene {

/// Mirror image of a picture: its columns in reverse order, its rows, or both.
enum class PictureMirror : std::uint8_t { none, horizontal, vertical, both };

/// Steps that a channel's picture goes through after its window was cut out, in the order of the
/// members. All are off by default. server/docs/projector.md has the equations.
struct ChannelOutput {
  PictureMirror mirror = PictureMirror::none;
  std::uint32_t rotate_deg = 0;  ///< clockwise, after the mirror: 0, 90, 180 or 270
  /// EXR map of source positions, one for each pixel of the frame; empty: none. It replaces the
  /// polynomial below.
  std::filesystem::path distortion_file = {};
  std::array<double, 3> distortion_radial{};      ///< k1, k2, k3 of Brown's polynomial
  std::array<double, 2> distortion_tangential{};  ///< p1, p2 of the same
  double outside_w_m2_sr = 0.0;                   ///< radiance where the map points nowhere
  bool apply_shift = false;                       ///< the shift of a motion simulator is applied
  std::filesystem::path nuc_file = {};            ///< EXR with gain and offset; empty: none
  std::filesystem::path drive_table_file = {};    ///< CSV: radiance to drive; empty: none

  /// Returns whether Brown's polynomial has a coefficient other than 0.
  [[nodiscard]] bool has_polynomial() const noexcept {
    return distortion_radial != std::array<double, 3>{} ||
           distortion_tangential != std::array<double, 2>{};
  }
  [[nodiscard]] bool operator==(const ChannelOutput&) const = default;
};

}  // namespace emit::scene
