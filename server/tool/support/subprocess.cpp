// SPDX-License-Identifier: Apache-2.0
#include "tool/support/subprocess.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iterator>
#include <string_view>
#include <system_error>
#include <thread>

#include "tool/support/interrupt.hpp"

extern char** environ;

namespace emit::tool {

using physics::ErrorCode;
using physics::make_error;

physics::Result<Subprocess> Subprocess::start(const std::vector<std::string>& arguments,
                                              const std::filesystem::path& log, int output_fd) {
  std::vector<char*> argv;
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);

  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 2, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&actions, output_fd >= 0 ? output_fd : 2, 1);
  pid_t pid = -1;
  const int error = posix_spawn(&pid, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    return make_error(error == ENOENT ? ErrorCode::not_found : ErrorCode::io,
                      fmt::format("{}: cannot start: {}", arguments.front(), std::strerror(error)));
  }
  return Subprocess(pid);
}

Subprocess::Subprocess(Subprocess&& other) noexcept : pid_(other.pid_), status_(other.status_) {
  other.pid_ = -1;
}

Subprocess::~Subprocess() {
  if (pid_ > 0 && !status_) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
}

std::optional<int> Subprocess::poll() {
  if (status_ || pid_ <= 0) return status_;
  int status = 0;
  if (::waitpid(pid_, &status, WNOHANG) == pid_) {
    status_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  }
  return status_;
}

std::optional<int> Subprocess::wait(std::chrono::milliseconds timeout) {
  const auto end = std::chrono::steady_clock::now() + timeout;
  while (!poll() && std::chrono::steady_clock::now() < end) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return status_;
}

void Subprocess::send_signal(int signal_number) noexcept {
  if (pid_ > 0 && !status_) ::kill(pid_, signal_number);
}

physics::Result<void> run_program(const std::vector<std::string>& arguments,
                                  const std::filesystem::path& log) {
  auto process = Subprocess::start(arguments, log);
  if (!process) return tl::unexpected(std::move(process.error()));
  std::optional<int> status;
  while (!(status = process->wait(std::chrono::milliseconds(200)))) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::internal, "interrupted");
  }
  if (*status != 0) {
    std::ifstream text(log);
    const std::string said{std::istreambuf_iterator<char>(text), std::istreambuf_iterator<char>()};
    return make_error(
        ErrorCode::io,
        fmt::format("{} ended with exit code {}: {}",
                    std::filesystem::path(arguments.front()).filename().string(), *status, said));
  }
  return {};
}

std::optional<std::filesystem::path> find_program(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::string_view rest = path != nullptr ? path : "/usr/bin:/bin";
  while (!rest.empty()) {
    const std::string_view folder = rest.substr(0, rest.find(':'));
    rest.remove_prefix(std::min(folder.size() + 1, rest.size()));
    std::filesystem::path file = std::filesystem::path(folder) / name;
    std::error_code ignored;
    if (!folder.empty() && std::filesystem::is_regular_file(file, ignored) &&
        ::access(file.c_str(), X_OK) == 0) {
      return file;
    }
  }
  return std::nullopt;
}

physics::Result<std::filesystem::path> executable_dir() {
  std::error_code error;
  const auto path = std::filesystem::read_symlink("/proc/self/exe", error);
  if (error) {
    return make_error(ErrorCode::io,
                      "/proc/self/exe: cannot find the executable's folder: " + error.message());
  }
  return path.parent_path();
}

}  // namespace emit::tool
