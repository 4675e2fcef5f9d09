// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/commands.hpp"

int main(int argc, char** argv) {
  return emit::tool::run_tool(argc, argv, emit::tool::forwarded_lab_commands());
}
