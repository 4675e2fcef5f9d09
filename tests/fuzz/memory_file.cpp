// SPDX-License-Identifier: Apache-2.0
#include "fuzz/memory_file.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>

namespace emit::fuzz {
namespace {

void check(bool done, const char* what) {
  if (done) return;
  std::perror(what);
  std::exit(1);
}

}  // namespace

MemoryFile::MemoryFile()
    : fd_(::memfd_create("emit_fuzz", MFD_CLOEXEC)), path_("/proc/self/fd/" + std::to_string(fd_)) {
  check(fd_ >= 0, "memfd_create");
}

MemoryFile::~MemoryFile() {
  ::close(fd_);
}

void MemoryFile::put(std::span<const std::byte> bytes) {
  check(::ftruncate(fd_, 0) == 0, "ftruncate");
  const auto size = static_cast<ssize_t>(bytes.size());
  check(::pwrite(fd_, bytes.data(), bytes.size(), 0) == size, "pwrite");
}

const std::filesystem::path& file_of(std::span<const std::byte> bytes) {
  static MemoryFile file;
  file.put(bytes);
  return file.path();
}

}  // namespace emit::fuzz
