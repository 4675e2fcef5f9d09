// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <optional>
#include <span>

#include "emit/physics/error.hpp"
#include "emit/protocol/output_geometry.hpp"
#include "emit/scene/scene_desc.hpp"
#include "output/drive_table.hpp"
#include "output/pixel_gain.hpp"
#include "output/position_map.hpp"

namespace emit::server {

/// Everything that is done to the picture of a channel after its window: mirror and rotation, the
/// distortion map and the shift of a motion simulator in one step of resampling, correction of
/// non-uniformity, and the table from radiance to drive (docs/projector.md).
///
/// Thread: any after construction. Real time: apply() is RT-safe.
class OutputChain {
 public:
  /// The image that the picture is a window of.
  struct Origin {
    protocol::ImageSize image;
    scene::PixelRect window_px;
    double focal_px = 0.0;  ///< focal length of the image; 0: not known
  };
  /// Room around the window from which samples of the image are taken, with a shift and without. A
  /// channel whose picture moves shows the scene at its borders, as far as the image reaches.
  static constexpr std::uint32_t kShiftMarginPx = 16;
  static constexpr std::uint32_t kSampleMarginPx = 1;

  /// Loads the files of the settings. Setup only. Errors: those of PositionMap::read(),
  /// PixelGain::read() and DriveTable::read(); config, when a polynomial has no focal length or
  /// points nowhere.
  [[nodiscard]] static physics::Result<OutputChain> make(const scene::ChannelOutput& settings,
                                                         const Origin& origin);

  /// Returns the size of the frames.
  [[nodiscard]] const protocol::ImageSize& frame() const noexcept { return frame_; }
  /// Returns what is done, as protocol::OutputSteps.
  [[nodiscard]] std::uint8_t steps() const noexcept { return steps_; }
  /// Returns the part of the image that the frames are made of: the window with its margin.
  [[nodiscard]] const scene::PixelRect& source_px() const noexcept { return source_px_; }
  /// Returns how many pixels of a frame show nothing, whatever the shift is.
  [[nodiscard]] std::uint64_t outside_px() const noexcept { return map_ ? map_->outside_px() : 0; }

  /// Writes a frame.
  /// @param image     radiance of the whole image, by row
  /// @param shift_px  by which the image moves, right and down; used with kOutputShifted alone
  /// @param out       the frame, by row
  /// @return how many pixels the drive table has clamped
  /// @pre out has the size of frame()
  std::uint32_t apply(std::span<const float> image, const glm::vec2& shift_px,
                      std::span<float> out) const noexcept;

 private:
  OutputChain() = default;
  /// Writes rows of the window, mirrored and rotated.
  void turn_rows(std::span<const float> image, std::uint32_t first, std::uint32_t end,
                 std::span<float> out) const noexcept;

  protocol::ImageSize frame_;
  std::uint8_t steps_ = 0;
  scene::PixelRect source_px_;
  // Index in the image of the frame's first pixel, and of its neighbours to the right and below.
  std::ptrdiff_t turn_first_ = 0;
  std::ptrdiff_t turn_right_ = 1;
  std::ptrdiff_t turn_down_ = 0;
  std::optional<PositionMap> map_;  // empty: pixels are copied
  std::optional<PixelGain> gain_;
  std::optional<DriveTable> table_;
};

}  // namespace emit::server
