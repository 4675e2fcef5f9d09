// SPDX-License-Identifier: Apache-2.0
#include "net/shm_object.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/protocol/shared_ring.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

constexpr const char* kFolder = "/dev/shm";

std::string path_of(std::string_view name) {
  return fmt::format("{}/emitd-{}", kFolder, name);
}

std::string errno_text(int error) {
  return std::generic_category().message(error);
}

/// Bytes of the object that stand for something when they are locked; what they hold does not
/// matter.
constexpr off_t kMakerByte = 0;   ///< written by a process that lives: write lock
constexpr off_t kReaderByte = 1;  ///< somebody reads: read lock of each

struct flock lock_of(off_t byte, short type) {
  struct flock lock {};
  lock.l_type = type;
  lock.l_whence = SEEK_SET;
  lock.l_start = byte;
  lock.l_len = 1;
  return lock;
}

/// Takes a lock of the open file description, which ends with the last descriptor of its process.
bool take_lock(int fd, off_t byte, short type) {
  struct flock lock = lock_of(byte, type);
  return ::fcntl(fd, F_OFD_SETLK, &lock) == 0;
}

/// Returns whether another file description holds a lock.
bool is_locked(int fd, off_t byte) {
  struct flock lock = lock_of(byte, F_WRLCK);
  return ::fcntl(fd, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

tl::unexpected<physics::Error> name_in_use(const std::string& path) {
  return make_error(ErrorCode::io, path + ": another emitd that runs has this name");
}

/// Takes away what a process that is gone left behind. True: the name may be free now.
physics::Result<void> remove_stale(const std::string& path) {
  const Fd fd(::open(path.c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC));
  if (!fd) {
    if (errno == ENOENT) {
      return {};
    }
    return make_error(ErrorCode::io, fmt::format("{}: {}", path, errno_text(errno)));
  }
  // Whoever holds the lock of the object that bears the name may take the name away; nobody else
  // does, so it cannot change hands in between.
  if (!take_lock(fd.get(), kMakerByte, F_WRLCK)) {
    return name_in_use(path);
  }
  struct stat held {};
  struct stat named {};
  const bool same = ::fstat(fd.get(), &held) == 0 && ::lstat(path.c_str(), &named) == 0 &&
                    held.st_ino == named.st_ino && held.st_dev == named.st_dev;
  if (same && ::unlink(path.c_str()) != 0) {
    return make_error(ErrorCode::io, fmt::format("{}: {}", path, errno_text(errno)));
  }
  return {};
}

}  // namespace

ShmObject::ShmObject(ShmObject&& other) noexcept
    : fd_(std::move(other.fd_)),
      memory_(std::exchange(other.memory_, nullptr)),
      size_(std::exchange(other.size_, 0)),
      path_(std::exchange(other.path_, {})) {}

ShmObject& ShmObject::operator=(ShmObject&& other) noexcept {
  std::swap(fd_, other.fd_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  std::swap(path_, other.path_);
  return *this;
}

ShmObject::~ShmObject() {
  if (!path_.empty()) {
    ::unlink(path_.c_str());
  }
  if (memory_ != nullptr) {
    ::munmap(memory_, size_);
  }
}

physics::Result<void> ShmObject::map(std::uint64_t bytes, int protection) {
  // Populated: no page fault falls into a frame.
  void* memory = ::mmap(nullptr, static_cast<std::size_t>(bytes), protection,
                        MAP_SHARED | MAP_POPULATE, fd_.get(), 0);
  if (memory == MAP_FAILED) {
    return make_error(ErrorCode::io, fmt::format("mapping {} bytes: {}", bytes, errno_text(errno)));
  }
  memory_ = static_cast<std::byte*>(memory);
  size_ = static_cast<std::size_t>(bytes);
  return {};
}

physics::Result<ShmObject> ShmObject::create(std::uint64_t bytes, std::uint32_t mode) {
  ShmObject out;
  out.fd_ = Fd(::open(kFolder, O_TMPFILE | O_RDWR | O_CLOEXEC, 0600));
  if (!out.fd_) {
    return make_error(ErrorCode::io, fmt::format("{}: {}", kFolder, errno_text(errno)));
  }
  if (const int error = ::posix_fallocate(out.fd_.get(), 0, static_cast<off_t>(bytes));
      error != 0) {
    return make_error(ErrorCode::io,
                      fmt::format("{}: {} bytes: {}", kFolder, bytes, errno_text(error)));
  }
  if (!take_lock(out.fd_.get(), kMakerByte, F_WRLCK) ||
      ::fchmod(out.fd_.get(), static_cast<mode_t>(mode)) != 0) {
    return make_error(ErrorCode::io, fmt::format("{}: {}", kFolder, errno_text(errno)));
  }
  if (auto mapped = out.map(bytes, PROT_READ | PROT_WRITE); !mapped) {
    return tl::unexpected<physics::Error>(std::move(mapped.error()));
  }
  return out;
}

physics::Result<void> ShmObject::publish(std::string_view name) {
  EMIT_CHECK(protocol::is_shm_name(name));
  const std::string path = path_of(name);
  const std::string self = fmt::format("/proc/self/fd/{}", fd_.get());
  // Others may come and go under the same name meanwhile.
  constexpr int kAttempts = 16;
  for (int i = 0; i < kAttempts; ++i) {
    if (::linkat(AT_FDCWD, self.c_str(), AT_FDCWD, path.c_str(), AT_SYMLINK_FOLLOW) == 0) {
      path_ = path;
      return {};
    }
    if (errno != EEXIST) {
      return make_error(ErrorCode::io, fmt::format("{}: {}", path, errno_text(errno)));
    }
    if (auto removed = remove_stale(path); !removed) {
      return removed;
    }
  }
  return name_in_use(path);
}

physics::Result<ShmObject> ShmObject::open(std::string_view name) {
  EMIT_CHECK(protocol::is_shm_name(name));
  const std::string path = path_of(name);
  ShmObject out;
  out.fd_ = Fd(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  if (!out.fd_) {
    return errno == ENOENT
               ? make_error(
                     ErrorCode::not_found,
                     fmt::format("{}: no emitd on this host has stream.shm = \"{}\"", path, name))
               : make_error(ErrorCode::io, fmt::format("{}: {}", path, errno_text(errno)));
  }
  struct stat status {};
  if (::fstat(out.fd_.get(), &status) != 0 || !S_ISREG(status.st_mode) || status.st_size <= 0) {
    return make_error(ErrorCode::io, path + ": not shared memory");
  }
  if (!out.alive()) {
    return make_error(ErrorCode::io, path + ": left behind by an emitd that is gone");
  }
  // The maker writes from here on.
  if (!take_lock(out.fd_.get(), kReaderByte, F_RDLCK)) {
    return make_error(ErrorCode::io, fmt::format("{}: {}", path, errno_text(errno)));
  }
  if (auto mapped = out.map(static_cast<std::uint64_t>(status.st_size), PROT_READ); !mapped) {
    return tl::unexpected<physics::Error>(std::move(mapped.error()).with_context(path));
  }
  return out;
}

bool ShmObject::alive() const noexcept {
  return is_locked(fd_.get(), kMakerByte);
}

bool ShmObject::has_readers() const noexcept {
  EMIT_DCHECK((::fcntl(fd_.get(), F_GETFL) & O_ACCMODE) == O_RDWR);
  return is_locked(fd_.get(), kReaderByte);
}

physics::Result<void> check_shm_name_free(std::string_view name) {
  const std::string path = path_of(name);
  const Fd fd(::open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_CLOEXEC));
  if (fd && is_locked(fd.get(), kMakerByte)) {
    return name_in_use(path);
  }
  return {};
}

}  // namespace emit::server
