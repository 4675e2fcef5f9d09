// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/image/png_image.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/geodesy.hpp"

namespace emit::v1 {
class FrameDecision;
}

namespace emit::tool {

/// Severity of an entry of the log panel.
enum class EventLevel : std::uint8_t { info, warning, error };

/// Topic of a file, its message type and the number of its messages.
struct FoxgloveTopic {
  std::string name;
  std::string message;
  std::uint64_t messages = 0;
};

/// Pinhole camera without distortion. The centre of the top left pixel is (0, 0), as in OpenCV.
struct PinholeCamera {
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  double focal_px = 0.0;              ///< positive
  std::array<double, 2> centre_px{};  ///< where the axis meets the image, right and down
};

/// Writes an MCAP file of messages that Foxglove and other viewers know by name. Topics appear with
/// their first message. Every stamp is used as time of the message, of the log and of publishing,
/// and is POSIX ns, not negative. Frames of reference are named by the caller; `world` is
/// east-north-up. Errors of all functions: io.
/// Thread: one owner.  Real time: not RT-safe.
class FoxgloveFile {
 public:
  /// Creates or overwrites a file.
  [[nodiscard]] static physics::Result<FoxgloveFile> create(const std::filesystem::path& path,
                                                            std::string_view software);
  FoxgloveFile(FoxgloveFile&&) noexcept;
  FoxgloveFile& operator=(FoxgloveFile&&) noexcept;
  ~FoxgloveFile();

  /// Writes foxglove.PoseInFrame: a pose in the world frame.
  [[nodiscard]] physics::Result<void> pose(std::string_view topic, std::int64_t stamp_ns,
                                           const physics::Pose& pose);
  /// Writes foxglove.FrameTransform: where a frame stands in the world frame.
  [[nodiscard]] physics::Result<void> transform(std::string_view topic, std::int64_t stamp_ns,
                                                std::string_view child_frame,
                                                const physics::Pose& pose);
  /// Writes foxglove.LocationFix.
  [[nodiscard]] physics::Result<void> location(std::string_view topic, std::int64_t stamp_ns,
                                               std::string_view frame,
                                               const physics::GeoPlace& place);
  /// Writes foxglove.RawImage of encoding 32FC1.
  /// @pre values.size() is a multiple of width_px
  [[nodiscard]] physics::Result<void> image(std::string_view topic, std::int64_t stamp_ns,
                                            std::string_view frame, std::uint32_t width_px,
                                            std::span<const float> values);
  /// Writes foxglove.RawImage of encoding rgb8.
  [[nodiscard]] physics::Result<void> image(std::string_view topic, std::int64_t stamp_ns,
                                            std::string_view frame, const image::RgbImage& picture);
  /// Writes foxglove.CameraCalibration.
  [[nodiscard]] physics::Result<void> calibration(std::string_view topic, std::int64_t stamp_ns,
                                                  std::string_view frame,
                                                  const PinholeCamera& camera);
  /// Writes foxglove.Log.
  [[nodiscard]] physics::Result<void> event(std::string_view topic, std::int64_t stamp_ns,
                                            EventLevel level, std::string_view name,
                                            const std::string& text);
  /// Writes emit.v1.FrameDecision as it is. Plots read its fields by the schema in the file.
  [[nodiscard]] physics::Result<void> frame(std::string_view topic, std::int64_t stamp_ns,
                                            const v1::FrameDecision& decision);

  /// Returns the topics written so far, by name.
  [[nodiscard]] std::vector<FoxgloveTopic> topics() const;
  /// Writes the index and closes the file.
  [[nodiscard]] physics::Result<void> close();

 private:
  struct Impl;
  explicit FoxgloveFile(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::tool
