// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"

int main(int argc, char** argv) {
  return emit::cli::run_tool(argc, argv);
}
