// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>
#include <string>

#include "emit/client/client.hpp"

namespace emit::client {

/// Reads frames where a daemon on this host writes them (shm://name).
/// Errors: not_found, io (not permitted, its daemon is gone), protocol (no ring of ours).
[[nodiscard]] physics::Result<std::unique_ptr<FrameClient>> open_shm_frame_client(
    const std::string& name);

}  // namespace emit::client
