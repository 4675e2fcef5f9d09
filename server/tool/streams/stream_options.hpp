// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>

#include "emit/client/security.hpp"
#include "emit/protocol/parity.hpp"
#include "tool/command_line/command_line.hpp"

/// Options of the commands that talk to a daemon.
namespace emit::tool {

/// Adds the options --tls-* of every command that connects to a control port.
void add_security(CommandLine& line, client::Security& target);

/// Adds the option --fec K+M: groups of up to K fragments with M of parity, or off.
void add_error_correction(CommandLine& line, protocol::FecParams& target);
void add_error_correction(CommandLine& line, std::optional<protocol::FecParams>& target);

}  // namespace emit::tool
