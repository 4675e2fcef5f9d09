// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>

namespace emit::scene {

/// Mirror image of a picture: its columns in reverse order, its rows, or both.
enum class PictureMirror : std::uint8_t { none, horizontal, vertical, both };

/// Quantity of a channel's pixels, if nothing else makes drive or counts of them.
enum class PictureQuantity : std::uint8_t { radiance, apparent_temperature, photon_radiance };

/// Shape of the spot that optics make of a point.
enum class SpotKind : std::uint8_t { none, gaussian, airy, file };

/// Optics of a channel's seeker: what an injected image lacks, because it goes past the real ones.
/// Lengths are in pixels of the sensor's image. server/docs/optics.md has the equations.
struct ChannelOptics {
  SpotKind spot = SpotKind::none;
  double sigma_px = 0.0;                 ///< gaussian: standard deviation
  double airy_px = 0.0;                  ///< airy: wavelength times f-number
  double obscuration_frac = 0.0;         ///< airy: diameter of the central obscuration, 0 to 0.9
  std::filesystem::path spot_file = {};  ///< file: EXR with the share of each pixel
  bool vignetting = false;               ///< irradiance falls with the fourth power of the cosine
  [[nodiscard]] bool operator==(const ChannelOptics&) const = default;
};

/// Detector of a channel's seeker. Noise in kelvin is that before a blackbody of `reference_k`.
/// server/docs/optics.md has the equations.
struct ChannelDetector {
  double reference_k = 300.0;
  double netd_k = 0.0;              ///< temporal noise of each pixel, standard deviation
  double photon_frac = 0.0;         ///< share of its variance that grows with radiance
  double row_noise_k = 0.0;         ///< 1/f noise that the pixels of a row share
  double column_noise_k = 0.0;      ///< 1/f noise that the pixels of a column share
  double gain_spread_frac = 0.0;    ///< fixed pattern: standard deviation of the pixels' gains
  double offset_spread_k = 0.0;     ///< fixed pattern: standard deviation of their offsets
  double bad_px_frac = 0.0;         ///< share of pixels that are dead or hot, half each
  std::uint32_t seed = 1;           ///< of the fixed pattern and, with the frame's number, of noise
  double counts_per_w_m2_sr = 0.0;  ///< above 0: frames hold counts in place of radiance
  double counts_offset = 0.0;       ///< counts of radiance 0
  std::uint32_t counts_bits = 14;   ///< counts end at 2^bits - 1
  [[nodiscard]] bool operator==(const ChannelDetector&) const = default;
};

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
  PictureQuantity quantity = PictureQuantity::radiance;
  ChannelOptics optics = {};
  ChannelDetector detector = {};

  /// Returns whether Brown's polynomial has a coefficient other than 0.
  [[nodiscard]] bool has_polynomial() const noexcept {
    return distortion_radial != std::array<double, 3>{} ||
           distortion_tangential != std::array<double, 2>{};
  }
  [[nodiscard]] bool operator==(const ChannelOutput&) const = default;
};

}  // namespace emit::scene
