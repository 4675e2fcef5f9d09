// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// A pipe through which a child process hands over lines of text. Single thread.
class LinePipe {
 public:
  /// Errors: io.
  [[nodiscard]] static physics::Result<LinePipe> open();
  /// Makes a named pipe that a program opens for writing as if it were a file, and reads it. The
  /// name must be free. Errors: io, naming the file.
  [[nodiscard]] static physics::Result<LinePipe> open_named(const std::filesystem::path& file);
  LinePipe(LinePipe&& other) noexcept;
  LinePipe& operator=(LinePipe&&) = delete;
  LinePipe(const LinePipe&) = delete;
  LinePipe& operator=(const LinePipe&) = delete;
  ~LinePipe();

  /// Returns the descriptor that the child writes to. It closes on exec, so that only the child
  /// that gets it as standard output keeps it.
  [[nodiscard]] int write_end() const noexcept { return write_fd_; }
  /// Closes this process's copy of the write end. The end of the child then ends the lines.
  void close_write_end() noexcept;

  /// Returns the next whole line without its end; nothing when none came within the timeout. A
  /// timeout of 0 polls. Errors: io (the writer has ended, or a line is longer than 64 KiB).
  [[nodiscard]] physics::Result<std::optional<std::string>> next(std::chrono::milliseconds timeout);

 private:
  LinePipe(int read_fd, int write_fd) : read_fd_(read_fd), write_fd_(write_fd) {}
  int read_fd_;
  int write_fd_;
  std::string text_;  ///< bytes that are not a whole line yet
};

}  // namespace emit::tool
