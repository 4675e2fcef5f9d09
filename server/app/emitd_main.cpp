// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <string>
#include <string_view>
#include <system_error>
#include <vector>

#include "agents/receiver/receiver.hpp"
#include "app/daemon.hpp"
#include "app/service_notifier.hpp"
#include "emit/config/load.hpp"
#include "emit/physics/nearest_name.hpp"
#include "emit/version.hpp"

namespace emit::server {
namespace {

constexpr int kExitFailure = 1;
constexpr int kExitUsage = 2;
constexpr int kExitConfig = 78;  // EX_CONFIG of sysexits.h

std::atomic<Daemon*> g_daemon{nullptr};
std::atomic<bool> g_ran{false};
std::atomic<int> g_exit_code{0};  ///< exit code of run()
static_assert(std::atomic<Daemon*>::is_always_lock_free && std::atomic<int>::is_always_lock_free);

extern "C" void emit_on_stop_signal(int /*signal*/) {
  if (Daemon* daemon = g_daemon.load()) {
    daemon->request_stop();
    return;
  }
  // The signal ends the process at once outside of run(). During loading or warming up nobody is
  // served yet, and a driver may be busy for long. After run() it is a repeated signal, and
  // cleaning up takes too long.
  if (!g_ran.load()) {
    constexpr std::string_view kText = "emitd: stopped before it was ready\n";
    [[maybe_unused]] const auto written = ::write(STDERR_FILENO, kText.data(), kText.size());
  }
  ::_exit(g_exit_code.load());
}

void handle_stop_signals() {
  struct sigaction action {};
  action.sa_handler = emit_on_stop_signal;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
}

struct Arguments {
  std::string config_file;
  std::vector<std::string> overrides;
  bool check = false;
};

constexpr DaemonOption kOptions[] = {
    {.name = "--config",
     .value = "FILE",
     .text = "daemon configuration (TOML); config/README.md lists the keys",
     .required = true},
    {.name = "--set",
     .value = "key=value",
     .text = "overrides a key of the configuration or of the scenario",
     .repeatable = true},
    {.name = "--check",
     .text = "load configuration, scenario, certificates and keys, say what is wrong,\n"
             "and exit; ports, folders and the device are not tried"}};

/// Text of several lines with `indent` before each but the first.
std::string indented(std::string_view text, std::string_view indent) {
  std::string out;
  for (const char c : text) {
    out += c;
    if (c == '\n') out += indent;
  }
  return out;
}

void print_usage(std::FILE* out, const char* program) {
  fmt::print(out,
             "usage: {} --config FILE [--set key=value]... [--check]\n"
             "       {} --version | --help\n"
             "\n",
             program, program);
  for (const DaemonOption& option : kOptions) {
    fmt::print(out, "  {:<15}  {}\n", fmt::format("{} {}", option.name, option.value),
               indented(option.text, std::string(19, ' ')));
  }
  const auto profile = config::find_data_file("profiles/default.toml");
  fmt::print(out,
             "\nExample: {} --config {} --set pacing.rate_hz=100\n"
             "Profiles to begin with: {}\n",
             program, profile ? profile->string() : "default.toml",
             profile ? profile->parent_path().string() : "share/emit/profiles of the installation");
  fmt::print(out, "\nexit: {}\n", indented(daemon_exit_codes(), std::string(6, ' ')));
}

/// Says what is wrong with an argument that parse_arguments() cannot take.
std::string fault_of(const std::string& argument, const char* program) {
  if (!argument.starts_with('-')) {
    return fmt::format("'{0}' is no option; --config {0} names the configuration", argument);
  }
  const std::string name = argument.substr(0, argument.find('='));
  std::vector<std::string_view> names{"--help", "--version"};
  for (const DaemonOption& option : kOptions) {
    names.push_back(option.name);
    if (option.name != name) continue;
    return option.value.empty() ? fmt::format("{} takes no value", name)
                                : fmt::format("{0} needs a value: {0} {1}", name, option.value);
  }
  return fmt::format("{} has no option '{}'{}", program, name, physics::did_you_mean(name, names));
}

/// Returns an exit code, or -1 to go on.
int parse_arguments(int argc, char** argv, const char* program, Arguments& out) {
  const auto usage = [&](const std::string& why) {
    fmt::print(stderr, "{0}: error: {1}; `{0} --help` lists the options\n", program, why);
    return kExitUsage;
  };
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    const auto value_of = [&](std::string_view name, std::string& value) {
      if (argument == name && i + 1 < argc) {
        value = argv[++i];
        return true;
      }
      if (argument.size() > name.size() + 1 && argument.starts_with(name) &&
          argument[name.size()] == '=') {
        value = argument.substr(name.size() + 1);
        return true;
      }
      return false;
    };
    std::string value;
    if (argument == "--help" || argument == "-h") {
      print_usage(stdout, program);
      return 0;
    }
    if (argument == "--version") {
      fmt::print("emitd {} ({})\n", kVersion, kCommit);
      return 0;
    }
    if (argument == "--check") {
      out.check = true;
    } else if (value_of("--config", value)) {
      out.config_file = value;
    } else if (value_of("--set", value)) {
      if (value.find('=') == std::string::npos) {
        return usage(
            fmt::format("--set {0}: not key=value; the value is missing: --set {0}=VALUE", value));
      }
      out.overrides.push_back(value);
    } else {
      return usage(fault_of(std::string(argument), program));
    }
  }
  if (out.config_file.empty()) {
    return usage("--config FILE is required");
  }
  return -1;
}

int exit_code_of(const physics::Error& error) {
  switch (error.code) {
    case physics::ErrorCode::config:
    case physics::ErrorCode::parse:
    case physics::ErrorCode::not_found:
    case physics::ErrorCode::unsupported:
      return kExitConfig;
    default:
      return kExitFailure;
  }
}

int fail(const char* program, const physics::Error& error) {
  // An error of a configuration has a line for each fault.
  for (std::size_t at = 0; at <= error.text.size();) {
    const std::size_t end = std::min(error.text.find('\n', at), error.text.size());
    fmt::print(stderr, "{}: error: {}\n", program,
               std::string_view(error.text).substr(at, end - at));
    at = end + 1;
  }
  return exit_code_of(error);
}

/// Returns how `emit` explains pixels of a scenario, where it lies beside this program.
std::vector<std::string> explain_command(const std::filesystem::path& scenario,
                                         const std::vector<std::string>& overrides) {
  std::error_code error;
  const auto own = std::filesystem::read_symlink("/proc/self/exe", error);
  const std::filesystem::path emit = own.parent_path() / "emit";
  if (error || scenario.empty() || ::access(emit.c_str(), X_OK) != 0) return {};
  std::vector<std::string> out{emit.string(), "explain", scenario.string()};
  for (const std::string& one : overrides) {
    out.emplace_back("--set");
    out.push_back(one);
  }
  return out;
}

int serve(const Arguments& arguments, const char* program) {
  if (!arguments.check) {
    handle_stop_signals();
  }
  const config::SplitOverrides overrides = config::split_overrides(arguments.overrides);
  const auto daemon_config = config::load_daemon(arguments.config_file, overrides.daemon);
  if (!daemon_config) {
    fail(program, daemon_config.error());
    return kExitConfig;
  }
  std::optional<scene::ScenarioDesc> scenario;
  if (!daemon_config->scenario.empty()) {
    auto loaded = config::load_scenario(daemon_config->scenario, overrides.scenario);
    if (!loaded) {
      fail(program, loaded.error());
      return kExitConfig;
    }
    scenario = std::move(*loaded);
  } else if (!overrides.scenario.empty()) {
    fmt::print(stderr, "{}: error: --set {}: there is no scenario to override\n", program,
               overrides.scenario.front());
    return kExitConfig;
  }
  if (arguments.check) {
    if (const auto checked = check_security(*daemon_config); !checked) {
      fail(program, physics::Error(checked.error()).with_context(arguments.config_file));
      return kExitConfig;
    }
    if (scenario) {
      for (const std::string& text : scenario->warnings) {
        fmt::print(stderr, "{}: warning: {}\n", program, text);
      }
    }
    fmt::print("{}: ok\n", arguments.config_file);
    return 0;
  }
  // Two descriptors per client at most, of up to 1024; the usual 1024 is for programs with
  // select().
  if (rlimit files{}; ::getrlimit(RLIMIT_NOFILE, &files) == 0) {
    files.rlim_cur = files.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &files);
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on the size of files ends the journal, not the frames
  const ServiceNotifier notifier = ServiceNotifier::from_environment();
  DaemonOptions options;
  options.notifier = &notifier;
  options.drop_privileges = true;
  options.explain_command = explain_command(daemon_config->scenario, overrides.scenario);
  auto daemon = Daemon::create(*daemon_config, std::move(scenario), std::move(options));
  if (!daemon) {
    return fail(program, daemon.error());
  }

  g_daemon.store(daemon->get());
  fmt::print("{}\n", (*daemon)->ready_line());
  std::fflush(stdout);
  const int code = (*daemon)->run();
  g_exit_code.store(code);
  g_ran.store(true);
  g_daemon.store(nullptr);
  if (code == kExitDeviceLost) {
    // Taking the context down may hang in the driver, and flushing all streams behind a log that
    // nobody reads.
    std::_Exit(code);
  }
  if (!(*daemon)->log_taken()) {
    daemon->reset();
    std::_Exit(code);  // exit() would wait for whoever does not read the log
  }
  return code;
}

}  // namespace

std::span<const DaemonOption> daemon_options() noexcept {
  return kOptions;
}

std::string_view daemon_exit_codes() noexcept {
  return "0 after SIGTERM or SIGINT, 2 usage, 75 the device was lost (start it again),\n"
         "78 bad configuration, 1 otherwise";
}

int emitd_main(int argc, char** argv, const char* program) {
  Arguments arguments;
  const int code = parse_arguments(argc, argv, program, arguments);
  if (code >= 0) {
    return code;
  }
  try {
    return serve(arguments, program);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: error: {}\n", program, error.what());
    return kExitFailure;
  }
}

}  // namespace emit::server
