// SPDX-License-Identifier: Apache-2.0
// The loop through a motion simulator on a fake clock: host, conductor, motion agent and a
// simulated table that is reached by UDP, by memory or by ACUTROL commands.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "agents/motion/motion_agent.hpp"
#include "agents/motion/motion_setup.hpp"
#include "axes/open_axes_link.hpp"
#include "emit/physics/constants.hpp"
#include "motion/table_simulator.hpp"
#include "support/conductor_rig.hpp"
#include "support/table_ends.hpp"

namespace emit::server {
namespace {

using protocol::MotionState;
using test::kMs;
using test::kSecondNs;

constexpr glm::dvec2 kSizePx{640.0, 512.0};
const double kFocalPx = 320.0 / std::tan(5.0 * physics::kDegree);
const glm::dvec3 kGimbalRad{0.2, -0.1, 0.05};  // of the seeker that is injected into
const glm::dvec3 kTargetM{900.0, 1200.0, 250.0};

enum class Link : std::uint8_t { udp, memory, acutrol };

struct LoopOptions {
  Link link = Link::udp;
  std::string rings = "yaw-pitch-roll";
  double delay_s = 0.001;
  double noise_arcsec = 0.0;
  bool projects = true;
  bool injects_too = false;  ///< a second channel looks along the detector of the seeker
  std::int64_t display_delay_ns = 10 * kMs;
  bool applies_shift = false;  ///< a second channel shows a window, moved by the shift
};

config::DaemonConfig daemon_config(const LoopOptions& options, const std::string& controller) {
  config::DaemonConfig config;
  config.motion.controller = controller;
  config.motion.unit_rings = options.rings;
  config.motion.target_rings = config::TargetRings::azimuth_elevation;
  config.motion.target_entity = 7;
  config.motion.axes.assign(5, {-2.0, 2.0, 7.0, 140.0, 0.0});
  // The parts of a real table never stand exactly as they should.
  config.motion.lab_rad = {0.6, 0.01, -0.02};
  config.motion.unit_base_rad = {0.01, 0.02, -0.01};
  config.motion.unit_mount_rad = {-0.02, 0.01, 0.03};
  config.motion.target_base_rad = {0.02, -0.01, 0.01};
  config.motion.target_mount_rad = {0.01, 0.015, -0.02};
  return config;
}

scene::ScenarioDesc scenario_with_target() {
  scene::ScenarioDesc scenario = test::scenario_with_entity(7);
  scenario.sensor.width_px = 640;
  scenario.sensor.height_px = 512;
  scenario.sensor.fov_h_rad = 10.0 * physics::kDegree;
  return scenario;
}

std::vector<Channel> channels_of(scene::ChannelKind kind) {
  Channel channel;
  channel.kind = kind;
  return {channel};
}

std::unique_ptr<test::TableEnd> make_end(Link link) {
  switch (link) {
    case Link::udp:
      return std::make_unique<test::UdpTableEnd>();
    case Link::memory:
      return std::make_unique<test::MemoryTableEnd>();
    case Link::acutrol:
      break;
  }
  return std::make_unique<test::AcutrolTableEnd>();
}

/// Everything in the loop, with frames at 100 Hz, poses at 100 Hz and axes at 1 kHz.
class Loop {
 public:
  explicit Loop(const LoopOptions& options)
      : options_(options),
        end_(make_end(options.link)),
        plan_(*make_motion_plan(daemon_config(options, end_->controller()), scenario_with_target(),
                                channels_of(options.projects ? scene::ChannelKind::projector
                                                             : scene::ChannelKind::injection))),
        rig_(pacing(options), scenario_with_target(), false, &plan_) {
    auto link = open_axes_link(daemon_config(options, end_->controller()).motion,
                               rig_.context().counters, rig_.context().motion_events);
    EXPECT_TRUE(link.has_value());
    auto follower = TableFollower::create(plan_.follower);
    EXPECT_TRUE(follower.has_value());
    if (options.applies_shift) apply_shift();
    if (options.injects_too) inject_too();
    agent_.emplace(rig_.context(), std::move(*link), std::move(*follower), kMs);
    EXPECT_TRUE(agent_->on_start());
    TableSimulator::Options simulated;
    TableSimulator::Axis axis;
    axis.dynamics.limits = {-2.0, 2.0, 7.0, 140.0};
    axis.dynamics.natural_rad_s = 2.0 * physics::kPi * 20.0;
    axis.dynamics.delay_s = options.delay_s;
    axis.dynamics.noise_rad = options.noise_arcsec * physics::kDegree / 3600.0;
    simulated.axes.assign(5, axis);
    simulated.step_ns = step_ns();
    auto table = TableSimulator::create(simulated);
    EXPECT_TRUE(table.has_value());
    table_.emplace(std::move(*table));
    rig_.settle();
  }

  void run(std::int64_t for_ns) {
    for (std::int64_t end_ns = rig_.clock.tai_ns() + for_ns; rig_.clock.tai_ns() < end_ns;) {
      // Answers that are asked for need as long to come as the questions did.
      if (options_.link == Link::acutrol) {
        rig_.clock.advance(kMs / 2);
        turn_table(controller_answers);
        rig_.clock.advance(kMs / 2);
        if (host_speaks && sim_ns() % (10 * kMs) == 5 * kMs) send_pose();
        turn_table(false);
      } else {
        rig_.clock.advance(kMs);
        if (host_speaks && sim_ns() % (10 * kMs) == 5 * kMs) send_pose();
        turn_table(controller_answers);
      }
      if (agent_runs) agent_->do_work(rig_.clock.tai_ns());
      rig_.settle();
    }
  }

  /// Returns the distance between where the frame shows a point of the world to the real seeker and
  /// where the simulated one sees it, px. `from_centre_px` is the place of the point in the image.
  [[nodiscard]] double pointing_error_px(const protocol::FrameHeader& frame,
                                         const glm::dvec2& from_centre_px) const {
    const TableAngles angles = angles_at(frame.display_ns);
    const glm::dmat3 seeker_from_projector = plan_.follower.table.seeker_from_projector(angles);
    const glm::dmat3 sensor_from_body = physics::sensor_from_body();
    // The frame has the point at this place before it is shifted.
    const glm::dvec3 in_rendered =
        glm::transpose(sensor_from_body) * glm::dvec3(from_centre_px / kFocalPx, 1.0);
    const glm::dvec3 in_world = glm::mat3_cast(frame.pose.world_from_body) * in_rendered;
    const glm::dvec2 shifted_px = from_centre_px + glm::dvec2(frame.shift_x_px, frame.shift_y_px);
    const glm::dvec3 shown = seeker_from_projector * glm::transpose(sensor_from_body) *
                             glm::dvec3(shifted_px / kFocalPx, 1.0);
    const glm::dvec3 wanted =
        glm::transpose(glm::mat3_cast(seeker_at(frame.sim_time_ns))) * in_world;
    return kFocalPx * glm::length(glm::cross(glm::normalize(shown), glm::normalize(wanted)));
  }
  [[nodiscard]] std::int64_t sim_ns() const { return rig_.clock.tai_ns() - start_ns_; }
  [[nodiscard]] static glm::dquat seeker_at(std::int64_t sim_ns) {
    const double t = 1e-9 * static_cast<double>(sim_ns);
    return physics::world_from_body_heading_pitch_roll(
        0.6 + 0.3 * std::sin(1.7 * t), 0.15 * std::sin(1.1 * t), 0.4 * std::sin(0.9 * t));
  }
  [[nodiscard]] TableAngles angles_at(std::int64_t wall_ns) const {
    const auto found = std::ranges::find(monitors, wall_ns, &protocol::AxesMonitor::time_ns);
    if (found == monitors.end()) return {};
    const auto& m = found->measured;
    return {{m[0].angle_rad, m[1].angle_rad, m[2].angle_rad}, {m[3].angle_rad, m[4].angle_rad}};
  }

  test::ConductorRig& rig() { return rig_; }
  std::vector<protocol::AxesMonitor> monitors;
  [[nodiscard]] protocol::AxesMode last_mode() const { return end_->last_mode; }
  bool host_speaks = true;
  bool controller_answers = true;
  bool agent_runs = true;
  std::uint64_t host_run = 1;
  int target_every = 1;  ///< poses of the seeker for one of the target
  glm::dvec3 target_m = kTargetM;
  bool target_teleports = false;
  TableSimulator& table() { return *table_; }

 private:
  static config::PacingConfig pacing(const LoopOptions& options) {
    config::PacingConfig out;
    out.mode = config::PacingMode::ig_clock;
    out.rate_hz = 100.0;
    out.display_delay_ns = options.display_delay_ns;
    return out;
  }
  /// Channels: the whole image of 8 x 4, and a window of it that shifts.
  void apply_shift() {
    scene::ScenarioDesc scenario;
    scenario.bands = {{"8-12", 8.0, 12.0, {}}};
    scenario.channels.resize(2);
    for (scene::ChannelDesc& channel : scenario.channels) {
      channel.band = "8-12";
      channel.kind = scene::ChannelKind::projector;
    }
    scenario.channels[1].window_px = {2, 1, 4, 2};
    scenario.channels[1].output.apply_shift = true;
    auto table = make_channels(scenario, *rig_.render().source_info(), true);
    ASSERT_TRUE(table.has_value()) << table.error().text;
    rig_.context().cameras = std::move(table->cameras);
    rig_.context().channels = std::move(table->channels);
    rig_.context().pictures = std::move(table->pictures);
    rig_.context().shifts_pictures = true;
    rig_.render().shift_by(plan_);
  }
  /// Channels: one along the projector and one along the detector.
  void inject_too() {
    scene::ScenarioDesc scenario;
    scenario.bands = {{"8-12", 8.0, 12.0, {}}};
    scenario.channels.resize(2);
    for (scene::ChannelDesc& channel : scenario.channels) channel.band = "8-12";
    scenario.channels[0].kind = scene::ChannelKind::projector;
    auto table = make_channels(scenario, *rig_.render().source_info(), true);
    ASSERT_TRUE(table.has_value()) << table.error().text;
    ASSERT_EQ(table->cameras.size(), 2U);
    rig_.context().channels = std::move(table->channels);
    rig_.context().pictures = std::move(table->pictures);
    rig_.context().cameras = std::move(table->cameras);
  }
  void send_pose() {
    const glm::dquat seeker = seeker_at(sim_ns());
    rig_.with([&](protocol::HostFrameData& frame) {
          frame.seeker.world_from_body = seeker;
          if (options_.injects_too) frame.gimbal_rad = kGimbalRad;
          // A host tells the rates of its seeker.
          const double step_s = 1e-4;
          const glm::dquat turn = glm::conjugate(seeker) *
                                  seeker_at(sim_ns() + static_cast<std::int64_t>(step_s * 1e9));
          frame.seeker_rates =
              protocol::PoseRates{{}, glm::dvec3(turn.x, turn.y, turn.z) * (2.0 / step_s)};
          if (number_ % static_cast<std::uint64_t>(target_every) != 0) return;
          frame.entity_count = 1;
          frame.entities[0] = {};
          frame.entities[0].entity_id = 7;
          frame.entities[0].has_pose = true;
          frame.entities[0].pose.position_world_m = target_m;
          frame.entities[0].teleport = std::exchange(target_teleports, false);
        })
        .send(++number_, sim_ns(), 0.0, host_run);
  }

  [[nodiscard]] std::int64_t step_ns() const {
    return options_.link == Link::acutrol ? kMs / 2 : kMs;
  }
  void turn_table(bool answers) {
    const std::int64_t now_ns = rig_.clock.tai_ns();
    end_->take(*table_, now_ns);
    const protocol::AxesMonitor& monitor = table_->step(now_ns);
    monitors.push_back(monitor);
    if (answers) end_->report(monitor, now_ns);
  }

  LoopOptions options_;
  std::unique_ptr<test::TableEnd> end_;
  MotionPlan plan_;
  test::ConductorRig rig_;
  const std::int64_t start_ns_ = rig_.clock.tai_ns();
  std::optional<MotionAgent> agent_;
  std::optional<TableSimulator> table_;
  std::uint64_t number_ = 0;
};

/// Root mean square and greatest pointing error over frames that are shown already.
struct Pointing {
  double rms_px = 0.0;
  double max_px = 0.0;
  int frames = 0;
};
Pointing pointing_of(Loop& loop, std::size_t from, const glm::dvec2& from_centre_px) {
  Pointing out;
  double squares = 0.0;
  for (std::size_t i = from; i < loop.rig().frames.size(); ++i) {
    const protocol::FrameHeader& header = loop.rig().frames[i].header;
    if (header.display_ns > loop.rig().clock.tai_ns()) continue;
    const double error_px = loop.pointing_error_px(header, from_centre_px);
    squares += error_px * error_px;
    out.max_px = std::max(out.max_px, error_px);
    ++out.frames;
  }
  out.rms_px = std::sqrt(squares / std::max(out.frames, 1));
  return out;
}

/// Tests of every way to the controller.
class MotionLoopBy : public ::testing::TestWithParam<Link> {};
std::string name_of(const ::testing::TestParamInfo<Link>& test) {
  constexpr std::array kNames = {"udp", "memory", "acutrol"};
  return kNames[static_cast<std::size_t>(test.param)];
}
INSTANTIATE_TEST_SUITE_P(Links, MotionLoopBy,
                         ::testing::Values(Link::udp, Link::memory, Link::acutrol), name_of);

TEST_P(MotionLoopBy, a_minute_of_projection_points_within_a_tenth_of_a_pixel) {
  LoopOptions options;
  options.link = GetParam();
  options.noise_arcsec = 1.0;
  Loop loop(options);
  loop.run(10 * kSecondNs);
  const std::size_t from = loop.rig().frames.size();
  loop.monitors.clear();
  loop.run(60 * kSecondNs);
  int flagged = 0;
  for (std::size_t i = from; i < loop.rig().frames.size(); ++i) {
    const protocol::FrameHeader& header = loop.rig().frames[i].header;
    flagged += (header.flags & protocol::kFlagMotionFault) != 0 ? 1 : 0;
    EXPECT_EQ(header.motion_state, MotionState::following);
  }
  EXPECT_EQ(flagged, 0);
  for (const glm::dvec2 place :
       {glm::dvec2(0.0), glm::dvec2(-320.0, -256.0), glm::dvec2(320.0, 256.0)}) {
    const Pointing pointing = pointing_of(loop, from, place);
    EXPECT_GE(pointing.frames, 5990);
    EXPECT_LT(pointing.rms_px, 0.1);
    EXPECT_LT(pointing.max_px, 0.4);
    RecordProperty(fmt::format("rms_px_{:.0f}", place.x), fmt::format("{:.4f}", pointing.rms_px));
    EXPECT_GT(pointing.rms_px, 1e-4) << "noise and lag cannot leave nothing";
  }
  // The header tells the error of earlier frames, and the metrics hold all of them.
  const double told_px = loop.rig().frames.back().header.pointing_error_px;
  EXPECT_GT(told_px, 0.0);
  EXPECT_LT(told_px, 0.4);
  EXPECT_LT(loop.rig().context().motion_times.pointing.max.load(), 0.4);
  EXPECT_EQ(loop.rig().count(Counter::axes_reports_refused), 0U);
  EXPECT_EQ(loop.rig().count(Counter::axes_torn_reads), 0U);
  EXPECT_EQ(loop.rig().count(Counter::axes_connections_lost), 0U);
  EXPECT_GT(loop.rig().count(Counter::axes_reports), 69'000U) << "one for nearly every command";
  EXPECT_EQ(loop.rig().count(Counter::axes_inputs_dropped), 0U);
  EXPECT_EQ(loop.rig().count(Counter::axes_reports_dropped), 0U);
}

TEST_P(MotionLoopBy, frames_say_that_a_controller_is_silent) {
  LoopOptions options;
  options.link = GetParam();
  Loop loop(options);
  loop.run(8 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U);
  const std::size_t from = loop.rig().frames.size();
  loop.controller_answers = false;
  loop.run(100 * kMs);
  const protocol::FrameHeader header = loop.rig().frames.back().header;
  EXPECT_EQ(header.motion_faults, protocol::kMotionNoFeedback);
  EXPECT_EQ(header.motion_state, MotionState::waiting);
  loop.run(2 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.size() - from, 210U) << "frames go on";
  loop.controller_answers = true;
  loop.run(12 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U);
  EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::following);
}

/// A frame whose display the axes reach without prediction leaves geometry alone.
TEST(MotionLoop, geometry_holds_over_the_field_in_every_nesting_order) {
  for (const char* rings : {"yaw-pitch-roll", "yaw-roll-pitch", "pitch-yaw-roll", "pitch-roll-yaw",
                            "roll-yaw-pitch", "roll-pitch-yaw"}) {
    LoopOptions options;
    options.rings = rings;
    options.delay_s = 0.0;
    options.display_delay_ns = 0;
    Loop loop(options);
    loop.run(8 * kSecondNs);
    const std::size_t from = loop.rig().frames.size();
    loop.monitors.clear();
    loop.run(1 * kSecondNs);
    for (double x = -320.0; x <= 320.0; x += 160.0) {
      for (double y = -256.0; y <= 256.0; y += 128.0) {
        const Pointing pointing = pointing_of(loop, from + 1, {x, y});
        EXPECT_GE(pointing.frames, 98);
        EXPECT_LT(pointing.max_px, 0.05) << rings << " at " << x << ", " << y;
      }
    }
    EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::following) << rings;
  }
}

/// One daemon, both kinds: the projected image is right through the axes, and the injected one is
/// that of the detector on its gimbals, over the whole field of both.
TEST(MotionLoop, geometry_holds_for_projection_and_injection_at_once) {
  LoopOptions options;
  options.delay_s = 0.0;
  options.display_delay_ns = 0;
  options.injects_too = true;
  Loop loop(options);
  loop.run(8 * kSecondNs);
  const std::size_t from = loop.rig().frames.size();
  loop.monitors.clear();
  loop.run(1 * kSecondNs);
  const glm::dmat3 body_from_detector =
      glm::mat3_cast(glm::angleAxis(kGimbalRad.x, glm::dvec3(0.0, 0.0, 1.0)) *
                     glm::angleAxis(kGimbalRad.y, glm::dvec3(0.0, 1.0, 0.0)) *
                     glm::angleAxis(kGimbalRad.z, glm::dvec3(1.0, 0.0, 0.0)));
  int projected = 0;
  for (std::size_t i = from + 1; i < loop.rig().frames.size(); ++i) {
    const PublishFrame& frame = loop.rig().frames[i];
    if (frame.header.display_ns > loop.rig().clock.tai_ns()) continue;
    ASSERT_EQ(frame.image.camera_count, 2U);
    protocol::FrameHeader of_projector = frame.header;
    of_projector.pose = frame.image.cameras[0].pose;
    const glm::dmat3 detector =
        glm::mat3_cast(Loop::seeker_at(frame.header.sim_time_ns)) * body_from_detector;
    const glm::dmat3 injected = glm::mat3_cast(frame.image.cameras[1].pose.world_from_body);
    for (double x = -320.0; x <= 320.0; x += 160.0) {
      for (double y = -256.0; y <= 256.0; y += 128.0) {
        EXPECT_LT(loop.pointing_error_px(of_projector, {x, y}), 0.05) << x << ", " << y;
        // A point that the injected image shows at (x, y), seen by the detector itself.
        const glm::dvec3 seen = glm::transpose(detector) * (injected * glm::dvec3(kFocalPx, x, y));
        EXPECT_LT(glm::distance(kFocalPx * glm::dvec2(seen.y, seen.z) / seen.x, glm::dvec2(x, y)),
                  0.05);
      }
    }
    ++projected;
  }
  EXPECT_GE(projected, 98);
  EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::following);
}

TEST(MotionLoop, an_injected_frame_looks_along_the_seeker) {
  LoopOptions options;
  options.projects = false;
  Loop loop(options);
  loop.run(8 * kSecondNs);
  const protocol::FrameHeader& header = loop.rig().frames.back().header;
  const glm::dquat turn =
      glm::conjugate(Loop::seeker_at(header.sim_time_ns)) * header.pose.world_from_body;
  EXPECT_LT(2.0 * std::abs(glm::length(glm::dvec3(turn.x, turn.y, turn.z))), 1e-4);
  EXPECT_EQ(header.shift_x_px, 0.0F);
  EXPECT_EQ(header.motion_state, MotionState::following);
  EXPECT_EQ(header.flags & protocol::kFlagMotionFault, 0U);
}

TEST(MotionLoop, frames_say_why_the_axes_do_not_follow) {
  Loop loop({});
  loop.run(20 * kMs);
  EXPECT_NE(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U)
      << "the axes have not set off yet";
  loop.run(8 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U);
  // The controller stops to answer.
  loop.controller_answers = false;
  loop.run(100 * kMs);
  protocol::FrameHeader header = loop.rig().frames.back().header;
  EXPECT_NE(header.flags & protocol::kFlagMotionFault, 0U);
  EXPECT_EQ(header.motion_faults, protocol::kMotionNoFeedback);
  EXPECT_EQ(header.motion_state, MotionState::waiting);
  EXPECT_EQ(loop.last_mode(), protocol::AxesMode::park);
  EXPECT_EQ(loop.rig().count(Counter::axes_feedback_losses), 1U);
  loop.controller_answers = true;
  loop.run(8 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U);
  // The host stops.
  loop.host_speaks = false;
  loop.run(500 * kMs);
  header = loop.rig().frames.back().header;
  EXPECT_NE(header.flags & protocol::kFlagMotionFault, 0U);
  EXPECT_NE(header.motion_faults & protocol::kMotionNoHost, 0);
  EXPECT_EQ(loop.last_mode(), protocol::AxesMode::park);
  EXPECT_GT(loop.rig().count(Counter::frames_motion_fault), 0U);
}

TEST(MotionLoop, an_agent_that_hangs_is_seen_in_the_frames) {
  for (const bool projects : {true, false}) {
    LoopOptions options;
    options.projects = projects;
    Loop loop(options);
    loop.run(8 * kSecondNs);
    ASSERT_EQ(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U);
    loop.agent_runs = false;
    loop.run(100 * kMs);
    const protocol::FrameHeader& header = loop.rig().frames.back().header;
    EXPECT_EQ(header.motion_state, MotionState::waiting);
    EXPECT_NE(header.motion_faults & protocol::kMotionNoFeedback, 0);
  }
}

TEST(MotionLoop, a_stopped_run_parks_the_axes_and_a_reset_closes_the_interlock) {
  Loop loop({});
  loop.run(8 * kSecondNs);
  const double elevation_rad = loop.monitors.back().demanded[4].angle_rad;
  loop.rig().command(CommandKind::stop);
  // The target rises by 1.5 degrees while the run is stopped, and is not told of again.
  loop.target_m = kTargetM + glm::dvec3(0.0, 0.0, 40.0);
  loop.run(500 * kMs);
  EXPECT_EQ(loop.last_mode(), protocol::AxesMode::park);
  loop.target_every = 1'000'000;

  loop.rig().command(CommandKind::start);
  loop.run(8 * kSecondNs);
  EXPECT_EQ(loop.last_mode(), protocol::AxesMode::follow);
  EXPECT_GT(std::abs(loop.monitors.back().demanded[4].angle_rad - elevation_rad), 0.01)
      << "the rings point to where it went";

  // A host that was started anew does not close an open interlock; the command does.
  loop.table().set_fault(0, AxisFault::runaway);
  loop.run(2 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::fault);
  loop.table().set_fault(0, AxisFault::none);
  loop.host_run = 2;
  loop.run(2 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::fault);
  loop.rig().command(CommandKind::reset);
  loop.run(20 * kMs);
  loop.rig().command(CommandKind::start);
  loop.run(10 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::following);
}

TEST(MotionLoop, a_target_that_comes_seldom_or_teleports_leaves_the_axes_calm) {
  Loop loop({});
  loop.target_every = 5;
  loop.run(8 * kSecondNs);
  const auto largest_rate = [&] {
    double out = 0.0;
    for (const protocol::AxesMonitor& monitor : loop.monitors) {
      for (const auto axis : {3U, 4U}) {
        out = std::max(out, std::abs(monitor.demanded[axis].rate_rad_s));
      }
    }
    loop.monitors.clear();
    return out;
  };
  largest_rate();
  loop.run(2 * kSecondNs);
  EXPECT_LT(largest_rate(), 1e-3) << "it stands";
  EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::following);
  loop.target_m = kTargetM + glm::dvec3(0.0, 0.0, 40.0);
  loop.target_teleports = true;
  loop.run(1 * kSecondNs);
  EXPECT_LT(largest_rate(), 4.0) << "a jump of 1.5 degrees within a tenth of a second";
  loop.run(8 * kSecondNs);
  EXPECT_EQ(loop.rig().frames.back().header.motion_state, MotionState::following);
}

TEST(MotionLoop, a_repeated_frame_is_shown_in_its_own_slot) {
  Loop loop({});
  loop.run(30 * kMs);
  EXPECT_NE(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U);
  loop.run(8 * kSecondNs);
  loop.rig().script.ready = false;
  loop.run(50 * kMs);
  const protocol::FrameHeader repeated = loop.rig().frames.back().header;
  ASSERT_NE(repeated.flags & protocol::kFlagRepeated, 0U);
  EXPECT_EQ(repeated.display_ns, repeated.slot_begin_ns + 10 * kMs);
  EXPECT_EQ(repeated.motion_state, MotionState::following);
}

TEST(MotionLoop, a_picture_is_moved_by_the_shift_that_its_header_has) {
  LoopOptions options;
  options.noise_arcsec = 1.0;
  options.applies_shift = true;
  Loop loop(options);
  loop.run(10 * kSecondNs + 8 * kMs);
  const std::size_t from = loop.rig().frames.size();
  loop.monitors.clear();
  const std::uint64_t unknown = loop.rig().count(Counter::output_shifts_unknown);
  double largest_px = 0.0;
  for (int i = 0; i < 300; ++i) {
    // A slot begins after 2 ms. Its pixels come 6 ms later; the axes are measured anew meanwhile.
    loop.rig().script.ready = false;
    loop.run(8 * kMs);
    loop.rig().script.ready = true;
    loop.run(2 * kMs);
    const PublishFrame& frame = loop.rig().frames.back();
    const glm::vec2 shift_px = frame.image.shift_px;
    ASSERT_EQ(frame.header.shift_x_px, shift_px.x);
    ASSERT_EQ(frame.header.shift_y_px, shift_px.y);
    largest_px = std::max<double>(largest_px, glm::length(shift_px));
    // The scripted image rises by 1 a column and by 8 a row, so that a moved one is known exactly.
    for (std::uint32_t y = 0; y < 2; ++y) {
      for (std::uint32_t x = 0; x < 4; ++x) {
        ASSERT_NEAR(frame.image.pictures[1][y * 4 + x],
                    frame.image.pictures[0][(1 + y) * 8 + 2 + x] - shift_px.x - 8.0F * shift_px.y,
                    2e-3);
      }
    }
    ASSERT_EQ(frame.image.crc32c[1], protocol::crc32c(std::as_bytes(frame.image.pictures[1])));
  }
  EXPECT_GT(largest_px, 0.01) << "the axes do lag";
  const Pointing pointing = pointing_of(loop, from, {0.0, 0.0});
  EXPECT_GE(pointing.frames, 290);
  EXPECT_LT(pointing.rms_px, 0.1) << "the header has the shift that was applied";
  EXPECT_EQ(loop.rig().count(Counter::output_shifts_unknown), unknown);
  EXPECT_EQ(loop.rig().count(Counter::shift_feedback_dropped), 0U);
}

TEST(MotionLoop, a_picture_rests_and_is_flagged_while_the_axes_are_not_known) {
  LoopOptions options;
  options.applies_shift = true;
  Loop loop(options);
  loop.run(8 * kSecondNs);
  ASSERT_EQ(loop.rig().frames.back().header.flags & protocol::kFlagMotionFault, 0U);
  loop.controller_answers = false;
  loop.run(200 * kMs);
  const PublishFrame& frame = loop.rig().frames.back();
  EXPECT_EQ(frame.image.shift_px, glm::vec2(0.0F));
  EXPECT_EQ(frame.header.shift_x_px, 0.0F);
  EXPECT_NE(frame.header.flags & protocol::kFlagMotionFault, 0U);
  EXPECT_NE(frame.header.motion_faults & protocol::kMotionNoFeedback, 0);
  EXPECT_GT(loop.rig().count(Counter::output_shifts_unknown), 0U);
  EXPECT_EQ(frame.image.pictures[1][0], frame.image.pictures[0][8 + 2]);
}

TEST(MotionLoop, a_repeated_frame_says_what_remains_of_the_shift) {
  LoopOptions options;
  options.applies_shift = true;
  Loop loop(options);
  loop.run(8 * kSecondNs);
  const PublishFrame newest = loop.rig().frames.back();
  loop.rig().script.ready = false;
  loop.run(50 * kMs);
  const PublishFrame& repeated = loop.rig().frames.back();
  ASSERT_TRUE(repeated.repeat);
  // The axes have turned by half a degree since, 56 arcsec a pixel.
  EXPECT_GT(std::abs(repeated.header.shift_x_px - newest.image.shift_px.x), 1.0F);
}

TEST(MotionLoop, a_target_that_the_scenario_lacks_is_refused) {
  config::DaemonConfig config = daemon_config({}, "127.0.0.1:1");
  config.motion.target_entity = 8;
  const auto plan =
      make_motion_plan(config, scenario_with_target(), channels_of(scene::ChannelKind::projector));
  ASSERT_FALSE(plan.has_value());
  EXPECT_THAT(plan.error().text, ::testing::HasSubstr("the scenario has no entity 8"));
}

TEST(MotionLoop, an_agent_that_did_not_run_leaves_out_commands_and_counts_them) {
  Loop loop({});
  loop.run(100 * kMs);
  const std::uint64_t sent = loop.rig().count(Counter::axes_commands);
  loop.rig().clock.advance(50 * kMs);
  loop.run(kMs);
  EXPECT_EQ(loop.rig().count(Counter::axes_commands), sent + 1);
  EXPECT_EQ(loop.rig().count(Counter::axes_commands_missed), 50U);
}

}  // namespace
}  // namespace emit::server
