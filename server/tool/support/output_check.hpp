// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <filesystem>

#include "emit/physics/error.hpp"

/// Checks of the files that a command will write, made before its long work. A check neither
/// creates nor changes anything, so that an existing result survives a run that fails later.
/// Thread: any. Real time: not RT-safe.
namespace emit::tool {

/// Checks that a file can be written: an existing one is a file that may be written, and a new one
/// has an existing folder that takes files. Errors (io) name the path and the reason.
[[nodiscard]] physics::Result<void> check_output_file(const std::filesystem::path& file);

/// Format of an image that a command writes.
enum class ImageFormat : std::uint8_t { exr, png };

/// Checks that the name of a file does not promise another format than the one that is written. A
/// name without extension promises none, and case does not count. Errors: invalid_argument.
[[nodiscard]] physics::Result<void> check_image_name(const std::filesystem::path& file,
                                                     ImageFormat format);

/// Checks that files can be written into a folder. A folder that does not exist yet is one that a
/// command creates with its parents: the nearest parent that exists is then checked. Errors (io)
/// name the path and the reason.
[[nodiscard]] physics::Result<void> check_output_folder(const std::filesystem::path& folder);

}  // namespace emit::tool
