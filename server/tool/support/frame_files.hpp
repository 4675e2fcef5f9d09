// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "emit/image/exr_image.hpp"
#include "emit/image/false_color.hpp"
#include "emit/image/temperature_table.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

using ApparentTemperature = image::TemperatureTable;

/// Returns the band of a frame's attributes; a rectangle where they do not give the response. The
/// result is empty for a frame without a band, or with one that fails physics::validate().
[[nodiscard]] std::optional<physics::Band> spectral_band(const image::FrameMetadata& metadata);
/// Describes for the user how radiances become kelvins: "band 3-5 um by its response of 12 points".
[[nodiscard]] std::string conversion_text(const physics::Band& band, bool response_known);

/// Planes of one frame on their way to disk; empty planes are left out.
struct FramePlanes {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::span<const float> radiance_w_m2_sr;
  std::span<const float> temperature_k;
  std::span<const float> drive;    ///< command of a projector's emitters, in place of radiance
  std::span<const float> photons;  ///< photon radiance, s-1 m-2 sr-1, in place of radiance
  std::span<const float> counts;   ///< what a detector's converter reads, in place of radiance
  std::span<const float> depth_m;
  std::span<const float> object_id;
  std::span<const float> coverage_frac;
  /// Mask of the pixels: 1 where a pixel arrived, else 0. If it is not empty, the frame is marked
  /// as partial.
  std::span<const float> valid;
  /// Table for frames without temperature. If it is null, it is built from the metadata's band,
  /// which takes about a second. Callers with many frames set it.
  const ApparentTemperature* apparent = nullptr;
  image::FrameMetadata metadata;
  /// Place of the pixels in the sensor's image, if that is larger. A sensor of size 0 means that it
  /// is not known.
  scene::PixelRect window_px;
  std::uint32_t sensor_width_px = 0;
  std::uint32_t sensor_height_px = 0;
  // Steps that the pixels went through after the window (protocol::OutputSteps), and their shift.
  std::uint16_t output_steps = 0;
  float applied_shift_x_px = 0.0F;
  float applied_shift_y_px = 0.0F;
};

/// Returns the unit of a quantity as files and people write it: "W m-2 sr-1", "K", "drive"
/// "counts" or "photons s-1 m-2 sr-1".
[[nodiscard]] std::string_view pixel_unit(protocol::PixelQuantity quantity) noexcept;
/// Returns the plane of a frame that holds a quantity.
[[nodiscard]] std::span<const float>& plane_of(FramePlanes& planes,
                                               protocol::PixelQuantity quantity) noexcept;
/// Returns what protocol::OutputSteps say, for people: "mirror horizontal, rotate 90, shift". The
/// text is empty where nothing was done.
[[nodiscard]] std::string output_text(std::uint16_t output_steps);

/// Quantity that the colours of a picture stand for.
enum class PngQuantity : unsigned char {
  apparent,  ///< temperature of a blackbody of the pixel's radiance in the band, as a sensor sees
  temperature,  ///< temperature of the surface itself, without sky
  radiance,     ///< radiance in the band
};

/// Returns the quantity named "apparent", "temperature" or "radiance". Any other text gives
/// apparent.
[[nodiscard]] PngQuantity png_quantity(std::string_view text) noexcept;

/// Content and colours of a PNG. The limits are those of temperatures; radiance is shown
/// between its 1st and 99th percentile. A colour bar lies beside the picture.
struct PngStyle {
  double min_k = 280.0;
  double max_k = 330.0;
  PngQuantity quantity = PngQuantity::apparent;
};

[[nodiscard]] physics::Result<void> write_frame_exr(const std::filesystem::path& file,
                                                    const FramePlanes& frame);
/// Writes a false-colour PNG. Drive is shown between its 1st and 99th percentile. Apparent
/// temperature falls back to radiance for a frame of no band, and to the frame's temperature where
/// it has no radiance. Errors: invalid_argument (the frame lacks the quantity), io.
[[nodiscard]] physics::Result<void> write_frame_png(const std::filesystem::path& file,
                                                    const FramePlanes& frame,
                                                    const PngStyle& style);
/// Writes frame_NNNNNN.exr and .png into `directory`, numbered by the metadata's frame number.
[[nodiscard]] physics::Result<void> write_frame_files(const std::filesystem::path& directory,
                                                      const FramePlanes& frame,
                                                      const PngStyle& style);

/// Names of the files of several frames that one option names. `{time}` and `{band}` in the name
/// are replaced by the simulated time in s and by the name of the band. Where a run has several
/// times or bands and the name has no such place, "_t<time>" or "_<band>" is added before the
/// extension.
class FrameFileNames {
 public:
  FrameFileNames(std::filesystem::path pattern, bool several_times, bool several_bands)
      : pattern_(std::move(pattern)),
        several_times_(several_times),
        several_bands_(several_bands) {}
  [[nodiscard]] std::filesystem::path file(double time_s, std::string_view band) const;

 private:
  std::filesystem::path pattern_;
  bool several_times_;
  bool several_bands_;
};

/// Creates a folder and its parents. Errors: io.
[[nodiscard]] physics::Result<void> make_directory(const std::filesystem::path& directory);

}  // namespace emit::tool
