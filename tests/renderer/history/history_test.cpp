// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "emit/physics/constants.hpp"
#include "history/pose_history.hpp"
#include "history/step_plan.hpp"
#include "support/times.hpp"

namespace emit::renderer {
namespace {

using emit::test::kSecondNs;

physics::Pose at_east(double east_m) {
  return {{east_m, 0.0, 0.0}, physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0)};
}

scene::ObjectDesc scripted() {
  scene::ObjectDesc object;
  object.entity_id = 1;
  object.trajectory = {{0, at_east(0.0), true, false},
                       {100 * kSecondNs, at_east(0.0), true, false},
                       {110 * kSecondNs, at_east(100.0), true, false},
                       {200 * kSecondNs, at_east(0.0), true, true}};
  return object;
}

TEST(PoseHistory, interpolates_holds_and_jumps_as_scripted) {
  const PoseHistory history(scripted(), at_east(5.0));
  EXPECT_EQ(history.at(-kSecondNs).pose.position_world_m.x, 0.0);
  EXPECT_NEAR(history.at(105 * kSecondNs).pose.position_world_m.x, 50.0, 1e-9);
  // The entity does not drift towards the jump.
  EXPECT_EQ(history.at(199 * kSecondNs).pose.position_world_m.x, 100.0);
  EXPECT_EQ(history.at(200 * kSecondNs).pose.position_world_m.x, 0.0);
  EXPECT_EQ(history.at(999 * kSecondNs).pose.position_world_m.x, 0.0);
}

TEST(PoseHistory, an_entity_without_trajectory_stays_at_its_placement) {
  scene::ObjectDesc object;
  object.entity_id = 1;
  object.on = false;
  const PoseHistory history(object, at_east(5.0));
  EXPECT_EQ(history.at(7).pose.position_world_m.x, 5.0);
  EXPECT_FALSE(history.at(7).on);
}

TEST(PoseHistory, finds_starts_stops_and_jumps) {
  const PoseHistory history(scripted(), at_east(0.0));
  const std::vector<std::int64_t> expected = {100 * kSecondNs, 110 * kSecondNs, 200 * kSecondNs};
  EXPECT_EQ(std::vector(history.events_ns().begin(), history.events_ns().end()), expected);
}

TEST(PoseHistory, live_poses_override_the_script_from_their_time_on_and_reset_brings_it_back) {
  PoseHistory history(scripted(), at_east(0.0));
  ASSERT_TRUE(history.append(50 * kSecondNs, at_east(-7.0), true, true));
  EXPECT_EQ(history.at(49 * kSecondNs).pose.position_world_m.x, 0.0);
  EXPECT_EQ(history.at(50 * kSecondNs).pose.position_world_m.x, -7.0);
  EXPECT_EQ(history.at(105 * kSecondNs).pose.position_world_m.x, -7.0);
  const std::vector<std::int64_t> jump = {50 * kSecondNs};
  EXPECT_EQ(std::vector(history.events_ns().begin(), history.events_ns().end()), jump);
  history.reset();
  EXPECT_NEAR(history.at(105 * kSecondNs).pose.position_world_m.x, 50.0, 1e-9);
  EXPECT_EQ(history.events_ns().size(), 3U);
}

TEST(PoseHistory, what_is_foreseen_counts_after_the_newest_pose_until_the_next_one) {
  PoseHistory history(scripted(), at_east(0.0));
  history.foresee(2 * kSecondNs, at_east(9.0));
  EXPECT_EQ(history.at(2 * kSecondNs).pose.position_world_m.x, 0.0) << "the script goes on";
  ASSERT_TRUE(history.append(kSecondNs, at_east(1.0), true, false));
  const PoseHistory::Known known = history.known();
  history.foresee(kSecondNs, at_east(9.0));
  EXPECT_EQ(history.at(kSecondNs).pose.position_world_m.x, 1.0) << "the host has said it";
  history.foresee(3 * kSecondNs, at_east(5.0));
  EXPECT_EQ(history.at(kSecondNs).pose.position_world_m.x, 1.0);
  EXPECT_EQ(history.at(2 * kSecondNs).pose.position_world_m.x, 3.0);
  EXPECT_EQ(history.at(3 * kSecondNs).pose.position_world_m.x, 5.0);
  EXPECT_EQ(history.at(9 * kSecondNs).pose.position_world_m.x, 5.0) << "it stands from there on";
  // The history of shade does not know of it.
  EXPECT_FALSE(history.departs(known, 3 * kSecondNs));
  EXPECT_EQ(history.known().newest.sim_time_ns, kSecondNs);
  history.forget();
  EXPECT_EQ(history.at(3 * kSecondNs).pose.position_world_m.x, 1.0);
  history.foresee(3 * kSecondNs, at_east(5.0));
  ASSERT_TRUE(history.append(2 * kSecondNs, at_east(2.0), true, false));
  EXPECT_EQ(history.at(3 * kSecondNs).pose.position_world_m.x, 2.0);
}

TEST(PoseHistory, refuses_time_going_back) {
  PoseHistory history(scripted(), at_east(0.0));
  EXPECT_TRUE(history.append(50 * kSecondNs, at_east(0.0), true, false));
  EXPECT_FALSE(history.append(49 * kSecondNs, at_east(0.0), true, false));
}

TEST(PoseHistory, thinning_keeps_a_curved_drive_to_two_centimetres) {
  PoseHistory history(scripted(), at_east(0.0));
  const auto pose_at = [](double t_s) {
    physics::Pose pose;
    pose.position_world_m = {50.0 * std::sin(0.2 * t_s), 50.0 * std::cos(0.2 * t_s), 0.0};
    pose.world_from_body =
        physics::world_from_body_heading_pitch_roll(physics::kPi / 2.0 + 0.2 * t_s, 0.0, 0.0);
    return pose;
  };
  for (int i = 0; i <= 20000; ++i) {
    ASSERT_TRUE(history.append(i * 5'000'000LL, pose_at(i * 5e-3), true, false));
  }
  double worst_m = 0.0;
  for (int i = 0; i <= 100000; ++i) {
    const double t_s = i * 1e-3;
    const auto state = history.at(static_cast<std::int64_t>(t_s * 1e9));
    worst_m = std::max(worst_m,
                       glm::distance(state.pose.position_world_m, pose_at(t_s).position_world_m));
  }
  EXPECT_LT(worst_m, 0.02);
  EXPECT_EQ(history.dropped(), 0U);
}

TEST(PoseHistory, a_full_store_thins_the_oldest_poses_and_counts_them) {
  PoseHistory history(scripted(), at_east(0.0));
  std::int64_t t_ns = 0;
  for (std::size_t i = 0; i < PoseHistory::kMaxLivePoses + 100; ++i) {
    t_ns += 2 * kSecondNs;  // too far apart to be thinned out
    ASSERT_TRUE(history.append(t_ns, at_east(static_cast<double>(i % 2)), true, false));
  }
  EXPECT_GT(history.dropped(), 0U);
  EXPECT_NEAR(history.at(t_ns).pose.position_world_m.x,
              static_cast<double>((PoseHistory::kMaxLivePoses + 99) % 2), 1e-9);
  history.reset();
  EXPECT_EQ(history.dropped(), 0U) << "a new run has lost nothing yet";
}

TEST(PoseHistory, path_counts_motion_but_no_jumps) {
  const PoseHistory history(scripted(), at_east(0.0));
  EXPECT_NEAR(history.path_m(100 * kSecondNs, 110 * kSecondNs), 100.0, 1e-6);
  EXPECT_EQ(history.path_m(0, 90 * kSecondNs), 0.0);
  EXPECT_NEAR(history.path_m(105 * kSecondNs, 300 * kSecondNs), 50.0, 1e-6);  // across the jump
  EXPECT_EQ(history.path_m(150 * kSecondNs, 200 * kSecondNs), 0.0);
}

TEST(PoseHistory, path_does_not_count_the_way_from_the_script_to_the_first_live_pose) {
  PoseHistory history(scripted(), at_east(0.0));
  ASSERT_TRUE(history.append(50 * kSecondNs, at_east(-70.0), true, false));
  ASSERT_TRUE(history.append(52 * kSecondNs, at_east(-73.0), true, false));
  EXPECT_NEAR(history.path_m(40 * kSecondNs, 60 * kSecondNs), 3.0, 1e-9);
}

TEST(PoseHistory, jitter_of_the_host_is_neither_start_nor_stop) {
  PoseHistory history(scripted(), at_east(0.0));
  for (int i = 0; i < 4000; ++i) {
    ASSERT_TRUE(history.append(i * 5'000'000LL, at_east(i % 2 == 0 ? 0.0 : 0.001), true, false));
  }
  EXPECT_TRUE(history.events_ns().empty());
}

TEST(PoseHistory, finds_start_and_stop_of_a_live_drive) {
  PoseHistory history(scripted(), at_east(0.0));
  const auto east_m = [](double t_s) { return 5.0 * std::clamp(t_s - 10.0, 0.0, 10.0); };
  for (int i = 0; i <= 6000; ++i) {
    ASSERT_TRUE(history.append(i * 5'000'000LL, at_east(east_m(i * 5e-3)), true, false));
  }
  ASSERT_EQ(history.events_ns().size(), 2U);
  EXPECT_NEAR(static_cast<double>(history.events_ns()[0]) * 1e-9, 10.0, 0.02);
  EXPECT_NEAR(static_cast<double>(history.events_ns()[1]) * 1e-9, 20.0, 0.02);
}

scene::ScenarioDesc clear_day() {
  scene::ScenarioDesc scenario;
  scenario.place = {48.56 * physics::kDegree, 11.26 * physics::kDegree, 380.0};
  scenario.epoch_utc_ns = 1403330400LL * kSecondNs;
  scenario.thermal.steps = 27;
  return scenario;
}

TEST(PoseHistory, a_full_list_of_events_still_tells_of_new_ones) {
  PoseHistory history(scene::ObjectDesc{}, physics::Pose{});
  constexpr std::int64_t kStepNs = 1'000'000'000;
  for (std::int64_t i = 1; i <= 2 * static_cast<std::int64_t>(PoseHistory::kMaxEvents); ++i) {
    ASSERT_TRUE(history.append(i * kStepNs, physics::Pose{}, i % 2 == 0, false));
    EXPECT_EQ(history.events_ns().back(), i * kStepNs);
    ASSERT_TRUE(history.append(i * kStepNs + kStepNs / 2, physics::Pose{}, i % 2 == 0, false));
    EXPECT_EQ(history.events_ns().back(), i * kStepNs);
  }
  EXPECT_EQ(history.events_ns().size(), PoseHistory::kMaxEvents);
}

TEST(StepPlan, covers_the_history_without_gap) {
  const auto scenario = clear_day();
  StepPlan plan(scenario.thermal);
  const Environment environment(scenario);
  plan.update(12600 * kSecondNs, environment, {});
  const auto intervals = plan.intervals();
  ASSERT_EQ(intervals.size(), 27U);
  EXPECT_EQ(intervals.front().begin_ns, 0);
  EXPECT_EQ(intervals.back().end_ns, 12600 * kSecondNs);
  for (std::size_t i = 1; i < intervals.size(); ++i) {
    EXPECT_EQ(intervals[i].begin_ns, intervals[i - 1].end_ns);
    EXPECT_TRUE(intervals[i].sun_up);
  }
}

TEST(StepPlan, puts_nodes_on_the_events_of_entities) {
  const auto scenario = clear_day();
  StepPlan plan(scenario.thermal);
  const Environment environment(scenario);
  std::vector<PoseHistory> entities;
  entities.emplace_back(scripted(), at_east(0.0));
  plan.update(12600 * kSecondNs, environment, entities);
  std::vector<std::int64_t> nodes;
  for (const auto& interval : plan.intervals()) {
    nodes.push_back(interval.begin_ns);
    EXPECT_GE(interval.end_ns, interval.begin_ns);
  }
  // Three events lie in the first, long interval. Each takes one of the nodes nearby, in order.
  EXPECT_TRUE(std::find(nodes.begin(), nodes.end(), 200 * kSecondNs) != nodes.end());
  // All events of a stop have nodes of their own a few seconds later.
  plan.update(130 * kSecondNs, environment, entities);
  nodes.clear();
  for (const auto& interval : plan.intervals()) nodes.push_back(interval.begin_ns);
  EXPECT_TRUE(std::find(nodes.begin(), nodes.end(), 100 * kSecondNs) != nodes.end());
  EXPECT_TRUE(std::find(nodes.begin(), nodes.end(), 110 * kSecondNs) != nodes.end());
}

TEST(StepPlan, needs_no_shadow_map_at_night) {
  auto scenario = clear_day();
  scenario.thermal.history_start_ns = 14 * 3600 * kSecondNs;  // 20:00 UTC, the sun has set
  StepPlan plan(scenario.thermal);
  const Environment environment(scenario);
  plan.update(18 * 3600 * kSecondNs, environment, {});
  for (const auto& interval : plan.intervals()) EXPECT_FALSE(interval.sun_up);
}

TEST(Environment, takes_weather_with_every_pose_for_hours) {
  const auto scenario = clear_day();
  Environment environment(scenario);
  scene::WeatherSample sample;
  sample.air_k = 290.0;
  for (int i = 0; i < 100'000; ++i) {
    sample.sim_time_ns = i * 5'000'000LL;
    ASSERT_TRUE(environment.append(sample));  // the weather is unchanged
  }
  EXPECT_EQ(environment.changes_ns().size(), 1U);
  for (int i = 100'000; i < 200'000; ++i) {
    sample.sim_time_ns = i * 5'000'000LL;
    sample.air_k = 290.0 + 1e-5 * i;
    ASSERT_TRUE(environment.append(sample));
  }
  const auto sun = environment.sun_at(sample.sim_time_ns);
  EXPECT_NEAR(environment.forcing_at(sample.sim_time_ns, sun).air_k, 292.0, 1e-4);
}

TEST(Environment, weather_from_the_host_holds_from_its_time_on) {
  const auto scenario = clear_day();
  Environment environment(scenario);
  const auto sun = environment.sun_at(3600 * kSecondNs);
  const double before = environment.forcing_at(3600 * kSecondNs, sun).direct_normal_w_m2;
  scene::WeatherSample overcast;
  overcast.sim_time_ns = 7200 * kSecondNs;
  overcast.longwave_down_w_m2 = 390.0;
  overcast.air_k = 285.0;
  ASSERT_TRUE(environment.append(overcast));
  EXPECT_EQ(environment.forcing_at(3600 * kSecondNs, sun).direct_normal_w_m2, before);
  EXPECT_EQ(environment.forcing_at(7200 * kSecondNs, sun).direct_normal_w_m2, 0.0);
  overcast.sim_time_ns = 7100 * kSecondNs;
  EXPECT_FALSE(environment.append(overcast));
  // A step ends and another begins exactly there, and the step before it still has the old weather.
  StepPlan plan(scenario.thermal);
  plan.update(12600 * kSecondNs, environment, {});
  bool found = false;
  for (const auto& interval : plan.intervals()) {
    found = found || interval.begin_ns == 7200 * kSecondNs;
    if (interval.end_ns == 7200 * kSecondNs) {
      EXPECT_GT(interval.forcing_end.direct_normal_w_m2, 0.0);
    }
  }
  EXPECT_TRUE(found);
  environment.reset();
  EXPECT_GT(environment.forcing_at(7200 * kSecondNs, sun).direct_normal_w_m2, 0.0);
}

TEST(Environment, RainOfTheHostFollowsThatOfTheTable) {
  scene::ScenarioDesc scenario = clear_day();
  for (const std::int64_t hour : {0, 1, 2, 3}) {
    scene::WeatherSample row;
    row.sim_time_ns = hour * 3600 * kSecondNs;
    row.air_k = 290.0;
    row.longwave_down_w_m2 = 330.0;
    row.rain_mm_h = hour == 1 ? 2.0 : 0.0;
    scenario.weather.push_back(row);
  }
  Environment environment(scenario);
  const auto rain_mm = [&](double from_h, double to_h) {
    return environment.rain_mm(std::llround(from_h * 3.6e12), std::llround(to_h * 3.6e12));
  };
  EXPECT_TRUE(environment.rains());
  EXPECT_NEAR(rain_mm(0.0, 3.0), 2.0, 1e-12);
  EXPECT_NEAR(rain_mm(0.5, 0.75), 0.5, 1e-12);
  // A row of the host rains until the next one.
  scene::WeatherSample live = scenario.weather.back();
  live.sim_time_ns = 1800 * kSecondNs;
  live.rain_mm_h = 6.0;
  ASSERT_TRUE(environment.append(live));
  EXPECT_NEAR(rain_mm(0.0, 1.0), 1.0 + 3.0, 1e-12);
  live.sim_time_ns = 5400 * kSecondNs;
  live.rain_mm_h = 0.0;
  ASSERT_TRUE(environment.append(live));
  EXPECT_NEAR(rain_mm(0.0, 24.0), 1.0 + 6.0, 1e-12);
  EXPECT_NEAR(rain_mm(1.0, 1.25), 1.5, 1e-12);
  // The plan hands on all of it, whatever its steps are.
  StepPlan plan(scenario.thermal);
  plan.update(12600 * kSecondNs, environment, {});
  double sum_mm = 0.0;
  for (const auto& interval : plan.intervals()) sum_mm += interval.rain_mm;
  const auto intervals = plan.intervals();
  EXPECT_NEAR(sum_mm, environment.rain_mm(intervals.front().begin_ns, intervals.back().end_ns),
              1e-9);
  environment.reset();
  EXPECT_NEAR(rain_mm(0.0, 24.0), 2.0, 1e-12);
}

}  // namespace
}  // namespace emit::renderer
