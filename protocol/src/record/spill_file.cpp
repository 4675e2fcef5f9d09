// SPDX-License-Identifier: Apache-2.0
#include "spill_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <stdlib.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <system_error>

namespace emit::protocol {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

namespace {

/// Returns the folder of the file that `path` leads to, also through links. It is empty where the
/// file has no folder (a pipe, a file that was removed).
std::filesystem::path real_folder(const std::filesystem::path& path) {
  std::error_code error;
  const auto type = std::filesystem::status(path, error).type();
  if (type != std::filesystem::file_type::regular &&
      type != std::filesystem::file_type::not_found) {
    return {};
  }
  const auto absolute = std::filesystem::absolute(path, error);
  return std::filesystem::weakly_canonical(absolute, error).parent_path();
}

/// Opens a nameless file in the folder. Returns -1 and sets errno where the folder takes none.
int open_nameless(const std::filesystem::path& folder) {
  int fd = ::open(folder.c_str(), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
  if (fd >= 0) return fd;
  // Not every file system supports O_TMPFILE.
  std::string name = (folder / "emit-index-XXXXXX").string();
  fd = ::mkostemp(name.data(), O_CLOEXEC);
  if (fd >= 0 && ::unlink(name.c_str()) != 0) {
    const int error = errno;
    ::close(fd);
    errno = error;
    return -1;
  }
  return fd;
}

}  // namespace

Result<void> SpillFile::open(const std::filesystem::path& beside) {
  block_.reserve(kBlockBytes);
  std::error_code no_temporary;
  const auto temporary = std::filesystem::temp_directory_path(no_temporary);
  std::string refusals;
  for (const auto& folder : {real_folder(beside), temporary}) {
    if (folder.empty()) continue;
    name_ = fmt::format("{}: index in {}", beside.string(), folder.string());
    fd_ = open_nameless(folder);
    if (fd_ >= 0) {
      cause_ = {};
      return {};
    }
    cause_ = std::error_code(errno, std::generic_category());
    refusals += fmt::format("; {}: {}", folder.string(), cause_.message());
  }
  if (no_temporary) refusals += "; temporary folder: " + no_temporary.message();
  return make_error(ErrorCode::io, fmt::format("{}: no folder takes the index of the file{}",
                                               beside.string(), refusals));
}

SpillFile::~SpillFile() {
  if (fd_ >= 0) ::close(fd_);
}

Result<void> SpillFile::failed(const char* action, int error) const {
  return make_error(ErrorCode::io,
                    fmt::format("{}: offset {}: cannot {}: {}", name_, spilled_bytes_, action,
                                std::generic_category().message(error)));
}

Result<void> SpillFile::append(std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    if (block_.size() == kBlockBytes) {
      if (auto spilled = spill(); !spilled) return spilled;
    }
    const auto piece = bytes.first(std::min(bytes.size(), kBlockBytes - block_.size()));
    block_.insert(block_.end(), piece.begin(), piece.end());
    bytes = bytes.subspan(piece.size());
  }
  return {};
}

Result<void> SpillFile::spill() {
  std::span<const std::byte> rest = block_;
  while (!rest.empty()) {
    const ssize_t written = ::write(fd_, rest.data(), rest.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return failed("write", written < 0 ? errno : EIO);
    rest = rest.subspan(static_cast<std::size_t>(written));
  }
  spilled_bytes_ += block_.size();
  block_.clear();
  return {};
}

Result<std::size_t> SpillFile::read(std::uint64_t offset, std::span<std::byte> into) const {
  std::size_t count = 0;
  while (count < into.size() && offset < spilled_bytes_) {
    const auto wanted = std::min<std::uint64_t>(into.size() - count, spilled_bytes_ - offset);
    const ssize_t got = ::pread(fd_, into.data() + count, wanted, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got <= 0) {
      const auto error = failed("read", got < 0 ? errno : EIO);
      return tl::unexpected(error.error());
    }
    count += static_cast<std::size_t>(got);
    offset += static_cast<std::uint64_t>(got);
  }
  if (count < into.size() && offset < size()) {
    const auto piece = std::span(block_).subspan(offset - spilled_bytes_);
    const std::size_t copied = std::min(piece.size(), into.size() - count);
    std::ranges::copy(piece.first(copied), into.begin() + static_cast<std::ptrdiff_t>(count));
    count += copied;
  }
  return count;
}

}  // namespace emit::protocol
