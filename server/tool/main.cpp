// SPDX-License-Identifier: Apache-2.0
#include <csignal>

#include "tool/commands/commands.hpp"

int main(int argc, char** argv) {
  // A limit on the size of files then is a write error with a message, as a full disk is.
  std::signal(SIGXFSZ, SIG_IGN);
  return emit::tool::run_tool(argc, argv);
}
