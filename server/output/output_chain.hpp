// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/protocol/output_geometry.hpp"
#include "emit/scene/scene_desc.hpp"
#include "output/detector.hpp"
#include "output/drive_table.hpp"
#include "output/pixel_gain.hpp"
#include "output/position_map.hpp"
#include "output/spot_filter.hpp"

namespace emit::server {

/// Everything that is done to the picture of a channel after its window: the spot of its optics,
/// mirror and rotation, the distortion map and the shift of a motion simulator in one step of
/// resampling, vignetting, the detector, correction of non-uniformity, and the table from radiance
/// to drive (docs/projector.md, docs/optics.md).
///
/// Thread: one at a time. Real time: apply() is RT-safe.
class OutputChain {
 public:
  /// The image that the picture is a window of.
  struct Origin {
    protocol::ImageSize image;
    scene::PixelRect window_px;
    double focal_px = 0.0;                         ///< focal length of the image; 0: not known
    std::optional<scene::SpectralBand> band = {};  ///< of the radiance; empty: not known
  };
  /// Number of a frame, and its shift.
  struct Moment {
    glm::vec2 shift_px{0.0F};  ///< by which the image moves, right and down, with kOutputShifted
    std::uint64_t frame_number = 0;  ///< noise depends on it, beside its seed
  };
  /// Room around the window from which samples of the image are taken, with a shift and without. A
  /// channel whose picture moves shows the scene at its borders, as far as the image reaches.
  static constexpr std::uint32_t kShiftMarginPx = 16;
  static constexpr std::uint32_t kSampleMarginPx = 1;

  /// Loads the files of the settings. Setup only. Errors: those of PositionMap::read(),
  /// PixelGain::read(), DriveTable::read(), make_spot() and Detector::make(); config, when a
  /// polynomial or the vignetting has no focal length, or a polynomial points nowhere.
  [[nodiscard]] static physics::Result<OutputChain> make(const scene::ChannelOutput& settings,
                                                         const Origin& origin);

  /// Returns the size of the frames.
  [[nodiscard]] const protocol::ImageSize& frame() const noexcept { return frame_; }
  /// Returns what is done, as protocol::OutputSteps.
  [[nodiscard]] std::uint16_t steps() const noexcept { return steps_; }
  /// Returns what the pixels of the frames are.
  [[nodiscard]] protocol::PixelQuantity quantity() const noexcept { return quantity_; }
  /// Returns the part of the image that the frames are made of: the window with its margin.
  [[nodiscard]] const scene::PixelRect& source_px() const noexcept {
    return spot_ ? spot_->reads_px() : source_px_;
  }
  /// Returns how many pixels of a frame show nothing, whatever the shift is.
  [[nodiscard]] std::uint64_t outside_px() const noexcept { return map_ ? map_->outside_px() : 0; }

  /// Returns whether a shift is larger than the room around the window, so that an edge of the
  /// frame shows nothing.
  [[nodiscard]] bool cuts(const Moment& moment) const noexcept;

  /// Writes a frame.
  /// @param image  radiance of the whole image, by row
  /// @param out    the frame, by row
  /// @return how many pixels the drive table, the detector's converter or the table of apparent
  /// temperatures has clamped
  /// @pre out has the size of frame()
  std::uint32_t apply(std::span<const float> image, const Moment& moment,
                      std::span<float> out) noexcept;

 private:
  OutputChain() = default;
  /// Chooses what the pixels are at the end. Errors: config, when there is no band.
  physics::Result<void> choose_quantity(const scene::ChannelOutput& settings, const Origin& origin);
  /// Makes the quantity of a row of radiance. Returns how many pixels are outside its range.
  std::uint32_t convert_line(std::span<float> line) const noexcept;
  /// Writes rows of the window, mirrored and rotated.
  void turn_rows(std::span<const float> image, std::uint32_t first, std::uint32_t end,
                 std::span<float> out) const noexcept;

  protocol::ImageSize frame_;
  std::uint16_t steps_ = 0;
  scene::PixelRect source_px_;  // without the margin of the spot
  // Room around the window in it: to the left and above, to the right and below.
  glm::vec2 room_before_px_{0.0F};
  glm::vec2 room_behind_px_{0.0F};
  std::optional<SpotFilter> spot_;
  // Index in the image of the frame's first pixel, and of its neighbours to the right and below.
  std::ptrdiff_t turn_first_ = 0;
  std::ptrdiff_t turn_right_ = 1;
  std::ptrdiff_t turn_down_ = 0;
  std::optional<PositionMap> map_;      // empty: pixels are copied
  std::vector<float> vignetting_frac_;  // of each pixel, by row; empty: 1
  std::optional<Detector> detector_;
  std::optional<PixelGain> gain_;
  std::optional<DriveTable> table_;
  protocol::PixelQuantity quantity_ = protocol::PixelQuantity::radiance_w_m2_sr;
  std::optional<physics::ApparentTemperature> apparent_;
  float apparent_from_w_m2_sr_ = 0.0F;  // radiances at the ends of its table
  float apparent_to_w_m2_sr_ = 0.0F;
  float photons_per_joule_ = 0.0F;
};

}  // namespace emit::server
