// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <bit>
#include <memory>
#include <optional>
#include <vector>

#include "emit/physics/constants.hpp"
#include "gateway/cigi_host.hpp"
#include "support/heap_counter.hpp"

namespace emit::server {
namespace {

namespace cigi = protocol::cigi;

constexpr std::int64_t kFrameNs = 10'000'000;
constexpr std::int64_t kStartNs = 1'800'000'000'000'000'000;

/// A gateway with a host on a clock that the test moves.
class CigiHostTest : public testing::Test {
 protected:
  void make(bool synchronous = true) {
    CigiHost::Options options;
    options.cigi.listen = options.cigi.host = "127.0.0.1:1";
    options.synchronous = synchronous;
    options.rate_hz = 1e9 / static_cast<double>(kFrameNs);
    gateway_ = std::make_unique<CigiHost>(options, nullptr, counters_, events_);
  }
  /// Sends a message of the host that arrives now.
  void send(cigi::IgMode mode, const std::vector<cigi::Packet>& packets = {}, bool stamp = false) {
    std::array<std::byte, 4096> memory;
    cigi::Writer writer(memory, version_, cigi::ByteOrder::big);
    cigi::IgControl control;
    control.mode = mode;
    control.host_frame = ++host_frame_;
    control.timestamp_valid = stamp;
    control.timestamp_ticks = cigi::timestamp_ticks(now_ns_ - kStartNs);
    EXPECT_FALSE(writer.add(control));
    for (const cigi::Packet& packet : packets) EXPECT_FALSE(writer.add(packet));
    gateway_->take(writer.message(), now_ns_);
  }
  /// Returns the message that is due now; none: there is none.
  std::optional<cigi::StartOfFrame> receive() {
    const auto message = gateway_->message(now_ns_);
    if (message.empty()) return std::nullopt;
    cigi::Reader reader(message, cigi::Sender::ig);
    cigi::Packet packet;
    EXPECT_EQ(reader.next(packet), cigi::Step::packet);
    const auto start = std::get<cigi::StartOfFrame>(packet);
    while (reader.next(packet) == cigi::Step::packet) {
      if (const auto* text = std::get_if<cigi::ImageGeneratorMessage>(&packet)) {
        texts_.emplace_back(text->view());
      }
    }
    return start;
  }
  bool next() { return gateway_->next(*frame_, now_ns_); }
  static cigi::EntityControl seeker() {
    cigi::EntityControl out;
    out.state = cigi::EntityState::active;
    out.place.altitude_m_or_z_m = 100.0;
    return out;
  }

  Counters counters_;
  EventLog events_{256, counters_};
  std::unique_ptr<CigiHost> gateway_;
  std::unique_ptr<protocol::HostFrameData> frame_ = std::make_unique<protocol::HostFrameData>();
  std::int64_t now_ns_ = kStartNs;
  std::uint32_t host_frame_ = 0;
  cigi::Version version_ = cigi::Version::v3_3;
  std::vector<std::string> texts_;
};

TEST_F(CigiHostTest, StartOfFrameWaitsForTheImageAndThenComesAtOnce) {
  make();
  ASSERT_TRUE(receive());
  send(cigi::IgMode::operate, {seeker()});
  ASSERT_TRUE(next());
  for (int period = 0; period < 3; ++period) {
    now_ns_ += kFrameNs;
    EXPECT_FALSE(receive()) << "the image is not there";
  }
  now_ns_ += 1;
  gateway_->report({GatewayReport::Kind::published, frame_->frame_number});
  EXPECT_LE(gateway_->wake_at_ns(), now_ns_);
  const auto start = receive();
  ASSERT_TRUE(start);
  EXPECT_EQ(start->last_host_frame, host_frame_);
  EXPECT_FALSE(receive()) << "none is sent to catch up";
  now_ns_ += kFrameNs;
  EXPECT_TRUE(receive());
}

TEST_F(CigiHostTest, AnImageThatNeverComesDoesNotSilenceTheImageGenerator) {
  make();
  ASSERT_TRUE(receive());
  send(cigi::IgMode::operate, {seeker()});
  ASSERT_TRUE(next());
  now_ns_ = gateway_->wake_at_ns();
  EXPECT_TRUE(receive());
  EXPECT_LT(now_ns_ - kStartNs, 10'000'000'000);
}

TEST_F(CigiHostTest, AsynchronouslyNobodyWaits) {
  make(false);
  ASSERT_TRUE(receive());
  send(cigi::IgMode::operate, {seeker()}, true);
  ASSERT_TRUE(next());
  now_ns_ += kFrameNs;
  EXPECT_TRUE(receive());
}

TEST_F(CigiHostTest, WhatWaitsForNothingNeedsNoReport) {
  make();
  ASSERT_TRUE(receive());
  // There is no sensor, hence no host frame and no image.
  send(cigi::IgMode::operate);
  EXPECT_FALSE(next());
  now_ns_ += kFrameNs;
  EXPECT_TRUE(receive());
}

/// Component Control in both versions of CIGI.
class CigiPartTest : public CigiHostTest, public testing::WithParamInterface<cigi::Version> {
 protected:
  /// Packet that gives the sensor a pose.
  [[nodiscard]] cigi::Packet placed_seeker() const {
    if (version_ == cigi::Version::v3_3) return seeker();
    return cigi::EntityPosition{};
  }
};

TEST_P(CigiPartTest, ComponentControlHeatsAPartAndResetSendsItAgain) {
  version_ = GetParam();
  make();
  ASSERT_TRUE(receive());
  cigi::ComponentControl engine;
  engine.instance_id = 7;
  engine.component_id = 2;
  engine.component_state = 1;
  engine.data[0] = std::bit_cast<std::uint32_t>(480.5F);
  cigi::ShortComponentControl wrong;
  wrong.instance_id = 7;
  wrong.component_id = 2;
  wrong.component_state = 3;
  wrong.data[0] = std::bit_cast<std::uint32_t>(2.0F);
  send(cigi::IgMode::operate, {placed_seeker(), engine, wrong});
  ASSERT_TRUE(next());
  ASSERT_EQ(frame_->part_count, 1U);
  EXPECT_EQ(frame_->parts[0].entity_id, 7U);
  EXPECT_EQ(frame_->parts[0].part_id, 2U);
  EXPECT_EQ(frame_->parts[0].kind, protocol::PartCommandData::Kind::temperature);
  EXPECT_EQ(frame_->parts[0].value, 480.5);
  EXPECT_EQ(counters_.get(Counter::gateway_packets_unused), 1U);
  gateway_->report({GatewayReport::Kind::published, frame_->frame_number});
  send(cigi::IgMode::operate, {placed_seeker()});
  ASSERT_TRUE(next());
  EXPECT_EQ(frame_->part_count, 0U);
  gateway_->report({GatewayReport::Kind::reset, 0});
  send(cigi::IgMode::operate, {placed_seeker()});
  ASSERT_TRUE(next());
  EXPECT_EQ(frame_->part_count, 1U);
}

INSTANTIATE_TEST_SUITE_P(Versions, CigiPartTest,
                         testing::Values(cigi::Version::v3_3, cigi::Version::v4_0),
                         [](const auto& each) {
                           return each.param == cigi::Version::v3_3 ? "V33" : "V40";
                         });

/// View Definition in both versions of CIGI.
class CigiViewTest : public CigiHostTest, public testing::WithParamInterface<cigi::Version> {};

TEST_P(CigiViewTest, ViewDefinitionSetsTheFieldOfViewOfTheSensor) {
  version_ = GetParam();
  scene::ScenarioDesc scenario;
  scenario.sensor.width_px = 640;
  scenario.sensor.height_px = 512;
  scenario.sensor.fov_h_rad = 20.0 * physics::kDegree;
  scenario.sensor.fov_h_min_rad = 4.0 * physics::kDegree;
  CigiHost::Options options;
  options.scenario = &scenario;
  options.rate_hz = 1.0;
  gateway_ = std::make_unique<CigiHost>(options, nullptr, counters_, events_);
  const auto view_of = [](float left, float right, float top, float bottom, unsigned enabled) {
    cigi::ViewDefinition view;
    view.left_deg = left;
    view.right_deg = right;
    view.top_deg = top;
    view.bottom_deg = bottom;
    view.left_enabled = (enabled & 1U) != 0;
    view.right_enabled = (enabled & 2U) != 0;
    view.top_enabled = (enabled & 4U) != 0;
    view.bottom_enabled = (enabled & 8U) != 0;
    return view;
  };
  const auto after = [&](const cigi::ViewDefinition& view) {
    now_ns_ += 1'000'000'000;
    if (version_ == cigi::Version::v3_3) {
      send(cigi::IgMode::operate, {seeker(), view});
    } else {
      cigi::EntityPosition place;
      place.place.altitude_m_or_z_m = 100.0;
      send(cigi::IgMode::operate, {place, view});
    }
    EXPECT_TRUE(next());
    return frame_->fov_h_rad ? *frame_->fov_h_rad / physics::kDegree : 0.0;
  };
  const auto unused = [&] { return counters_.get(Counter::gateway_packets_unused); };
  // tan(3 deg) * 512 / 640 = tan(2.40082 deg)
  EXPECT_NEAR(after(view_of(-3, 3, 0, 0, 3)), 6.0, 1e-5);
  EXPECT_NEAR(after(view_of(-5, 5, 4.00509F, -4.00509F, 15)), 10.0, 1e-5);
  EXPECT_NEAR(after(view_of(0, 0, 2.40082F, -2.40082F, 12)), 6.0, 1e-4);
  EXPECT_NEAR(after(view_of(-2, 2, 0, 0, 3)), 4.0, 1e-5);
  EXPECT_NEAR(after(view_of(-10, 10, 0, 0, 3)), 20.0, 1e-5);
  EXPECT_NEAR(after(view_of(-1, 1, 1, 1, 0)), 20.0, 1e-5) << "nothing is enabled";
  EXPECT_EQ(unused(), 0U);
  // Each of these has no effect, and the host is told why.
  std::uint64_t told = 0;
  for (const auto& view :
       {view_of(-3, 4, 0, 0, 3), view_of(0, 4, 0, 0, 2), view_of(-3, 3, 3, -3, 15),
        view_of(-1.9F, 1.9F, 0, 0, 3), view_of(-11, 11, 0, 0, 3), view_of(0, 0, 5, -4, 12),
        view_of(3, -3, 0, 0, 3)}) {
    EXPECT_NEAR(after(view), 20.0, 1e-5) << told;
    EXPECT_EQ(unused(), ++told);
  }
  // Standby forgets the view.
  send(cigi::IgMode::standby);
  EXPECT_EQ(after(view_of(0, 0, 0, 0, 0)), 0.0);
  // A fixed view lets pass without a word what says the same again.
  options.is_view_fixed = true;
  gateway_ = std::make_unique<CigiHost>(options, nullptr, counters_, events_);
  EXPECT_EQ(after(view_of(-10, 10, 0, 0, 3)), 0.0);
  EXPECT_EQ(unused(), told);
  EXPECT_EQ(after(view_of(-5, 5, 0, 0, 3)), 0.0);
  EXPECT_EQ(unused(), told + 1);
}
INSTANTIATE_TEST_SUITE_P(Versions, CigiViewTest,
                         testing::Values(cigi::Version::v3_3, cigi::Version::v4_0));

TEST_F(CigiHostTest, ATimeOfDayThatIsSentAgainAndAgainSetsTheClockOnce) {
  const scene::ScenarioDesc scenario;  // its epoch is 1970
  CigiHost::Options options;
  options.scenario = &scenario;
  options.rate_hz = 1.0;
  gateway_ = std::make_unique<CigiHost>(options, nullptr, counters_, events_);
  cigi::CelestialSphereControl noon;
  noon.date_valid = noon.sun_enabled = true;
  noon.hour_utc = 12;
  noon.date_mmddyyyy = 1'01'1970;
  std::uint64_t run_id = 0;
  for (int second = 0; second < 300; ++second) {
    now_ns_ += 1'000'000'000;
    send(cigi::IgMode::operate, {seeker(), noon});
    ASSERT_TRUE(next());
    if (second == 0) run_id = frame_->run_id;
    ASSERT_EQ(frame_->run_id, run_id) << "second " << second;
    ASSERT_EQ(frame_->sim_time_ns, (12 * 3600 + second) * std::int64_t{1'000'000'000});
  }
}

TEST_F(CigiHostTest, AResetBringsBackWhatTheHostHasSentOnce) {
  make();
  cigi::EntityControl truck = seeker();
  truck.entity_id = 7;
  cigi::AtmosphereControl air;
  air.air_temperature_c = 20.0F;
  send(cigi::IgMode::operate, {seeker(), truck, air});
  ASSERT_TRUE(next());
  EXPECT_EQ(frame_->entity_count, 1U);
  EXPECT_TRUE(frame_->environment);
  send(cigi::IgMode::operate, {seeker()});
  ASSERT_TRUE(next());
  EXPECT_EQ(frame_->entity_count, 0U);
  EXPECT_FALSE(frame_->environment);
  gateway_->report({GatewayReport::Kind::reset, 0});
  send(cigi::IgMode::operate, {seeker()});
  ASSERT_TRUE(next());
  EXPECT_EQ(frame_->entity_count, 1U);
  EXPECT_TRUE(frame_->environment);
}

TEST_F(CigiHostTest, WildRatesOfTheSensorEndNoImage) {
  make();
  cigi::RateControl wild;
  wild.yaw_deg_s = 1e30F;
  send(cigi::IgMode::operate, {seeker(), wild});
  ASSERT_TRUE(next());
  EXPECT_FALSE(frame_->seeker_rates);
  EXPECT_EQ(counters_.get(Counter::gateway_packets_refused), 1U);
}

TEST_F(CigiHostTest, TheClockOfTheMachineMaySetBack) {
  make();
  ASSERT_TRUE(receive());
  now_ns_ -= 3'600'000'000'000;
  EXPECT_TRUE(receive());
}

TEST_F(CigiHostTest, ADatabaseThatIsNotThereIsSaidSo) {
  make();
  std::array<std::byte, 64> memory;
  const auto wish = [&](std::int8_t database) {
    cigi::Writer writer(memory, cigi::Version::v3_3, cigi::ByteOrder::little);
    cigi::IgControl control;
    control.mode = cigi::IgMode::operate;
    control.host_frame = ++host_frame_;
    control.database = database;
    EXPECT_FALSE(writer.add(control));
    gateway_->take(writer.message(), now_ns_);
    now_ns_ += kFrameNs;
    return receive().value().database;
  };
  EXPECT_EQ(wish(0), 0);
  EXPECT_EQ(wish(9), -128);
  EXPECT_EQ(wish(1), -1);
  EXPECT_EQ(wish(1), -1) << "until the host answers";
  EXPECT_EQ(wish(0), 1);
  EXPECT_EQ(wish(0), 1);
}

TEST_F(CigiHostTest, AStrayNumberOfTheHostBeginsARunOfItsOwn) {
  make();
  send(cigi::IgMode::operate, {seeker()});
  ASSERT_TRUE(next());
  const std::uint64_t first = frame_->run_id;
  host_frame_ += 1000;
  send(cigi::IgMode::operate, {seeker()});
  ASSERT_TRUE(next());
  EXPECT_EQ(frame_->run_id, first);
  EXPECT_EQ(frame_->sim_time_ns, 1001 * kFrameNs);
  host_frame_ = 0;
  int lost = 0;
  for (bool came = false; !came; came = next()) {
    ++now_ns_;
    send(cigi::IgMode::operate, {seeker()});
    ASSERT_LT(++lost, 20);
  }
  EXPECT_NE(frame_->run_id, first);
  EXPECT_EQ(frame_->sim_time_ns, 0);
}

TEST_F(CigiHostTest, NothingAllocatesWhileItServes) {
  make();
  static_cast<void>(receive());
  send(cigi::IgMode::operate, {seeker()});
  ASSERT_TRUE(next());
  std::array<std::byte, 4096> memory;
  cigi::Writer writer(memory, cigi::Version::v3_3, cigi::ByteOrder::big);
  cigi::IgControl control;
  control.mode = cigi::IgMode::operate;
  cigi::EntityControl unknown = seeker();
  unknown.entity_id = 50;
  cigi::HatHotRequest question;
  question.update_period_frames = 1;
  const std::uint64_t before = test::heap_request_count();
  for (std::uint32_t frame = 0; frame < 100; ++frame) {
    writer.clear();
    control.host_frame = ++host_frame_;
    static_cast<void>(writer.add(control));
    static_cast<void>(writer.add(seeker()));
    static_cast<void>(writer.add(unknown));
    static_cast<void>(writer.add(question));
    now_ns_ += kFrameNs;
    gateway_->take(writer.message(), now_ns_);
    ASSERT_TRUE(gateway_->next(*frame_, now_ns_));
    gateway_->report({GatewayReport::Kind::published, frame_->frame_number});
    ASSERT_FALSE(gateway_->message(now_ns_).empty());
  }
  EXPECT_EQ(test::heap_request_count(), before);
  EXPECT_EQ(counters_.get(Counter::gateway_answers), 100U);
}

}  // namespace
}  // namespace emit::server
