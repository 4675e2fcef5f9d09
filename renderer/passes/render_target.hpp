// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/physics/error.hpp"
#include "gl/objects.hpp"

namespace emit::renderer {

/// Checks that the driver can draw into a framebuffer. `name` says in the error what it is for.
/// Setup only. Errors: gpu.
[[nodiscard]] physics::Result<void> check_complete(const gl::Framebuffer& framebuffer,
                                                   const char* name);

}  // namespace emit::renderer
