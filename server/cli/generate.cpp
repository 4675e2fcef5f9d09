// SPDX-License-Identifier: Apache-2.0
#include "commands.hpp"
#include "console.hpp"
#include "scene_options.hpp"

namespace emit::cli {

int run_generate(const GenerateCommand& command) {
  const auto done = generate_scenes(command.scene, command.out, command.set);
  return done ? kExitOk : fail_call(done.error());
}

}  // namespace emit::cli
