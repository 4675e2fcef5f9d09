// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "telemetry/progress.hpp"

namespace emit::tool {

/// The commands show progress as the daemon's log does.
using server::Progress;

}  // namespace emit::tool
