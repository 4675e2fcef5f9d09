// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

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
  CommandDescription serve;
  serve.name = "serve";
  serve.text = "Run the daemon (same as emitd)";
  serve.footer = fmt::format("Exit codes: {}", server::daemon_exit_codes());
  for (const server::DaemonOption& option : server::daemon_options()) {
    OptionDescription out;
    out.names.emplace_back(option.name);
    out.value = option.value;
    out.takes_value = !option.value.empty();
    out.required = option.required;
    out.repeatable = option.repeatable;
    out.text = option.text;
    if (out.value == "FILE") out.kind = ValueKind::file;
    serve.options.push_back(std::move(out));
  }
  tool.raw_command(serve, run);
}

}  // namespace emit::tool
