// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <span>
#include <string>

#include "emit/physics/error.hpp"
#include "emit/reference/fit.hpp"

namespace emit::tool {

/// Fitted modes of one material that are written into a library file.
struct LibraryEntry {
  reference::FitResult fit;
  bool foster = true;  ///< otherwise the modes of emit2014
};

/// Returns the text of a material library (TOML) with the modes of the named materials replaced.
/// Everything else, comments included, stays as it is. Errors: not_found, naming a material that
/// the text lacks.
[[nodiscard]] physics::Result<std::string> with_fitted_modes(const std::string& library,
                                                             std::span<const LibraryEntry> entries);

/// Replaces the modes from file to file (they may be one). An empty `library` is the shipped one.
/// Errors: io, not_found.
[[nodiscard]] physics::Result<void> write_library(const std::filesystem::path& library,
                                                  std::span<const LibraryEntry> entries,
                                                  const std::filesystem::path& out);

}  // namespace emit::tool
