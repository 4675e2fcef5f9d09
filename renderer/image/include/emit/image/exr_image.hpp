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

/// One float32 plane, row-major, rows down.
struct ExrChannel {
  std::string name;
  std::vector<float> pixels;
};
using ExrAttribute = std::variant<std::string, double, std::int32_t>;

/// Scan-line OpenEXR image of 32-bit float channels, ZIP compressed.
struct ExrImage {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  std::vector<ExrChannel> channels;  ///< names unique; a file read back lists them by name
  std::map<std::string, ExrAttribute> attributes;

  /// nullptr when there is none of that name.
  [[nodiscard]] const ExrChannel* find(std::string_view channel) const noexcept;
  /// Copies the plane in; its size must be width_px * height_px by the time of write_exr().
  void add(std::string channel, std::span<const float> pixels);
};

/// Setup or recorder threads only: allocates and writes files.
/// Errors: invalid_argument (plane of the wrong size, no channel, name used twice), io.
[[nodiscard]] physics::Result<void> write_exr(const std::filesystem::path& file,
                                              const ExrImage& image);
/// Reads half, float and uint channels into float. Errors: not_found, io, parse, unsupported (deep
/// or subsampled images; more than 65536 pixels a side, 2^28 in all or 256 channels); a message
/// names the file. Takes memory only as the file's pixels come.
[[nodiscard]] physics::Result<ExrImage> read_exr(const std::filesystem::path& file);

/// What a frame says about itself. Attribute names: simTimeNs and frameNumber (decimal strings,
/// exact), posePositionX/Y/ZM and poseQuatW/X/Y/Z (world_from_body), bandName, bandLoUm, bandHiUm,
/// units, bandResponse ("rectangle", or "um:frac" pairs separated by blanks).
struct FrameMetadata {
  std::int64_t sim_time_ns = 0;
  std::uint64_t frame_number = 0;
  physics::Pose sensor_pose;
  std::string band_name;
  double band_lo_um = 0.0;  ///< 0 with band_hi_um 0: no single band
  double band_hi_um = 0.0;
  std::string units = "W m-2 sr-1";
  /// Spectral response between the limits; empty: a perfect rectangle; absent: not known (files
  /// that do not say).
  std::optional<std::vector<physics::ResponsePoint>> band_response = std::nullopt;
};
void set_frame_metadata(ExrImage& image, const FrameMetadata& metadata);
/// Error: parse, naming the attribute that is missing or malformed.
[[nodiscard]] physics::Result<FrameMetadata> frame_metadata(const ExrImage& image);

/// Channel names of frames (contract).
inline constexpr char kRadianceChannel[] = "radiance";        ///< W m-2 sr-1 in band
inline constexpr char kTemperatureChannel[] = "temperature";  ///< K; NaN: sky
inline constexpr char kDepthChannel[] = "depth";              ///< m along the boresight; +Inf: sky
inline constexpr char kObjectChannel[] = "object";            ///< id; 0: sky
inline constexpr char kValidChannel[] =
    "valid";  ///< 1, or 0: the pixel never arrived; absent: all did

}  // namespace emit::image
