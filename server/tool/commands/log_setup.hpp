// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

#include "emit/protocol/record/log_outline.hpp"
#include "tool/support/json.hpp"

namespace emit::tool {

/// Returns how much of the daemon's setup a run holds, in words.
[[nodiscard]] std::string setup_text(const protocol::LogRunOutline& run);
/// Returns the setup of a run; null where the journal does not say it.
[[nodiscard]] Json setup_json(const protocol::LogRunOutline& run);

}  // namespace emit::tool
