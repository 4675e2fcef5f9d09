// SPDX-License-Identifier: Apache-2.0
#include "app/daemon.hpp"
#include "tool/commands/commands.hpp"

namespace emit::tool {

int run_serve(int argc, char** argv) {
  return server::emitd_main(argc, argv, "emit serve");
}

}  // namespace emit::tool
