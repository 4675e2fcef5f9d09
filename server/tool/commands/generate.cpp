// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/scene_options.hpp"

namespace emit::tool {

int run_generate(const GenerateCommand& command) {
  const auto done = generate_scenes(command.scene, command.out, command.set);
  return done ? kExitOk : fail_call(done.error());
}

}  // namespace emit::tool
