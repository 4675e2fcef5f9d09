// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>

namespace emit::tool {

/// Lines from a terminal or a pipe that let frames go one by one.
/// Thread: one owner.
class StepInput {
 public:
  /// Reads from a file descriptor, which stays the caller's.
  explicit StepInput(int fd) : fd_(fd) {}

  /// Waits for a line. Returns true for the next frame; false for the line `q`, at the end of the
  /// input and when the command is interrupted. A last line without its line end counts.
  [[nodiscard]] bool wait_for_line();

 private:
  int fd_;
  std::string pending_;  // bytes behind the newest line
  bool ended_ = false;
};

}  // namespace emit::tool
