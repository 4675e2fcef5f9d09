// SPDX-License-Identifier: Apache-2.0
#include "app/daemon.hpp"

int main(int argc, char** argv) {
  return emit::server::emitd_main(argc, argv);
}
