// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/image/exr_image.hpp"
#include "emit/protocol/frame_header.hpp"

namespace emit::v1 {
class RecordedFrame;
}

namespace emit::tool {

/// Returns what a picture file says of an image of a log: time, pose, band with its response, unit
/// and field of view.
/// @param header  the frame header that the message holds
[[nodiscard]] image::FrameMetadata metadata_of(const v1::RecordedFrame& frame,
                                               const protocol::FrameHeader& header);

}  // namespace emit::tool
