// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/protocol/pixel_codec.hpp"

namespace emit::v1 {
class RecordedFrame;
}

namespace emit::protocol {

/// Puts pixels into a message: compressed by PixelEncoder where that makes them smaller, else as
/// they are, with their CRC-32C.
/// @pre pixels.size_bytes() is at most the size that the encoder was made for
void set_pixels(v1::RecordedFrame& frame, std::span<const float> pixels, PixelEncoder& encoder);

/// Reads the images of a log, the topic `frames`, in file order. Other topics are skipped.
/// Thread: one owner.  Real time: not RT-safe.
class FrameLogReader {
 public:
  /// Opens a log. Errors: those of McapReader::open().
  [[nodiscard]] static physics::Result<FrameLogReader> open(const std::filesystem::path& path);
  FrameLogReader(FrameLogReader&&) noexcept;
  FrameLogReader& operator=(FrameLogReader&&) noexcept;
  ~FrameLogReader();

  /// Moves to the next image. Returns false at the end. Errors: those of McapReader::next(); parse
  /// with file and offset: a message that is no RecordedFrame, a size or compression that the
  /// pixels do not fit, or pixels of another CRC than the message says.
  [[nodiscard]] physics::Result<bool> next();
  /// Returns the message that next() moved to.
  [[nodiscard]] const v1::RecordedFrame& frame() const noexcept;
  /// Returns its pixels, width_px * height_px of them, row by row; valid until the next call.
  [[nodiscard]] std::span<const float> pixels() const noexcept;
  /// Returns a description of the missing tail at the end of a file that was cut off.
  [[nodiscard]] const std::optional<std::string>& truncation() const noexcept;

 private:
  struct Impl;
  explicit FrameLogReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
