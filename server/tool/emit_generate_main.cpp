// SPDX-License-Identifier: Apache-2.0
// Build-time stand-alone of `emit generate`: depends on the scene generator alone, so that the
// build makes the scenes again only when the generator changed.
#include <fmt/format.h>

#include "tool/support/scene_options.hpp"

int main(int argc, char** argv) {
  if (argc != 3) {
    fmt::print(stderr, "usage: emit_generate SCENE|all DIRECTORY\n");
    return 2;
  }
  const auto done = emit::tool::generate_scenes(argv[1], argv[2], {});
  if (!done) fmt::print(stderr, "emit_generate: {}\n", done.error().text);
  return done ? 0 : 1;
}
