// SPDX-License-Identifier: Apache-2.0
#include "axes/axes_memory.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>

#include "rt/error_text.hpp"
#include "rt/fd.hpp"

namespace emit::server {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Permission bits of a file that is made; the umask takes some away.
constexpr mode_t kFileMode = 0666;

tl::unexpected<physics::Error> refused(const config::MemoryPlace& place, int error) {
  return make_error(ErrorCode::io, fmt::format("{}: {}", place.file.string(), error_text(error)));
}

}  // namespace

AxesMemory::~AxesMemory() {
  if (mapped_ != nullptr) ::munmap(mapped_, mapped_bytes_);
}

physics::Result<AxesMemory> AxesMemory::open(const config::MemoryPlace& place) {
  const Fd fd(::open(place.file.c_str(), O_RDWR | O_CLOEXEC));
  if (!fd) return refused(place, errno);
  return map(fd.get(), place);
}

physics::Result<AxesMemory> AxesMemory::open_or_make(const config::MemoryPlace& place) {
  const Fd fd(::open(place.file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, kFileMode));
  if (!fd) return errno == EEXIST ? open(place) : refused(place, errno);
  const std::uint64_t bytes = place.offset_bytes + protocol::kAxesMemoryBytes;
  if (const int error = ::posix_fallocate(fd.get(), 0, static_cast<off_t>(bytes)); error != 0) {
    ::unlink(place.file.c_str());
    return refused(place, error);
  }
  return map(fd.get(), place);
}

physics::Result<AxesMemory> AxesMemory::map(int fd, const config::MemoryPlace& place) {
  struct stat status {};
  if (::fstat(fd, &status) != 0) return refused(place, errno);
  const std::uint64_t end = place.offset_bytes + protocol::kAxesMemoryBytes;
  // A device does not tell its size here: the kernel refuses to map what it does not have.
  if (S_ISREG(status.st_mode) && static_cast<std::uint64_t>(status.st_size) < end) {
    return make_error(
        ErrorCode::io,
        fmt::format("{}: the file has {} bytes, and the axes need {} (offset {}, blocks of {})",
                    place.file.string(), status.st_size, end, place.offset_bytes,
                    protocol::kAxesMemoryBytes));
  }
  const auto page = static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  const std::uint64_t first = place.offset_bytes / page * page;
  const auto bytes = static_cast<std::size_t>(end - first);
  // Populated: no page fault falls into a command.
  void* mapped = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_POPULATE, fd,
                        static_cast<off_t>(first));
  if (mapped == MAP_FAILED) return refused(place, errno);
  auto* const blocks = reinterpret_cast<std::uint64_t*>(static_cast<std::byte*>(mapped) +
                                                        (place.offset_bytes - first));
  return AxesMemory(mapped, bytes, blocks);
}

}  // namespace emit::server
