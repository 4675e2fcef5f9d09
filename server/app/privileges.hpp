// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

#include "emit/physics/error.hpp"

namespace emit::server {

/// Gives up every capability of this thread, and with it of all threads it starts, for good: nor
/// may a program that it executes gain any (PR_SET_NO_NEW_PRIVS). Beforehand a process that may do
/// so raises its own limits for real-time priority and locked memory, so that agents can still be
/// scheduled ahead of others; both are limits of this process alone.
/// Returns a line for the log: what there was, what is kept. Errors (internal): the kernel kept
/// something. Call it while the process has one thread. Not RT-safe.
[[nodiscard]] physics::Result<std::string> drop_privileges();

}  // namespace emit::server
