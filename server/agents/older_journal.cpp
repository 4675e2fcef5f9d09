// SPDX-License-Identifier: Apache-2.0
#include "agents/older_journal.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <sys/stat.h>

#include <fcntl.h>
#include <stdio.h>

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

/// False only where it was read to its end: what cannot be read may be somebody's.
bool holds_a_run(const std::filesystem::path& file, std::uint64_t bytes) {
  constexpr std::uint64_t kMostOfNone = 256u << 10;
  if (bytes > kMostOfNone) {
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

}  // namespace

physics::Result<std::filesystem::path> keep_older_journal(const std::filesystem::path& file) {
  struct stat status {};
  const Fd opened(::open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!opened || ::fstat(opened.get(), &status) != 0 || !S_ISREG(status.st_mode)) {
    return std::filesystem::path();
  }
  // Whoever writes a log holds it locked.
  if (::flock(opened.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
    return physics::make_error(physics::ErrorCode::io,
                               file.string() + ": another process writes it");
  }
  if (status.st_size == 0 || !holds_a_run(file, static_cast<std::uint64_t>(status.st_size))) {
    return std::filesystem::path();
  }
  std::tm changed{};
  ::gmtime_r(&status.st_mtime, &changed);
  const std::string stem = file.stem().string();
  constexpr int kMostOfASecond = 1000;
  for (int i = 1; i <= kMostOfASecond; ++i) {
    const std::filesystem::path kept =
        file.parent_path() / fmt::format("{}.{:%Y%m%dT%H%M%S}Z{}{}", stem, changed,
                                         i == 1 ? std::string() : fmt::format("-{}", i),
                                         file.extension().string());
    // Never over another one, as rename() would.
    if (::renameat2(AT_FDCWD, file.c_str(), AT_FDCWD, kept.c_str(), RENAME_NOREPLACE) == 0) {
      return kept;
    }
    if (errno != EEXIST) {
      return physics::make_error(
          physics::ErrorCode::io,
          fmt::format("{}: cannot be kept as {}: {}", file.string(), kept.string(),
                      std::generic_category().message(errno)));
    }
  }
  return physics::make_error(physics::ErrorCode::io,
                             file.string() + ": cannot be kept: all names are taken");
}

}  // namespace emit::server
