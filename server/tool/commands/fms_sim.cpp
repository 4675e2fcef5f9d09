// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <time.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <string_view>
#include <utility>

#include "emit/physics/constants.hpp"
#include "emit/protocol/axes.hpp"
#include "motion/table_simulator.hpp"
#include "rt/clock.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/fms_sim/fms_sim_port.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using physics::kDegree;

/// Fault of an axis from an instant on, such as "2:stuck@1.5".
struct PlannedFault {
  std::size_t axis = 0;
  server::AxisFault fault = server::AxisFault::none;
  double at_s = 0.0;
};

struct FmsSimOptions {
  std::string listen = fmt::format("127.0.0.1:{}", protocol::kDefaultAxesPort);
  std::optional<config::MemoryPlace> memory;
  std::string acutrol;  ///< empty: not served
  std::uint32_t axes = 5;
  double rate_hz = 1000.0;
  double seconds = 0.0;  ///< 0: until interrupted
  double natural_hz = 20.0;
  double damping = 0.7;
  double delay_ms = 1.0;
  double noise_arcsec = 1.0;
  double travel_deg = 120.0;
  double most_rate_deg_s = 400.0;
  double most_acceleration_deg_s2 = 8000.0;
  std::vector<std::string> faults;
  std::optional<std::filesystem::path> json;
};

/// Reads a whole text as a number. Returns false if it is none.
template <class Number>
bool read_number(std::string_view text, Number& out) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  return error == std::errc() && end == text.data() + text.size();
}

physics::Result<PlannedFault> parse_fault(const std::string& text, std::size_t axes) {
  constexpr std::array<std::pair<std::string_view, server::AxisFault>, 3> kNames = {
      {{"stuck", server::AxisFault::stuck},
       {"runaway", server::AxisFault::runaway},
       {"none", server::AxisFault::none}}};
  const std::string_view view = text;
  const std::size_t colon = view.find(':');
  const std::size_t at = view.find('@');
  PlannedFault out;
  if (colon < at && at != std::string_view::npos && read_number(view.substr(0, colon), out.axis) &&
      read_number(view.substr(at + 1), out.at_s) && out.axis < axes && out.at_s >= 0.0 &&
      std::isfinite(out.at_s)) {
    for (const auto& [name, fault] : kNames) {
      out.fault = fault;
      if (view.substr(colon + 1, at - colon - 1) == name) return out;
    }
  }
  return physics::make_error(physics::ErrorCode::invalid_argument,
                             fmt::format("--fault '{}' must be AXIS:stuck, AXIS:runaway or "
                                         "AXIS:none with @SECONDS, and an axis from 0 to {}",
                                         text, axes - 1));
}

server::TableSimulator::Options table_of(const FmsSimOptions& command) {
  server::TableSimulator::Axis axis;
  axis.dynamics.limits = {-command.travel_deg * kDegree, command.travel_deg * kDegree,
                          command.most_rate_deg_s * kDegree,
                          command.most_acceleration_deg_s2 * kDegree};
  axis.dynamics.natural_rad_s = 2.0 * physics::kPi * command.natural_hz;
  axis.dynamics.damping = command.damping;
  axis.dynamics.delay_s = 1e-3 * command.delay_ms;
  axis.dynamics.noise_rad = command.noise_arcsec * kDegree / 3600.0;
  server::TableSimulator::Options out;
  out.axes.assign(command.axes, axis);
  out.step_ns = static_cast<std::int64_t>(std::llround(1e9 / command.rate_hz));
  return out;
}

class FmsSimRun {
 public:
  FmsSimRun(const FmsSimOptions& command, server::TableSimulator table,
            std::unique_ptr<FmsSimPort> port, std::vector<PlannedFault> faults)
      : command_(command),
        table_(std::move(table)),
        port_(std::move(port)),
        faults_(std::move(faults)) {}

  /// Runs to the end, or until it is interrupted. Errors: io (the clock).
  physics::Result<void> run() {
    const std::int64_t step_ns = table_of(command_).step_ns;
    const auto steps =
        command_.seconds > 0.0
            ? std::max<std::uint64_t>(
                  1, static_cast<std::uint64_t>(std::llround(command_.seconds * command_.rate_hz)))
            : 0;
    Progress progress("steps", std::max<std::uint64_t>(steps, 1));
    const std::int64_t start_ns = clock_.tai_ns();
    std::uint64_t step = 0;
    while (!InterruptGuard::interrupted() && (steps == 0 || step < steps)) {
      // Wait by an absolute timer: a late step does not delay those behind it.
      const std::int64_t due_ns = start_ns + static_cast<std::int64_t>(step + 1) * step_ns;
      const timespec due{static_cast<time_t>(due_ns / 1'000'000'000),
                         static_cast<long>(due_ns % 1'000'000'000)};
      const int slept = ::clock_nanosleep(CLOCK_TAI, TIMER_ABSTIME, &due, nullptr);
      if (slept == EINTR) continue;
      if (slept != 0) {
        return physics::make_error(physics::ErrorCode::io,
                                   fmt::format("cannot wait: {}", std::strerror(slept)));
      }
      ++step;
      figures_.late_us.add(1e-3 * static_cast<double>(clock_.tai_ns() - due_ns));
      for (const PlannedFault& fault : faults_) {
        if (1e-9 * static_cast<double>(due_ns - start_ns) >= fault.at_s) {
          table_.set_fault(fault.axis, fault.fault);
        }
      }
      port_->take(table_, due_ns, figures_);
      const protocol::AxesMonitor& monitor = table_.step(due_ns);
      note(monitor);
      port_->report(monitor, due_ns, figures_);
      if (steps != 0) progress.advance_to(step);
    }
    progress.finish();
    return {};
  }
  [[nodiscard]] const FmsSimFigures& figures() const noexcept { return figures_; }

 private:
  /// Keeps what the axes did, and tells of changes of the state.
  void note(const protocol::AxesMonitor& monitor) {
    if (monitor.timed_out && !timed_out_) ++figures_.timeouts;
    timed_out_ = monitor.timed_out;
    if (monitor.state != state_) {
      fmt::print(stderr, "fms-sim: {}{}\n", protocol::to_string(monitor.state),
                 monitor.timed_out ? ", the host is silent" : "");
      state_ = monitor.state;
    }
    if (monitor.state == protocol::AxesState::following) {
      ++figures_.following_steps;
      for (std::size_t i = 0; i < monitor.count; ++i) {
        const double error_rad = monitor.measured[i].angle_rad - monitor.demanded[i].angle_rad;
        figures_.squares_rad2[i] += error_rad * error_rad;
        figures_.most_rad[i] = std::max(figures_.most_rad[i], std::abs(error_rad));
      }
    }
  }

  const FmsSimOptions& command_;
  server::TableSimulator table_;
  std::unique_ptr<FmsSimPort> port_;
  std::vector<PlannedFault> faults_;
  const server::SystemClock clock_;
  protocol::AxesState state_ = protocol::AxesState::motors_off;
  bool timed_out_ = false;
  FmsSimFigures figures_;
};

Json to_json(const FmsSimOptions& command, const FmsSimFigures& figures) {
  Json json = Json::object();
  json.set("rate_hz", command.rate_hz).set("steps", figures.late_us.count());
  json.set("commands", figures.commands).set("commands_missing", figures.missing);
  json.set("commands_dropped", figures.dropped).set("commands_malformed", figures.malformed);
  json.set("torn_reads", figures.torn);
  json.set("timeouts", figures.timeouts).set("failed_sends", figures.failed_sends);
  json.set("late_p50_us", figures.late_us.percentile(0.5));
  json.set("late_p99_us", figures.late_us.percentile(0.99));
  json.set("late_max_us", figures.late_us.max());
  json.set("following_steps", figures.following_steps);
  Json axes = Json::array();
  for (std::size_t i = 0; i < command.axes; ++i) {
    const double count = static_cast<double>(std::max<std::uint64_t>(figures.following_steps, 1));
    Json axis = Json::object();
    axis.set("error_rms_rad", std::sqrt(figures.squares_rad2[i] / count));
    axis.set("error_max_rad", figures.most_rad[i]);
    axes.push(axis);
  }
  json.set("axes", axes);
  return json;
}

physics::Result<std::unique_ptr<FmsSimPort>> open_port(const FmsSimOptions& command) {
  if (command.memory) return open_memory_port(*command.memory);
  if (!command.acutrol.empty()) return open_acutrol_port(command.acutrol, command.axes);
  return open_udp_port(command.listen);
}

int run(const FmsSimOptions& command) {
  std::vector<PlannedFault> faults;
  for (const std::string& text : command.faults) {
    const auto fault = parse_fault(text, command.axes);
    if (!fault) return fail(kExitUsage, fault.error().text);
    faults.push_back(*fault);
  }
  // A later fault replaces an earlier one.
  std::ranges::stable_sort(faults, {}, &PlannedFault::at_s);
  auto table = server::TableSimulator::create(table_of(command));
  if (!table) return fail_call(table.error());
  auto port = open_port(command);
  if (!port) return fail_call(port.error());
  const InterruptGuard interrupt;
  // Tell scripts which port was taken, as emitd does.
  fmt::print(text_stream(command.json), "ready {}\n", (*port)->name());
  std::fflush(text_stream(command.json));

  FmsSimRun run(command, std::move(*table), std::move(*port), std::move(faults));
  if (const auto done = run.run(); !done) return fail(done.error());
  const FmsSimFigures& figures = run.figures();
  fmt::print(text_stream(command.json),
             "{} steps, late by {:.0f} us (median), {:.0f} us (99 %), {:.0f} us (most)\n"
             "{} commands taken, {} missing, {} dropped, {} malformed, {} timeouts\n",
             figures.late_us.count(), figures.late_us.percentile(0.5),
             figures.late_us.percentile(0.99), figures.late_us.max(), figures.commands,
             figures.missing, figures.dropped, figures.malformed, figures.timeouts);
  if (command.json) {
    if (auto done = write_json(*command.json, to_json(command, figures)); !done) {
      return fail(done.error());
    }
  }
  return kExitOk;
}

void add_options(CommandLine& line, FmsSimOptions& options) {
  Option listen =
      line.option("--listen", options.listen, "Address and UDP port of the controller; port 0: any")
          .type_name("HOST:PORT")
          .show_default();
  Option memory =
      line.parsed(
              "--memory",
              [&options](const std::string& text) -> physics::Result<void> {
                auto place = config::parse_memory_place(text);
                if (!place) return tl::unexpected(std::move(place.error()));
                options.memory = std::move(*place);
                return {};
              },
              "Talk through blocks of a file or device instead; the file is made where there is "
              "none")
          .type_name("PATH@OFFSET")
          .excludes(listen);
  line.option("--acutrol", options.acutrol,
              "Serve the ACUTROL command language by TCP instead; port 0: any")
      .type_name("HOST:PORT")
      .excludes(listen)
      .excludes(memory);
  line.option("--axes", options.axes, "Number of axes: the rings of the unit, then the target's")
      .in_range(1U, static_cast<unsigned>(protocol::kMaxAxes))
      .show_default();
  line.option("--rate", options.rate_hz, "Steps of the controller a second")
      .type_name("HZ")
      .in_range(10.0, 4000.0)
      .show_default();
  line.seconds("--seconds", options.seconds, "Time to run; 0: until interrupted")
      .in_range(0.0, 1e7);
  line.option("--natural-hz", options.natural_hz, "Natural frequency of each axis")
      .in_range(0.1, 1000.0)
      .show_default();
  line.option("--damping", options.damping, "Damping ratio of each axis")
      .in_range(0.01, 10.0)
      .show_default();
  line.option("--delay-ms", options.delay_ms, "Time from a command to its effect")
      .in_range(0.0, 50.0)
      .show_default();
  line.option("--noise-arcsec", options.noise_arcsec, "Standard deviation of measured angles")
      .in_range(0.0, 36000.0)
      .show_default();
  line.option("--travel-deg", options.travel_deg, "Travel of each axis, both ways")
      .in_range(0.1, 1e6)
      .show_default();
  line.option("--max-rate-deg-s", options.most_rate_deg_s, "Greatest rate of each axis")
      .in_range(0.1, 1e6)
      .show_default();
  line.option("--max-acceleration-deg-s2", options.most_acceleration_deg_s2,
              "Greatest acceleration of each axis")
      .in_range(0.1, 1e8)
      .show_default();
  line.option("--fault", options.faults,
              "Fault of an axis from a time on: AXIS:stuck@SECONDS, AXIS:runaway@SECONDS, or "
              "AXIS:none@SECONDS for its end")
      .type_name("FAULT")
      .repeatable();
  add_json(line, options.json);
}

}  // namespace

void add_fms_sim(CommandLine& tool) {
  tool.command<FmsSimOptions>(
      {.name = "fms-sim",
       .text = "Flight motion simulator stand-in: axes that answer commands by UDP, memory or TCP",
       .example = "emit fms-sim --listen 127.0.0.1:7010 --fault 2:stuck@20 --seconds 60"},
      add_options, run);
}

}  // namespace emit::tool
