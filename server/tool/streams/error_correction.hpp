// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

#include "emit/physics/error.hpp"
#include "emit/protocol/parity.hpp"

namespace emit::tool {

/// Parses "K+M" or "off". Errors (invalid_argument) name the limits.
[[nodiscard]] physics::Result<protocol::FecParams> parse_error_correction(const std::string& text);
[[nodiscard]] std::string to_string(const protocol::FecParams& fec);

}  // namespace emit::tool
