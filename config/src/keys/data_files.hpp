// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <string_view>

#include "emit/physics/error.hpp"

namespace emit::config {

/// Absolute, normalised path. Relative ones start at `directory`; `share:x` is x in the data
/// folders (errors: not_found).
[[nodiscard]] physics::Result<std::filesystem::path> resolve_path(
    std::string_view text, const std::filesystem::path& directory);

}  // namespace emit::config
