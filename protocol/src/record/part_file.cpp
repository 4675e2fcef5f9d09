// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/part_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace emit::protocol {
namespace {

namespace fs = std::filesystem;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

}  // namespace

Result<PartFile> PartFile::begin(const fs::path& target, std::span<const fs::path> inputs) {
  std::error_code none;  // what does not exist is equivalent to nothing
  for (const fs::path& input : inputs) {
    if (fs::equivalent(target, input, none)) {
      return make_error(ErrorCode::invalid_argument,
                        target.string() + ": is an input, and inputs are not written over");
    }
  }
  fs::path place = target;
  if (fs::is_symlink(fs::symlink_status(target, none))) {
    std::error_code error;
    place = fs::weakly_canonical(target, error);
    if (error) {
      return make_error(ErrorCode::io,
                        fmt::format("{}: cannot write: {}", target.string(), error.message()));
    }
  }
  const fs::file_status status = fs::status(place, none);
  if (fs::exists(status) && !fs::is_regular_file(status)) {
    return make_error(ErrorCode::io,
                      target.string() + ": cannot write: it is there and no regular file");
  }
  fs::path part = place;
  part += fmt::format(".{}.tmp", ::getpid());
  return PartFile(std::move(place), std::move(part));
}

PartFile::PartFile(PartFile&& other) noexcept
    : target_(std::move(other.target_)), part_(std::exchange(other.part_, {})) {}

PartFile::~PartFile() {
  if (part_.empty()) return;
  std::error_code ignored;
  fs::remove(part_, ignored);
}

Result<void> PartFile::commit() {
  const auto failed = [this](int error) {
    return make_error(ErrorCode::io, fmt::format("{}: cannot write: {}", target_.string(),
                                                 std::generic_category().message(error)));
  };
  // The name may reach the disk before the data do; a power cut would then leave an empty file.
  const int fd = ::open(part_.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) return failed(errno);
  const int synced = ::fsync(fd);
  const int error = errno;
  ::close(fd);
  if (synced != 0 && error != EINVAL) return failed(error);
  if (::rename(part_.c_str(), target_.c_str()) != 0) return failed(errno);
  part_.clear();
  return {};
}

}  // namespace emit::protocol
