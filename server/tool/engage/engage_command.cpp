// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/engage_command.hpp"

#include <fmt/format.h>

#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/scene/trajectory.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/engage/engage_report.hpp"
#include "tool/engage/engage_session.hpp"
#include "tool/engage/jsbsim_host.hpp"
#include "tool/engage/scripted_host.hpp"
#include "tool/engage/tracker_study.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/subprocess.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::kDegree;
using physics::make_error;
using physics::Result;

struct EngageOptions {
  ScenarioChoice input{"engage", {}};
  std::filesystem::path out = "emit-engage";
  std::string host = "scripted";
  std::filesystem::path jsbsim = "/usr/games/JSBSim";
  std::optional<std::filesystem::path> jsbsim_root;
  std::string aircraft = "c172x";
  double mount_pitch_deg = 0.0;
  std::string seeker;
  std::string method = "hot-spot";
  std::string channel;
  bool real_time = false;
  std::optional<double> rate_hz;
  double start_s = 0.0;
  double duration_s = 30.0;
  double display_delay_ms = 40.0;
  std::uint32_t target = 1;
  std::vector<double> aim_m;
  std::optional<double> speed_m_s;
  double heading_error_deg = 6.0;
  double gain = 4.0;
  double memory_frac = 0.8;
  std::string gnss_format = "nmea";
  bool study = false;
  bool only_study = false;
  TrackerStudyOptions study_options;
  /// Weather of the templates' simulations where it differs from the truth: a fair forecast.
  std::vector<std::string> forecast;
  bool exact_forecast = false;
  bool keep = false;
  std::optional<std::filesystem::path> json;
};

/// The rate of the loop that a machine without a GPU keeps in real time.
constexpr double kRealTimeRateHz = 20.0;
constexpr double kStepRateHz = 100.0;

/// Nozzle of the shipped jet: forward, right, down.
const std::vector<double> kNozzleM{-5.5, 0.0, -1.75};

/// Errors of a weather forecast: haze, wind and air temperature.
const std::vector<std::string> kForecast{"weather.linke_turbidity=4.5", "weather.wind_m_s=3",
                                         "weather.air_mean_k=294"};

ScriptedFlight flight_of(const EngageOptions& command) {
  ScriptedFlight out;
  out.target_entity = command.target;
  const std::vector<double>& aim = command.aim_m.empty() ? kNozzleM : command.aim_m;
  out.aim_body_m = {aim[0], aim[1], aim[2]};
  out.speed_m_s = command.speed_m_s.value_or(out.speed_m_s);
  out.heading_error_rad = command.heading_error_deg * kDegree;
  out.engagement.navigation_gain = command.gain;
  out.engagement.filter_memory_frac = command.memory_frac;
  return out;
}

/// Runs `emit export gnss` on the flown poses.
Result<std::filesystem::path> write_gnss(const EngageOptions& command,
                                         const std::filesystem::path& log,
                                         const std::filesystem::path& work) {
  const auto bin = executable_dir();
  if (!bin) return tl::unexpected(bin.error());
  const auto file = command.out / ("flight." + command.gnss_format);
  std::vector<std::string> arguments{(*bin / "emit").string(),
                                     "export",
                                     "gnss",
                                     log.string(),
                                     "--scenario",
                                     command.input.scenario,
                                     "--format",
                                     command.gnss_format,
                                     "--out",
                                     file.string()};
  for (const std::string& set : command.input.set) {
    arguments.emplace_back("--set");
    arguments.push_back(set);
  }
  auto process = Subprocess::start(arguments, work / "gnss.log");
  if (!process) return tl::unexpected(process.error());
  const auto status = process->wait(std::chrono::seconds(60));
  if (!status || *status != 0) {
    return make_error(ErrorCode::io,
                      fmt::format("emit export gnss failed; see {}", (work / "gnss.log").string()));
  }
  return file;
}

/// Makes the host. `scripted` becomes the scripted one, if it is that.
Result<std::unique_ptr<FlightHost>> make_host(const EngageOptions& command,
                                              const scene::ScenarioDesc& scenario,
                                              std::int64_t start_ns, double rate_hz,
                                              const std::filesystem::path& work,
                                              const ScriptedHost*& scripted) {
  if (command.host == "scripted") {
    auto host = ScriptedHost::create(scenario, start_ns, flight_of(command));
    if (!host) return tl::unexpected(host.error());
    scripted = host->get();
    return std::unique_ptr<FlightHost>(std::move(*host));
  }
  JsbsimHost::Options options;
  options.program = command.jsbsim;
  options.root = *command.jsbsim_root;
  options.aircraft = command.aircraft;
  options.speed_m_s = command.speed_m_s.value_or(options.speed_m_s);
  options.mount_pitch_rad = command.mount_pitch_deg * kDegree;
  options.rate_hz = rate_hz;
  options.work = work;
  auto host = JsbsimHost::start(scenario, start_ns, options);
  if (!host) return tl::unexpected(host.error());
  return std::unique_ptr<FlightHost>(std::move(*host));
}

SessionOptions session_of(const EngageOptions& command, double rate_hz) {
  SessionOptions out;
  out.set = command.input.set;
  out.channel = command.channel;
  out.seeker = command.seeker;
  out.method = command.method;
  out.real_time = command.real_time;
  out.rate_hz = rate_hz;
  out.duration_s = command.duration_s;
  out.display_delay_ms = command.display_delay_ms;
  out.target_entity = command.target;
  out.out = command.out;
  return out;
}

/// Flies, and adds to the results. Errors: those of the hosts and of the session.
Result<void> fly(const EngageOptions& command, const scene::ScenarioDesc& scenario,
                 WorkFolder& work, EngageResults& results) {
  const auto start_ns = static_cast<std::int64_t>(std::llround(1e9 * command.start_s));
  const SessionOptions options = session_of(command, results.rate_hz);
  const ScriptedHost* scripted = nullptr;
  auto host = make_host(command, scenario, start_ns, results.rate_hz, work.path(), scripted);
  if (!host) return tl::unexpected(host.error());
  results.host = (*host)->name();

  EngageSession session(options, scenario, start_ns, work);
  fmt::print(text_stream(command.json), "starting emitd on scenario {} ({})\n", scenario.name,
             scenario.file.string());
  if (auto started = session.start(); !started) return started;
  results.device = session.device();
  results.channel = session.channel().name;
  results.band = session.channel().band;
  results.focal_px = session.focal_px();
  auto flown = command.real_time ? session.fly_in_real_time(**host) : session.fly_in_steps(**host);
  if (!flown) return tl::unexpected(flown.error());
  results.flight = std::move(*flown);
  if (auto stopped = session.stop(); !stopped) return stopped;
  if (scripted != nullptr) {
    const server::ClosestApproach& closest = scripted->engagement().closest();
    results.outcome = EngageOutcome{closest.distance_m(), closest.time_s(), closest.offset_m(),
                                    scripted->engagement().on_ground()};
  }
  auto gnss = write_gnss(command, session.flight_log(), work.path());
  if (!gnss) return tl::unexpected(gnss.error());
  results.gnss = *gnss;
  return {};
}

/// Runs the tracker study, and adds it to the results.
Result<void> study(const EngageOptions& command, const scene::ScenarioDesc& scenario,
                   const WorkFolder& work, EngageResults& results) {
  TrackerStudyOptions options = command.study_options;
  options.truth = command.input;
  options.forecast = command.forecast.empty() ? kForecast : command.forecast;
  if (command.exact_forecast) options.forecast.clear();
  options.start_s = command.start_s;
  options.out = command.out;
  options.work = work.path();
  const auto end_ns = static_cast<std::int64_t>(
      std::llround(1e9 * (command.start_s + command.study_options.length_s)));
  for (const scene::ObjectDesc& object : scenario.objects) {
    if (object.entity_id != command.target || object.trajectory.empty()) continue;
    options.look_at_m = scene::trajectory_at(object.trajectory, end_ns).pose.position_world_m;
  }
  auto done = run_tracker_study(options);
  if (!done) return tl::unexpected(done.error());
  results.study = std::move(*done);
  return write_svg(command.out / "tracker_study.svg", study_plots(*results.study));
}

int report(const EngageOptions& command, const EngageResults& results, WorkFolder& work) {
  const auto html = command.out / "report.html";
  if (auto done = write_engage_html(html, command.out, results); !done) return fail(done.error());
  if (results.flight) {
    if (auto done = write_frames_csv(command.out / "frames.csv", results); !done) {
      return fail(done.error());
    }
  }
  const Json json = engage_json(results);
  if (auto done = write_json(command.out / "report.json", json); !done) return fail(done.error());
  if (command.json) {
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  fmt::print(text_stream(command.json), "{}report: {}\n", engage_text(results), html.string());
  if (results.gnss) {
    fmt::print(text_stream(command.json), "trajectory for GNSS simulators: {}\n",
               results.gnss->string());
  }
  if (work.kept()) {
    fmt::print(text_stream(command.json), "configuration and logs are kept in {}\n",
               work.path().string());
  }
  return kExitOk;
}

int run(const EngageOptions& command) {
  if (!command.aim_m.empty() && command.aim_m.size() != 3) {
    return fail(kExitUsage, "--aim-m: three numbers: forward, right and down");
  }
  if (command.host == "jsbsim" && !command.only_study) {
    if (!command.jsbsim_root) {
      return fail(kExitUsage, "--host jsbsim needs --jsbsim-root, a folder with aircraft/");
    }
    if (command.real_time) {
      return fail(kExitUsage, "--real-time flies the scripted host: JSBSim is stepped");
    }
  }
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  if (auto made = make_directory(command.out); !made) return fail(made.error());
  WorkFolder work(command.keep);
  if (auto made = work.create(command.out); !made) return fail(made.error());
  const InterruptGuard interrupt;
  EngageResults results;
  results.scenario = scenario->name;
  results.seeker = command.seeker.empty() ? "reference, " + command.method : command.seeker;
  results.real_time = command.real_time;
  results.rate_hz = command.rate_hz.value_or(command.real_time ? kRealTimeRateHz : kStepRateHz);
  Result<void> done;
  if (!command.only_study) done = fly(command, *scenario, work, results);
  if (done && (command.study || command.only_study)) {
    done = study(command, *scenario, work, results);
  }
  if (!done) {
    if (!InterruptGuard::interrupted()) work.keep();
    const int code = fail(done.error());
    if (work.kept()) {
      fmt::print(stderr, "emit: configuration and logs are kept in {}\n", work.path().string());
    }
    return code;
  }
  return report(command, results, work);
}

void add_host_options(CommandLine& line, EngageOptions& options) {
  line.option("--host", options.host, "Simulation of the flight")
      .one_of({"scripted", "jsbsim"})
      .show_default();
  line.path("--jsbsim", options.jsbsim,
            "JSBSim's program, from Debian's package flightgear or a build of its own")
      .show_default();
  line.path("--jsbsim-root", options.jsbsim_root,
            "JSBSim: folder with aircraft/, engine/ and systems/");
  line.option("--aircraft", options.aircraft, "JSBSim: name of the aircraft")
      .type_name("NAME")
      .show_default();
  line.option("--mount-pitch-deg", options.mount_pitch_deg,
              "JSBSim: pitch of the seeker in the aircraft, up positive")
      .in_range(-90.0, 90.0)
      .show_default();
}

void add_flight_options(CommandLine& line, EngageOptions& options) {
  line.option("--seeker", options.seeker,
              "Shell command of a seeker in place of the reference seeker "
              "(server/docs/engage.md)")
      .type_name("COMMAND");
  line.option("--method", options.method, "Tracker of the reference seeker")
      .one_of({"hot-spot", "correlation"})
      .show_default();
  line.option("--channel", options.channel, "Channel that the seeker reads; default: the first")
      .type_name("NAME");
  line.flag("--real-time", options.real_time,
            "Fly by the wall clock, with a motion simulator (emit fms-sim) and projected frames. "
            "Without it the loop is in lock-step and the same in every run");
  line.option("--rate-hz", options.rate_hz, "Poses and frames a second of flight")
      .in_range(1.0, 1000.0)
      .default_text("100, in real time 20");
  line.seconds("--start-s", options.start_s, "Simulated time of the launch").show_default();
  line.seconds("--duration-s", options.duration_s, "Longest time of flight")
      .positive()
      .show_default();
  line.option("--display-delay-ms", options.display_delay_ms,
              "Real time: from the begin of a frame's slot to its display")
      .in_range(0.0, 200.0)
      .show_default();
  line.option("--target", options.target, "entity_id of the target").show_default();
  line.option("--aim-m", options.aim_m,
              "Point of the target to hit, in its body: forward, right and down, one value each "
              "time; default: the nozzle of the shipped jet")
      .repeatable()
      .type_name("M");
  line.option("--speed-m-s", options.speed_m_s, "Speed at the launch")
      .in_range(20.0, 2000.0)
      .default_text("260, with JSBSim 60");
  line.option("--heading-error-deg", options.heading_error_deg,
              "Angle of the launch to the right of the target")
      .in_range(-60.0, 60.0)
      .show_default();
  line.option("--gain", options.gain, "Gain of proportional navigation")
      .in_range(1.0, 10.0)
      .show_default();
  line.option("--filter-memory", options.memory_frac,
              "Weight of the frame before in the filter of the line of sight")
      .in_range(0.0, 0.99)
      .show_default();
  line.option("--gnss-format", options.gnss_format, "Format of the flown trajectory")
      .one_of({"nmea", "ecef-csv", "llh-csv", "spirent-mot"})
      .show_default();
}

void add_options(CommandLine& line, EngageOptions& options) {
  line.output_folder("--out", options.out, "Folder for report, pictures and logs")
      .default_text(options.out.string());
  line.option("--scenario", options.input.scenario, "Shipped scenario or .toml file")
      .show_default();
  add_set(line, options.input.set);
  add_host_options(line, options);
  add_flight_options(line, options);
  line.flag("--tracker-study", options.study,
            "Also match templates of simulations with thermal shadows, plain shadows and none "
            "over an hour; takes minutes");
  line.flag("--only-tracker-study", options.only_study, "The tracker study without a flight");
  line.option("--study-band", options.study_options.band, "Band of the tracker study")
      .type_name("NAME")
      .show_default();
  line.seconds("--study-length-s", options.study_options.length_s, "Length of the tracker study")
      .positive()
      .show_default();
  line.seconds("--study-step-s", options.study_options.step_s, "Time between two pictures")
      .positive()
      .show_default();
  line.option(
          "--study-range-m", options.study_options.range_m,
          "Tracker study: distance of the camera from where the target is at the end of the study")
      .positive()
      .show_default();
  line.option("--study-noise-k", options.study_options.noise_k,
              "Tracker study: noise of the detector")
      .in_range(0.0001, 10.0)
      .show_default();
  const Option forecast =
      line.option("--forecast", options.forecast,
                  "Tracker study: setting by which the simulations of the templates differ from "
                  "the truth; repeatable; default: weather.linke_turbidity=4.5, "
                  "weather.wind_m_s=3, weather.air_mean_k=294")
          .type_name("KEY=VALUE")
          .repeatable();
  line.flag("--exact-forecast", options.exact_forecast,
            "Tracker study: the simulations of the templates have the weather of the truth")
      .excludes(forecast);
  line.flag("--keep", options.keep, "Keep the configuration and the logs of the programs");
  add_json(line, options.json);
}

}  // namespace

void add_engage(CommandLine& tool) {
  tool.command<EngageOptions>(
      {.name = "engage",
       .text = "A closed loop that flies: host, emitd, seeker, guidance, and a report with the "
               "miss distance",
       .example = "emit engage --out flight"},
      add_options, run);
}

}  // namespace emit::tool
