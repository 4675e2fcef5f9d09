// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "agents/frame_source.hpp"
#include "emit/config/daemon_config.hpp"
#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"
#include "rt/clock.hpp"
#include "rt/counters.hpp"

namespace emit::server {

class ServiceNotifier;

/// Parts that a caller may replace. Tests give a fake clock and a null source.
struct DaemonOptions {
  Clock* clock = nullptr;             ///< null: SystemClock; must outlive the daemon
  FrameSourceFactory source_factory;  ///< empty: the source that the configuration names
  bool stepped = false;               ///< no threads: the caller runs the agents with step()
  const ServiceNotifier* notifier = nullptr;  ///< null: nobody; must outlive the daemon
  /// Drops the privileges of the process beyond its user once the ports are open. It is for
  /// programs that are the daemon, because it cannot be undone.
  bool drop_privileges = false;
  /// Program and arguments that explain a pixel of a run, up to those that name run and pixel
  /// (server::Explainer); empty: none is there.
  std::vector<std::string> explain_command;
  std::function<void(const std::string&)>
      on_log;  ///< null: spdlog as configured; set: log lines go here
};

/// Exit code when the device is lost, or fails again and again: EX_TEMPFAIL of sysexits.h. A new
/// process may well succeed.
inline constexpr int kExitDeviceLost = 75;

/// The whole daemon: agents, sockets, journal and frame source behind one object.
///
///   auto daemon = Daemon::create(config, scenario, {});
///   std::jthread thread([&] { exit_code = (*daemon)->run(); });
///   connect(fmt::format("tcp://127.0.0.1:{}", (*daemon)->control_port()));
///   (*daemon)->request_stop();   // also async-signal-safe
///
/// Several daemons may live in one process (ports 0). Nothing here installs signal handlers.
class Daemon {
 public:
  /// Opens sockets and files and loads the source; nothing runs yet, but the kernel queues what
  /// arrives. Port 0 in the configuration takes a free port. `scenario` may be absent only for a
  /// canned source or with a source factory.
  /// Errors: config, io (address in use, journal file), gpu, parse, not_found.
  [[nodiscard]] static physics::Result<std::unique_ptr<Daemon>> create(
      const config::DaemonConfig& config, std::optional<scene::ScenarioDesc> scenario,
      DaemonOptions options);
  virtual ~Daemon() = default;

  /// Runs until request_stop(), then drains: frames in flight are sent, the journal is flushed and
  /// closed. Returns the exit code of a process: 0, 1 when an agent failed, or kExitDeviceLost.
  /// After a lost device the render thread may hang in the driver, and with it this object's
  /// destructor, so the process leaves by std::_Exit. Call it once per daemon.
  [[nodiscard]] virtual int run() = 0;
  /// Returns false after run() when nobody took the last lines of the log, on which exit() would
  /// wait.
  [[nodiscard]] virtual bool log_taken() const noexcept = 0;
  /// Asks the daemon to stop. Thread: any, and signal handlers.
  virtual void request_stop() noexcept = 0;

  /// Runs every agent once, in a fixed order, in stepped mode. Returns the work done (0 = idle).
  virtual int step() = 0;

  [[nodiscard]] virtual std::uint16_t control_port() const noexcept = 0;
  [[nodiscard]] virtual std::uint16_t host_udp_port() const noexcept = 0;  ///< 0 = off
  [[nodiscard]] virtual std::uint16_t metrics_port() const noexcept = 0;   ///< 0 = off
  [[nodiscard]] virtual std::uint16_t trigger_port() const noexcept = 0;   ///< 0 = off
  [[nodiscard]] virtual std::uint64_t counter(Counter id) const noexcept = 0;
  /// Returns "ready control=HOST:PORT host_udp=HOST:PORT", then " trigger=HOST:PORT" and "
  /// metrics=HOST:PORT" unless these are off.
  [[nodiscard]] virtual std::string ready_line() const = 0;
};

/// One option of emitd, as its --help shows it.
struct DaemonOption {
  std::string_view name;        ///< with dashes
  std::string_view value = {};  ///< what the value is called; empty: a flag
  std::string_view text;
  bool required = false;
  bool repeatable = false;
};
[[nodiscard]] std::span<const DaemonOption> daemon_options() noexcept;
/// Exit codes of emitd, as its --help shows them.
[[nodiscard]] std::string_view daemon_exit_codes() noexcept;

/// Runs emitd; main() of emitd and `emit serve` call it. Exit codes: 0 after SIGTERM or SIGINT, 2
/// usage, 75 the device was lost, 78 bad configuration (file:line:column on standard error), 1
/// otherwise.
/// @param program  name shown in messages, "emitd" or "emit serve"; argv[0] is skipped.
[[nodiscard]] int emitd_main(int argc, char** argv, const char* program = "emitd");

}  // namespace emit::server
