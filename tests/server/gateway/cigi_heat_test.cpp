// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_heat.hpp"

#include <gtest/gtest.h>

#include <bit>
#include <limits>
#include <memory>

#include "support/heap_counter.hpp"

namespace emit::server {
namespace {

namespace cigi = protocol::cigi;
using Kind = protocol::PartCommandData::Kind;

scene::ScenarioDesc truck() {
  scene::ScenarioDesc out;
  scene::ObjectDesc object;
  object.entity_id = 5;
  scene::PartDesc engine;
  engine.id = 1;
  engine.curve.given = true;
  scene::PartDesc exhaust;
  exhaust.id = 2;
  object.parts = {engine, exhaust};
  out.objects.push_back(object);
  return out;
}

cigi::ShortComponentControl packet_of(std::uint16_t entity, std::uint16_t part, std::uint8_t state,
                                      float value) {
  cigi::ShortComponentControl out;
  out.instance_id = entity;
  out.component_id = part;
  out.component_state = state;
  out.data[0] = std::bit_cast<std::uint32_t>(value);
  return out;
}

TEST(CigiHeat, AComponentOfAnEntityDrivesItsPartOnceUntilItIsSentAgain) {
  const scene::ScenarioDesc scenario = truck();
  CigiHeat heat(&scenario, {{.id = 12, .entity = 5}});
  cigi::ComponentControl packet;
  packet.instance_id = 12;
  packet.component_id = 1;
  packet.component_state = CigiHeat::kThrottle;
  packet.data[0] = std::bit_cast<std::uint32_t>(0.5F);
  ASSERT_TRUE(heat.take(packet));
  ASSERT_TRUE(heat.take(packet_of(12, 2, CigiHeat::kTemperatureK, 650.0F)));
  const auto frame = std::make_unique<protocol::HostFrameData>();
  const std::uint64_t before = test::heap_request_count();
  heat.fill(*frame);
  ASSERT_EQ(frame->part_count, 2U);
  EXPECT_EQ(frame->parts[0].entity_id, 5U);
  EXPECT_EQ(frame->parts[0].part_id, 1U);
  EXPECT_EQ(frame->parts[0].kind, Kind::throttle);
  EXPECT_EQ(frame->parts[0].value, 0.5);
  EXPECT_EQ(frame->parts[1].kind, Kind::temperature);
  EXPECT_EQ(frame->parts[1].value, 650.0);
  heat.fill(*frame);
  EXPECT_EQ(frame->part_count, 0U);
  // A reset takes the host's own state on.
  ASSERT_TRUE(heat.take(packet_of(12, 2, CigiHeat::kOff, 0.0F)));
  heat.mark_all();
  heat.fill(*frame);
  ASSERT_EQ(frame->part_count, 2U);
  EXPECT_EQ(frame->parts[1].kind, Kind::off);
  EXPECT_EQ(test::heap_request_count(), before);
  heat.clear();
  heat.mark_all();
  heat.fill(*frame);
  EXPECT_EQ(frame->part_count, 0U);
}

TEST(CigiHeat, WhatNoPartTakesHasNoEffect) {
  const scene::ScenarioDesc scenario = truck();
  CigiHeat heat(&scenario, {});
  EXPECT_TRUE(heat.take(packet_of(5, 2, CigiHeat::kPowerWM2, 900.0F)));
  EXPECT_FALSE(heat.take(packet_of(5, 2, CigiHeat::kThrottle, 0.5F))) << "no curve";
  EXPECT_FALSE(heat.take(packet_of(5, 3, CigiHeat::kPowerWM2, 900.0F))) << "no such part";
  EXPECT_FALSE(heat.take(packet_of(6, 1, CigiHeat::kThrottle, 0.5F))) << "no such entity";
  EXPECT_FALSE(heat.take(packet_of(0, 1, CigiHeat::kThrottle, 0.5F))) << "scenery";
  EXPECT_FALSE(heat.take(packet_of(5, 1, CigiHeat::kThrottle, 1.5F)));
  EXPECT_FALSE(heat.take(packet_of(5, 1, CigiHeat::kTemperatureK, 10.0F)));
  EXPECT_FALSE(
      heat.take(packet_of(5, 1, CigiHeat::kPowerWM2, std::numeric_limits<float>::quiet_NaN())));
  EXPECT_FALSE(heat.take(packet_of(5, 1, 4, 0.5F))) << "no such state";
  auto view = packet_of(5, 1, CigiHeat::kThrottle, 0.5F);
  view.component_class = cigi::ComponentClass::view;
  EXPECT_FALSE(heat.take(view));
}

TEST(CigiHeat, MorePartsThanAFrameHoldsComeWithTheNextOnes) {
  CigiHeat heat(nullptr, {});
  for (std::uint16_t part = 1; part <= 70; ++part) {
    ASSERT_TRUE(heat.take(packet_of(3, part, CigiHeat::kTemperatureK, 300.0F + part)));
  }
  const auto frame = std::make_unique<protocol::HostFrameData>();
  std::uint32_t sent = 0;
  for (int frames = 0; frames < 3; ++frames) {
    heat.fill(*frame);
    for (std::uint32_t i = 0; i < frame->part_count; ++i) {
      EXPECT_EQ(frame->parts[i].part_id, ++sent);
    }
  }
  EXPECT_EQ(sent, 70U);
}

}  // namespace
}  // namespace emit::server
