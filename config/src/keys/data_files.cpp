// SPDX-License-Identifier: Apache-2.0
#include "data_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "emit/config/load.hpp"
#include "emit/physics/nearest_name.hpp"

namespace emit::config {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

std::vector<fs::path> data_directories() {
  std::vector<fs::path> out;
  if (const char* folder = std::getenv("EMIT_DATA_DIR"); folder != nullptr && *folder != '\0') {
    out.emplace_back(folder);
  }
  std::error_code code;
  if (const fs::path executable = fs::read_symlink("/proc/self/exe", code); !code) {
    out.push_back((executable.parent_path() / "../share/emit").lexically_normal());
  }
  return out;
}

Result<fs::path> find_data_file(const fs::path& relative) {
  std::string tried;
  for (const fs::path& folder : data_directories()) {
    const fs::path candidate = (folder / relative).lexically_normal();
    std::error_code code;
    if (fs::exists(candidate, code)) {
      return fs::absolute(candidate, code);
    }
    tried += (tried.empty() ? "" : ", ") + candidate.string();
  }
  return make_error(ErrorCode::not_found,
                    fmt::format("'{}' is not among the data files (tried {}; EMIT_DATA_DIR sets "
                                "the folder)",
                                relative.string(), tried));
}

Result<fs::path> resolve_path(std::string_view text, const fs::path& directory) {
  constexpr std::string_view kShare = "share:";
  if (text.substr(0, kShare.size()) == kShare) {
    return find_data_file(fs::path(text.substr(kShare.size())));
  }
  const fs::path given{text};
  if (given.is_absolute()) {
    return given.lexically_normal();
  }
  std::error_code code;
  const fs::path base = directory.empty() ? fs::current_path(code) : directory;
  return (base / given).lexically_normal();
}

std::vector<std::string> shipped_scenarios() {
  std::vector<std::string> names;
  for (const fs::path& folder : data_directories()) {
    std::error_code code;
    for (fs::directory_iterator it(folder / "scenarios", code), end; !code && it != end;
         it.increment(code)) {
      if (it->path().extension() == ".toml") {
        names.push_back(it->path().stem().string());
      }
    }
  }
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());
  return names;
}

Result<fs::path> resolve_scenario(std::string_view name_or_path) {
  const fs::path given{name_or_path};
  std::error_code code;
  if (given.empty()) {
    return make_error(ErrorCode::not_found, "the scenario's name is empty");
  }
  if (fs::is_regular_file(given, code)) {
    return given;
  }
  // A name has no folder, so that "scenes/box" can only be a path that does not exist.
  if (!given.has_parent_path() && given != "." && given != "..") {
    fs::path file = fs::path("scenarios") / given;
    if (file.extension() != ".toml") {
      file += ".toml";
    }
    if (Result<fs::path> found = find_data_file(file)) {
      return found;
    }
  }
  const std::vector<std::string> shipped = shipped_scenarios();
  std::string text = fmt::format("scenario '{}' is neither a file nor shipped{}", name_or_path,
                                 physics::did_you_mean(name_or_path, shipped));
  std::string listed;
  for (const std::string& name : shipped) {
    listed += (listed.empty() ? "" : ", ") + name;
  }
  if (listed.empty()) {
    text += "; no shipped scenarios were found (EMIT_DATA_DIR sets the folder)";
  } else {
    text += " (shipped: " + listed + ")";
  }
  return make_error(ErrorCode::not_found, text);
}

}  // namespace emit::config
