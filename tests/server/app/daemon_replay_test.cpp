// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <optional>
#include <thread>
#include <vector>

#include "app/daemon.hpp"
#include "app/replay.hpp"
#include "emit/client/client.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/protocol/trigger.hpp"
#include "emit/v1/control.pb.h"
#include "net/socket.hpp"
#include "support/daemon_process.hpp"
#include "support/scripted_source.hpp"
#include "support/times.hpp"

namespace emit::server {
namespace {

using test::ScratchFolder;
using test::ScriptedSource;
using test::SourceScript;

using emit::test::kLongNs;

FrameSourceFactory scripted(SourceScript& script) {
  return [&script] {
    return physics::Result<std::unique_ptr<FrameSource>>(
        std::make_unique<ScriptedSource>(script, 32, 16, 7));
  };
}

/// A daemon in this process, on its own threads.
struct LiveDaemon {
  LiveDaemon(const config::DaemonConfig& config, SourceScript& script,
             const std::optional<scene::ScenarioDesc>& scenario = std::nullopt) {
    DaemonOptions options;
    options.source_factory = scripted(script);
    options.on_log = [](const std::string&) {};
    auto created = Daemon::create(config, scenario, options);
    EXPECT_TRUE(created.has_value()) << created.error().text;
    daemon = std::move(*created);
    url = "tcp://127.0.0.1:" + std::to_string(daemon->control_port());
    thread = std::thread([this] { code = daemon->run(); });
  }
  ~LiveDaemon() { stop(); }
  void stop() {
    daemon->request_stop();
    if (thread.joinable()) {
      thread.join();
    }
  }
  std::unique_ptr<Daemon> daemon;
  std::string url;
  std::thread thread;
  int code = -1;
};

config::DaemonConfig configuration(config::PacingMode mode, const std::string& journal) {
  config::DaemonConfig config;
  config.pacing.mode = mode;
  config.pacing.rate_hz = 400.0;
  config.host.udp = "127.0.0.1:0";
  config.control.tcp = "127.0.0.1:0";
  config.trigger.udp = "127.0.0.1:0";
  config.journal.file = journal;
  return config;
}

/// A sync source at 400 Hz, with faults: numbers missing, sent twice and too early.
class Triggers {
 public:
  explicit Triggers(const Daemon& daemon)
      : address_(numeric_address("127.0.0.1", daemon.trigger_port())), thread_([this] { run(); }) {}
  ~Triggers() {
    stop_.store(true);
    thread_.join();
  }
  Triggers(const Triggers&) = delete;
  Triggers& operator=(const Triggers&) = delete;

 private:
  void run() {
    auto socket = UdpSocket::open(SocketContext(), address_);
    protocol::Trigger trigger{1, 0, 0};
    while (socket && !stop_.load()) {
      trigger.number += trigger.number % 31 == 0 ? 3 : 1;
      std::array<std::byte, protocol::kTriggerBytes> bytes;
      protocol::encode(trigger, bytes);
      for (int copy = trigger.number % 17 == 0 ? 2 : 1; copy > 0; --copy) {
        static_cast<void>(socket->send_to(bytes, address_));
      }
      std::this_thread::sleep_for(std::chrono::microseconds(trigger.number % 23 == 0 ? 100 : 2500));
    }
  }

  SocketAddress address_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Sends everything that a journal must carry: entities, jumps, parts, weather, hold, stop and
/// step, reset, a restart of the host.
void drive(client::HostClient& host, client::FrameClient& frames) {
  std::uint64_t number = 0;
  std::uint64_t run = 1;
  const auto send = [&](bool frame_follows) {
    protocol::HostFrameData frame;
    frame.frame_number = ++number;
    frame.run_id = run;
    frame.sim_time_ns = static_cast<std::int64_t>(number) * 5'000'000;
    frame.seeker.position_world_m = {0.1 * static_cast<double>(number), -3.0, 200.0};
    frame.entity_count = 2;
    for (std::uint32_t i = 0; i < 2; ++i) {
      frame.entities[i].entity_id = i + 1;
      frame.entities[i].has_pose = true;
      frame.entities[i].pose.position_world_m.x = static_cast<double>(number * (i + 1)) / 3.0;
      frame.entities[i].teleport = number % 17 == 0;
      frame.entities[i].on = number % 13 != 0;
    }
    if (number % 7 == 0) {
      frame.parts[0] = {1, 2, protocol::PartCommandData::Kind::throttle,
                        static_cast<double>(number % 10) / 10.0};
      frame.parts[1] = {2, 1, protocol::PartCommandData::Kind::off, 0.0};
      frame.part_count = 2;
    }
    if (number % 11 == 0) {
      frame.environment.emplace();
      frame.environment->air_k = 280.0 + static_cast<double>(number % 7);
    }
    ASSERT_TRUE(host.send(frame).has_value());
    if (frame_follows) {
      const auto received = frames.receive(kLongNs);
      ASSERT_TRUE(received.has_value()) << received.error().text;
      ASSERT_NE(*received, nullptr);
    }
  };
  const auto command = [&](protocol::CommandKind kind) {
    ASSERT_TRUE(host.command(kind).has_value());
    const auto status = host.receive_status(kLongNs);
    ASSERT_TRUE(status.has_value()) << status.error().text;
    ASSERT_TRUE(status->has_value() && (*status)->ok());
  };
  const auto send_some = [&](int count, bool frame_follows = true) {
    for (int i = 0; i < count; ++i) {
      ASSERT_NO_FATAL_FAILURE(send(frame_follows));
    }
  };
  ASSERT_NO_FATAL_FAILURE(send_some(60));
  ASSERT_NO_FATAL_FAILURE(command(protocol::CommandKind::hold));
  ASSERT_NO_FATAL_FAILURE(send_some(20));
  ASSERT_NO_FATAL_FAILURE(command(protocol::CommandKind::start));
  ASSERT_NO_FATAL_FAILURE(command(protocol::CommandKind::stop));
  ASSERT_NO_FATAL_FAILURE(send_some(20, false));
  ASSERT_NO_FATAL_FAILURE(command(protocol::CommandKind::step));
  ASSERT_NO_FATAL_FAILURE(command(protocol::CommandKind::start));
  const auto stepped = frames.receive(kLongNs);
  ASSERT_TRUE(stepped.has_value() && *stepped != nullptr);
  ASSERT_NO_FATAL_FAILURE(send_some(20));
  ASSERT_NO_FATAL_FAILURE(command(protocol::CommandKind::reset));
  number = 0;
  ASSERT_NO_FATAL_FAILURE(send_some(30));
  ++run;
  number = 0;
  ASSERT_NO_FATAL_FAILURE(send_some(30));
}

/// Applies entries to a fresh source. Every frame must have the pixels of the live run.
struct Replay {
  SourceScript script;
  ScriptedSource source{script, 32, 16, 2};
  JournalPlayer player{source, *make_channels(std::nullopt, source.info())};
  std::uint64_t frames = 0;
  std::uint64_t rendered = 0;

  void apply(const v1::JournalEntry& entry) {
    const auto frame = player.apply(entry);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    if (*frame) {
      ++frames;
      rendered += (*frame)->repeated ? 0U : 1U;
      EXPECT_TRUE((*frame)->matches)
          << "frame " << (*frame)->frame_number << " of run " << (*frame)->run_id;
    }
  }
};

class DaemonReplay : public ::testing::TestWithParam<config::PacingMode> {};

TEST_P(DaemonReplay, TheJournalAloneGivesTheSamePixels) {
  const bool lock_step = GetParam() == config::PacingMode::host_step;
  ScratchFolder folder;
  SourceScript live_script;
  Replay from_file;
  Replay from_stream;
  std::uint64_t published = 0;
  {
    // Frames lose quality, in lock step always; the journal tells which.
    live_script.quality_levels = {{1.0, 0.0}, {0.5, 0.1}};
    auto config = configuration(GetParam(), folder.file("run.mcap"));
    if (lock_step) config.pacing.budget_ns = 1;
    LiveDaemon live(config, live_script);
    auto frames = client::FrameClient::connect(live.url);
    ASSERT_TRUE(frames.has_value()) << frames.error().text;
    ASSERT_TRUE((*frames)->subscribe({}).has_value());
    auto recorder = client::RecorderClient::connect(live.url);
    ASSERT_TRUE(recorder.has_value()) << recorder.error().text;
    auto host = client::HostClient::connect(live.url);
    ASSERT_TRUE(host.has_value()) << host.error().text;
    std::optional<Triggers> triggers;
    if (GetParam() == config::PacingMode::trigger) triggers.emplace(*live.daemon);
    ASSERT_NO_FATAL_FAILURE(drive(**host, **frames));

    std::thread stopping([&] { live.stop(); });
    v1::JournalEntry entry;
    for (;;) {
      const auto more = (*recorder)->receive(entry, kLongNs);
      if (!more) {
        EXPECT_TRUE((*recorder)->closed()) << more.error().text;
        break;
      }
      EXPECT_TRUE(*more) << "the daemon must close the journal stream when it ends";
      if (!*more) {
        break;
      }
      from_stream.apply(entry);
    }
    stopping.join();
    EXPECT_EQ(live.code, 0);
    published = live.daemon->counter(Counter::frames_published);
    EXPECT_EQ(live.daemon->counter(Counter::journal_dropped), 0U);
    if (lock_step) {
      EXPECT_EQ(live.daemon->counter(Counter::frames_shed), published);
    }
    EXPECT_EQ(live.daemon->counter(Counter::host_epochs), 1U);
  }
  auto log = protocol::LogReader::open(folder.file("run.mcap"));
  ASSERT_TRUE(log.has_value()) << log.error().text;
  for (auto more = log->next(); more && *more; more = log->next()) {
    ASSERT_NO_FATAL_FAILURE(from_file.apply(log->journal()));
  }
  EXPECT_EQ(from_file.frames, published);
  EXPECT_EQ(from_stream.frames, published);
  EXPECT_EQ(from_file.player.mismatches(), 0U);
  EXPECT_EQ(from_file.rendered, live_script.submitted.size());
  EXPECT_EQ(live_script.held.load(), 0) << "every slot went back to the source";
  // Weather that no frame used before the end, or before a reset, is not applied again.
  EXPECT_LE(from_file.script.weather.size(), live_script.weather.size());
  EXPECT_GT(from_file.script.weather.size(), 0U);
  if (lock_step) {
    EXPECT_EQ(from_file.script.weather.size(), live_script.weather.size());
    EXPECT_EQ(published, 60U + 20U + 1U + 20U + 30U + 30U);
  }
}

INSTANTIATE_TEST_SUITE_P(Pacing, DaemonReplay,
                         ::testing::Values(config::PacingMode::host_step,
                                           config::PacingMode::ig_clock,
                                           config::PacingMode::trigger),
                         [](const auto& parameter) {
                           return parameter.param == config::PacingMode::host_step  ? "HostStep"
                                  : parameter.param == config::PacingMode::ig_clock ? "IgClock"
                                                                                    : "Trigger";
                         });

/// Plays every entry of a journal.
void play_all(JournalPlayer& player, const std::string& journal) {
  auto log = protocol::LogReader::open(journal);
  ASSERT_TRUE(log.has_value()) << log.error().text;
  for (auto more = log->next(); more && *more; more = log->next()) {
    const auto frame = player.apply(log->journal());
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
  }
}

/// Cameras with fields of view, places and rates of their own, gimbals and a zoom: every image has
/// the same bits again, and clients get the headers of their own camera.
TEST(DaemonReplayOfCameras, EveryImageHasTheSameBits) {
  ScratchFolder folder;
  const std::string journal = folder.file("run.mcap");
  scene::ScenarioDesc scenario;
  scenario.name = "cameras";
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  scenario.sensor.fov_h_rad = 0.5;
  scenario.sensor.fov_h_min_rad = 0.1;
  for (const char* name : {"seeker", "wide", "side"}) {
    scenario.channels.push_back({name, scene::ChannelKind::injection, "8-12"});
  }
  // The seeker's noise has the same bits again too.
  scenario.channels[0].output.optics = {.spot = scene::SpotKind::gaussian, .sigma_px = 0.8};
  scenario.channels[0].output.detector = {
      .netd_k = 0.1, .row_noise_k = 0.05, .gain_spread_frac = 0.01, .counts_per_w_m2_sr = 100.0};
  scenario.channels[1].camera.fov_h_rad = 0.4;
  scenario.channels[1].every_nth = 3;
  scenario.channels[2].camera.offset_body_m = {0.0, 5.0, 0.0};
  scenario.channels[2].window_px = {4, 2, 20, 10};
  SourceScript live_script;
  {
    LiveDaemon live(configuration(config::PacingMode::host_step, journal), live_script, scenario);
    auto host = client::HostClient::connect(live.url);
    auto side = client::FrameClient::connect(live.url);
    auto seeker = client::FrameClient::connect(live.url);
    ASSERT_TRUE(host.has_value() && side.has_value() && seeker.has_value());
    client::SubscribeOptions wanted;
    wanted.channel_name = "side";
    ASSERT_TRUE((*side)->subscribe(wanted).has_value());
    wanted.channel_name = "seeker";
    ASSERT_TRUE((*seeker)->subscribe(wanted).has_value());
    for (std::uint64_t k = 1; k <= 20; ++k) {
      protocol::HostFrameData frame;
      frame.frame_number = k;
      frame.run_id = 1;
      frame.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
      frame.seeker.position_world_m = {0.1 * static_cast<double>(k), -3.0, 200.0};
      if (k % 4 == 0) frame.fov_h_rad = 0.5 / static_cast<double>(k / 4);
      if (k % 5 == 0) frame.gimbal_rad = glm::dvec3(0.01 * static_cast<double>(k), 0.02, 0.03);
      ASSERT_TRUE((*host)->send(frame).has_value());
      const auto first = (*seeker)->receive(kLongNs);
      const auto second = (*side)->receive(kLongNs);
      ASSERT_TRUE(first.has_value() && *first != nullptr);
      ASSERT_TRUE(second.has_value() && *second != nullptr);
      const client::ReceivedFrame* of_seeker = *first;
      const client::ReceivedFrame* of_side = *second;
      const double zoom = k < 4 ? 0.5 : 0.5 / static_cast<double>(k / 4);
      EXPECT_EQ(of_seeker->header.fov_h_rad, static_cast<float>(zoom)) << k;
      EXPECT_EQ(of_side->header.fov_h_rad, static_cast<float>(zoom)) << k;
      EXPECT_EQ(of_seeker->header.pose.position_world_m, frame.seeker.position_world_m);
      EXPECT_NEAR(glm::length(of_side->header.pose.position_world_m -
                              of_seeker->header.pose.position_world_m),
                  5.0, 1e-12);
      EXPECT_EQ(of_side->header.width_px, 20U);
      EXPECT_NE(of_side->header.payload_crc32c, of_seeker->header.payload_crc32c);
      EXPECT_EQ(of_seeker->header.quantity, protocol::PixelQuantity::counts);
      EXPECT_EQ(of_seeker->header.output_steps,
                protocol::kOutputBlurred | protocol::kOutputDetected | protocol::kOutputCounted);
    }
  }
  SourceScript script;
  ScriptedSource source(script, 32, 16, 7);
  JournalPlayer player(source, *make_channels(scenario, source.info()));
  ASSERT_NO_FATAL_FAILURE(play_all(player, journal));
  EXPECT_EQ(player.frames(), 20U);
  EXPECT_EQ(player.mismatches(), 0U);
  ASSERT_EQ(script.submitted.size(), 20U + 20U + 7U);
  ASSERT_EQ(live_script.submitted.size(), script.submitted.size());
  for (std::size_t i = 0; i < script.submitted.size(); ++i) {
    EXPECT_EQ(script.submitted[i].fov_h_rad, live_script.submitted[i].fov_h_rad) << i;
    EXPECT_EQ(script.submitted[i].frame_number, live_script.submitted[i].frame_number) << i;
  }
}

/// Images that look ahead have the same bits again, and clients are told their instant.
TEST(DaemonReplayOfCameras, ThatLookAheadHaveTheSameBits) {
  ScratchFolder folder;
  const std::string journal = folder.file("run.mcap");
  scene::ScenarioDesc scenario;
  scenario.name = "ahead";
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  scenario.channels = {{"next", scene::ChannelKind::injection, "8-12"},
                       {"now", scene::ChannelKind::injection, "8-12"}};
  scenario.channels[0].camera.look_ahead_frames = 2;
  SourceScript live_script;
  std::size_t moved = 0;
  {
    auto config = configuration(config::PacingMode::ig_clock, journal);
    config.pacing.horizon_ns = 1'000'000'000;
    LiveDaemon live(config, live_script, scenario);
    auto host = client::HostClient::connect(live.url);
    auto next = client::FrameClient::connect(live.url);
    ASSERT_TRUE(host.has_value() && next.has_value());
    client::SubscribeOptions wanted;
    wanted.channel_name = "next";
    const auto channel = (*next)->subscribe(wanted);
    ASSERT_TRUE(channel.has_value());
    EXPECT_EQ(channel->look_ahead_frames, 2U);
    for (std::uint64_t k = 1; k <= 40; ++k) {
      protocol::HostFrameData frame;
      frame.frame_number = k;
      frame.run_id = 1;
      frame.sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
      frame.seeker.position_world_m = {0.1 * static_cast<double>(k), -3.0, 200.0};
      frame.entity_count = 1;
      frame.entities[0].entity_id = 1;
      frame.entities[0].has_pose = true;
      frame.entities[0].pose.position_world_m.x = 0.3 * static_cast<double>(k);
      ASSERT_TRUE((*host)->send(frame).has_value());
      const auto received = (*next)->receive(kLongNs);
      ASSERT_TRUE(received.has_value() && *received != nullptr);
      const protocol::FrameHeader& header = (*received)->header;
      if ((header.flags & (protocol::kFlagRepeated | protocol::kFlagStale)) != 0) continue;
      // Two frames of 400 Hz: the pose is that of the later instant, at 20 m/s.
      if (header.pose_sim_time_ns == 0 || header.predictions < 3) continue;
      ++moved;
      EXPECT_NEAR(header.pose.position_world_m.x, 20e-9 * static_cast<double>(header.sim_time_ns),
                  1e-6);
      EXPECT_NE(header.flags & protocol::kFlagExtrapolated, 0U);
    }
  }
  EXPECT_GT(moved, 5U);
  SourceScript script;
  ScriptedSource source(script, 32, 16, 7);
  JournalPlayer player(source, *make_channels(scenario, source.info()));
  ASSERT_NO_FATAL_FAILURE(play_all(player, journal));
  EXPECT_GT(player.frames(), 20U);
  EXPECT_EQ(player.mismatches(), 0U);
  ASSERT_EQ(script.submitted.size(), live_script.submitted.size());
  for (std::size_t i = 0; i < script.submitted.size(); ++i) {
    EXPECT_EQ(script.submitted[i].sim_time_ns, live_script.submitted[i].sim_time_ns) << i;
  }
}

/// The checksum of a frame is that of its first channel, with everything that is done to its
/// picture, and the journal has the shift.
TEST(JournalPlayer, MovesThePictureByTheShiftOfTheJournal) {
  scene::ScenarioDesc scenario;
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  scenario.channels = {{"shown", scene::ChannelKind::projector, "8-12", {4, 2, 20, 10}}};
  scenario.channels[0].output.apply_shift = true;
  scenario.channels[0].output.rotate_deg = 180;
  SourceScript script;
  ScriptedSource source(script, 32, 16, 2);
  JournalPlayer player(source, *make_channels(scenario, source.info()));
  v1::JournalEntry entry;
  entry.set_sequence(1);
  entry.mutable_run_start()->set_run_id(1);
  ASSERT_TRUE(player.apply(entry).has_value());
  std::vector<std::uint32_t> sums;
  for (const float shift_px : {0.0F, 0.375F}) {
    entry.Clear();
    entry.set_sequence(2 + sums.size());
    entry.mutable_frame()->set_rendered(true);
    entry.mutable_frame()->mutable_sensor_pose()->mutable_position_m();
    entry.mutable_frame()->mutable_sensor_pose()->mutable_world_from_body()->set_w(1.0);
    entry.mutable_frame()->set_applied_shift_x_px(shift_px);
    entry.mutable_frame()->set_applied_shift_y_px(-shift_px);
    const auto frame = player.apply(entry);
    ASSERT_TRUE(frame.has_value()) << frame.error().text;
    ASSERT_TRUE(frame->has_value());
    // The turned window, moved along rows and columns, computed here.
    const auto plane = (*frame)->view->radiance_w_m2_sr[0];
    std::vector<float> expected;
    for (std::size_t y = 0; y < 10; ++y) {
      for (std::size_t x = 0; x < 20; ++x) {
        const std::size_t column = 4 + 19 - x;
        const std::size_t row = 2 + 9 - y;
        const auto at = [&](std::size_t c, std::size_t r) { return plane[r * 32 + c]; };
        // A shift to the right by a fraction f mixes in the left neighbour; upwards, the lower one.
        const auto moved_right = [&](std::size_t r) {
          if (shift_px == 0.0F) return at(column, r);
          return at(column - 1, r) + (1.0F - shift_px) * (at(column, r) - at(column - 1, r));
        };
        const float left = moved_right(row);
        const float lower_left = moved_right(row + 1);
        expected.push_back(left + shift_px * (lower_left - left));
      }
    }
    EXPECT_EQ((*frame)->crc32c, protocol::crc32c(std::as_bytes(std::span(expected)))) << shift_px;
    sums.push_back((*frame)->crc32c);
  }
}

TEST(JournalPlayer, RefusesAJournalWithAHole) {
  Replay replay;
  v1::JournalEntry entry;
  entry.set_sequence(1);
  entry.mutable_run_start()->set_run_id(1);
  replay.apply(entry);
  entry.set_sequence(3);
  const auto result = replay.player.apply(entry);
  ASSERT_FALSE(result.has_value());
  EXPECT_NE(result.error().text.find("lost"), std::string::npos);
}

TEST(JournalPlayer, RefusesAJournalThatBeginsInTheMiddle) {
  Replay replay;
  v1::JournalEntry entry;
  entry.set_sequence(9);
  entry.mutable_frame()->set_rendered(true);
  EXPECT_FALSE(replay.player.apply(entry).has_value());
}

}  // namespace
}  // namespace emit::server
