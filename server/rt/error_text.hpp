// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

namespace emit::server {

/// Returns the system's text of an errno value. Thread: any. Allocates.
[[nodiscard]] std::string error_text(int error);

}  // namespace emit::server
