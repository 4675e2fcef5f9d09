// SPDX-License-Identifier: Apache-2.0
#include "tool/commands/commands.hpp"

#include <fmt/format.h>

#include <csignal>

#include "emit/version.hpp"
#include "tool/campaign/campaign_command.hpp"
#include "tool/doctor/doctor_command.hpp"
#include "tool/engage/engage_command.hpp"
#include "tool/nature/weather_command.hpp"
#include "tool/offline/explain_command.hpp"
#include "tool/offline/probe_command.hpp"
#include "tool/scenes/scene_command.hpp"

namespace emit::tool {
int run_tool(int argc, char** argv, const LabCommands& lab) {
  // A limit on the size of files then is a write error with a message, as a full disk is.
  std::signal(SIGXFSZ, SIG_IGN);
  Program program("emit",
                  "emit: command-line tool of emitd, the real-time infrared image generator.",
                  fmt::format("emit {} ({})", kVersion, kCommit),
                  "Exit codes: 0 success, 2 bad usage, 78 bad configuration or scenario, 75 the "
                  "device was lost "
                  "(serve), 1 any other failure.\n"
                  "Example: emit demo --out frames");
  CommandLine tool = program.root();
  // The order is that of `emit --help`.
  for (const auto add :
       {add_render,   add_probe,      add_explain, add_solve,     add_inspect,  add_scene,
        add_compare,  add_generate,   add_view,    add_campaign,  add_demo,     add_engage,
        add_serve,    add_receive,    add_stat,    add_send,      add_latency,  add_trigger,
        add_fms_sim,  add_trace,      add_record,  add_replay,    add_log,      add_export,
        add_make_log, add_weather,    add_doctor,  lab.materials, lab.evaluate, lab.fit,
        lab.bench,    lab.completion, lab.man}) {
    add(tool);
  }
  return program.run(argc, argv);
}

}  // namespace emit::tool
