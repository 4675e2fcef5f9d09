// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/line_pipe.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;

physics::Result<LinePipe> LinePipe::open() {
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) {
    return make_error(ErrorCode::io, fmt::format("cannot make a pipe: {}", std::strerror(errno)));
  }
  return LinePipe(ends[0], ends[1]);
}

physics::Result<LinePipe> LinePipe::open_named(const std::filesystem::path& file) {
  const auto fault = [&file] {
    return make_error(ErrorCode::io, fmt::format("{}: {}", file.string(), std::strerror(errno)));
  };
  if (::mkfifo(file.c_str(), 0600) != 0) return fault();
  // A reader that does not wait for a writer can be opened first. With a writer of its own, the
  // pipe does not end before the program has opened it.
  const int read_fd = ::open(file.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC);
  if (read_fd < 0) return fault();
  const int write_fd = ::open(file.c_str(), O_WRONLY | O_CLOEXEC);
  if (write_fd < 0) {
    const auto error = fault();
    ::close(read_fd);
    return error;
  }
  return LinePipe(read_fd, write_fd);
}

LinePipe::LinePipe(LinePipe&& other) noexcept
    : read_fd_(std::exchange(other.read_fd_, -1)),
      write_fd_(std::exchange(other.write_fd_, -1)),
      text_(std::move(other.text_)) {}

LinePipe::~LinePipe() {
  close_write_end();
  if (read_fd_ >= 0) ::close(read_fd_);
}

void LinePipe::close_write_end() noexcept {
  if (write_fd_ >= 0) ::close(std::exchange(write_fd_, -1));
}

physics::Result<std::optional<std::string>> LinePipe::next(std::chrono::milliseconds timeout) {
  constexpr std::size_t kMaxLineBytes = 65536;
  const auto end = std::chrono::steady_clock::now() + timeout;
  while (true) {
    if (const std::size_t stop = text_.find('\n'); stop != std::string::npos) {
      std::string line = text_.substr(0, stop);
      text_.erase(0, stop + 1);
      return line;
    }
    if (text_.size() > kMaxLineBytes) {
      return make_error(ErrorCode::io, "a line is longer than 64 KiB");
    }
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        end - std::chrono::steady_clock::now() + std::chrono::microseconds(999));
    pollfd ready{read_fd_, POLLIN, 0};
    const int count = ::poll(&ready, 1, static_cast<int>(std::max<std::int64_t>(left.count(), 0)));
    if (count == 0) return std::optional<std::string>();
    if (count < 0) {
      // A signal is looked at by the caller, who sees that no line came.
      if (errno == EINTR) return std::optional<std::string>();
      return make_error(ErrorCode::io, fmt::format("cannot wait: {}", std::strerror(errno)));
    }
    std::array<char, 4096> space;
    const ssize_t size = ::read(read_fd_, space.data(), space.size());
    if (size == 0) return make_error(ErrorCode::io, "the program has ended");
    if (size < 0) {
      if (errno == EINTR || errno == EAGAIN) continue;
      return make_error(ErrorCode::io, fmt::format("cannot read: {}", std::strerror(errno)));
    }
    text_.append(space.data(), static_cast<std::size_t>(size));
  }
}

}  // namespace emit::tool
