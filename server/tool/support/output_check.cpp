// SPDX-License-Identifier: Apache-2.0
#include "tool/support/output_check.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>

namespace emit::tool {
namespace {

namespace fs = std::filesystem;

tl::unexpected<physics::Error> cannot_write(const fs::path& path, const std::string& reason) {
  return physics::make_error(physics::ErrorCode::io,
                             fmt::format("{}: cannot write: {}", path.string(), reason));
}

/// Whether the process may use `path` in this way, by its effective user. Empty: it may.
std::string refusal(const fs::path& path, int mode) {
  if (::faccessat(AT_FDCWD, path.c_str(), mode, AT_EACCESS) == 0) return {};
  return std::generic_category().message(errno);
}

/// Checks that `folder` exists and takes new files. `path` is what the error names.
physics::Result<void> check_takes_files(const fs::path& path, const fs::path& folder) {
  std::error_code error;
  const fs::file_status status = fs::status(folder, error);
  if (status.type() == fs::file_type::not_found) {
    return cannot_write(path, fmt::format("there is no folder {}", folder.string()));
  }
  if (error) return cannot_write(path, fmt::format("{}: {}", folder.string(), error.message()));
  if (!fs::is_directory(status)) {
    return cannot_write(path, fmt::format("{} is not a folder", folder.string()));
  }
  if (const std::string reason = refusal(folder, W_OK | X_OK); !reason.empty()) {
    return cannot_write(path, fmt::format("{}: {}", folder.string(), reason));
  }
  return {};
}

fs::path folder_of(const fs::path& path) {
  return path.has_parent_path() ? path.parent_path() : fs::path(".");
}

}  // namespace

physics::Result<void> check_output_file(const fs::path& file) {
  if (file.empty()) return cannot_write(file, "the name is empty");
  std::error_code error;
  const fs::file_status status = fs::status(file, error);
  if (fs::is_directory(status)) return cannot_write(file, "it is a folder");
  if (fs::exists(status)) {
    if (const std::string reason = refusal(file, W_OK); !reason.empty()) {
      return cannot_write(file, reason);
    }
    return {};
  }
  if (!file.has_filename()) return cannot_write(file, "the name ends with a slash");
  return check_takes_files(file, folder_of(file));
}

physics::Result<void> check_image_name(const fs::path& file, ImageFormat format) {
  const bool exr = format == ImageFormat::exr;
  std::string given = file.extension().string();
  for (char& c : given) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  if (given.empty() || given == (exr ? ".exr" : ".png")) return {};
  return physics::make_error(
      physics::ErrorCode::invalid_argument,
      fmt::format("{}: the name ends with '{}', but {}", file.string(), given,
                  exr ? "an OpenEXR file (.exr) is written; --png FILE.png writes a picture "
                        "beside it"
                      : "a PNG file (.png) is written"));
}

physics::Result<void> check_output_folder(const fs::path& folder) {
  if (folder.empty()) return cannot_write(folder, "the name is empty");
  // A slash at the end does not make another folder.
  fs::path nearest = folder.has_filename() ? folder : folder_of(folder);
  while (true) {
    std::error_code error;
    const fs::file_status status = fs::symlink_status(nearest, error);
    if (status.type() != fs::file_type::not_found) break;
    const fs::path parent = folder_of(nearest);
    if (parent == nearest) break;
    nearest = parent;
  }
  return check_takes_files(folder, nearest);
}

}  // namespace emit::tool
