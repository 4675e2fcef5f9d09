// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <system_error>

#include "emit/physics/error.hpp"

namespace emit::server {

/// Renames a journal that an earlier process left at `file` to NAME.YYYYMMDDThhmmssZ.EXT, so that a
/// restart does not overwrite the run that crashed. The time is that of its last change; -2, -3 ...
/// follow it where that name exists. A journal without a frame and without a host's message may be
/// overwritten, because a daemon that cannot start tries every second. A file that is not regular
/// is left alone. If `file` is a symbolic link, its target is renamed.
/// @return the new name; empty: nothing was renamed. Errors (io), naming the file: also one that
/// another process is writing, one that cannot be read, and a folder that takes no new name.
/// @param cause  becomes the system's reason where the folder takes no new name; null: not wanted
[[nodiscard]] physics::Result<std::filesystem::path> keep_older_journal(
    const std::filesystem::path& file, std::error_code* cause = nullptr);

}  // namespace emit::server
