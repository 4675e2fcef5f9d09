// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/protocol/output_geometry.hpp"
#include "emit/scene/channel_output.hpp"

namespace emit::server {

/// Detector that reads radiance with fixed pattern, noise, bad pixels and counts (docs/optics.md
/// eq. 5 to 9). Noise depends on the number of the frame alone.
///
/// Thread: one at a time. Real time: begin_frame() and apply_line() are RT-safe.
class Detector {
 public:
  /// Makes the fixed pattern. Setup only.
  /// Errors: config, when noise is stated in kelvin and the channel has no band, or when a
  /// blackbody of the reference temperature has next to no radiance in it; when there are bad
  /// pixels and no counts.
  [[nodiscard]] static physics::Result<Detector> make(const scene::ChannelDetector& settings,
                                                      const std::optional<physics::Band>& band,
                                                      const protocol::ImageSize& frame);

  /// Finds the drift of the rows and columns in a frame.
  void begin_frame(std::uint64_t frame_number) noexcept;
  /// Replaces radiance by what the detector reads of a row. Returns how many pixels its converter
  /// has clamped.
  std::uint32_t apply_line(std::uint32_t row, std::span<float> line) noexcept;

 private:
  Detector() = default;

  scene::ChannelDetector settings_;
  protocol::ImageSize frame_;
  float reference_w_m2_sr_ = 0.0F;
  float noise_w_m2_sr_ = 0.0F;  ///< temporal, before the reference
  float row_w_m2_sr_ = 0.0F;
  float column_w_m2_sr_ = 0.0F;
  std::vector<float> gain_;  ///< by row; empty: no fixed pattern
  std::vector<float> offset_w_m2_sr_;
  /// A pixel that reads the same whatever it sees.
  struct BadPixel {
    std::uint32_t row = 0;
    std::uint32_t column = 0;
    bool hot = false;
  };
  std::vector<BadPixel> bad_;             ///< by row
  std::vector<std::uint32_t> first_bad_;  ///< by row, and one more: its first entry in bad_
  std::uint64_t frame_number_ = 0;
  std::vector<float> row_drift_w_m2_sr_;
  std::vector<float> column_drift_w_m2_sr_;
  std::vector<float> normals_;  ///< of a row
};

}  // namespace emit::server
