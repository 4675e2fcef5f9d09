// SPDX-License-Identifier: Apache-2.0
// Channels with a camera of their own: place, direction, field of view and rate.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/frames.hpp"
#include "support/conductor_rig.hpp"

namespace emit::server {
namespace {

using physics::kDegree;
using test::kMs;
using CameraRig = test::ConductorRig;

/// The seeker, a wide view beside it, one that looks to its right from 1 m ahead, 2 m to the right
/// and 3 m below, and one that entity 7 carries.
scene::ScenarioDesc four_views() {
  scene::ScenarioDesc scenario = test::scenario_with_entity(7);
  scenario.bands = {{"8-12", 8.0, 12.0, {}}};
  scenario.sensor.width_px = 8;
  scenario.sensor.height_px = 4;
  scenario.sensor.fov_h_rad = test::kFovRad;
  scenario.sensor.fov_h_min_rad = test::kFovMinRad;
  for (const char* name : {"seeker", "wide", "side", "carried"}) {
    scenario.channels.push_back({name, scene::ChannelKind::injection, "8-12"});
  }
  scenario.channels[1].camera.fov_h_rad = test::kFovRad;
  scenario.channels[2].camera.offset_body_m = {1.0, 2.0, 3.0};
  scenario.channels[2].camera.yaw_pitch_roll_rad = {90.0 * kDegree, 0.0, 0.0};
  scenario.channels[2].every_nth = 2;
  scenario.channels[3].camera.entity_id = 7;
  scenario.channels[3].camera.yaw_pitch_roll_rad = {0.0, 30.0 * kDegree, 0.0};
  return scenario;
}

void use_channels_of(CameraRig& rig, const scene::ScenarioDesc& scenario) {
  auto table = make_channels(scenario, *rig.render().source_info());
  ASSERT_TRUE(table.has_value()) << table.error().text;
  rig.context().channels = std::move(table->channels);
  rig.context().pictures = std::move(table->pictures);
  rig.context().cameras = std::move(table->cameras);
}

/// Returns where a camera of the sensor's format shows a point, px from the top left corner.
glm::dvec2 place_px(const CameraImage& camera, const glm::dvec3& world_m) {
  const glm::dvec3 body = glm::transpose(glm::mat3_cast(camera.pose.world_from_body)) *
                          (world_m - camera.pose.position_world_m);
  const double focal_px = 4.0 / std::tan(0.5 * camera.fov_h_rad);
  return {4.0 + focal_px * body.y / body.x, 2.0 + focal_px * body.z / body.x};
}

TEST(Cameras, ChannelsLookFromTheirPlacesAndEachKnownPointIsWhereItBelongs) {
  CameraRig rig({}, four_views());
  use_channels_of(rig, four_views());
  ASSERT_EQ(rig.context().cameras.size(), 4U);
  const glm::dquat level = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);  // north
  for (std::uint64_t k = 1; k <= 2; ++k) {
    rig.with([&](protocol::HostFrameData& frame) {
         frame.seeker = {{100.0, 200.0, 50.0}, level};
         frame.fov_h_rad = 0.2;
         frame.gimbal_rad = glm::dvec3(10.0 * kDegree, 0.0, 0.0);
         frame.entity_count = 1;
         frame.entities[0].entity_id = 7;
         frame.entities[0].has_pose = true;
         frame.entities[0].pose = {{0.0, 0.0, 10.0}, level};
       })
        .send(k, static_cast<std::int64_t>(k) * kMs);
    rig.settle();
  }
  ASSERT_EQ(rig.frames.size(), 2U);
  ASSERT_EQ(rig.script.submitted.size(), 4U + 3U) << "one image for each camera that is due";
  const Image& image = rig.frames[0].image;
  ASSERT_EQ(image.camera_count, 4U);
  const auto expect_at = [](const glm::dvec2& place, double x_px, double y_px, const char* name) {
    EXPECT_NEAR(place.x, x_px, 1e-9) << name;
    EXPECT_NEAR(place.y, y_px, 1e-9) << name;
  };
  // The gimbals turn the seeker by 10 degrees to the right, and the host has zoomed.
  const double focal_px = 4.0 / std::tan(0.1);
  const glm::dvec3 seeker_m(100.0, 200.0, 50.0);
  const auto ahead = [](double right_deg, double down_m) {
    return glm::dvec3(100.0 * std::sin(right_deg * kDegree), 100.0 * std::cos(right_deg * kDegree),
                      -down_m);
  };
  expect_at(place_px(image.cameras[0], seeker_m + ahead(10.0, 0.0)), 4.0, 2.0, "seeker");
  expect_at(place_px(image.cameras[0], seeker_m + ahead(12.0, 0.0)),
            4.0 + focal_px * std::tan(2.0 * kDegree), 2.0, "seeker");
  // A field of view of its own stays.
  EXPECT_EQ(image.cameras[0].fov_h_rad, 0.2);
  EXPECT_EQ(image.cameras[1].fov_h_rad, test::kFovRad);
  const double wide_px = 4.0 / std::tan(0.5 * test::kFovRad);
  expect_at(place_px(image.cameras[1], seeker_m + ahead(10.0, 5.0)), 4.0, 2.0 + 0.05 * wide_px,
            "wide");
  // The gimbals carry the camera beside them: it looks 100 degrees from north.
  const double sine = std::sin(10.0 * kDegree);
  const double cosine = std::cos(10.0 * kDegree);
  const glm::dvec3 side_m = seeker_m + glm::dvec3(sine + 2.0 * cosine, cosine - 2.0 * sine, -3.0);
  expect_at(place_px(image.cameras[2], side_m + 50.0 * glm::dvec3(cosine, -sine, 0.0)), 4.0, 2.0,
            "side");
  expect_at(place_px(image.cameras[3], {0.0, 100.0 * std::cos(30.0 * kDegree), 10.0 + 50.0}), 4.0,
            2.0, "carried");
  // Every channel has the pixels of its own camera.
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_NE(image.crc32c[i], image.crc32c[j]) << i << ' ' << j;
    }
  }
  EXPECT_FALSE(rig.frames[1].image.cameras[2].shown) << "every second frame";
  EXPECT_TRUE(rig.frames[1].image.pictures[2].empty());
  EXPECT_EQ(rig.script.held.load(), 0);
}

TEST(Cameras, EachIsFlaggedForItself) {
  config::PacingConfig pacing;
  pacing.budget_ns = 3 * kMs;
  CameraRig rig(pacing, four_views());
  use_channels_of(rig, four_views());
  // The camera of the entity looks at a surface that was not prepared, and takes long.
  rig.script.on_submit = [&](const renderer::FrameRequest& request) {
    rig.script.coarse.set(0, rig.script.submitted.size() == 3);
    if (request.frame_number == 4) rig.clock.advance(4 * kMs);
  };
  rig.send(1, 0);
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 1U);
  const Image& image = rig.frames[0].image;
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ((image.cameras[i].flags & protocol::kFlagDegraded) != 0, i == 3) << i;
    EXPECT_EQ(std::isnan(image.cameras[i].estimated_error_k), i == 3) << i;
  }
  EXPECT_EQ(rig.count(Counter::frames_coarse), 1U);
  EXPECT_NE(rig.frames[0].header.flags & protocol::kFlagDegraded, 0U);
}

TEST(Cameras, WaitForSlotsWithoutLosingOrRepeatingAnImage) {
  CameraRig rig({}, four_views());
  use_channels_of(rig, four_views());
  // The source has 7 slots: a second frame of 3 images does not fit beside one of 4 that is held.
  rig.send(1, 0);
  rig.send(2, kMs);
  rig.send(3, 2 * kMs);
  rig.settle_without_sender();
  rig.settle();
  ASSERT_EQ(rig.frames.size(), 3U);
  ASSERT_EQ(rig.script.submitted.size(), 4U + 3U + 4U);
  for (std::size_t i = 0; i < rig.script.submitted.size(); ++i) {
    EXPECT_EQ(rig.script.submitted[i].frame_number, i + 1);
  }
  EXPECT_EQ(rig.script.held.load(), 0);
}

/// The seeker, the same a frame later, and the view of entity 7 a frame later.
scene::ScenarioDesc views_ahead() {
  scene::ScenarioDesc scenario = four_views();
  scenario.channels.clear();
  for (const char* name : {"carried", "next", "now"}) {
    scenario.channels.push_back({name, scene::ChannelKind::injection, "8-12"});
    scenario.channels.back().camera.look_ahead_frames = 1;
  }
  scenario.channels[0].camera.entity_id = 7;
  scenario.channels[2].camera.look_ahead_frames = 0;
  return scenario;
}

TEST(Cameras, LookAheadToWhereTheNextFrameWillBe) {
  config::PacingConfig pacing;
  pacing.mode = config::PacingMode::ig_clock;
  pacing.rate_hz = 100.0;
  pacing.horizon_ns = 30 * kMs;
  CameraRig rig(pacing, views_ahead());
  use_channels_of(rig, views_ahead());
  ASSERT_EQ(rig.context().cameras.size(), 3U);
  EXPECT_FALSE(rig.context().cameras[0].looks_ahead()) << "the frame's own instant comes first";
  const glm::dquat level = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
  // The source gets the place of the entity for the later instant alone, after the frame's own.
  std::vector<double> foreseen_m;
  rig.script.on_submit = [&](const renderer::FrameRequest& request) {
    const auto& foreseen = rig.script.foreseen;
    if (foreseen.empty()) return;
    EXPECT_EQ(request.sim_time_ns, rig.script.foreseen_ns);
    ASSERT_EQ(foreseen.size(), 1U);
    EXPECT_EQ(foreseen[0].entity_id, 7U);
    foreseen_m.push_back(foreseen[0].pose.position_world_m.x);
  };
  rig.settle();
  rig.frames.clear();
  // The seeker flies east with 100 m/s, and the entity follows with 40 m/s^2 of acceleration. Both
  // state their rates; the host sends every 10 ms, until it falls silent.
  const auto entity_m = [](double t_s) { return 10.0 * t_s + 20.0 * t_s * t_s; };
  for (std::uint64_t k = 1; k <= 30; ++k) {
    const double t_s = 0.01 * static_cast<double>(k);
    if (k <= 20) {
      rig.with([&](protocol::HostFrameData& frame) {
           frame.seeker = {{100.0 * t_s, 0.0, 50.0}, level};
           frame.seeker_rates = protocol::PoseRates{{100.0, 0.0, 0.0}, glm::dvec3(0.0)};
           frame.entity_count = 1;
           frame.entities[0].entity_id = 7;
           frame.entities[0].has_pose = true;
           frame.entities[0].pose = {{entity_m(t_s), 0.0, 10.0}, level};
           frame.entities[0].rates =
               protocol::PoseRates{{10.0 + 40.0 * t_s, 0.0, 0.0}, glm::dvec3(0.0)};
         })
          .send(k, static_cast<std::int64_t>(k) * 10 * kMs);
    }
    rig.next_slot();
  }
  std::size_t judged = 0;
  for (std::size_t i = 0; i + 1 < rig.frames.size(); ++i) {
    const server::PublishFrame& frame = rig.frames[i];
    const server::PublishFrame& next = rig.frames[i + 1];
    if (frame.repeat || next.repeat || frame.header.host_frame_number == 0) continue;
    const AheadImage& ahead = frame.image.ahead;
    const glm::dvec3& now_m = frame.image.cameras[0].pose.position_world_m;
    const glm::dvec3& ahead_m = frame.image.cameras[2].pose.position_world_m;
    const glm::dvec3& next_m = next.image.cameras[0].pose.position_world_m;
    // The next frame shows what this one foresees, also where the host is silent.
    EXPECT_EQ(ahead.sim_time_ns, next.header.sim_time_ns) << i;
    EXPECT_NEAR(ahead_m.x, next_m.x, 1e-9) << i;
    const std::int64_t by_ns = ahead.sim_time_ns - frame.header.sim_time_ns;
    EXPECT_LE(by_ns, 10 * kMs);
    if (by_ns < 10 * kMs) {
      EXPECT_NE(frame.header.flags & protocol::kFlagExtrapolated, 0U) << i << " at the horizon";
      EXPECT_NE(ahead.flags & protocol::kFlagStale, 0U) << i;
      continue;
    }
    EXPECT_NEAR(ahead_m.x - now_m.x, 1.0, 1e-9) << i;
    EXPECT_NE(ahead.flags & protocol::kFlagExtrapolated, 0U) << i;
    const double t_s = 1e-9 * static_cast<double>(ahead.sim_time_ns);
    // Acceleration is known from the third pose on.
    if (i > 3) {
      EXPECT_NEAR(frame.image.cameras[1].pose.position_world_m.x, entity_m(t_s), 1e-4) << i;
      ++judged;
    }
  }
  EXPECT_GT(judged, 10U);
  ASSERT_GE(foreseen_m.size(), 20U);
  for (std::size_t i = 2; i < foreseen_m.size(); i += 2) {
    EXPECT_EQ(foreseen_m[i], foreseen_m[i + 1]) << "both cameras of a frame";
    EXPECT_GT(foreseen_m[i], foreseen_m[i - 1]);
  }
  ASSERT_GE(rig.script.submitted.size(), 6U);
  const auto& last = rig.script.submitted;
  EXPECT_EQ(last[last.size() - 3].frame_number + 1, last[last.size() - 2].frame_number);
  EXPECT_EQ(last[last.size() - 2].sim_time_ns, last[last.size() - 1].sim_time_ns);
  EXPECT_EQ(last[last.size() - 2].thermal_time_ns, last[last.size() - 3].thermal_time_ns);
  EXPECT_EQ(rig.script.held.load(), 0);
}

TEST(Cameras, ThatLookAheadNeedAClockAndAHorizon) {
  config::DaemonConfig config;
  config.file = "emitd.toml";
  const scene::ScenarioDesc scenario = views_ahead();
  const auto why = [&] {
    const auto checked = check_look_ahead(scenario, config);
    return checked ? std::string() : checked.error().text;
  };
  EXPECT_EQ(why(),
            "emitd.toml: channel 'carried' of the scenario has 'look_ahead_frames', which needs "
            "pacing.mode = \"ig-clock\" or \"trigger\"");
  config.pacing.mode = config::PacingMode::trigger;
  config.pacing.rate_hz = 100.0;
  config.pacing.display_delay_ns = 20 * kMs;
  config.pacing.horizon_ns = 30 * kMs;
  EXPECT_EQ(why(), "");
  config.pacing.horizon_ns = 29 * kMs;
  EXPECT_EQ(why(),
            "emitd.toml: channel 'carried' of the scenario has 'look_ahead_frames', which needs "
            "pacing.horizon_ms of at least 30: 20 ms to the display and 10 ms ahead");
}

TEST(Cameras, AProjectorOfAMotionSimulatorFixesTheViewUnlessItHasItsOwn) {
  scene::ScenarioDesc scenario = four_views();
  EXPECT_FALSE(is_view_fixed(cameras_of(scenario, true))) << "none projects";
  scenario.channels[0].kind = scene::ChannelKind::projector;
  EXPECT_TRUE(is_view_fixed(cameras_of(scenario, true)));
  EXPECT_FALSE(is_view_fixed(cameras_of(scenario, false))) << "no motion simulator";
  scenario.channels[0].camera.fov_h_rad = test::kFovRad;
  EXPECT_FALSE(is_view_fixed(cameras_of(scenario, true)));
}

}  // namespace
}  // namespace emit::server
