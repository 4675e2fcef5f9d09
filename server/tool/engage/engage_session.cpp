// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/engage_session.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/constants.hpp"
#include "emit/scene/trajectory.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr std::chrono::seconds kFrameTimeout(120);

/// Axes of the simulated motion simulator, with the limits that `emit fms-sim` has by default.
config::MotionConfig motion_config(const std::string& controller, std::uint32_t target_entity) {
  using physics::kDegree;
  config::MotionConfig out;
  out.controller = controller;
  const config::MotionAxisConfig axis{-110.0 * kDegree, 110.0 * kDegree, 400.0 * kDegree,
                                      8000.0 * kDegree, 0.0};
  out.axes.assign(5, axis);
  out.target_rings = config::TargetRings::azimuth_elevation;
  out.target_entity = target_entity;
  // A busy machine without a real-time kernel leaves gaps between measurements.
  out.feedback_timeout_ns = 1'000'000'000;
  out.host_timeout_ns = 1'000'000'000;
  out.controller_timeout_ms = 1000;
  return out;
}

}  // namespace

double EngageSession::focal_px() const noexcept {
  return 0.5 * scenario_.sensor.width_px / std::tan(0.5 * scenario_.sensor.fov_h_rad);
}

Result<std::string> EngageSession::start_motion() {
  const auto bin = executable_dir();
  if (!bin) return tl::unexpected(bin.error());
  auto lines = LinePipe::open();
  if (!lines) return tl::unexpected(lines.error());
  auto process =
      Subprocess::start({(*bin / "emit").string(), "fms-sim", "--listen", "127.0.0.1:0", "--axes",
                         "5", "--json", (options_.out / "fms_sim.json").string()},
                        work_.path() / "fms_sim.log", lines->write_end());
  if (!process) return tl::unexpected(process.error());
  lines->close_write_end();
  motion_.emplace(std::move(*process));
  motion_lines_.emplace(std::move(*lines));
  const auto line = motion_lines_->next(std::chrono::seconds(20));
  if (!line) return tl::unexpected(physics::Error(line.error()).with_context("emit fms-sim"));
  constexpr std::string_view kReady = "ready axes_udp=";
  if (!*line || !(*line)->starts_with(kReady)) {
    return make_error(ErrorCode::io, "emit fms-sim did not say that it is ready");
  }
  return (*line)->substr(kReady.size());
}

config::DaemonConfig EngageSession::daemon_config(const std::string& controller) const {
  std::error_code ignored;
  config::DaemonConfig out;
  out.scenario = std::filesystem::absolute(scenario_.file, ignored);
  out.source.first_time_ns = start_ns_;
  out.pacing.mode = config::PacingMode::host_step;
  out.host.udp = "127.0.0.1:0";
  out.control.tcp = "127.0.0.1:0";
  out.stream.shm = fmt::format("emit-engage-{}", ::getpid());
  out.journal.file = std::filesystem::absolute(options_.out / "journal.mcap", ignored);
  if (options_.real_time) {
    out.pacing.mode = config::PacingMode::ig_clock;
    out.pacing.rate_hz = options_.rate_hz;
    out.pacing.horizon_ns = 200'000'000;
    out.pacing.display_delay_ns = std::llround(1e6 * options_.display_delay_ms);
    out.motion = motion_config(controller, options_.target_entity);
    // The laboratory looks the way of the launch, so that the axes stay far from their ends.
    const physics::Pose launch = scene::trajectory_at(scenario_.sensor.trajectory, start_ns_).pose;
    out.motion.lab_rad = {physics::heading_pitch_roll(launch.world_from_body).heading_rad, 0.0,
                          0.0};
    out.source.first_time_ns = start_ns_ - kHoldNs;
  }
  return out;
}

Result<void> EngageSession::start() {
  std::string controller;
  std::vector<std::string> set = options_.set;
  if (options_.real_time) {
    auto address = start_motion();
    if (!address) return tl::unexpected(address.error());
    controller = std::move(*address);
    for (std::size_t i = 0; i < scenario_.channels.size(); ++i) {
      set.push_back(fmt::format("channel[{}].kind=\"projector\"", i));
    }
  }
  const config::DaemonConfig config = daemon_config(controller);
  auto daemon = DaemonProcess::start(config, set, work_.path(), std::chrono::minutes(15));
  if (!daemon) return tl::unexpected(daemon.error());
  daemon_.emplace(std::move(*daemon));
  if (auto done = connect(); !done) return done;
  SeekerProcess::Options seeker;
  seeker.command = options_.seeker;
  seeker.method = options_.method;
  seeker.url = "shm://" + config.stream.shm;
  seeker.channel = channel_.name;
  seeker.focal_px = focal_px();
  seeker.newest = options_.real_time;
  seeker.log = work_.path() / "seeker.log";
  auto started = SeekerProcess::start(seeker, std::chrono::seconds(60));
  if (!started) return tl::unexpected(started.error());
  seeker_.emplace(std::move(*started));
  return {};
}

Result<void> EngageSession::connect() {
  auto frames = client::FrameClient::connect("shm://" + fmt::format("emit-engage-{}", ::getpid()));
  if (!frames) return tl::unexpected(frames.error());
  frames_ = std::move(*frames);
  client::SubscribeOptions wish;
  wish.channel_name = options_.channel;
  wish.every_frame = !options_.real_time;
  auto channel = frames_->subscribe(wish);
  if (!channel) return tl::unexpected(channel.error());
  channel_ = std::move(*channel);
  if (const auto band = channel_.spectral_band()) apparent_.emplace(*band);
  auto host = client::HostClient::connect("tcp://" + daemon_->control_address());
  if (!host) return tl::unexpected(host.error());
  host_ = std::move(*host);
  return {};
}

void EngageSession::fill_host_frame(const FlightHost& host, std::uint64_t number,
                                    std::int64_t sim_time_ns) {
  make_host_frame(scenario_, sim_time_ns, options_.rate_hz, 0, *sent_);
  sent_->frame_number = number;
  sent_->seeker = host.seeker_pose();
  sent_->seeker_rates = host.seeker_rates();
}

Result<void> EngageSession::send_host_frame(protocol::LogWriter* log) {
  if (auto sent = host_->send(*sent_); !sent) return sent;
  while (true) {
    const auto status = host_->receive_status(0);
    if (!status) return tl::unexpected(status.error());
    if (!*status) break;
    if (!(*status)->ok()) {
      return make_error(
          ErrorCode::protocol,
          fmt::format("emitd refused pose {}: {}", (*status)->host_frame_number, (*status)->text));
    }
  }
  // A log that was made holds simulation times. They may begin below 0 and then count from there.
  if (log == nullptr) return {};
  return log->write_host(*sent_, sent_->sim_time_ns - std::min<std::int64_t>(start_ns_, 0));
}

Result<const client::ReceivedFrame*> EngageSession::frame_of_host(std::uint64_t number) {
  const auto end = Clock::now() + kFrameTimeout;
  while (Clock::now() < end) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
    const auto frame = frames_->receive(200'000'000);
    if (!frame) {
      if (auto alive = daemon_->check_alive(); !alive) return tl::unexpected(alive.error());
      return tl::unexpected(frame.error());
    }
    if (*frame != nullptr && (*frame)->header.host_frame_number == number) return *frame;
  }
  return make_error(ErrorCode::io,
                    fmt::format("no frame for pose {} within {} s", number, kFrameTimeout.count()));
}

Result<SeekerAnswer> EngageSession::answer_to_host(std::uint64_t number) {
  const auto end = Clock::now() + kFrameTimeout;
  while (Clock::now() < end) {
    if (InterruptGuard::interrupted()) return make_error(ErrorCode::io, "interrupted");
    const auto answer = seeker_->next(std::chrono::milliseconds(200));
    if (!answer) return tl::unexpected(answer.error());
    if (!*answer) continue;
    if ((*answer)->host_frame_number == number) return **answer;
    return make_error(ErrorCode::protocol,
                      fmt::format("the seeker answered to pose {} where pose {} was due: it must "
                                  "answer every frame in order",
                                  (*answer)->host_frame_number, number));
  }
  return make_error(ErrorCode::io, fmt::format("the seeker did not answer pose {} within {} s",
                                               number, kFrameTimeout.count()));
}

LoopFrame EngageSession::frame_at(const FlightHost& host) {
  LoopFrame out;
  out.time_s = host.time_s();
  out.host_pose = host.seeker_pose();
  out.truth = host.truth();
  out.target_m = host.target_m(out.time_s);
  return out;
}

void EngageSession::take_answer(const protocol::FrameHeader& header, const SeekerAnswer& answer,
                                LoopFrame& frame, FlightHost& host) const {
  frame.frame_pose = header.pose;
  frame.flags = header.flags;
  frame.motion_state = header.motion_state;
  if (header.motion_state == protocol::MotionState::following) {
    frame.pointing_error_px = static_cast<double>(header.pointing_error_px);
  }
  frame.answer = answer;
  const double time_s = 1e-9 * static_cast<double>(header.sim_time_ns - start_ns_);
  std::optional<glm::dvec3> direction;
  if (answer.found) {
    direction = direction_of(answer, header.pose);
    if (const auto target = host.target_m(time_s)) {
      const glm::dvec3 truth = *target - header.pose.position_world_m;
      frame.measured_error_rad =
          std::atan2(glm::length(glm::cross(*direction, truth)), glm::dot(*direction, truth));
    }
  }
  host.measure(time_s, direction);
}

double EngageSession::progress_frac(const FlightHost& host) const noexcept {
  if (host.guided() && first_range_m_ > 0.0) return 1.0 - host.truth().range_m / first_range_m_;
  return host.time_s() / options_.duration_s;
}

Result<void> EngageSession::keep_film(const client::ReceivedFrame& shown, const FlightHost& host,
                                      LoopRecord& record) {
  const double progress = progress_frac(host);
  if (next_film_ >= options_.film_frac.size() || progress < options_.film_frac[next_film_]) {
    return {};
  }
  while (next_film_ < options_.film_frac.size() && progress >= options_.film_frac[next_film_]) {
    ++next_film_;
  }
  FilmPicture picture;
  picture.time_s = 1e-9 * static_cast<double>(shown.header.sim_time_ns - start_ns_);
  picture.range_m = host.truth().range_m;
  picture.file = fmt::format("film_{:02}.png", record.film.size());
  picture.frame_number = shown.header.frame_number;
  FramePlanes planes;
  planes.width_px = shown.header.width_px;
  planes.height_px = shown.header.height_px;
  plane_of(planes, shown.header.quantity) = shown.pixels;
  planes.apparent = apparent_ ? &*apparent_ : nullptr;
  planes.metadata = {shown.header.sim_time_ns,
                     shown.header.frame_number,
                     shown.header.pose,
                     channel_.band,
                     channel_.band_lo_um,
                     channel_.band_hi_um,
                     std::string(pixel_unit(shown.header.quantity)),
                     channel_.response};
  if (auto done = write_frame_png(options_.out / picture.file, planes,
                                  {scenario_.display.min_k, scenario_.display.max_k});
      !done) {
    return done;
  }
  record.film.push_back(std::move(picture));
  return {};
}

Result<LoopRecord> EngageSession::fly_in_steps(FlightHost& host) {
  auto log = protocol::LogWriter::create(flight_log());
  if (!log) return tl::unexpected(log.error());
  LoopRecord record;
  first_range_m_ = host.truth().range_m;
  const auto begin = Clock::now();
  const auto most =
      static_cast<std::uint64_t>(std::floor(options_.duration_s * options_.rate_hz)) + 1;
  Progress progress("frames", most);
  for (std::uint64_t k = 0; k < most; ++k) {
    LoopFrame frame = frame_at(host);
    const auto sim_time_ns =
        start_ns_ +
        static_cast<std::int64_t>(std::llround(static_cast<double>(k) * 1e9 / options_.rate_hz));
    fill_host_frame(host, k + 1, sim_time_ns);
    const auto sent = Clock::now();
    if (auto done = send_host_frame(&*log); !done) return tl::unexpected(done.error());
    ++record.poses;
    const auto shown = frame_of_host(k + 1);
    if (!shown) return tl::unexpected(shown.error());
    const auto answer = answer_to_host(k + 1);
    if (!answer) return tl::unexpected(answer.error());
    frame.loop_delay_ms = std::chrono::duration<double, std::milli>(Clock::now() - sent).count();
    ++record.answers;
    const std::size_t pictures = record.film.size();
    if (auto done = keep_film(**shown, host, record); !done) return tl::unexpected(done.error());
    if (record.film.size() > pictures) record.film.back().answer = *answer;
    take_answer((*shown)->header, *answer, frame, host);
    record.frames.push_back(frame);
    const auto flies = host.advance(1.0 / options_.rate_hz);
    if (!flies) return tl::unexpected(flies.error());
    progress.advance_to(k + 1);
    if (!*flies) {
      record.ended = true;
      break;
    }
  }
  progress.finish();
  record.wall_s = std::chrono::duration<double>(Clock::now() - begin).count();
  if (auto done = log->close(); !done) return tl::unexpected(done.error());
  return record;
}

Result<void> EngageSession::stop() {
  // The seeker ends when the stream does.
  host_.reset();
  if (daemon_) {
    if (auto done = daemon_->stop(std::chrono::seconds(30)); !done) return done;
  }
  if (motion_) {
    motion_->send_signal(SIGINT);
    static_cast<void>(motion_->wait(std::chrono::seconds(10)));
  }
  return {};
}

}  // namespace emit::tool
