// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <map>
#include <memory>
#include <random>

#include "gateway/dis_exercise.hpp"
#include "support/heap_counter.hpp"

namespace emit::server {
namespace {

namespace dis = protocol::dis;

constexpr std::int64_t kOneMsNs = 1'000'000;
constexpr std::int64_t kOneSecondNs = 1'000'000'000;
/// Just before a full hour of the stamps.
constexpr std::int64_t kWallNs = 1'800'000'000 * kOneSecondNs;
constexpr double kRadiusM = 500.0;
constexpr double kTurnRadS = 0.4;

const physics::GeoPlace kPlace{physics::degrees(35.0), physics::degrees(-117.0),
                               physics::Metres(700.0)};

scene::ScenarioDesc scenario() {
  scene::ScenarioDesc out;
  out.place = {kPlace.latitude.value(), kPlace.longitude.value(), kPlace.height.value()};
  scene::ObjectDesc object;
  object.entity_id = 9;
  out.objects.push_back(object);
  return out;
}

/// A body on a level circle about the origin of the world, nose forward.
struct Circle {
  [[nodiscard]] static physics::Pose pose(double t_s) {
    const double a = kTurnRadS * t_s;
    // It flies clockwise as seen from above: heading a, on a circle about the origin.
    return {{-kRadiusM * std::cos(a), kRadiusM * std::sin(a), 1000.0},
            physics::world_from_body_heading_pitch_roll(a, 0.0, 0.0)};
  }
  [[nodiscard]] static glm::dvec3 velocity_m_s(double t_s) {
    const double a = kTurnRadS * t_s;
    return kRadiusM * kTurnRadS * glm::dvec3(std::sin(a), std::cos(a), 0.0);
  }
  [[nodiscard]] static glm::dvec3 acceleration_m_s2(double t_s) {
    const double a = kTurnRadS * t_s;
    return kRadiusM * kTurnRadS * kTurnRadS * glm::dvec3(std::cos(a), -std::sin(a), 0.0);
  }
};

class DisExerciseTest : public testing::Test {
 protected:
  DisExerciseTest() {
    DisExercise::Options options;
    options.dis.listen = "127.0.0.1:0";
    options.dis.seeker = "1:2:3";
    options.dis.entities = {{"1:2:4", 9}};
    options.dis.exercise = 5;
    options.first_time_ns = 7 * kOneSecondNs;
    options.scenario = &scenario_;
    exercise_ = std::make_unique<DisExercise>(options, counters_, events_);
  }
  /// Returns a PDU with the state of a body on the circle.
  [[nodiscard]] dis::EntityState state(std::uint16_t entity, double t_s,
                                       dis::DeadReckoningModel model = dis::DeadReckoningModel::rvw,
                                       double shift_s = 0.0) const {
    const glm::dmat3 ecef_from_world = physics::ecef_from_enu(kPlace);
    const physics::Pose pose = Circle::pose(t_s + shift_s);
    dis::EntityState out;
    out.entity_id = {1, 2, entity};
    out.model = model;
    out.location_ecef_m = physics::ecef_m(kPlace) + ecef_from_world * pose.position_world_m;
    out.velocity_m_s = glm::vec3(ecef_from_world * Circle::velocity_m_s(t_s + shift_s));
    out.acceleration_m_s2 = glm::vec3(ecef_from_world * Circle::acceleration_m_s2(t_s + shift_s));
    out.angular_velocity_rad_s = {0.0F, 0.0F, static_cast<float>(kTurnRadS)};
    const dis::EulerAnglesF64 angles =
        dis::euler_angles(glm::transpose(ecef_from_world * glm::mat3_cast(pose.world_from_body)));
    out.orientation = {static_cast<float>(angles.psi_rad), static_cast<float>(angles.theta_rad),
                       static_cast<float>(angles.phi_rad)};
    return out;
  }
  /// Sends a PDU that was stamped at `sent_ns` of the sender's clock and arrives at `now_ns`.
  template <class Pdu>
  void send(const Pdu& pdu, std::int64_t sent_ns, std::int64_t now_ns, std::uint8_t exercise = 5) {
    std::array<std::byte, 512> memory;
    dis::Writer writer(memory, 7, exercise);
    EXPECT_FALSE(writer.add(pdu, dis::timestamp_of(sent_ns, true)));
    exercise_->take(writer.datagram(), now_ns);
  }

  const scene::ScenarioDesc scenario_ = scenario();
  Counters counters_;
  EventLog events_{256, counters_};
  std::unique_ptr<DisExercise> exercise_;
  std::unique_ptr<protocol::HostFrameData> frame_ = std::make_unique<protocol::HostFrameData>();
};

TEST_F(DisExerciseTest, LossAndDelayShiftNothing) {
  // Ten PDUs a second with delays from 2 ms to 20 ms, of which half are lost, over a full hour of
  // the stamps. The sender's clock is 0.3 s ahead.
  std::mt19937 random(11);
  std::uniform_real_distribution<double> delay_ms(2.0, 20.0);
  std::bernoulli_distribution lost(0.5);
  const std::int64_t sender_ahead_ns = 300 * kOneMsNs;
  std::multimap<std::int64_t, std::int64_t> arrivals;  // arrival, sent (both since the start)
  for (std::int64_t sent_ns = 0; sent_ns < 60 * kOneSecondNs; sent_ns += 100 * kOneMsNs) {
    if (sent_ns > 0 && lost(random)) continue;
    arrivals.emplace(sent_ns + static_cast<std::int64_t>(delay_ms(random) * 1e6), sent_ns);
  }
  const std::int64_t hour_ns = 3600 * kOneSecondNs;
  const std::int64_t start_ns = (kWallNs / hour_ns + 1) * hour_ns - 30 * kOneSecondNs;
  double most_m = 0.0;
  double most_rad = 0.0;
  std::int64_t offset_ns = 0;
  std::uint64_t frames = 0;
  auto next = arrivals.begin();
  for (std::int64_t t_ns = 0; t_ns < 60 * kOneSecondNs; t_ns += kOneMsNs) {
    for (; next != arrivals.end() && next->first <= t_ns; ++next) {
      const double sent_s = 1e-9 * static_cast<double>(next->second);
      send(state(3, sent_s), start_ns + sender_ahead_ns + next->second, start_ns + next->first);
    }
    if (!exercise_->next(*frame_, start_ns + t_ns)) continue;
    if (++frames == 1) offset_ns = frame_->sim_time_ns - t_ns;
    // The least delay of 2 ms is all that is between the two clocks.
    const double true_s = 1e-9 * static_cast<double>(t_ns);
    if (t_ns < 20 * kOneSecondNs) continue;
    EXPECT_NEAR(static_cast<double>(frame_->sim_time_ns - t_ns - offset_ns), 0.0, 30e6);
    const physics::Pose truth = Circle::pose(true_s - 0.002);
    most_m =
        std::max(most_m, glm::distance(frame_->seeker.position_world_m, truth.position_world_m));
    const glm::dvec3 nose = frame_->seeker.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
    const glm::dvec3 wanted = truth.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
    most_rad = std::max(most_rad, glm::length(glm::cross(nose, wanted)));
  }
  EXPECT_GE(frames, 5900U) << "poses come at their own rate";
  // 200 m/s for the millisecond that the least delay is uncertain by, and the jerk over the gaps.
  EXPECT_LT(most_m, 2.5);
  EXPECT_LT(most_rad, 0.003);
  EXPECT_GT(most_m, 1e-6);
}

TEST_F(DisExerciseTest, AnEntityGoesOnForSecondsByItsModel) {
  send(state(3, 0.0), kWallNs, kWallNs);
  send(state(4, 0.0, dis::DeadReckoningModel::rvw, 1.0), kWallNs, kWallNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs));
  ASSERT_EQ(frame_->entity_count, 1U);
  EXPECT_EQ(frame_->entities[0].entity_id, 9U);
  EXPECT_TRUE(frame_->entities[0].teleport) << "it was nowhere before";
  EXPECT_EQ(frame_->sim_time_ns, 7 * kOneSecondNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs + 500 * kOneMsNs));
  EXPECT_EQ(frame_->sim_time_ns, 7 * kOneSecondNs + 500 * kOneMsNs);
  const physics::Pose truth = Circle::pose(1.5);
  // The third derivative over half a second: 500 m * 0.4^3 * 0.5^3 / 6.
  EXPECT_LT(glm::distance(frame_->entities[0].pose.position_world_m, truth.position_world_m), 0.7);
  EXPECT_FALSE(frame_->entities[0].teleport);
  EXPECT_LT(glm::distance(frame_->entities[0].pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0),
                          truth.world_from_body * glm::dvec3(1.0, 0.0, 0.0)),
            1e-5);
}

TEST_F(DisExerciseTest, EntitiesOfOneSenderShareStamps) {
  send(state(4, 0.0), kWallNs, kWallNs);
  send(state(3, 0.0), kWallNs, kWallNs);
  send(state(3, 0.1), kWallNs + 100 * kOneMsNs, kWallNs + 100 * kOneMsNs);
  send(state(4, 0.1), kWallNs + 100 * kOneMsNs, kWallNs + 100 * kOneMsNs);
  EXPECT_EQ(counters_.get(Counter::gateway_messages_old), 0U);
  send(state(4, 0.05), kWallNs + 50 * kOneMsNs, kWallNs + 110 * kOneMsNs);
  EXPECT_EQ(counters_.get(Counter::gateway_messages_old), 1U) << "overtaken by a newer one";
}

TEST_F(DisExerciseTest, AFrozenEntityStandsAndADeactivatedOneIsHidden) {
  send(state(3, 0.0), kWallNs, kWallNs);
  auto frozen = state(4, 0.0);
  frozen.appearance = 1U << 21U;
  send(frozen, kWallNs, kWallNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs));
  const glm::dvec3 before = frame_->entities[0].pose.position_world_m;
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs + kOneSecondNs));
  EXPECT_EQ(frame_->entities[0].pose.position_world_m, before);
  auto gone = state(4, 1.0);
  gone.appearance = 1U << 23U;
  send(gone, kWallNs + kOneSecondNs, kWallNs + kOneSecondNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs + kOneSecondNs + 20 * kOneMsNs));
  ASSERT_EQ(frame_->entity_count, 1U);
  EXPECT_FALSE(frame_->entities[0].on);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs + kOneSecondNs + 40 * kOneMsNs));
  EXPECT_EQ(frame_->entity_count, 0U) << "once is enough";
}

TEST_F(DisExerciseTest, SilenceHidesAnEntityAndASilentSeekerEndsThePoses) {
  send(state(3, 0.0), kWallNs, kWallNs);
  send(state(4, 0.0), kWallNs, kWallNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs));
  const std::int64_t later_ns = kWallNs + 13 * kOneSecondNs;
  EXPECT_FALSE(exercise_->next(*frame_, later_ns));
  send(state(3, 13.0), later_ns, later_ns);
  ASSERT_TRUE(exercise_->next(*frame_, later_ns + 10 * kOneMsNs));
  ASSERT_EQ(frame_->entity_count, 1U);
  EXPECT_FALSE(frame_->entities[0].on);
  send(state(4, 13.0), later_ns + kOneMsNs, later_ns + kOneMsNs);
  ASSERT_TRUE(exercise_->next(*frame_, later_ns + 20 * kOneMsNs));
  EXPECT_TRUE(frame_->entities[0].on);
  EXPECT_TRUE(frame_->entities[0].teleport);
}

TEST_F(DisExerciseTest, WhatTheExerciseDoesNotHaveIsHidden) {
  send(state(3, 0.0), kWallNs, kWallNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs));
  ASSERT_EQ(frame_->entity_count, 1U) << "the scenario may show it";
  EXPECT_FALSE(frame_->entities[0].on);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs + 10 * kOneMsNs));
  EXPECT_EQ(frame_->entity_count, 0U);
  // After a command that resets the run it has to be said once more.
  exercise_->report({GatewayReport::Kind::reset, 0});
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs + 20 * kOneMsNs));
  EXPECT_EQ(frame_->entity_count, 1U);
}

TEST_F(DisExerciseTest, ASilentSeekerAndAClockThatIsSetBackKeepNobodyAwake) {
  send(state(3, 0.0), kWallNs, kWallNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs));
  const std::int64_t later_ns = kWallNs + 20 * kOneSecondNs;
  EXPECT_FALSE(exercise_->next(*frame_, later_ns));
  EXPECT_GT(exercise_->wake_at_ns(), later_ns);
  // An hour back: the next host frame does not wait for an hour.
  const std::int64_t back_ns = later_ns - 3600 * kOneSecondNs;
  send(state(3, 1.0), kWallNs + kOneSecondNs, back_ns);
  static_cast<void>(exercise_->next(*frame_, back_ns));
  EXPECT_LT(exercise_->wake_at_ns(), back_ns + kOneSecondNs);
}

TEST_F(DisExerciseTest, ModelsThatDoNotTurnHaveNoRateOfTurn) {
  send(state(3, 0.0, dis::DeadReckoningModel::fpw), kWallNs, kWallNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs));
  ASSERT_TRUE(frame_->seeker_rates);
  EXPECT_EQ(frame_->seeker_rates->angular_rate_body_rad_s, glm::dvec3(0.0));
  EXPECT_GT(glm::length(frame_->seeker_rates->velocity_world_m_s), 100.0);
}

TEST_F(DisExerciseTest, AnUpdateKeepsTheModel) {
  dis::EntityStateUpdate update;
  update.entity_id = {1, 2, 3};
  send(update, kWallNs, kWallNs);
  EXPECT_EQ(counters_.get(Counter::gateway_packets_unused), 1U) << "nobody knows it yet";
  send(state(3, 0.0), kWallNs, kWallNs);
  const auto moved = state(3, 0.5);
  update.location_ecef_m = moved.location_ecef_m;
  update.velocity_m_s = moved.velocity_m_s;
  update.orientation = moved.orientation;
  send(update, kWallNs + 500 * kOneMsNs, kWallNs + 500 * kOneMsNs);
  ASSERT_TRUE(exercise_->next(*frame_, kWallNs + 600 * kOneMsNs));
  EXPECT_LT(glm::distance(frame_->seeker.position_world_m, Circle::pose(0.6).position_world_m),
            0.2);
}

TEST_F(DisExerciseTest, WhatIsNotForThisExerciseIsCountedAndLeftOut) {
  send(state(3, 0.0), kWallNs, kWallNs, 6);
  send(state(77, 0.0), kWallNs, kWallNs);
  EXPECT_EQ(counters_.get(Counter::gateway_packets_unused), 2U);
  auto wild = state(3, 0.0);
  wild.velocity_m_s.x = 1e7F;
  send(wild, kWallNs, kWallNs);
  EXPECT_FALSE(exercise_->next(*frame_, kWallNs));
  const std::array<std::byte, 5> rest{std::byte{7}};
  exercise_->take(rest, kWallNs);
  EXPECT_GT(counters_.get(Counter::gateway_messages_refused) +
                counters_.get(Counter::gateway_packets_refused),
            1U);
}

TEST_F(DisExerciseTest, NothingAllocatesWhileItServes) {
  send(state(3, 0.0), kWallNs, kWallNs);
  send(state(4, 0.0), kWallNs, kWallNs);
  const std::uint64_t before = test::heap_request_count();
  for (int i = 1; i <= 100; ++i) {
    const std::int64_t now_ns = kWallNs + i * 10 * kOneMsNs;
    send(state(3, 0.01 * i), now_ns, now_ns);
    send(state(50, 0.01 * i), now_ns, now_ns);
    ASSERT_TRUE(exercise_->next(*frame_, now_ns));
  }
  EXPECT_EQ(test::heap_request_count(), before);
}

}  // namespace
}  // namespace emit::server
