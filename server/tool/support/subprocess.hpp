// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <sys/types.h>

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"

namespace emit::tool {

/// A child process whose standard error goes to a file, and its standard output to the same file or
/// to a pipe. Single thread, setup only.
/// The destructor kills and reaps a child that still runs.
class Subprocess {
 public:
  /// Starts a program. `log` receives both output streams; with an `output_fd` of 0 or more,
  /// standard output goes there. Errors: not_found (no such executable), io.
  [[nodiscard]] static physics::Result<Subprocess> start(const std::vector<std::string>& arguments,
                                                         const std::filesystem::path& log,
                                                         int output_fd = -1);
  Subprocess(Subprocess&& other) noexcept;
  Subprocess& operator=(Subprocess&&) = delete;
  Subprocess(const Subprocess&) = delete;
  Subprocess& operator=(const Subprocess&) = delete;
  ~Subprocess();

  /// Returns the exit status once the child has ended: 0..255, or 128 + signal. Does not wait.
  [[nodiscard]] std::optional<int> poll();
  /// Waits at most `timeout`. The result is empty when the child still runs.
  [[nodiscard]] std::optional<int> wait(std::chrono::milliseconds timeout);
  void send_signal(int signal_number) noexcept;
  [[nodiscard]] pid_t pid() const noexcept { return pid_; }

 private:
  explicit Subprocess(pid_t pid) : pid_(pid) {}
  pid_t pid_ = -1;
  std::optional<int> status_;
};

/// Runs a program to its end. `log` receives both output streams. Errors: those of
/// Subprocess::start(); io, naming the program with what it said, when its exit status is not 0;
/// internal, when an InterruptGuard has seen a signal.
[[nodiscard]] physics::Result<void> run_program(const std::vector<std::string>& arguments,
                                                const std::filesystem::path& log);

/// Returns the first program of that name in the folders of PATH; empty if there is none.
[[nodiscard]] std::optional<std::filesystem::path> find_program(const std::string& name);

/// Returns the folder of the running executable. Errors: io.
[[nodiscard]] physics::Result<std::filesystem::path> executable_dir();

}  // namespace emit::tool
