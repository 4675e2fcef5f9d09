// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <fstream>

#include "tool/support/console.hpp"
#include "client/http_get.hpp"
#include "tool/commands/timing_commands.hpp"

namespace emit::tool {

int run_trace(const TraceCommand& command) {
  constexpr std::int64_t kTimeoutNs = 10'000'000'000;
  std::string url = command.url;
  while (url.ends_with('/')) url.pop_back();
  if (!url.ends_with("/trace")) url += "/trace";
  const auto answer = client::http_get(url, kTimeoutNs);
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

}  // namespace emit::tool
