// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>

#include "emit/physics/error.hpp"

namespace emit::image {

/// Limits of what read_exr() accepts: pixels a side, and channels of a part.
inline constexpr std::int64_t kMaxExrSidePx = 65536;
inline constexpr std::int64_t kMaxExrChannels = 256;
/// Largest size of one compressed chunk after decompression, in bytes.
inline constexpr std::int64_t kMaxExrChunkBytes = std::int64_t{1} << 28;

/// Checks the headers of an OpenEXR file before the library reads them, because the library
/// allocates memory for whatever they announce. Nothing may be larger than the file has bytes for,
/// nor exceed the limits above. The check knows only as much of the format as it needs.
/// Errors: io, parse, unsupported. The message does not contain the file's name.
[[nodiscard]] physics::Result<void> check_exr_header(const std::filesystem::path& file);

}  // namespace emit::image
