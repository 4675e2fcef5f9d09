// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/planck.hpp"

namespace emit::image {

/// One channel of an image: a name and float32 pixels, row-major, rows down.
struct ExrChannel {
  std::string name;
  std::vector<float> pixels;
};
/// Value of an attribute in the file's header.
using ExrAttribute = std::variant<std::string, double, std::int32_t>;

/// OpenEXR image of 32-bit float channels, stored in scan lines with ZIP compression.
struct ExrImage {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<ExrChannel> channels;  ///< unique names; read_exr() sorts them by name
  std::map<std::string, ExrAttribute> attributes;

  /// Returns the channel of that name, or nullptr if there is none.
  [[nodiscard]] const ExrChannel* find(std::string_view channel) const noexcept;
  /// Adds a channel with a copy of the pixels. Their number must be width_px * height_px when
  /// write_exr() is called.
  void add(std::string channel, std::span<const float> pixels);
};

/// Writes an image to a file. It allocates and writes files, so only setup and recorder threads may
/// call it.
/// Errors: invalid_argument (a channel of the wrong size, no channel, a name used twice), io.
[[nodiscard]] physics::Result<void> write_exr(const std::filesystem::path& file,
                                              const ExrImage& image);
/// Reads the half, float and uint channels of a file into float. Memory grows with the pixels read,
/// so a small file cannot ask for much.
/// Errors: not_found, io, parse, unsupported (deep or subsampled images; more than 65536 pixels a
/// side, 2^28 pixels in all or 256 channels). The message names the file.
[[nodiscard]] physics::Result<ExrImage> read_exr(const std::filesystem::path& file);

/// Metadata that a frame carries in its file. The attributes are simTimeNs and frameNumber (decimal
/// strings, exact), posePositionX/Y/ZM and poseQuatW/X/Y/Z (world_from_body), bandName, bandLoUm,
/// bandHiUm, units, bandResponse ("rectangle", or "um:frac" pairs separated by blanks) and fovHDeg.
struct FrameMetadata {
  std::int64_t sim_time_ns = 0;
  std::uint64_t frame_number = 0;
  physics::Pose sensor_pose;
  std::string band_name;
  double band_lo_um = 0.0;  ///< both limits are 0 if the image has no single band
  double band_hi_um = 0.0;
  std::string units = "W m-2 sr-1";
  /// Spectral response between the limits. An empty table is a perfect rectangle; no value means
  /// that the file does not say.
  std::optional<std::vector<physics::ResponsePoint>> band_response = std::nullopt;
  /// Horizontal field of view of the whole sensor, rad; no value where it is not known.
  std::optional<double> fov_h_rad = std::nullopt;
};
/// Stores the metadata as attributes of the image.
void set_frame_metadata(ExrImage& image, const FrameMetadata& metadata);
/// Reads the metadata from the attributes of an image. Errors: parse, naming the attribute that is
/// missing or malformed.
[[nodiscard]] physics::Result<FrameMetadata> frame_metadata(const ExrImage& image);

/// Names of the channels of a frame. They are a contract with the readers of the files.
inline constexpr char kRadianceChannel[] = "radiance";        ///< W m-2 sr-1 in the band
inline constexpr char kTemperatureChannel[] = "temperature";  ///< K; NaN in the sky
inline constexpr char kDriveChannel[] = "drive";              ///< command of a projector's emitter
inline constexpr char kCountsChannel[] = "counts";            ///< whole numbers of a detector
inline constexpr char kPhotonsChannel[] = "photons";          ///< s-1 m-2 sr-1 in the band
inline constexpr char kDepthChannel[] = "depth";    ///< m along the boresight; +Inf in the sky
inline constexpr char kObjectChannel[] = "object";  ///< object id; 0 in the sky
/// Share of the pixel that small targets cover, 0..1; optional.
inline constexpr char kCoverageChannel[] = "coverage";
inline constexpr char kValidChannel[] =
    "valid";  ///< 0 if the pixel never arrived, else 1; optional

}  // namespace emit::image
