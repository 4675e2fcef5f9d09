// SPDX-License-Identifier: Apache-2.0
#include "surface/state/file_sink.hpp"

#include <fcntl.h>
#include <isa-l/crc64.h>
#include <unistd.h>

#include <cerrno>
#include <utility>

namespace emit::renderer {

std::uint64_t crc64_xz(std::span<const std::byte> bytes, std::uint64_t before) noexcept {
  return ::crc64_ecma_refl(before, reinterpret_cast<const unsigned char*>(bytes.data()),
                           bytes.size());
}

FileSink::FileSink(const std::filesystem::path& file)
    : fd_(::open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644)),
      error_(fd_ < 0 ? errno : 0) {
  block_.reserve(kBlockBytes);
}

FileSink::~FileSink() {
  if (fd_ >= 0) ::close(fd_);
}

void FileSink::put(const void* data, std::size_t bytes) {
  const auto* from = static_cast<const std::byte*>(data);
  while (bytes > kBlockBytes - block_.size()) {
    const std::size_t part = kBlockBytes - block_.size();
    block_.insert(block_.end(), from, from + part);
    from += part;
    bytes -= part;
    write_block();
  }
  block_.insert(block_.end(), from, from + bytes);
}

std::uint64_t FileSink::checksum() {
  write_block();
  return checksum_;
}

std::error_code FileSink::finish() {
  write_block();
  // The file must be on the disk before its name is: a loss of power would leave half a state.
  if (error_ == 0 && ::fsync(fd_) != 0 && errno != EINVAL) error_ = errno;
  if (fd_ >= 0 && ::close(std::exchange(fd_, -1)) != 0 && error_ == 0) error_ = errno;
  return {error_, std::generic_category()};
}

void FileSink::write_block() {
  checksum_ = crc64_xz(block_, checksum_);
  std::span<const std::byte> left(block_);
  while (!left.empty() && error_ == 0) {
    const ssize_t written = ::write(fd_, left.data(), left.size());
    if (written > 0) {
      left = left.subspan(static_cast<std::size_t>(written));
    } else if (written == 0 || errno != EINTR) {
      error_ = written == 0 ? EIO : errno;
    }
  }
  block_.clear();
}

}  // namespace emit::renderer
