// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/output_geometry.hpp"

namespace emit::server {

/// Gain and offset of every pixel of a frame, which make the emitters of a projector alike.
///
/// Thread: any after construction. Real time: apply_line() is RT-safe.
class PixelGain {
 public:
  /// Reads the channels `gain` (0 or more) and `offset` (W m-2 sr-1) of an EXR file with the size
  /// of the frame. Errors: those of image::read_exr(); config, when a channel is missing, the size
  /// is another one, or a value is out of range. They name the file.
  [[nodiscard]] static physics::Result<PixelGain> read(const std::filesystem::path& file,
                                                       const protocol::ImageSize& frame);

  /// Replaces each value L of a row by gain L + offset, in float32.
  void apply_line(std::uint32_t row, std::span<float> line) const noexcept;

 private:
  PixelGain() = default;
  std::vector<float> gain_;  // by row
  std::vector<float> offset_w_m2_sr_;
};

}  // namespace emit::server
