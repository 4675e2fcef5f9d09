// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_session.hpp"

namespace emit::server {

/// Shared keys of a file that others may not read, at least one. Errors (config), naming it.
[[nodiscard]] physics::Result<std::vector<protocol::SessionKey>> read_key_file(
    const std::filesystem::path& file);

}  // namespace emit::server
