// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/jsbsim_host.hpp"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cmath>
#include <cstring>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <thread>

#include "emit/scene/trajectory.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kMetresPerFoot = 0.3048;
/// Rate of JSBSim's own steps is at least this, as its aircraft expect.
constexpr double kLeastStepRateHz = 100.0;
constexpr std::chrono::seconds kPatience(30);

/// Returns a loopback address.
sockaddr_in loopback(std::uint16_t port) {
  sockaddr_in out{};
  out.sin_family = AF_INET;
  out.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  out.sin_port = htons(port);
  return out;
}

/// Returns a TCP port that nobody uses now.
Result<std::uint16_t> free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  sockaddr_in address = loopback(0);
  socklen_t length = sizeof address;
  auto* const plain = reinterpret_cast<sockaddr*>(&address);
  const bool bound =
      fd >= 0 && ::bind(fd, plain, length) == 0 && ::getsockname(fd, plain, &length) == 0;
  const int error = errno;
  if (fd >= 0) ::close(fd);
  if (!bound) {
    return make_error(ErrorCode::io, fmt::format("no free port: {}", std::strerror(error)));
  }
  return ntohs(address.sin_port);
}

Result<void> write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream stream(file);
  stream << text;
  stream.flush();
  if (!stream)
    return make_error(ErrorCode::io, fmt::format("{}: cannot be written", file.string()));
  return {};
}

/// Makes a root folder for JSBSim that shows the user's aircraft and takes files of this run.
Result<void> make_root(const JsbsimHost::Options& options, const std::filesystem::path& root) {
  std::error_code error;
  const auto aircraft =
      std::filesystem::absolute(options.root, error) / "aircraft" / options.aircraft;
  if (!std::filesystem::is_regular_file(aircraft / (options.aircraft + ".xml"), error)) {
    return make_error(
        ErrorCode::not_found,
        fmt::format("{}: no such aircraft", (aircraft / (options.aircraft + ".xml")).string()));
  }
  const auto own = root / "aircraft" / options.aircraft;
  std::filesystem::create_directories(own, error);
  for (const auto& entry : std::filesystem::directory_iterator(aircraft, error)) {
    std::filesystem::create_symlink(entry.path(), own / entry.path().filename(), error);
  }
  for (const char* folder : {"engine", "systems"}) {
    const auto shared = std::filesystem::absolute(options.root, error) / folder;
    if (std::filesystem::exists(shared, error)) {
      std::filesystem::create_symlink(shared, root / folder, error);
    }
  }
  if (!std::filesystem::exists(own / (options.aircraft + ".xml"), error)) {
    return make_error(ErrorCode::io, fmt::format("{}: cannot link the aircraft", own.string()));
  }
  return {};
}

std::string start_xml(const physics::GeoPlace& place, double heading_rad, double speed_m_s) {
  return fmt::format(
      "<?xml version=\"1.0\"?>\n<initialize name=\"emit_start\">\n"
      "  <latitude unit=\"RAD\" type=\"geodetic\"> {:.17g} </latitude>\n"
      "  <longitude unit=\"RAD\"> {:.17g} </longitude>\n"
      "  <altitude unit=\"M\"> {:.17g} </altitude>\n"
      "  <phi unit=\"RAD\"> 0 </phi>\n  <theta unit=\"RAD\"> 0 </theta>\n"
      "  <psi unit=\"RAD\"> {:.17g} </psi>\n"
      "  <vnorth unit=\"M/SEC\"> {:.17g} </vnorth>\n  <veast unit=\"M/SEC\"> {:.17g} </veast>\n"
      "  <vdown unit=\"M/SEC\"> 0 </vdown>\n  <running> -1 </running>\n</initialize>\n",
      place.latitude.value(), place.longitude.value(), place.height.value(), heading_rad,
      speed_m_s * std::cos(heading_rad), speed_m_s * std::sin(heading_rad));
}

std::string script_xml(const JsbsimHost::Options& options, std::uint16_t port, double step_hz) {
  std::string properties;
  for (const std::string& name : jsbsim_properties()) {
    properties += fmt::format("    <property> {} </property>\n", name);
  }
  return fmt::format(
      "<?xml version=\"1.0\"?>\n<runscript name=\"emit engage\">\n"
      "  <use aircraft=\"{}\" initialize=\"emit_start\"/>\n  <input port=\"{}\"/>\n"
      "  <output name=\"states.csv\" type=\"CSV\" rate=\"{:.17g}\">\n{}  </output>\n"
      "  <run start=\"0\" end=\"1e9\" dt=\"{:.17g}\"/>\n</runscript>\n",
      options.aircraft, port, step_hz, properties, 1.0 / step_hz);
}

}  // namespace

std::vector<std::string> jsbsim_properties() {
  return {"position/lat-geod-rad",  "position/long-gc-rad",  "position/h-sl-meters",
          "attitude/phi-rad",       "attitude/theta-rad",    "attitude/psi-rad",
          "velocities/v-north-fps", "velocities/v-east-fps", "velocities/v-down-fps"};
}

Result<JsbsimState> parse_jsbsim_row(const std::string& row) {
  JsbsimState out;
  const std::array<double*, 10> targets{
      &out.time_s,    &out.latitude_rad, &out.longitude_rad, &out.height_m,  &out.roll_rad,
      &out.pitch_rad, &out.heading_rad,  &out.north_ft_s,    &out.east_ft_s, &out.down_ft_s};
  const char* at = row.data();
  const char* const end = row.data() + row.size();
  for (std::size_t i = 0; i < targets.size(); ++i) {
    const auto [stop, error] = std::from_chars(at, end, *targets[i]);
    const bool last = i + 1 == targets.size();
    if (error != std::errc() || !std::isfinite(*targets[i]) ||
        (last ? stop != end : stop == end || *stop != ',')) {
      return make_error(ErrorCode::protocol,
                        fmt::format("JSBSim: cell {} of '{}' is no number", i + 1, row));
    }
    at = stop + 1;
  }
  return out;
}

physics::Pose pose_of(const JsbsimState& state, const physics::GeoPlace& origin) {
  const physics::GeoPlace place{physics::Radians(state.latitude_rad),
                                physics::Radians(state.longitude_rad),
                                physics::Metres(state.height_m)};
  const glm::dmat3 world_from_ecef = glm::transpose(physics::ecef_from_enu(origin));
  const glm::dquat world_from_local =
      glm::normalize(glm::quat_cast(world_from_ecef * physics::ecef_from_enu(place)));
  return {
      world_from_ecef * (physics::ecef_m(place) - physics::ecef_m(origin)),
      glm::normalize(world_from_local * physics::world_from_body_heading_pitch_roll(
                                            state.heading_rad, state.pitch_rad, state.roll_rad))};
}

Result<std::unique_ptr<JsbsimHost>> JsbsimHost::start(const scene::ScenarioDesc& scenario,
                                                      std::int64_t start_ns,
                                                      const Options& options) {
  if (scenario.sensor.trajectory.empty()) {
    return make_error(ErrorCode::config,
                      scenario.file.string() + ": the sensor has no position to start from");
  }
  const auto root = options.work / "jsbsim";
  if (auto made = make_root(options, root); !made) return tl::unexpected(made.error());
  const physics::GeoPlace origin{physics::Radians(scenario.place.lat_rad),
                                 physics::Radians(scenario.place.lon_rad),
                                 physics::Metres(scenario.place.height_m)};
  const physics::Pose pose = scene::trajectory_at(scenario.sensor.trajectory, start_ns).pose;
  const physics::GeoPlace place = physics::place_at_ecef(
      physics::ecef_m(origin) + physics::ecef_from_enu(origin) * pose.position_world_m);
  const double heading = physics::heading_pitch_roll(pose.world_from_body).heading_rad;
  const auto own = root / "aircraft" / options.aircraft / "emit_start.xml";
  if (auto done = write_text(own, start_xml(place, heading, options.speed_m_s)); !done) {
    return tl::unexpected(done.error());
  }
  auto rows = LinePipe::open_named(root / "states.csv");
  if (!rows) return tl::unexpected(rows.error());
  const auto port = free_port();
  if (!port) return tl::unexpected(port.error());
  std::unique_ptr<JsbsimHost> out(new JsbsimHost(options, origin, std::move(*rows)));
  if (auto done = out->launch(*port); !done) return tl::unexpected(done.error());
  if (auto done = out->connect(*port); !done) return tl::unexpected(done.error());
  const auto came = out->next_state(kPatience);
  if (!came) return tl::unexpected(came.error());
  if (!*came) return make_error(ErrorCode::io, "JSBSim: its first state did not come");
  out->rows_.close_write_end();
  // JSBSim makes a step or two before it holds. The flight begins where it rests.
  constexpr std::chrono::milliseconds kRest(300);
  while (true) {
    const auto more = out->next_state(kRest);
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
  }
  out->begin_s_ = out->state_.time_s;
  return out;
}

Result<void> JsbsimHost::launch(std::uint16_t port) {
  steps_ = static_cast<std::uint32_t>(std::ceil(kLeastStepRateHz / options_.rate_hz - 1e-9));
  const auto root = std::filesystem::absolute(options_.work / "jsbsim");
  const auto script = root / "emit_script.xml";
  if (auto done = write_text(script, script_xml(options_, port, options_.rate_hz * steps_));
      !done) {
    return done;
  }
  auto process = Subprocess::start({options_.program.string(), "--root=" + root.string(),
                                    "--script=" + script.string(), "--suspend", "--nohighlight"},
                                   options_.work / "jsbsim.log");
  if (!process) return tl::unexpected(process.error());
  process_.emplace(std::move(*process));
  return {};
}

Result<void> JsbsimHost::connect(std::uint16_t port) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (std::chrono::steady_clock::now() < end) {
    if (const auto status = process_->poll()) {
      return make_error(ErrorCode::io,
                        fmt::format("JSBSim ended with exit code {}; see {}", *status,
                                    (options_.work / "jsbsim.log").string()));
    }
    console_ = ::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const sockaddr_in address = loopback(port);
    if (console_ >= 0 &&
        ::connect(console_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) {
      const int yes = 1;
      static_cast<void>(::setsockopt(console_, IPPROTO_TCP, TCP_NODELAY, &yes, sizeof yes));
      return {};
    }
    if (console_ >= 0) ::close(console_);
    console_ = -1;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return make_error(ErrorCode::io, "JSBSim: its console does not answer");
}

JsbsimHost::~JsbsimHost() {
  if (console_ >= 0) ::close(console_);
}

Result<void> JsbsimHost::iterate() {
  constexpr std::string_view kCommand = "iterate 1\n";
  if (::send(console_, kCommand.data(), kCommand.size(), MSG_NOSIGNAL) !=
      static_cast<ssize_t>(kCommand.size())) {
    return make_error(ErrorCode::io, fmt::format("JSBSim's console: {}", std::strerror(errno)));
  }
  // Nobody needs the console's answers: the rows tell what happened. They are read so that JSBSim
  // never waits for room.
  std::array<char, 1024> answers;
  while (::recv(console_, answers.data(), answers.size(), MSG_DONTWAIT) > 0) {
  }
  return {};
}

Result<bool> JsbsimHost::next_state(std::chrono::milliseconds timeout) {
  const auto end = std::chrono::steady_clock::now() + timeout;
  while (true) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        end - std::chrono::steady_clock::now());
    const auto line = rows_.next(std::max(left, std::chrono::milliseconds(0)));
    if (!line) {
      return make_error(ErrorCode::io, fmt::format("JSBSim: {}; see {}", line.error().text,
                                                   (options_.work / "jsbsim.log").string()));
    }
    if (!*line) return false;
    if ((*line)->starts_with("Time")) continue;  // the header
    const auto state = parse_jsbsim_row(**line);
    if (!state) return tl::unexpected(state.error());
    // JSBSim writes a row for every pass, also for those in which it holds.
    if (has_state_ && state->time_s <= state_.time_s) continue;
    state_ = *state;
    has_state_ = true;
    return true;
  }
}

physics::Pose JsbsimHost::seeker_pose() const noexcept {
  physics::Pose out = pose_of(state_, origin_);
  // The body's y axis points to the right, about which a turn lifts the nose.
  out.world_from_body =
      out.world_from_body * glm::angleAxis(options_.mount_pitch_rad, glm::dvec3(0.0, 1.0, 0.0));
  return out;
}

FlightTruth JsbsimHost::truth() const noexcept {
  FlightTruth out;
  const glm::dmat3 world_from_ecef = glm::transpose(physics::ecef_from_enu(origin_));
  const physics::GeoPlace place{physics::Radians(state_.latitude_rad),
                                physics::Radians(state_.longitude_rad),
                                physics::Metres(state_.height_m)};
  out.velocity_m_s =
      world_from_ecef * physics::ecef_from_enu(place) *
      (kMetresPerFoot * glm::dvec3(state_.east_ft_s, state_.north_ft_s, -state_.down_ft_s));
  return out;
}

Result<bool> JsbsimHost::advance(double) {
  // Instants count from the first one, so that rounding does not add up.
  ++poses_;
  const double step_s = 1.0 / (options_.rate_hz * steps_);
  const double goal_s = begin_s_ + static_cast<double>(poses_) / options_.rate_hz;
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (state_.time_s < goal_s - 0.25 * step_s) {
    if (auto done = iterate(); !done) return tl::unexpected(done.error());
    const auto came = next_state(std::chrono::milliseconds(200));
    if (!came) return tl::unexpected(came.error());
    if (std::chrono::steady_clock::now() > end) {
      return make_error(ErrorCode::io, "JSBSim: it does not step");
    }
  }
  if (std::abs(state_.time_s - goal_s) > 0.25 * step_s) {
    return make_error(
        ErrorCode::protocol,
        fmt::format("JSBSim: it went to {:.6f} s where {:.6f} s was due", state_.time_s, goal_s));
  }
  return true;
}

}  // namespace emit::tool
