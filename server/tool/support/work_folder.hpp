// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fmt/format.h>
#include <stdlib.h>

#include <cerrno>
#include <filesystem>
#include <string>
#include <system_error>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// Work folder for configuration, journal and log, under a name that nothing had before; removed at
/// the end unless it is to be kept. Single thread, setup only.
class WorkFolder {
 public:
  explicit WorkFolder(bool keep) : keep_(keep) {}
  ~WorkFolder() {
    std::error_code ignored;
    if (!keep_ && !path_.empty()) std::filesystem::remove_all(path_, ignored);
  }
  WorkFolder(const WorkFolder&) = delete;
  WorkFolder& operator=(const WorkFolder&) = delete;
  /// Makes `parent`/run-XXXXXX. Errors: io.
  [[nodiscard]] physics::Result<void> create(const std::filesystem::path& parent) {
    std::string name = (parent / "run-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) {
      return physics::make_error(
          physics::ErrorCode::io,
          fmt::format("{}: cannot create the work folder: {}", parent.string(),
                      std::generic_category().message(errno)));
    }
    path_ = name;
    return {};
  }
  void keep() noexcept { keep_ = true; }
  [[nodiscard]] bool kept() const noexcept { return keep_ && !path_.empty(); }
  [[nodiscard]] const std::filesystem::path& path() const noexcept { return path_; }

 private:
  std::filesystem::path path_;
  bool keep_;
};

}  // namespace emit::tool
