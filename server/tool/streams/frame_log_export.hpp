// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>

#include "emit/image/exr_image.hpp"
#include "emit/physics/error.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/record/log_outline.hpp"

namespace emit::v1 {
class RecordedFrame;
}

namespace emit::tool {

/// Returns what a picture file says of an image of a log: time, pose, band with its response, unit
/// and field of view.
/// @param header  the frame header that the message holds
[[nodiscard]] image::FrameMetadata recorded_metadata(const v1::RecordedFrame& frame,
                                                     const protocol::FrameHeader& header);

struct FrameExportOptions {
  std::optional<std::int64_t> from_ns{};  ///< first simulation time, ns; absent: the begin
  std::optional<std::int64_t> to_ns{};    ///< last simulation time, ns; absent: the end
  std::optional<std::uint64_t> run_id{};  ///< absent: the only run with images in the range
  /// Called before each image with the number of those written; false stops.
  protocol::LogProgress progress{};
};

struct FrameExportSummary {
  std::uint64_t images = 0;    ///< written
  std::uint64_t compared = 0;  ///< with the journal of the same log
  std::uint64_t differ = 0;
  std::uint64_t first_differing = 0;      ///< frame number; meaningful when differ > 0
  std::optional<std::string> truncation;  ///< of the log
};

/// Writes the images of a log as frame_NNNNNN.exr into an existing folder. Each image has the CRC
/// that its message says, and is compared with the journal where that has the checksum of its
/// channel. Errors: those of the readers; io; invalid_argument (no image in the range, or images of
/// several runs).
[[nodiscard]] physics::Result<FrameExportSummary> export_log_frames(
    const std::filesystem::path& log, const std::filesystem::path& folder,
    const FrameExportOptions& options);

}  // namespace emit::tool
