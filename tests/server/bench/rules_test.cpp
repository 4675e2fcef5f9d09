// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <glm/gtc/quaternion.hpp>
#include <limits>
#include <memory>
#include <numbers>

#include "bench/accuracy/bench_rules.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/v1/control.pb.h"
#include "tool/commands/demo_report.hpp"
#include "tool/streams/pose_log.hpp"
#include "tool/view/view_control.hpp"

namespace emit::tool {
namespace {

constexpr float kSky = std::numeric_limits<float>::infinity();
constexpr float kNan = std::numeric_limits<float>::quiet_NaN();

physics::Pose looking_down() {
  physics::Pose pose;
  pose.position_world_m = {0.0, 0.0, 10.0};
  pose.world_from_body =
      physics::world_from_body_heading_pitch_roll(0.0, -0.5 * std::numbers::pi, 0.0);
  return pose;
}

TEST(CliBenchRules, shares_are_counted_by_height_and_temperature) {
  scene::SensorDesc sensor;
  sensor.width_px = 5;
  sensor.height_px = 2;
  sensor.fov_h_rad = 0.5;
  // The pixels are sky, the figure, warm ground, cool ground, ground within a kelvin of the
  // warmest; twice.
  const std::array<float, 10> depth{kSky, 8, 10, 10, 10, kSky, 8, 10, 10, 10};
  const std::array<float, 10> kelvin{kNan, 290, 320, 310, 319.5F, kNan, 290, 320, 310, 319.5F};
  const SceneFill fill = measure_fill(sensor, looking_down(), depth, kelvin);
  EXPECT_DOUBLE_EQ(fill.surface_frac, 0.8);
  EXPECT_DOUBLE_EQ(fill.figure_frac, 0.2);
  EXPECT_DOUBLE_EQ(fill.swept_ground_frac, 0.2);
  EXPECT_TRUE(broken_rules(fill, false).empty());
  EXPECT_EQ(broken_rules(fill, true).size(), 1U);
  EXPECT_EQ(broken_rules({0.7, 0.1, 0.1}, true).size(), 3U);
}

TEST(CliBenchRules, published_tables_ask_for_pictures_and_errors_of_a_size) {
  EXPECT_TRUE(broken_rules(1024, 768, 20'000).empty());
  EXPECT_TRUE(broken_rules(2048, 768, std::nullopt).empty()) << "errors are another run's";
  EXPECT_EQ(broken_rules(1023, 768, 20'000).size(), 1U);
  EXPECT_EQ(broken_rules(1024, 767, 20'000).size(), 1U);
  ASSERT_EQ(broken_rules(1024, 768, 19'999).size(), 1U);
  EXPECT_NE(broken_rules(1024, 768, 19'999)[0].find("19999"), std::string::npos);
  EXPECT_EQ(broken_rules(64, 48, 1).size(), 2U);
}

TEST(CliDemoShortfalls, too_few_frames_and_no_frame_after_the_departure_fail) {
  DemoResults results;
  results.frames_written = 3;
  EXPECT_TRUE(demo_shortfalls(results, {}).empty());
  const std::vector<Departure> departures{{"truck", 0, 5'000'000'000}};
  ASSERT_EQ(demo_shortfalls(results, departures).size(), 1U);
  EXPECT_NE(demo_shortfalls(results, departures)[0].find("truck"), std::string::npos);
  results.frames_after_departure = 1;
  EXPECT_TRUE(demo_shortfalls(results, departures).empty());
  results.frames_written = 2;
  EXPECT_EQ(demo_shortfalls(results, departures).size(), 1U);
}

TEST(CliViewControl, steps_follow_the_turned_attitude) {
  physics::Pose north;
  north.world_from_body = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  view::ViewControl control;
  control.yaw_rad = 0.5 * std::numbers::pi;  // to the east
  control.forward_m = 2.0;
  control.right_m = 3.0;
  control.up_m = 1.0;
  const glm::dvec3 step = view::step_world_m(north, control);
  EXPECT_NEAR(step.x, 2.0, 1e-12);
  EXPECT_NEAR(step.y, -3.0, 1e-12);
  EXPECT_NEAR(step.z, 1.0, 1e-12);
}

TEST(CliPoseLog, csv_files_give_host_frames) {
  const auto file = std::filesystem::path(testing::TempDir()) / "emit_cli_pose_log.CSV";
  std::ofstream(file) << "sim_time_s,east_m,north_m,up_m,qw,qx,qy,qz\n"
                         "1.5,10,20,30,1,0,0,0\n1.6,11,20,30,1,0,0,0\n";
  auto log = PoseLog::open(file);
  ASSERT_TRUE(log.has_value()) << log.error().text;
  ASSERT_TRUE(*log->next());
  EXPECT_EQ(log->host().sim_time_ns, 1'500'000'000);
  EXPECT_EQ(log->host().seeker.position_world_m, glm::dvec3(10, 20, 30));
  ASSERT_TRUE(*log->next());
  EXPECT_EQ(log->host().frame_number, 2U);
  EXPECT_FALSE(*log->next());
  EXPECT_FALSE(log->notes().has_value());
  std::filesystem::remove(file);
  EXPECT_FALSE(PoseLog::open(file).has_value());
}

TEST(CliPoseLog, journals_give_the_host_frames_that_the_daemon_took) {
  const auto file = std::filesystem::path(testing::TempDir()) / "emit_cli_pose_log.mcap";
  auto writer = protocol::LogWriter::create(file);
  ASSERT_TRUE(writer.has_value()) << writer.error().text;
  const auto pose = std::make_unique<protocol::HostFrameData>();
  for (std::uint64_t k = 1; k <= 4; ++k) {
    v1::JournalEntry entry;
    entry.set_sequence(k);
    entry.set_wall_time_ns(static_cast<std::int64_t>(k));
    if (k % 2 == 0) {
      pose->frame_number = k;
      pose->run_id = 3;
      pose->sim_time_ns = static_cast<std::int64_t>(k) * 5'000'000;
      pose->seeker_rates = protocol::PoseRates{{1, 2, 3}, {4, 5, 6}};
      protocol::to_proto(*pose, *entry.mutable_host_frame());
    } else {
      entry.mutable_frame()->set_frame_number(k);
    }
    ASSERT_TRUE(writer->write_journal(entry));
  }
  ASSERT_TRUE(writer->close());
  auto log = PoseLog::open(file);
  ASSERT_TRUE(log.has_value()) << log.error().text;
  for (const std::int64_t time_ns : {10'000'000, 20'000'000}) {
    const auto more = log->next();
    ASSERT_TRUE(more.has_value()) << more.error().text;
    ASSERT_TRUE(*more);
    EXPECT_EQ(log->host().sim_time_ns, time_ns);
    EXPECT_EQ(log->host().run_id, 3U);
    ASSERT_TRUE(log->host().seeker_rates.has_value());
    EXPECT_EQ(log->host().seeker_rates->velocity_world_m_s, glm::dvec3(1, 2, 3));
  }
  EXPECT_FALSE(*log->next());
  std::filesystem::remove(file);
}

}  // namespace
}  // namespace emit::tool
