// SPDX-License-Identifier: Apache-2.0
#include "agents/recorder/older_journal.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <fcntl.h>
#include <stdio.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <ctime>
#include <string>
#include <system_error>

#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"
#include "rt/fd.hpp"

namespace emit::server {
namespace {

/// Returns false only when the file was read to its end without a run. A file that cannot be read
/// may be somebody's.
bool holds_a_run(const std::filesystem::path& file, std::uint64_t bytes) {
  constexpr std::uint64_t kMaxOfNone = 256u << 10;
  if (bytes > kMaxOfNone) {
    return true;
  }
  auto log = protocol::LogReader::open(file);
  if (!log) {
    return true;
  }
  for (;;) {
    const auto more = log->next();
    if (!more) {
      return true;
    }
    if (!*more) {
      return false;
    }
    if (log->topic() != protocol::LogTopic::journal || !log->journal().has_run_start()) {
      return true;
    }
  }
}

/// Renames a file without replacing another one, as rename() would. Returns 0 or errno.
int rename_to_new(const std::filesystem::path& from, const std::filesystem::path& to) noexcept {
  if (::renameat2(AT_FDCWD, from.c_str(), AT_FDCWD, to.c_str(), RENAME_NOREPLACE) == 0) {
    return 0;
  }
  if (errno != EINVAL && errno != ENOSYS) {
    return errno;
  }
  // Network file systems have no such rename.
  if (::link(from.c_str(), to.c_str()) != 0) {
    return errno;
  }
  // The link is already gone when a network file system asked twice and answers ENOENT.
  if (::unlink(from.c_str()) != 0 && errno != ENOENT) {
    const int error = errno;
    ::unlink(to.c_str());
    return error;
  }
  return 0;
}

}  // namespace

physics::Result<std::filesystem::path> keep_older_journal(const std::filesystem::path& file,
                                                          std::error_code* cause) {
  if (cause != nullptr) *cause = {};
  const auto failure = [&](const std::string& what) {
    return physics::make_error(physics::ErrorCode::io, fmt::format("{}: {}", file.string(), what));
  };
  struct stat status {};
  if (::stat(file.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) {
    return std::filesystem::path();
  }
  const Fd opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!opened || ::fstat(opened.get(), &status) != 0) {
    return errno == ENOENT ? physics::Result<std::filesystem::path>()
                           : failure("an older journal that cannot be read, so not written over: " +
                                     std::generic_category().message(errno));
  }
  // A writer locks its log, and so does a process that is renaming it. Network file systems give a
  // reader no lock but a shared one.
  if (::flock(opened.get(), LOCK_EX | LOCK_NB) != 0 &&
      (errno == EWOULDBLOCK ||
       (errno == EBADF && ::flock(opened.get(), LOCK_SH | LOCK_NB) != 0 && errno == EWOULDBLOCK))) {
    return failure("another process writes it");
  }
  if (status.st_size == 0 || !holds_a_run(file, static_cast<std::uint64_t>(status.st_size))) {
    return std::filesystem::path();
  }
  std::tm changed{};
  ::gmtime_r(&status.st_mtime, &changed);
  // The log itself is renamed, not a link to it: the new one goes where the old one is.
  std::error_code unresolved;
  const std::filesystem::path real = std::filesystem::canonical(file, unresolved);
  struct stat now {};
  if (!unresolved && ::stat(real.c_str(), &now) == 0 &&
      (now.st_dev != status.st_dev || now.st_ino != status.st_ino)) {
    return failure("another process has just begun it");
  }
  if (unresolved) {
    return failure("cannot be kept: " + unresolved.message());
  }
  const std::string stem = real.stem().string();
  constexpr int kMaxOfASecond = 1000;
  for (int i = 1; i <= kMaxOfASecond; ++i) {
    const std::filesystem::path kept =
        real.parent_path() / fmt::format("{}.{:%Y%m%dT%H%M%S}Z{}{}", stem, changed,
                                         i == 1 ? std::string() : fmt::format("-{}", i),
                                         real.extension().string());
    const int error = rename_to_new(real, kept);
    if (error == 0) {
      return kept;
    }
    if (error != EEXIST) {
      if (cause != nullptr) *cause = std::error_code(error, std::generic_category());
      return failure(fmt::format(
          "an older journal that cannot be kept as {}: {}; move it away, or give journal.file a "
          "folder of its own that emitd may write to",
          kept.string(), std::generic_category().message(error)));
    }
  }
  return failure("cannot be kept: all names are taken");
}

}  // namespace emit::server
