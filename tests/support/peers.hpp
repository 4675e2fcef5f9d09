// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "support/emit_process.hpp"

namespace emit::test {

/// Returns the folder to which deploy/scripts/install_deps.sh --with-peers brings programs that
/// Debian does not install.
inline std::filesystem::path peers_folder() {
  const auto of = [](const char* name) {
    const char* value = std::getenv(name);
    return std::string(value != nullptr ? value : "");
  };
  std::filesystem::path folder = of("EMIT_PEERS_DIR");
  if (folder.empty()) {
    const std::string cache = of("XDG_CACHE_HOME");
    folder = (cache.empty() ? std::filesystem::path(of("HOME")) / ".cache"
                            : std::filesystem::path(cache)) /
             "emit/peers";
  }
  return folder;
}

/// Returns the folder of the packages for Node.js that tests read emitd's output with; empty where
/// Node.js or one of them is missing. deploy/scripts/install_deps.sh --with-peers installs them.
inline std::string node_peers(const std::vector<std::string>& packages) {
  const std::filesystem::path folder = peers_folder();
  for (const std::string& package : packages) {
    if (!std::filesystem::exists(folder / "node_modules" / package / "package.json")) return {};
  }
  if (run_process({"node", "--version"}).exit_code != 0) return {};
  return (folder / "node_modules").string();
}

}  // namespace emit::test
