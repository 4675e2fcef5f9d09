// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <filesystem>
#include <string>

#include "emit/physics/error.hpp"
#include "tool/support/work_folder.hpp"

namespace emit::tool {

/// A film of false-colour pictures as animated WebP or MP4. The program ffmpeg encodes it, from PNG
/// files in a folder that is removed at the end. Thread: one owner. Real time: setup only.
class Film {
 public:
  /// Checks the name (.webp, .mp4) and looks for ffmpeg, so that a long run does not end without a
  /// film. Errors: invalid_argument (another extension), not_found (no ffmpeg), io.
  [[nodiscard]] static physics::Result<void> check(const std::filesystem::path& file);

  /// `rate_hz` pictures a second are shown. @pre rate_hz > 0
  Film(std::filesystem::path file, double rate_hz)
      : file_(std::move(file)), rate_hz_(rate_hz), folder_(false) {}

  /// Makes the folder of the pictures. Errors: io.
  [[nodiscard]] physics::Result<void> begin();
  /// Returns the name under which the caller writes the next picture. All have the same size.
  [[nodiscard]] std::filesystem::path next_picture();
  /// Encodes the pictures and replaces the film's file. Errors: io, with what ffmpeg says.
  [[nodiscard]] physics::Result<void> finish();

 private:
  std::filesystem::path file_;
  double rate_hz_;
  WorkFolder folder_;
  std::size_t pictures_ = 0;
};

}  // namespace emit::tool
