// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <system_error>

#include "emit/physics/error.hpp"

namespace emit::server {

/// A journal that an earlier process left at `file` is renamed to NAME.YYYYMMDDThhmmssZ.EXT, the
/// time of its last change (-2, -3 ... behind it where that exists), so that a restart does not
/// write over the run that crashed. One that holds no frame and no host's word is left to be
/// written over: a daemon that cannot start tries every second. What is no regular file is left. Of
/// a symbolic link the file is renamed that it leads to.
/// @return the new name; empty: nothing was renamed. Errors (io), naming the file: also one that
/// another process is writing, one that cannot be read, and a folder that takes no new name.
/// @param cause  becomes the system's reason where the folder takes no new name; null: not wanted
[[nodiscard]] physics::Result<std::filesystem::path> keep_older_journal(
    const std::filesystem::path& file, std::error_code* cause = nullptr);

}  // namespace emit::server
