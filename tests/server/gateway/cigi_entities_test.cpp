// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <numbers>
#include <set>

#include "emit/physics/constants.hpp"
#include "gateway/cigi_entities.hpp"

namespace emit::server {
namespace {

namespace cigi = protocol::cigi;
using physics::kDegree;

const physics::GeoPlace kOrigin{physics::degrees(-33.9), physics::degrees(151.2),
                                physics::Metres(20.0)};

cigi::EntityControl entity_at(std::uint16_t id, const physics::GeoPlace& place,
                              float yaw_deg = 0.0F) {
  cigi::EntityControl out;
  out.entity_id = id;
  out.state = cigi::EntityState::active;
  out.yaw_deg = yaw_deg;
  out.place = {physics::to_degrees(place.latitude), physics::to_degrees(place.longitude),
               place.height.value()};
  return out;
}
cigi::EntityControl child_of(std::uint16_t parent, std::uint16_t id, const glm::dvec3& offset_m,
                             float yaw_deg = 0.0F) {
  cigi::EntityControl out;
  out.entity_id = id;
  out.state = cigi::EntityState::active;
  out.attached = true;
  out.parent_id = parent;
  out.yaw_deg = yaw_deg;
  out.place = {offset_m.x, offset_m.y, offset_m.z};
  return out;
}

class CigiEntitiesTest : public testing::Test {
 protected:
  CigiEntities make(std::set<std::uint32_t> known, bool predicted = false) {
    CigiEntities::Options options;
    options.predicted = predicted;
    options.known = [known = std::move(known)](std::uint32_t id) { return known.contains(id); };
    return {earth_, nullptr, std::move(options)};
  }
  const protocol::HostFrameData& fill(CigiEntities& entities) {
    entities.fill(*frame_);
    return *frame_;
  }
  Georeference earth_{kOrigin};
  std::unique_ptr<protocol::HostFrameData> frame_ = std::make_unique<protocol::HostFrameData>();
};

TEST_F(CigiEntitiesTest, ABodyAtTheOriginHasTheAttitudeOfItsAngles) {
  CigiEntities entities = make({});
  auto packet = entity_at(0, kOrigin, 90.0F);
  packet.pitch_deg = 30.0F;
  ASSERT_TRUE(entities.take(packet));
  const auto pose = entities.seeker_pose();
  ASSERT_TRUE(pose);
  EXPECT_LT(glm::length(pose->position_world_m), 1e-6);
  const glm::dvec3 nose = pose->world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  EXPECT_NEAR(nose.x, std::cos(30.0 * kDegree), 1e-9) << "east";
  EXPECT_NEAR(nose.y, 0.0, 1e-9);
  EXPECT_NEAR(nose.z, 0.5, 1e-9) << "up";
}

TEST_F(CigiEntitiesTest, LevelFlightFarAwayIsLevelThere) {
  CigiEntities entities = make({});
  // A quarter of the way round the Earth to the north, the vertical is the north of the origin.
  const physics::GeoPlace far{physics::degrees(56.1), physics::degrees(151.2),
                              physics::Metres(0.0)};
  ASSERT_TRUE(entities.take(entity_at(0, far)));
  const auto pose = entities.seeker_pose();
  ASSERT_TRUE(pose);
  const glm::dvec3 down = pose->world_from_body * glm::dvec3(0.0, 0.0, 1.0);
  EXPECT_NEAR(down.y, -1.0, 1e-9);
  const glm::dvec3 nose = pose->world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  EXPECT_NEAR(nose.z, -1.0, 1e-9);
}

TEST_F(CigiEntitiesTest, ChildrenFollowTheirParentsInTheirFrame) {
  CigiEntities entities = make({2, 3});
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(2, kOrigin, 90.0F)));
  ASSERT_TRUE(entities.take(child_of(2, 3, {10.0, 2.0, -1.0}, 90.0F)));
  EXPECT_EQ(fill(entities).entity_count, 2U);
  const auto child = entities.pose_of(std::uint16_t{3});
  ASSERT_TRUE(child);
  // The parent looks east: forward is east, right is south, up is up.
  EXPECT_LT(glm::distance(child->position_world_m, glm::dvec3(10.0, -2.0, 1.0)), 1e-6);
  const glm::dvec3 nose = child->world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  EXPECT_LT(glm::distance(nose, glm::dvec3(0.0, -1.0, 0.0)), 1e-9);
  // A frame carries the child of a parent that has moved, and nobody else.
  EXPECT_EQ(fill(entities).entity_count, 0U);
  ASSERT_TRUE(entities.take(entity_at(2, kOrigin, 0.0F)));
  const auto& moved = fill(entities);
  ASSERT_EQ(moved.entity_count, 2U);
  EXPECT_LT(glm::distance(moved.entities[1].pose.position_world_m, glm::dvec3(2.0, 10.0, 1.0)),
            1e-6);
}

TEST_F(CigiEntitiesTest, ParentsInACircleHaveNoPose) {
  CigiEntities entities = make({2, 3});
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(child_of(3, 2, {1.0, 0.0, 0.0})));
  ASSERT_TRUE(entities.take(child_of(2, 3, {1.0, 0.0, 0.0})));
  EXPECT_FALSE(entities.pose_of(std::uint16_t{2}));
  const auto& frame = fill(entities);
  ASSERT_EQ(frame.entity_count, 2U);
  EXPECT_FALSE(frame.entities[0].has_pose);
  EXPECT_FALSE(frame.entities[0].on);
}

TEST_F(CigiEntitiesTest, StandbyHidesAndAReturnIsAJump) {
  CigiEntities entities = make({5});
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  auto packet = entity_at(5, kOrigin);
  ASSERT_TRUE(entities.take(packet));
  EXPECT_TRUE(fill(entities).entities[0].teleport) << "it was nowhere before";
  ASSERT_TRUE(entities.take(packet));
  EXPECT_FALSE(fill(entities).entities[0].teleport);
  packet.state = cigi::EntityState::destroyed;
  ASSERT_TRUE(entities.take(packet));
  EXPECT_FALSE(fill(entities).entities[0].on);
  packet.state = cigi::EntityState::active;
  ASSERT_TRUE(entities.take(packet));
  EXPECT_TRUE(fill(entities).entities[0].on);
  EXPECT_TRUE(frame_->entities[0].teleport);
}

TEST_F(CigiEntitiesTest, MoreThanFitsComesWithTheNextFrames) {
  std::set<std::uint32_t> known;
  for (std::uint32_t id = 1; id <= 300; ++id) known.insert(id);
  CigiEntities entities = make(known);
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  for (std::uint16_t id = 1; id <= 300; ++id) ASSERT_TRUE(entities.take(entity_at(id, kOrigin)));
  std::set<std::uint32_t> seen;
  for (int frame = 0; frame < 3; ++frame) {
    for (const auto& state : fill(entities).entity_span()) seen.insert(state.entity_id);
  }
  EXPECT_EQ(seen, known);
  EXPECT_EQ(fill(entities).entity_count, 0U);
}

TEST_F(CigiEntitiesTest, RatesAreThoseOfTheirFrame) {
  CigiEntities entities = make({});
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin, 90.0F)));
  cigi::RateControl rates;
  rates.x_m_s = 100.0F;
  rates.z_m_s = 5.0F;
  rates.yaw_deg_s = 10.0F;
  ASSERT_TRUE(entities.take(rates));
  const auto world = fill(entities).seeker_rates;
  ASSERT_TRUE(world);
  EXPECT_LT(glm::distance(world->velocity_world_m_s, glm::dvec3(0.0, 100.0, -5.0)), 1e-6)
      << "north and down";
  EXPECT_LT(glm::distance(world->angular_rate_body_rad_s, glm::dvec3(0.0, 0.0, 10.0 * kDegree)),
            1e-9);
  rates.local = true;
  ASSERT_TRUE(entities.take(rates));
  const auto local = fill(entities).seeker_rates;
  EXPECT_LT(glm::distance(local->velocity_world_m_s, glm::dvec3(100.0, 0.0, -5.0)), 1e-6)
      << "forward is east, the z axis is down";
}

TEST_F(CigiEntitiesTest, RatesMoveAnEntityUntilTheHostSaysWhereItIs) {
  CigiEntities entities = make({5});
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(5, kOrigin)));
  cigi::RateControl rates;
  rates.entity_id = 5;
  rates.local = true;
  rates.x_m_s = 10.0F;
  rates.yaw_deg_s = 90.0F;
  ASSERT_TRUE(entities.take(rates));
  entities.set_time(500'000'000);
  const auto& frame = fill(entities);
  ASSERT_EQ(frame.entity_count, 1U) << "nobody has sent it again";
  EXPECT_LT(glm::distance(frame.entities[0].pose.position_world_m, glm::dvec3(0.0, 5.0, 0.0)),
            1e-6);
  const glm::dvec3 nose = frame.entities[0].pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  EXPECT_NEAR(nose.x, std::sqrt(0.5), 1e-9) << "half of a right turn";
  // Other rates go on from there.
  rates.x_m_s = 0.0F;
  rates.yaw_deg_s = -90.0F;
  ASSERT_TRUE(entities.take(rates));
  entities.set_time(1'000'000'000);
  const auto& later = fill(entities);
  EXPECT_LT(glm::distance(later.entities[0].pose.position_world_m, glm::dvec3(0.0, 5.0, 0.0)),
            1e-6);
  EXPECT_NEAR((later.entities[0].pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0)).y, 1.0, 1e-9);
  // A place ends the way, and destruction ends the rates.
  auto gone = entity_at(5, kOrigin);
  ASSERT_TRUE(entities.take(gone));
  gone.state = cigi::EntityState::destroyed;
  ASSERT_TRUE(entities.take(gone));
  ASSERT_TRUE(entities.take(entity_at(5, kOrigin)));
  entities.set_time(9'000'000'000);
  EXPECT_LT(glm::length(entities.pose_of(std::uint16_t{5})->position_world_m), 1e-6);
}

TEST_F(CigiEntitiesTest, RatesOfAnAttachedEntityHaveNoEffect) {
  CigiEntities entities = make({});
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(child_of(0, 3, {1.0, 0.0, 0.0})));
  cigi::RateControl rates;
  rates.entity_id = 3;
  EXPECT_FALSE(entities.take(rates));
}

TEST_F(CigiEntitiesTest, WhereFramesArePredictedAnEntityThatIsNotSentAgainIsSaidToStand) {
  CigiEntities entities = make({5}, true);
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(5, kOrigin)));
  std::vector<std::uint32_t> counts;
  for (int frame = 0; frame < 6; ++frame) counts.push_back(fill(entities).entity_count);
  EXPECT_THAT(counts, testing::ElementsAre(1, 1, 1, 1, 0, 0));
  EXPECT_FALSE(frame_->entities[0].teleport);
}

TEST_F(CigiEntitiesTest, ANumberThatStandsForAnotherEntityIsUnknown) {
  CigiEntities::Options options;
  options.known = [](std::uint32_t id) { return id == 1; };
  options.entities = {{std::uint16_t{12}, 1U}};
  CigiEntities entities(earth_, nullptr, std::move(options));
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(12, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(1, kOrigin)));
  EXPECT_EQ(fill(entities).entity_count, 1U);
  EXPECT_EQ(entities.take_unknown(), std::uint16_t{1});
}

TEST_F(CigiEntitiesTest, AViewIsMountedOnItsEntity) {
  CigiEntities entities = make({4});
  ASSERT_TRUE(entities.take(entity_at(4, kOrigin, 180.0F)));
  EXPECT_FALSE(entities.has_seeker());
  cigi::ViewControl view;
  view.entity_id = 4;
  view.x_enabled = view.yaw_enabled = true;
  view.x_m = 3.0F;
  view.y_m = 100.0F;  // not enabled
  view.yaw_deg = 90.0F;
  ASSERT_TRUE(entities.take(view));
  const auto pose = entities.seeker_pose();
  ASSERT_TRUE(pose);
  EXPECT_LT(glm::distance(pose->position_world_m, glm::dvec3(0.0, -3.0, 0.0)), 1e-6);
  const glm::dvec3 nose = pose->world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  EXPECT_LT(glm::distance(nose, glm::dvec3(-1.0, 0.0, 0.0)), 1e-9) << "from south to west";
  view.view_id = 1;
  EXPECT_FALSE(entities.take(view)) << "another view";
}

TEST_F(CigiEntitiesTest, ThereIsAnEndToEntities) {
  CigiEntities entities = make({});
  for (std::uint32_t id = 0; id < CigiEntities::kMaxEntities; ++id) {
    ASSERT_TRUE(entities.take(entity_at(static_cast<std::uint16_t>(id), kOrigin)));
  }
  EXPECT_FALSE(entities.take(entity_at(60'000, kOrigin)));
  EXPECT_TRUE(entities.take(entity_at(7, kOrigin))) << "one that is there already";
  entities.clear();
  EXPECT_TRUE(entities.take(entity_at(60'000, kOrigin)));
}

class CigiPartsTest : public CigiEntitiesTest {
 protected:
  static constexpr std::uint16_t kTank = 12;
  static constexpr std::uint8_t kTurret = 1;
  static constexpr std::uint8_t kGun = 2;

  /// A tank whose turret is entity 21 and whose gun, on the turret, is entity 22.
  CigiEntities make_tank() {
    CigiEntities::Options options;
    options.known = [](std::uint32_t id) { return id == kTank || id == 21 || id == 22; };
    CigiPart::Joint turret{kTank, kTurret, 21, {}, {0.5, 0.0, -2.0}, {}};
    CigiPart::Joint gun{kTank, kGun, 22, kTurret, {1.0, 0.0, -0.25}, {}};
    options.parts = {gun, turret};  // in no order
    return {earth_, nullptr, std::move(options)};
  }
  static cigi::ShortArticulatedPartControl turned(float turret_yaw_deg, float gun_pitch_deg) {
    cigi::ShortArticulatedPartControl out;
    out.entity_id = kTank;
    out.motions = {{{kTurret, cigi::PartAxis::yaw, true, turret_yaw_deg},
                    {kGun, cigi::PartAxis::pitch, true, gun_pitch_deg}}};
    return out;
  }
  /// Returns the state of an entity in a frame; null: the frame does not have it.
  static const protocol::EntityStateData* state_of(const protocol::HostFrameData& frame,
                                                   std::uint32_t id) {
    for (const protocol::EntityStateData& state : frame.entity_span()) {
      if (state.entity_id == id) return &state;
    }
    return nullptr;
  }
};

TEST_F(CigiPartsTest, PartsStandAtTheirJointsAndTurnAboutThem) {
  CigiEntities entities = make_tank();
  // The tank heads east: its x is east, its y south, its z down.
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(kTank, kOrigin, 90.0F)));
  const auto* gun = state_of(fill(entities), 22);
  ASSERT_NE(gun, nullptr) << "parts are there before a packet moves them";
  EXPECT_LT(glm::distance(gun->pose.position_world_m, glm::dvec3(1.5, 0.0, 2.25)), 1e-6);
  EXPECT_TRUE(gun->on);
  // A quarter turn to the right points the turret south; the gun is raised by 30 degrees.
  ASSERT_TRUE(entities.take(turned(90.0F, 30.0F)));
  gun = state_of(fill(entities), 22);
  ASSERT_NE(gun, nullptr);
  EXPECT_FALSE(gun->teleport);
  EXPECT_LT(glm::distance(gun->pose.position_world_m, glm::dvec3(0.5, -1.0, 2.25)), 1e-6);
  const glm::dvec3 barrel = gun->pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
  EXPECT_LT(glm::distance(barrel, glm::dvec3(0.0, -std::cos(30.0 * kDegree), 0.5)), 1e-9);
  EXPECT_EQ(fill(entities).entity_count, 0U) << "nothing moves";
}

TEST_F(CigiPartsTest, PartsFollowTheirEntityAndVanishWithIt) {
  CigiEntities entities = make_tank();
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  EXPECT_FALSE(entities.pose_of_part(kTank, kGun)) << "the tank has no place yet";
  ASSERT_TRUE(entities.take(entity_at(kTank, kOrigin, 90.0F)));
  (void)fill(entities);
  auto moved = entity_at(kTank, kOrigin, 90.0F);
  moved.place.altitude_m_or_z_m += 3.0;
  ASSERT_TRUE(entities.take(moved));
  const auto* gun = state_of(fill(entities), 22);
  ASSERT_NE(gun, nullptr);
  EXPECT_NEAR(gun->pose.position_world_m.z, 5.25, 1e-6);
  moved.state = cigi::EntityState::destroyed;
  ASSERT_TRUE(entities.take(moved));
  gun = state_of(fill(entities), 22);
  ASSERT_NE(gun, nullptr);
  EXPECT_FALSE(gun->on);
  // The tank comes back elsewhere, and its parts do not travel there.
  moved.state = cigi::EntityState::active;
  moved.place.altitude_m_or_z_m += 100.0;
  ASSERT_TRUE(entities.take(moved));
  gun = state_of(fill(entities), 22);
  ASSERT_NE(gun, nullptr);
  EXPECT_TRUE(gun->on);
  EXPECT_TRUE(gun->teleport);
}

TEST_F(CigiPartsTest, AHiddenPartHidesWhatItCarries) {
  CigiEntities entities = make_tank();
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(kTank, kOrigin)));
  cigi::ArticulatedPartControl hide;
  hide.entity_id = kTank;
  hide.part_id = kTurret;
  ASSERT_TRUE(entities.take(hide));
  const protocol::HostFrameData& frame = fill(entities);
  ASSERT_NE(state_of(frame, 21), nullptr);
  EXPECT_FALSE(state_of(frame, 21)->on);
  ASSERT_NE(state_of(frame, 22), nullptr);
  EXPECT_FALSE(state_of(frame, 22)->on);
  EXPECT_TRUE(state_of(frame, kTank)->on);
}

TEST_F(CigiPartsTest, RatesTurnAPartUntilOtherRatesCome) {
  constexpr std::int64_t kSecondNs = 1'000'000'000;
  CigiEntities entities = make_tank();
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(kTank, kOrigin, 90.0F)));
  cigi::RateControl rates;
  rates.entity_id = kTank;
  rates.part_id = kTurret;
  rates.applies_to_part = true;
  rates.yaw_deg_s = 200.0F;  // further than half a turn between packets
  ASSERT_TRUE(entities.take(rates));
  (void)fill(entities);
  const auto heading_deg = [&](std::int64_t time_ns) {
    entities.set_time(time_ns);
    const auto* turret = state_of(fill(entities), 21);
    if (turret == nullptr) return -1.0;
    const glm::dvec3 x = turret->pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
    return std::fmod(std::atan2(x.x, x.y) / kDegree + 360.0, 360.0);
  };
  EXPECT_NEAR(heading_deg(kSecondNs), 290.0, 1e-6);
  // A packet for the pitch of the gun does not stop the turret.
  ASSERT_TRUE(entities.take(cigi::ShortArticulatedPartControl{
      kTank, {{{kGun, cigi::PartAxis::pitch, true, 10.0F}, {}}}}));
  EXPECT_NEAR(heading_deg(2 * kSecondNs), 130.0, 1e-6);
  rates.yaw_deg_s = 0.0F;
  ASSERT_TRUE(entities.take(rates));
  EXPECT_NEAR(heading_deg(3 * kSecondNs), 130.0, 1e-6);
  entities.set_time(4 * kSecondNs);
  EXPECT_EQ(fill(entities).entity_count, 0U);
}

TEST_F(CigiPartsTest, WaysAreAlongTheJointAndTheirLocalRatesAlongThePart) {
  CigiEntities entities = make_tank();
  ASSERT_TRUE(entities.take(entity_at(kTank, kOrigin, 90.0F)));
  cigi::ArticulatedPartControl turret;
  turret.entity_id = kTank;
  turret.part_id = kTurret;
  turret.part_enabled = turret.x_enabled = turret.yaw_enabled = true;
  turret.x_m = 0.25F;
  turret.yaw_deg = 90.0F;
  ASSERT_TRUE(entities.take(turret));
  auto pose = entities.pose_of_part(kTank, kTurret);
  ASSERT_TRUE(pose);
  EXPECT_LT(glm::distance(pose->position_world_m, glm::dvec3(0.75, 0.0, 2.0)), 1e-6);
  cigi::RateControl rates;
  rates.entity_id = kTank;
  rates.part_id = kTurret;
  rates.applies_to_part = rates.local = true;
  rates.x_m_s = 2.0F;
  ASSERT_TRUE(entities.take(rates));
  entities.set_time(500'000'000);
  pose = entities.pose_of_part(kTank, kTurret);
  ASSERT_TRUE(pose);
  EXPECT_LT(glm::distance(pose->position_world_m, glm::dvec3(0.75, -1.0, 2.0)), 1e-6)
      << "the part looks south, and moves there";
}

TEST_F(CigiPartsTest, PartsThatAreNotConfiguredHaveNoEffect) {
  CigiEntities entities = make_tank();
  ASSERT_TRUE(entities.take(entity_at(kTank, kOrigin)));
  cigi::ArticulatedPartControl packet;
  packet.entity_id = kTank;
  packet.part_id = 9;
  EXPECT_FALSE(entities.take(packet));
  packet.entity_id = 13;
  packet.part_id = kTurret;
  EXPECT_FALSE(entities.take(packet));
  cigi::RateControl rates;
  rates.entity_id = kTank;
  rates.part_id = 9;
  rates.applies_to_part = true;
  EXPECT_FALSE(entities.take(rates));
  // The entity of a part is not also one of the host's own.
  ASSERT_TRUE(entities.take(entity_at(0, kOrigin)));
  ASSERT_TRUE(entities.take(entity_at(21, kOrigin)));
  std::size_t count = 0;
  const protocol::HostFrameData& frame = fill(entities);
  for (const auto& state : frame.entity_span()) count += state.entity_id == 21 ? 1 : 0;
  EXPECT_EQ(count, 1U);
}

}  // namespace
}  // namespace emit::server
