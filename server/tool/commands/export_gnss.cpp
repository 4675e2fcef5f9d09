// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <functional>
#include <memory>
#include <thread>

#include "emit/client/client.hpp"
#include "gnss/earth_motion.hpp"
#include "gnss/gnss_formats.hpp"
#include "gnss/gps_time.hpp"
#include "gnss/truth_trajectory.hpp"
#include "net/socket.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/streams/pose_log.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/replacing_file.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;

struct GnssOptions {
  std::filesystem::path log;
  ScenarioChoice input;
  std::string format;
  std::optional<std::filesystem::path> out;
  std::string to;  ///< empty: to the file
  std::string speed = "1";
  std::optional<double> rate_hz;  ///< absent: that of the format
  double static_s = 0.0;
  std::string name;  ///< empty: that of the format
  int level = 2;
  double geoid_m = 0.0;
  server::TruthLimits limits;
  std::uint16_t host_port = protocol::kDefaultHostPort;
  std::optional<std::uint64_t> run_id;  ///< absent: the log's only one
  std::optional<std::filesystem::path> json;
};

/// Properties of a format.
struct GnssFormat {
  const char* name;
  double rate_hz;             ///< by default
  std::int64_t time_unit_ns;  ///< instants are whole multiples of it; 1: any
  bool gps_sdr_sim;           ///< that program reads it, with its limits
  bool utc_grid;              ///< rows are at whole periods of UTC
  const char* vehicle;        ///< name by default
};
constexpr std::array<GnssFormat, 5> kFormats = {
    {{"ecef-csv", 10.0, 1, true, false, ""},
     {"llh-csv", 10.0, 1, true, false, ""},
     {"nmea", 10.0, 10'000'000, true, true, ""},
     {"spirent-mot", 100.0, 1'000'000, false, false, "v1_m1"},
     {"skydel", 100.0, 1, false, false, ""}}};
constexpr std::string_view kUntested =
    "The Spirent and Skydel outputs are untested against hardware.";
/// Rows that gps-sdr-sim reads unless it is built otherwise (USER_MOTION_SIZE), at 10 Hz.
constexpr std::uint64_t kGpsSdrSimRows = 3000;
/// A vehicle further below the ellipsoid has another place than the scenario's.
constexpr double kLowestM = -10'000.0;

std::vector<std::string> format_names() {
  std::vector<std::string> out;
  out.reserve(kFormats.size());
  for (const GnssFormat& format : kFormats) out.emplace_back(format.name);
  return out;
}

/// Reads the seeker's poses of a log.
physics::Result<std::vector<server::TruthPose>> read_poses(const GnssOptions& command) {
  auto log = PoseLog::open(command.log, command.host_port);
  if (!log) return tl::unexpected(log.error());
  std::vector<server::TruthPose> out;
  std::uint64_t run_id = 0;
  std::uint64_t of_other_runs = 0;
  while (true) {
    const auto more = log->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    const protocol::HostFrameData& host = log->host();
    if (command.run_id && host.run_id != *command.run_id) {
      ++of_other_runs;
      continue;
    }
    if (!out.empty() && host.run_id != run_id) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("{}: run {} of the host begins with pose {} at {:.6f} s, after "
                                    "run {}: --run-id chooses one",
                                    command.log.string(), host.run_id, out.size() + 1,
                                    1e-9 * static_cast<double>(host.sim_time_ns), run_id));
    }
    run_id = host.run_id;
    out.push_back({host.sim_time_ns, host.seeker, host.seeker_rates});
  }
  if (const auto notes = log->notes()) warn(*notes);
  if (out.empty() && of_other_runs > 0) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: none of {} poses is of run {}", command.log.string(),
                                  of_other_runs, *command.run_id));
  }
  return out;
}

/// The rows of an output, made one after the other.
class GnssRows {
 public:
  /// Errors (invalid_argument): instants that the format cannot write.
  static physics::Result<GnssRows> create(const GnssOptions& command, const GnssFormat& format,
                                          const scene::ScenarioDesc& scenario,
                                          server::TruthTrajectory trajectory) {
    const double rate_hz = command.rate_hz.value_or(format.rate_hz);
    const double period_ns = 1e9 / rate_hz;
    const auto whole_ns = std::llround(period_ns);
    if (format.time_unit_ns > 1 && (std::abs(period_ns - static_cast<double>(whole_ns)) > 1e-3 ||
                                    whole_ns % format.time_unit_ns != 0)) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("--rate-hz {:g}: {} has times in steps of {:g} ms, and a "
                      "period is a whole number of them",
                      rate_hz, format.name, 1e-6 * static_cast<double>(format.time_unit_ns)));
    }
    GnssRows out(scenario, std::move(trajectory), rate_hz);
    const auto lead_ns = static_cast<std::int64_t>(std::llround(command.static_s * 1e9));
    out.start_ns_ = out.trajectory_.first_ns() - lead_ns;
    if (format.utc_grid) {
      const std::int64_t over_ns = (out.epoch_ns_ + out.start_ns_) % whole_ns;
      if (over_ns != 0) out.start_ns_ += (over_ns > 0 ? whole_ns : 0) - over_ns;
    }
    const double length_s = 1e-9 * static_cast<double>(out.trajectory_.last_ns() - out.start_ns_);
    if (length_s < 0.0) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("the log is shorter than a period of {:g} Hz", rate_hz));
    }
    out.count_ = static_cast<std::uint64_t>(std::floor(length_s * rate_hz + 1e-6)) + 1;
    return out;
  }

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] double rate_hz() const noexcept { return rate_hz_; }
  [[nodiscard]] std::int64_t start_utc_ns() const noexcept { return epoch_ns_ + start_ns_; }
  [[nodiscard]] const server::TruthTrajectory& trajectory() const noexcept { return trajectory_; }

  /// Errors (invalid_argument): a place deep in the ground.
  [[nodiscard]] physics::Result<server::GnssRow> row(std::uint64_t index) {
    server::GnssRow out;
    out.elapsed_ns = std::llround(static_cast<double>(index) * 1e9 / rate_hz_);
    const std::int64_t sim_time_ns = std::min(start_ns_ + out.elapsed_ns, trajectory_.last_ns());
    out.posix_utc_ns = epoch_ns_ + sim_time_ns;
    server::TruthState state;
    if (sim_time_ns < trajectory_.first_ns()) {
      // The vehicle stands on its launcher: at the first pose, without motion.
      state.pose = trajectory_.at(trajectory_.first_ns()).pose;
    } else {
      state = trajectory_.at(sim_time_ns);
    }
    out.motion = frame_.motion(state);
    const double height_m = out.motion.place.height.value();
    if (height_m < kLowestM) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("the seeker is {:.0f} m below the ellipsoid at {:.3f} s: the "
                                    "place of the scenario is not that of the log",
                                    -height_m, 1e-9 * static_cast<double>(sim_time_ns)));
    }
    const auto note = [](double& most, const glm::dvec3& v) {
      most = std::max(most, std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z));
    };
    note(most_speed_m_s, state.velocity_m_s);
    note(most_acceleration_m_s2, state.acceleration_m_s2);
    note(most_jerk_m_s3, state.jerk_m_s3);
    return out;
  }

  // Greatest values of the rows so far.
  double most_speed_m_s = 0.0;
  double most_acceleration_m_s2 = 0.0;
  double most_jerk_m_s3 = 0.0;

 private:
  GnssRows(const scene::ScenarioDesc& scenario, server::TruthTrajectory trajectory, double rate_hz)
      : trajectory_(std::move(trajectory)),
        frame_({physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
                physics::Metres(scenario.place.height_m)}),
        epoch_ns_(scenario.epoch_utc_ns),
        rate_hz_(rate_hz) {}

  server::TruthTrajectory trajectory_;
  server::EarthFrame frame_;
  std::int64_t epoch_ns_;
  double rate_hz_;
  std::int64_t start_ns_ = 0;  ///< simulation time of the first row
  std::uint64_t count_ = 0;
};

std::string row_text(const GnssOptions& command, const GnssFormat& format,
                     const server::GnssRow& row) {
  const std::string name = command.name.empty() ? format.vehicle : command.name;
  const std::string_view kind = format.name;
  if (kind == "ecef-csv") return server::ecef_csv_row(row);
  if (kind == "llh-csv") return server::llh_csv_row(row);
  if (kind == "nmea") return server::gga_sentence(row, command.geoid_m);
  if (kind == "spirent-mot") return server::mot_row(row, name);
  return server::skydel_datagram(row, static_cast<server::SkydelDynamics>(command.level), name);
}

/// Says what a reader of the file should know and cannot see in it.
void warn_of_limits(const GnssOptions& command, const GnssFormat& format, const GnssRows& rows) {
  if (format.gps_sdr_sim && rows.rate_hz() != 10.0) {
    warn(fmt::format("gps-sdr-sim takes rows as 0.1 s apart, and these are {:g} s apart",
                     1.0 / rows.rate_hz()));
  }
  if (format.gps_sdr_sim && rows.count() > kGpsSdrSimRows) {
    warn(
        fmt::format("{} rows: gps-sdr-sim reads {} (300 s), unless it is built with a larger "
                    "USER_MOTION_SIZE",
                    rows.count(), kGpsSdrSimRows));
  }
  const server::TruthTrajectory& trajectory = rows.trajectory();
  const glm::dvec3 v = trajectory.at(trajectory.first_ns()).velocity_m_s;
  const double speed_m_s = std::sqrt(v.x * v.x + v.y * v.y + v.z * v.z);
  constexpr double kStandingMS = 1.0;
  if (command.static_s > 0.0 && speed_m_s > kStandingMS) {
    warn(
        fmt::format("the first pose moves at {:.1f} m/s: the stationary lead-in ends with a jump "
                    "of velocity",
                    speed_m_s));
  }
}

/// Place and epoch decide everything here, so that defaults are worth a warning.
void warn_of_defaults(const scene::ScenarioDesc& scenario) {
  for (const std::string& text : scenario.warnings) {
    if (text.find("'epoch_utc' is not given") != std::string::npos ||
        text.find("'place.") != std::string::npos) {
      warn(text);
    }
  }
}

/// Sends datagrams at their instants.
class SkydelLink {
 public:
  /// Errors: invalid_argument (the URL), io.
  static physics::Result<SkydelLink> open(const std::string& to) {
    const auto url = client::parse_url(to);
    if (!url) return tl::unexpected(url.error());
    if (url->scheme != client::Url::Scheme::udp) {
      return make_error(ErrorCode::invalid_argument, fmt::format("{}: --to is a udp:// URL", to));
    }
    const auto address = server::resolve({url->host, url->port}, server::Transport::udp, false);
    if (!address) return tl::unexpected(address.error());
    SkydelLink out;
    auto socket = server::UdpSocket::open(out.context_, *address);
    if (!socket) return tl::unexpected(socket.error());
    if (auto done = socket->connect(*address); !done) return tl::unexpected(done.error());
    out.socket_ = std::move(*socket);
    out.to_ = to;
    out.say(server::kSkydelHello);
    return out;
  }
  SkydelLink(SkydelLink&&) = default;
  ~SkydelLink() {
    if (socket_) say(server::kSkydelBye);
  }

  /// Waits until the row is due, by multiples of real time; 0: it is due at once.
  void wait(const server::GnssRow& row, double speed) const {
    if (speed > 0.0) {
      std::this_thread::sleep_until(start_ + std::chrono::nanoseconds(static_cast<std::int64_t>(
                                                 static_cast<double>(row.elapsed_ns) / speed)));
    }
  }
  /// Errors: io, when nobody listens or the system refuses.
  physics::Result<void> send(std::string_view bytes) {
    while (true) {
      const server::IoResult sent = socket_.send(std::as_bytes(std::span(bytes)));
      if (sent.status == server::IoStatus::done) return {};
      if (sent.status != server::IoStatus::would_block) {
        return make_error(ErrorCode::io, fmt::format("{}: {}", to_, std::strerror(sent.error)));
      }
      std::this_thread::sleep_for(std::chrono::microseconds(100));
    }
  }

 private:
  SkydelLink() = default;
  void say(char message) { static_cast<void>(socket_.send(std::as_bytes(std::span(&message, 1)))); }

  server::SocketContext context_;
  server::UdpSocket socket_;
  std::string to_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
};

Json to_json(const GnssFormat& format, const GnssRows& rows, std::uint64_t written) {
  Json json = Json::object();
  json.set("format", format.name).set("rows", written).set("rate_hz", rows.rate_hz());
  json.set("start_utc", server::utc_text(rows.start_utc_ns()));
  if (const auto gps = server::gps_instant(rows.start_utc_ns())) {
    json.set("gps_week", gps->week).set("gps_second_of_week", gps->second_of_week);
    json.set("leap_seconds", gps->leap_seconds);
  }
  json.set("poses", rows.trajectory().size()).set("rates_of_log", rows.trajectory().has_rates());
  json.set("max_speed_m_s", rows.most_speed_m_s);
  json.set("max_acceleration_m_s2", rows.most_acceleration_m_s2);
  json.set("max_jerk_m_s3", rows.most_jerk_m_s3);
  return json;
}

/// Prints what was written, with what a user of the file sets in the GNSS simulator.
void report(const GnssOptions& command, const GnssRows& rows, std::uint64_t written) {
  std::FILE* const stream = command.out && *command.out == "-" ? stderr : text_stream(command.json);
  fmt::print(stream, "{}: {} rows at {:g} Hz from {} poses, velocities {}\n",
             command.out ? command.out->string() : command.to, written, rows.rate_hz(),
             rows.trajectory().size(),
             rows.trajectory().has_rates() ? "of the log" : "from positions");
  fmt::print(stream, "first row: {}", server::utc_text(rows.start_utc_ns()));
  if (const auto gps = server::gps_instant(rows.start_utc_ns())) {
    fmt::print(stream, ", GPS week {}, {:.3f} s (GPS time is {} s ahead of UTC)", gps->week,
               gps->second_of_week, gps->leap_seconds);
  }
  fmt::print(stream, "\nat most {:.1f} m/s, {:.2f} m/s2, {:.2f} m/s3\n", rows.most_speed_m_s,
             rows.most_acceleration_m_s2, rows.most_jerk_m_s3);
}

int run(const GnssOptions& command) {
  const GnssFormat& format = *std::ranges::find(
      kFormats, command.format, [](const GnssFormat& one) { return std::string(one.name); });
  const bool live = !command.to.empty();
  const bool skydel = command.format == "skydel";
  if (live == command.out.has_value()) {
    return fail(kExitUsage, "either --out FILE or --to udp://host:port is needed");
  }
  if (live && !skydel) return fail(kExitUsage, "--to needs --format skydel");
  if (!command.name.empty() && !skydel && command.format != "spirent-mot") {
    return fail(kExitUsage, fmt::format("--name: {} holds no name", command.format));
  }
  if (command.name.find_first_of(",\r\n") != std::string::npos) {
    return fail(kExitUsage, "--name: a name has no comma and no line end");
  }
  const auto speed = parse_speed(command.speed);
  if (!speed) return fail(kExitUsage, "--speed: a positive number or max");

  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  std::optional<ReplacingFile> file;
  if (command.out) {
    auto created = ReplacingFile::create(*command.out);
    if (!created) return fail(created.error());
    file.emplace(std::move(*created));
  }
  auto poses = read_poses(command);
  if (!poses) return fail(poses.error());
  auto trajectory = server::TruthTrajectory::create(std::move(*poses), command.limits);
  if (!trajectory) {
    return fail(std::move(trajectory.error()).with_context(command.log.string()));
  }
  auto rows = GnssRows::create(command, format, *scenario, std::move(*trajectory));
  if (!rows) return fail_call(rows.error());
  warn_of_defaults(*scenario);
  warn_of_limits(command, format, *rows);

  const InterruptGuard interrupt;
  std::optional<SkydelLink> link;
  if (live) {
    auto opened = SkydelLink::open(command.to);
    if (!opened) return fail_call(opened.error());
    link.emplace(std::move(*opened));
  }
  Progress progress("rows", rows->count());
  std::uint64_t written = 0;
  while (written < rows->count() && !InterruptGuard::interrupted()) {
    const auto row = rows->row(written);
    if (!row) return fail(row.error());
    const std::string text = row_text(command, format, *row);
    if (link) link->wait(*row, *speed);
    if (auto done = link ? link->send(text) : file->write(text); !done) return fail(done.error());
    progress.advance_to(++written);
  }
  progress.finish();
  if (file) {
    // Half a trajectory is none.
    if (written < rows->count()) return fail(kExitFailure, "interrupted: no file is written");
    if (auto done = file->commit(); !done) return fail(done.error());
  }
  report(command, *rows, written);
  if (command.json) {
    if (auto done = write_json(*command.json, to_json(format, *rows, written)); !done) {
      return fail(done.error());
    }
  }
  return kExitOk;
}

void add_options(CommandLine& line, GnssOptions& options) {
  line.path("log", options.log,
            "Journal or MCAP log with host frames, CSV with poses (*.csv), or a pcap/pcapng "
            "capture of a host's datagrams")
      .required();
  add_scenario(line, options.input, "--scenario");
  line.option("--format", options.format, "Layout of the rows").one_of(format_names()).required();
  line.output_file("--out", options.out, "File to write; - is standard output");
  line.option("--to", options.to, "skydel: send the datagrams to udp://host:port instead of a file")
      .type_name("URL");
  line.option("--speed", options.speed, "With --to: multiple of real time, or max")
      .type_name("X")
      .show_default();
  line.option("--rate-hz", options.rate_hz, "Rows a second")
      .in_range(0.1, 1000.0)
      .default_text("10; 100 for spirent-mot and skydel");
  line.seconds("--static-s", options.static_s,
               "Stand still at the first pose for this long before it, so that receivers acquire")
      .in_range(0.0, 86400.0)
      .show_default();
  line.option("--name", options.name,
              "spirent-mot: vehicle, v1_m1 by default; skydel: name of a vehicle, none by default")
      .type_name("NAME");
  line.option("--level", options.level,
              "skydel: derivatives of the position: 0 velocity, 1 acceleration, 2 jerk")
      .in_range(0, 2)
      .show_default();
  line.option("--geoid-m", options.geoid_m,
              "nmea: height of the geoid above the ellipsoid; the altitude is above the geoid")
      .in_range(-120.0, 120.0)
      .show_default();
  line.seconds("--max-gap-s", options.limits.max_gap_s, "Longest time between two poses")
      .positive()
      .show_default();
  line.option("--max-jump-m", options.limits.max_jump_m,
              "Farthest that a pose lies from where the motion before leads")
      .positive()
      .show_default();
  line.option("--host-port", options.host_port, "Capture: UDP port the host sent to")
      .type_name("PORT")
      .in_range(1, 65535)
      .show_default();
  line.option("--run-id", options.run_id, "Run of the host in a log that holds several")
      .type_name("N");
  add_json(line, options.json);
  line.footer(fmt::format(
      "{}\nExample: emit export gnss airfield.mcap --scenario airfield --format nmea --out "
      "airfield.nmea",
      kUntested));
}

}  // namespace

void add_export(CommandLine& tool) {
  CommandLine group = tool.group(
      {.name = "export",
       .text = "Write the truth of a log in formats of other programs",
       .example = "emit export gnss airfield.mcap --scenario airfield --format ecef-csv --out "
                  "motion.csv"});
  group.command<GnssOptions>(
      {.name = "gnss",
       .text = "The seeker's trajectory for GNSS simulators: gps-sdr-sim, NMEA, Spirent, Skydel",
       .example = "emit export gnss airfield.mcap --scenario airfield --format nmea --out "
                  "airfield.nmea"},
      add_options, run);
}

}  // namespace emit::tool
