// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>

#include "emit/physics/error.hpp"

namespace emit::image {

inline constexpr std::int64_t kMaxExrSidePx = 65536;
inline constexpr std::int64_t kMaxExrChannels = 256;
/// Of one compressed piece, unpacked.
inline constexpr std::int64_t kMaxExrChunkBytes = std::int64_t{1} << 28;

/// Looks over the headers of an OpenEXR file before the library does, which takes memory for
/// whatever they announce: nothing may be larger than the file has bytes for, nor over the limits
/// above. Knows no more of the format than that takes; all else is the library's business.
/// Errors: io, parse, unsupported; without the file's name.
[[nodiscard]] physics::Result<void> check_exr_header(const std::filesystem::path& file);

}  // namespace emit::image
