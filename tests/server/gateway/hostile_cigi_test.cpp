// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <memory>
#include <random>

#include "emit/config/load.hpp"
#include "emit/protocol/convert.hpp"
#include "gateway/cigi_host.hpp"
#include "support/heap_counter.hpp"

namespace emit::server {
namespace {

namespace cigi = protocol::cigi;

/// Messages of a host that has lost its mind, in both versions and byte orders: sound packets with
/// wild numbers, in any order, and now and then with bytes that were turned over.
class HostileHost {
 public:
  explicit HostileHost(std::uint32_t seed) : random_(seed) {}

  std::span<const std::byte> message() {
    const auto version = pick(2) == 0 ? cigi::Version::v3_3 : cigi::Version::v4_0;
    const auto order = pick(2) == 0 ? cigi::ByteOrder::little : cigi::ByteOrder::big;
    cigi::Writer writer(memory_, version, order);
    cigi::IgControl control;
    control.mode = pick(40) == 0 ? cigi::IgMode::standby : cigi::IgMode::operate;
    control.database = static_cast<std::int8_t>(pick(4));
    control.host_frame = pick(50) == 0 ? bits() : ++host_frame_;
    control.timestamp_valid = pick(3) > 0;
    control.timestamp_ticks = pick(50) == 0 ? bits() : host_frame_ * 1000;
    static_cast<void>(writer.add(control));
    for (std::uint32_t i = pick(12); i > 0; --i) static_cast<void>(writer.add(packet()));
    const std::size_t bytes = writer.message().size();
    if (pick(5) == 0) {
      for (std::uint32_t i = pick(4); i > 0; --i) {
        memory_[pick(static_cast<std::uint32_t>(bytes))] ^= std::byte{1} << pick(8);
      }
    }
    return std::span<const std::byte>(memory_).first(
        pick(20) == 0 ? pick(static_cast<std::uint32_t>(bytes)) : bytes);
  }

 private:
  std::uint32_t bits() { return static_cast<std::uint32_t>(random_()); }
  std::uint32_t pick(std::uint32_t below) { return below == 0 ? 0 : bits() % below; }
  std::uint16_t id() { return static_cast<std::uint16_t>(pick(3) == 0 ? bits() : pick(6)); }
  float angle(float most) { return std::uniform_real_distribution<float>(-most, most)(random_); }
  /// Returns any finite number.
  float wild() { return std::ldexp(angle(1.0F), static_cast<int>(pick(254)) - 126); }
  cigi::Place place(bool offset) {
    if (offset) return {wild(), wild(), wild()};
    // Many places are above the scene, so that rays meet something.
    if (pick(2) == 0) return {48.56 + 1e-4 * angle(1.0F), 11.26 + 1e-4 * angle(1.0F), angle(1e3F)};
    return {angle(90.0F), angle(180.0F), pick(2) == 0 ? wild() : angle(1e5F)};
  }
  cigi::Packet packet() {
    switch (pick(13)) {
      case 0:
      case 1: {
        cigi::EntityControl out;
        out.entity_id = id();
        out.state = static_cast<cigi::EntityState>(pick(3));
        out.attached = pick(3) == 0;
        out.parent_id = id();
        out.clamp = static_cast<cigi::Clamp>(pick(3));
        out.yaw_deg = angle(180.0F);
        out.pitch_deg = angle(90.0F);
        out.roll_deg = angle(180.0F);
        out.place = place(out.attached);
        return out;
      }
      case 2: {
        cigi::EntityPosition out;
        out.entity_id = id();
        out.attached = pick(3) == 0;
        out.parent_id = id();
        out.yaw_deg = angle(180.0F);
        out.place = place(out.attached);
        return out;
      }
      case 3: {
        cigi::EntityControl40 out;
        out.entity_id = id();
        out.state = static_cast<cigi::EntityState>(pick(3));
        return out;
      }
      case 4: {
        cigi::RateControl out;
        out.entity_id = id();
        out.local = pick(2) == 0;
        out.x_m_s = wild();
        out.yaw_deg_s = wild();
        return out;
      }
      case 5: {
        cigi::ViewControl out;
        out.view_id = static_cast<std::uint16_t>(pick(2));
        out.entity_id = id();
        out.x_enabled = out.yaw_enabled = pick(2) == 0;
        out.x_m = wild();
        out.yaw_deg = angle(180.0F);
        return out;
      }
      case 6: {
        cigi::AtmosphereControl out;
        out.air_temperature_c = wild();
        out.horizontal_wind_m_s = std::abs(wild());
        return out;
      }
      case 7: {
        cigi::WeatherControl out;
        out.layer_id = static_cast<std::uint8_t>(pick(5));
        out.enabled = true;
        out.coverage_percent = static_cast<float>(pick(101));
        return out;
      }
      case 8: {
        cigi::ComponentControl out;
        out.component_class = cigi::ComponentClass::atmosphere;
        out.component_id = CigiWeather::kRadiationComponent;
        for (std::uint32_t& word : out.data) word = bits();
        return out;
      }
      case 9: {
        cigi::CelestialSphereControl out;
        out.date_valid = out.sun_enabled = true;
        out.hour_utc = static_cast<std::uint8_t>(pick(24));
        out.date_mmddyyyy = 1'01'0000 + pick(10000);
        return out;
      }
      case 10: {
        cigi::HatHotRequest out;
        out.request_id = id();
        out.type = static_cast<cigi::HatHotType>(pick(3));
        out.relative_to_entity = pick(2) == 0;
        out.entity_id = id();
        out.update_period_frames = static_cast<std::uint8_t>(pick(3));
        out.place = place(out.relative_to_entity);
        return out;
      }
      case 11: {
        cigi::LosVectorRequest out;
        out.request_id = id();
        out.extended = pick(2) == 0;
        out.source_relative = pick(2) == 0;
        out.entity_id = id();
        out.azimuth_deg = angle(180.0F);
        out.elevation_deg = angle(90.0F);
        out.source = place(out.source_relative);
        return out;
      }
      default: {
        cigi::PositionRequest out;
        out.object_id = id();
        out.object_class = static_cast<cigi::ObjectClass>(pick(5));
        out.frame = static_cast<cigi::PositionFrame>(pick(3));
        out.continuous = pick(2) == 0;
        return out;
      }
    }
  }

  std::mt19937 random_;
  std::array<std::byte, 4096> memory_{};
  std::uint32_t host_frame_ = 0;
};

TEST(HostileCigi, WhateverComesFramesAreSoundAndAnswersWellFormed) {
  Counters counters;
  EventLog events(64, counters);
  // A ground and a box, of which the hostile host may ask anything.
  auto loaded = config::load_scenario(EMIT_TEST_SHARE_DIR "/scenarios/box.toml");
  ASSERT_TRUE(loaded) << loaded.error().text;
  scene::ScenarioDesc scenario = *loaded;
  auto scene = SceneQuery::create(scenario);
  ASSERT_TRUE(scene) << scene.error().text;
  for (std::uint32_t id = 1; id < 4; ++id) {
    scenario.objects.emplace_back().entity_id = id;
  }
  CigiHost::Options options;
  options.scenario = &scenario;
  options.rate_hz = 100.0;
  CigiHost gateway(options, std::make_unique<SceneQuery>(std::move(*scene)), counters, events);
  HostileHost host(3);
  auto frame = std::make_unique<protocol::HostFrameData>();
  std::int64_t now_ns = 1'800'000'000'000'000'000;
  int frames = 0;
  for (int i = 0; i < 50'000; ++i) {
    now_ns += 10'000'000;
    const auto sent = host.message();
    const std::uint64_t before = test::heap_request_count();
    gateway.take(sent, now_ns);
    const bool came = gateway.next(*frame, now_ns);
    ASSERT_EQ(test::heap_request_count(), before) << "message " << i;
    if (came) {
      ++frames;
      ASSERT_TRUE(physics::is_valid(frame->seeker)) << "message " << i;
      ASSERT_EQ(protocol::check_pose(frame->seeker, frame->seeker_rates),
                protocol::DecodeStatus::ok);
      for (const auto& entity : frame->entity_span()) {
        if (!entity.has_pose) continue;
        ASSERT_TRUE(physics::is_valid(entity.pose)) << "message " << i;
        ASSERT_EQ(protocol::check_pose(entity.pose, entity.rates), protocol::DecodeStatus::ok);
      }
      if (frame->environment) {
        ASSERT_EQ(protocol::check_environment(*frame->environment), protocol::DecodeStatus::ok);
      }
      ASSERT_LE(std::abs(frame->sim_time_ns), protocol::kMaxSimTimeNs);
      gateway.report({GatewayReport::Kind::published, frame->frame_number});
    }
    const std::uint64_t before_answers = test::heap_request_count();
    const auto message = gateway.message(now_ns);
    ASSERT_EQ(test::heap_request_count(), before_answers) << "message " << i;
    if (message.empty()) continue;
    cigi::Reader reader(message, cigi::Sender::ig);
    cigi::Packet packet;
    cigi::Step step = reader.next(packet);
    ASSERT_TRUE(std::holds_alternative<cigi::StartOfFrame>(packet)) << "message " << i;
    while (step == cigi::Step::packet) step = reader.next(packet);
    ASSERT_EQ(step, cigi::Step::end) << "message " << i;
    ASSERT_EQ(reader.refused_packets(), 0U) << "message " << i;
    while (events.ring().front() != nullptr) events.ring().pop();
  }
  EXPECT_GT(frames, 3000);
  EXPECT_GT(counters.get(Counter::gateway_answers), 5000U);
  EXPECT_GT(counters.get(Counter::gateway_packets_refused), 100U);
}

}  // namespace
}  // namespace emit::server
