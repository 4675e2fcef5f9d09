// SPDX-License-Identifier: Apache-2.0
#pragma once

namespace emit::tool {

class CommandLine;

/// Adds `emit explain`.
void add_explain(CommandLine& tool);

}  // namespace emit::tool
