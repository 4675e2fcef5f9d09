// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

namespace emit::server {

/// Returns the system's text of an errno value. Thread: any. Allocates.
[[nodiscard]] std::string error_text(int error);

/// Returns the text of an errno value of bind() or listen(). Where the address is in use it adds
/// who may hold it and how to find out. Thread: any. Allocates.
[[nodiscard]] std::string bind_error_text(int error);

}  // namespace emit::server
