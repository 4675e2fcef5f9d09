// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/ext/vector_float2.hpp>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/output_geometry.hpp"

namespace emit::server {

/// The part of an image that pictures are sampled from, within its memory.
struct SampledPart {
  std::size_t first = 0;     ///< index of its first pixel
  std::size_t pitch_px = 0;  ///< pixels from row to row of the image
  protocol::ImageSize size;
};

/// Source position of every pixel of a frame.
///
/// Coordinates here are those of samples: (0, 0) is the centre of the first pixel of the sampled
/// part, x to the right and y down. A frame pixel that shows nothing has NaN.
/// Thread: any after construction. Real time: sample_line() is RT-safe.
class PositionMap {
 public:
  /// Positions in a frame as they are stored and computed, by row. Points are places (px from the
  /// corner) in the picture that is resampled; one outside of it shows nothing.
  struct Source {
    protocol::ImageSize frame;
    std::vector<protocol::ImagePoint> points;
  };
  /// Returns the positions of a picture that is not distorted: the centre of each pixel.
  [[nodiscard]] static Source identity(const protocol::ImageSize& picture);
  /// Reads the channels `x` and `y` of an EXR file. Errors: those of image::read_exr(); config,
  /// when a channel is missing or no pixel shows anything of the picture. They name the file.
  [[nodiscard]] static physics::Result<Source> read(const std::filesystem::path& file,
                                                    const protocol::ImageSize& picture);
  /// Returns the positions of Brown's polynomial about the centre of the picture, with the frame's
  /// size that of the picture. (x, y) is a place of the frame from the centre, in focal lengths,
  /// and r its distance. The source position is
  ///     x (1 + k1 r^2 + k2 r^4 + k3 r^6) + 2 p1 x y + p2 (r^2 + 2 x^2)
  ///     y (1 + k1 r^2 + k2 r^4 + k3 r^6) + p1 (r^2 + 2 y^2) + 2 p2 x y.
  /// Source: D. C. Brown, "Close-range camera calibration", Photogrammetric Engineering 37 (1971);
  /// signs and order as OpenCV has them.
  [[nodiscard]] static Source brown(const protocol::ImageSize& picture, double focal_px,
                                    const std::array<double, 3>& radial,
                                    const std::array<double, 2>& tangential);

  /// Makes a map. `output_steps` says how the picture was mirrored and rotated, `window` is the
  /// size before that, and `window_at` its top left corner in the sampled part, px.
  PositionMap(const Source& source, std::uint16_t output_steps, const protocol::ImageSize& window,
              const protocol::ImagePoint& window_at, const SampledPart& part,
              float outside_w_m2_sr);

  [[nodiscard]] const protocol::ImageSize& frame() const noexcept { return frame_; }
  /// Returns how many pixels of the frame show nothing, whatever the shift is.
  [[nodiscard]] std::uint64_t outside_px() const noexcept { return outside_px_; }

  /// Writes one row of the frame. The image moves by `shift_px`, right and down: the pixel at p
  /// shows the image at p - shift. Values lie bilinearly between the four samples around, in
  /// float32; a position within half a pixel of the part's edge shows the sample at the edge. A
  /// position beyond the edge gets the outside value.
  void sample_line(std::span<const float> image, const glm::vec2& shift_px, std::uint32_t row,
                   std::span<float> line) const noexcept;

 private:
  protocol::ImageSize frame_;
  SampledPart part_;
  float outside_w_m2_sr_ = 0.0F;
  std::uint64_t outside_px_ = 0;
  std::vector<float> x_px_;  // by row
  std::vector<float> y_px_;
};

}  // namespace emit::server
