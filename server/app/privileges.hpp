// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

#include "emit/physics/error.hpp"

namespace emit::server {

/// Drops every capability of this thread, and with it of all threads it starts. This cannot be
/// undone, and programs that it executes gain none (PR_SET_NO_NEW_PRIVS). A process that may do so
/// first raises its own limits for real-time priority and locked memory, so that agents can still
/// be scheduled ahead of others. Both are limits of this process alone. Returns a line for the log
/// with the old and the remaining capabilities. Errors (internal): the kernel kept some. Call it
/// while the process has one thread. Not RT-safe.
[[nodiscard]] physics::Result<std::string> drop_privileges();

}  // namespace emit::server
