// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

namespace emit::test {

/// Folder of its own for each test, removed at the end.
class ScratchFolder {
 public:
  ScratchFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "emitd_test_XXXXXX").string();
    if (::mkdtemp(name.data()) != nullptr) {
      path_ = name;
    }
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }
  [[nodiscard]] std::string file(const std::string& name) const { return (path_ / name).string(); }
  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(file(name)) << text;
    return file(name);
  }
  [[nodiscard]] std::string read(const std::string& name) const {
    std::ifstream in(file(name));
    std::ostringstream out;
    out << in.rdbuf();
    return out.str();
  }

 private:
  std::filesystem::path path_;
};

/// Limits the size of files; called in a child before exec.
inline void limit_files(rlim_t bytes) {
  if (bytes != RLIM_INFINITY) {
    const rlimit limit{bytes, bytes};
    ::setrlimit(RLIMIT_FSIZE, &limit);
  }
}

/// A program of the build, with these arguments. Standard output and error go to files of `folder`;
/// killed at the end if need be.
class ChildProcess {
 public:
  /// Starts the program. With `file_limit_bytes` no file it writes gets longer (RLIMIT_FSIZE), as
  /// on a full disk.
  ChildProcess(const ScratchFolder& folder, std::string program, std::string out_name,
               std::string err_name, std::vector<std::string> arguments, rlim_t file_limit_bytes)
      : folder_(folder), out_name_(std::move(out_name)), err_name_(std::move(err_name)) {
    program.insert(0, EMIT_TEST_BIN_DIR "/");
    std::vector<char*> argv{program.data()};
    for (auto& argument : arguments) {
      argv.push_back(argument.data());
    }
    argv.push_back(nullptr);
    const std::string out = folder.file(out_name_);
    const std::string err = folder.file(err_name_);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(::open(out.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600), 1);
      ::dup2(::open(err.c_str(), O_CREAT | O_TRUNC | O_WRONLY, 0600), 2);
      limit_files(file_limit_bytes);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
  }
  ~ChildProcess() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
  }
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  void signal(int number) const { ::kill(pid_, number); }
  [[nodiscard]] pid_t pid() const { return pid_; }
  [[nodiscard]] std::string out() const { return folder_.read(out_name_); }
  [[nodiscard]] std::string err() const { return folder_.read(err_name_); }
  /// Returns the exit code, 128 + signal, or -1 when it does not end within the limit.
  [[nodiscard]] int wait(std::chrono::seconds limit = std::chrono::seconds(60)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (!ended()) {
      if (std::chrono::steady_clock::now() > end) {
        return -1;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return exit_code_;
  }
  [[nodiscard]] bool ended() {
    int status = 0;
    if (pid_ > 0 && ::waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = -1;
      exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
    }
    return pid_ <= 0;
  }

 private:
  const ScratchFolder& folder_;
  std::string out_name_;
  std::string err_name_;
  pid_t pid_ = -1;
  int exit_code_ = -1;
};

/// A real `emit`, which writes to NAME.out and NAME.err.
class ToolProcess : public ChildProcess {
 public:
  ToolProcess(const ScratchFolder& folder, const std::string& name,
              std::vector<std::string> arguments, rlim_t file_limit_bytes = RLIM_INFINITY)
      : ChildProcess(folder, "emit", name + ".out", name + ".err", std::move(arguments),
                     file_limit_bytes) {}

  /// Waits until standard error holds `text` this often. Returns false when that did not happen
  /// within the limit, or the process ended before.
  [[nodiscard]] bool says(const std::string& text, std::size_t times = 1,
                          std::chrono::seconds limit = std::chrono::seconds(60)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    for (;;) {
      const bool over = ended() || std::chrono::steady_clock::now() > end;
      const std::string all = err();
      std::size_t found = 0;
      for (std::size_t at = all.find(text); at != std::string::npos;
           at = all.find(text, at + text.size())) {
        ++found;
      }
      if (found >= times || over) {
        return found >= times;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  }
};

/// A real emitd, which writes to `stdout` and `stderr`.
class DaemonProcess : public ChildProcess {
 public:
  DaemonProcess(const ScratchFolder& folder, std::vector<std::string> arguments,
                rlim_t file_limit_bytes = RLIM_INFINITY)
      : ChildProcess(folder, "emitd", "stdout", "stderr", std::move(arguments), file_limit_bytes) {}

  /// Waits for the ready line. It returns false when the process ended first.
  [[nodiscard]] bool wait_ready(std::chrono::seconds limit = std::chrono::seconds(60)) {
    const auto end = std::chrono::steady_clock::now() + limit;
    while (std::chrono::steady_clock::now() < end) {
      const std::string said = out();
      const std::size_t line = said.find("ready control=");
      if (line != std::string::npos && said.find('\n', line) != std::string::npos) {
        std::istringstream words(said.substr(line));
        std::string word;
        words >> word >> word;
        control_ = word.substr(word.find('=') + 1);
        words >> word;
        host_udp_ = word.substr(word.find('=') + 1);
        std::string rest;
        std::getline(words, rest);
        if (const auto at = rest.find("metrics="); at != std::string::npos) {
          metrics_ = rest.substr(at + 8);
        }
        return true;
      }
      if (ended()) {
        return false;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return false;
  }
  [[nodiscard]] const std::string& control() const { return control_; }
  [[nodiscard]] const std::string& host_udp() const { return host_udp_; }
  /// Returns the address; empty: it is off.
  [[nodiscard]] const std::string& metrics() const { return metrics_; }

 private:
  std::string control_;
  std::string host_udp_;
  std::string metrics_;
};

/// Configuration of a daemon with canned frames on free ports; `more` is appended.
inline std::string canned_config(std::uint32_t width_px, std::uint32_t height_px,
                                 const std::string& pacing, const std::string& more = {}) {
  std::ostringstream out;
  out << "[source]\nkind = \"canned\"\ncanned_width_px = " << width_px
      << "\ncanned_height_px = " << height_px << "\ncanned_frames = 8\n"
      << "[pacing]\n"
      << pacing << "\n[host]\nudp = \"127.0.0.1:0\"\n"
      << "[control]\ntcp = \"127.0.0.1:0\"\n"
      << more;
  return out.str();
}

}  // namespace emit::test
