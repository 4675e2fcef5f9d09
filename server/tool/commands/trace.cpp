// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <fstream>

#include "client/http_get.hpp"
#include "tool/command_line/command_line.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

struct TraceOptions {
  std::string url;
  std::filesystem::path out;
};

int run(const TraceOptions& command) {
  constexpr std::int64_t kTraceTimeoutNs = 10'000'000'000;
  std::string url = command.url;
  while (url.ends_with('/')) url.pop_back();
  if (!url.ends_with("/trace")) url += "/trace";
  const auto answer = client::http_get(url, kTraceTimeoutNs);
  if (!answer) return fail_call(answer.error());
  if (answer->status != 200) {
    return fail(kExitFailure, fmt::format("{}: answer {}", url, answer->status));
  }
  std::ofstream file(command.out, std::ios::binary);
  file << answer->body;
  file.close();
  if (!file) return fail(kExitFailure, fmt::format("{}: cannot write", command.out.string()));
  fmt::print("{}: open it in https://ui.perfetto.dev or chrome://tracing\n", command.out.string());
  return kExitOk;
}

void add_options(CommandLine& line, TraceOptions& options) {
  line.option("url", options.url, "http://host:port of metrics.listen").required().type_name("URL");
  line.output_file("--out", options.out, "JSON file to write").required();
}

}  // namespace

void add_trace(CommandLine& tool) {
  tool.command<TraceOptions>(
      {.name = "trace",
       .text = "Stages of the frames sent last, as a Chrome trace for Perfetto or chrome://tracing",
       .example = "emit trace http://127.0.0.1:7002 --out trace.json"},
      add_options, run);
}

}  // namespace emit::tool
