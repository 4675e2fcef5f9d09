// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/python_program.hpp"

#include <filesystem>

#include "emit/config/load.hpp"

namespace emit::tool {

physics::Result<std::vector<std::string>> python_program(const std::string& module) {
  const auto package = config::find_data_file("python/emit_client/__init__.py");
  if (!package) return tl::unexpected(package.error());
  const std::string folder = package->parent_path().parent_path().string();
  std::error_code ignored;
  const bool debian = std::filesystem::exists("/usr/bin/python3", ignored);
  return std::vector<std::string>{"/usr/bin/env",
                                  "PYTHONPATH=" + folder,
                                  "PYTHONDONTWRITEBYTECODE=1",
                                  debian ? "/usr/bin/python3" : "python3",
                                  "-m",
                                  module};
}

}  // namespace emit::tool
