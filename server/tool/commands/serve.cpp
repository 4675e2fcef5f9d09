// SPDX-License-Identifier: Apache-2.0
#include "app/daemon.hpp"
#include "tool/commands/commands.hpp"

namespace emit::tool {
namespace {

/// The daemon reads its own arguments.
int run(int argc, char** argv) {
  return server::emitd_main(argc, argv, "emit serve");
}

}  // namespace

void add_serve(CommandLine& tool) {
  tool.raw_command("serve", "Run the daemon (same as emitd)", run);
}

}  // namespace emit::tool
