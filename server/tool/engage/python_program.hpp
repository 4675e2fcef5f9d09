// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// Returns the command line that runs a module of the Python package `emit_client`, to which its
/// arguments are appended. Debian's python3 is taken where it exists, because only it sees Debian's
/// packages. Errors: not_found (the package).
[[nodiscard]] physics::Result<std::vector<std::string>> python_program(const std::string& module);

}  // namespace emit::tool
