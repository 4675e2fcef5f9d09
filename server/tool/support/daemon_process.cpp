// SPDX-License-Identifier: Apache-2.0
#include "tool/support/daemon_process.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <deque>
#include <fstream>
#include <optional>
#include <sstream>
#include <thread>

#include "emit/config/load.hpp"
#include "tool/support/console.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Returns the word after "key=" in a line; empty when the key is not there.
std::string value_of(const std::string& line, const std::string& key) {
  const std::size_t at = line.find(key);
  if (at == std::string::npos) return "";
  const std::size_t from = at + key.size();
  return line.substr(from, line.find_first_of(" \t\r\n\"", from) - from);
}

/// State of a daemon's start as its log says it.
struct StartState {
  std::optional<std::string> ready_line;
  std::uint64_t warm_up_percent = 0;
};

StartState start_state(const std::filesystem::path& log) {
  std::ifstream file(log);
  std::string line;
  StartState out;
  while (std::getline(file, line)) {
    // The last line may still be incomplete: without its newline getline() hits the end of file.
    if (file.eof()) break;
    if (line.find("ready control=") != std::string::npos) {
      out.ready_line = line;
      break;
    }
    if (const std::string percent = value_of(line, "event=warm_up done_percent=");
        !percent.empty()) {
      out.warm_up_percent = std::strtoull(percent.c_str(), nullptr, 10);
    }
  }
  return out;
}

}  // namespace

physics::Result<DaemonProcess> DaemonProcess::start(const config::DaemonConfig& config,
                                                    const std::vector<std::string>& set,
                                                    const std::filesystem::path& directory,
                                                    std::chrono::milliseconds timeout) {
  const auto bin = executable_dir();
  if (!bin) return tl::unexpected(bin.error());
  const auto config_file = directory / "emitd.toml";
  std::ofstream file(config_file);
  file << config::print_daemon(config);
  file.close();
  if (!file) {
    return make_error(ErrorCode::io, fmt::format("{}: cannot write", config_file.string()));
  }
  const auto log = directory / "emitd.log";
  std::vector<std::string> arguments{(*bin / "emitd").string(), "--config", config_file.string()};
  for (const std::string& entry : set) {
    arguments.emplace_back("--set");
    arguments.push_back(entry);
  }
  auto process = Subprocess::start(arguments, log);
  if (!process) return tl::unexpected(process.error());

  DaemonProcess daemon(std::move(*process), log);
  const auto end = std::chrono::steady_clock::now() + timeout;
  Progress progress("warm-up of emitd", 100);
  while (true) {
    const StartState state = start_state(log);
    if (state.ready_line) {
      daemon.control_ = value_of(*state.ready_line, "control=");
      daemon.host_udp_ = value_of(*state.ready_line, "host_udp=");
      return daemon;
    }
    if (state.warm_up_percent > 0) progress.advance_to(state.warm_up_percent);
    if (const auto status = daemon.process_.poll()) {
      return make_error(
          *status == kExitConfig ? ErrorCode::config : ErrorCode::io,
          fmt::format("emitd ended with exit code {}:\n{}", *status, daemon.log_tail()));
    }
    if (std::chrono::steady_clock::now() > end) {
      return make_error(ErrorCode::io, fmt::format("emitd was not ready within {} s:\n{}",
                                                   timeout.count() / 1000, daemon.log_tail()));
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

physics::Result<void> DaemonProcess::check_alive() {
  if (const auto status = process_.poll()) {
    return make_error(ErrorCode::io,
                      fmt::format("emitd ended early with exit code {}:\n{}", *status, log_tail()));
  }
  return {};
}

double DaemonProcess::cpu_seconds() const {
  std::ifstream file(fmt::format("/proc/{}/stat", process_.pid()));
  std::string text;
  std::getline(file, text);
  // The second field is the name in parentheses and may hold blanks; utime and stime are 14 and 15.
  const std::size_t close = text.rfind(')');
  if (close == std::string::npos) return 0.0;
  std::istringstream fields(text.substr(close + 1));
  std::string skipped;
  for (int field = 3; field < 14; ++field) fields >> skipped;
  double user_ticks = 0.0;
  double system_ticks = 0.0;
  fields >> user_ticks >> system_ticks;
  return (user_ticks + system_ticks) / static_cast<double>(::sysconf(_SC_CLK_TCK));
}

physics::Result<void> DaemonProcess::stop(std::chrono::milliseconds timeout) {
  process_.send_signal(SIGTERM);
  const auto status = process_.wait(timeout);
  if (!status) {
    return make_error(ErrorCode::io, fmt::format("emitd did not end within {} s of SIGTERM:\n{}",
                                                 timeout.count() / 1000, log_tail()));
  }
  if (*status != 0) {
    return make_error(ErrorCode::io, fmt::format("emitd ended with exit code {} after SIGTERM:\n{}",
                                                 *status, log_tail()));
  }
  return {};
}

std::string DaemonProcess::log_tail() const {
  constexpr std::size_t kLines = 12;
  std::ifstream file(log_);
  std::deque<std::string> lines;
  std::string line;
  while (std::getline(file, line)) {
    lines.push_back(line);
    if (lines.size() > kLines) lines.pop_front();
  }
  std::string text;
  for (const std::string& kept : lines) text += "  " + kept + "\n";
  return text;
}

}  // namespace emit::tool
