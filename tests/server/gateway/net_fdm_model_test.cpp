// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>

#include "gateway/net_fdm_model.hpp"

namespace emit::server {
namespace {

namespace net_fdm = protocol::net_fdm;

constexpr std::int64_t kArrivalNs = 1'800'000'000'000'000'000;

TEST(NetFdmModel, ADatagramIsAPoseAtItsArrival) {
  Counters counters;
  EventLog events(16, counters);
  scene::ScenarioDesc scenario;
  scenario.place = {0.6, -2.0, 100.0};
  NetFdmModel model(5'000, &scenario, counters, events);
  auto frame = std::make_unique<protocol::HostFrameData>();
  EXPECT_FALSE(model.next(*frame, kArrivalNs));

  net_fdm::State state;
  state.latitude_rad = 0.6;
  state.longitude_rad = -2.0;
  state.altitude_m = 350.0;
  state.heading_rad = 1.5707964F;
  state.velocity_ned_m_s = {3.0, 40.0, -2.0};
  state.heading_rate_rad_s = 0.1F;
  std::array<std::byte, net_fdm::kBytes> bytes;
  net_fdm::encode(state, bytes);
  model.take(bytes, kArrivalNs);
  ASSERT_TRUE(model.next(*frame, kArrivalNs));
  EXPECT_EQ(frame->sim_time_ns, 5'000);
  EXPECT_LT(glm::distance(frame->seeker.position_world_m, glm::dvec3(0.0, 0.0, 250.0)), 1e-6);
  EXPECT_LT(glm::distance(frame->seeker.world_from_body * glm::dvec3(1.0, 0.0, 0.0),
                          glm::dvec3(1.0, 0.0, 0.0)),
            1e-6)
      << "east";
  ASSERT_TRUE(frame->seeker_rates);
  EXPECT_LT(glm::distance(frame->seeker_rates->velocity_world_m_s, glm::dvec3(40.0, 3.0, 2.0)),
            1e-5);
  EXPECT_NEAR(frame->seeker_rates->angular_rate_body_rad_s.z, 0.1, 1e-6);
  EXPECT_FALSE(model.next(*frame, kArrivalNs));

  // Three datagrams are lost: the next one has the time of its arrival.
  model.take(bytes, kArrivalNs + 40'000'000);
  ASSERT_TRUE(model.next(*frame, kArrivalNs + 40'000'000));
  EXPECT_EQ(frame->sim_time_ns, 5'000 + 40'000'000);
  EXPECT_EQ(frame->frame_number, 2U);

  // A clock that was set back does not turn time round.
  model.take(bytes, kArrivalNs);
  ASSERT_TRUE(model.next(*frame, kArrivalNs));
  EXPECT_EQ(frame->sim_time_ns, 5'000 + 40'000'000);
  EXPECT_EQ(frame->received_ns, kArrivalNs);
  const std::uint64_t run_id = frame->run_id;
  model.take(bytes, kArrivalNs + 10'000'000);
  ASSERT_TRUE(model.next(*frame, kArrivalNs + 10'000'000));
  EXPECT_EQ(frame->sim_time_ns, 5'000 + 50'000'000) << "it goes on";
  EXPECT_EQ(frame->run_id, run_id);
}

TEST(NetFdmModel, WhatIsNoDatagramIsRefused) {
  Counters counters;
  EventLog events(16, counters);
  NetFdmModel model(0, nullptr, counters, events);
  auto frame = std::make_unique<protocol::HostFrameData>();
  std::array<std::byte, net_fdm::kBytes> bytes{};
  model.take(bytes, kArrivalNs);
  EXPECT_EQ(counters.get(Counter::gateway_messages_refused), 1U);
  EXPECT_FALSE(model.next(*frame, kArrivalNs));
}

}  // namespace
}  // namespace emit::server
