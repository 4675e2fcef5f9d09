// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/protocol/cigi/reader.hpp"
#include "gateway/cigi_host.hpp"

namespace emit::server {
namespace {

namespace cigi = protocol::cigi;

cigi::SensorControl sensor_of(float gain, float level, bool black_hot = false) {
  cigi::SensorControl out;
  out.on = true;
  out.gain = gain;
  out.level = level;
  out.black_hot = black_hot;
  return out;
}

TEST(CigiPicture, GainAndLevelOfAHalfAreTheLimitsOfTheDisplay) {
  const scene::DisplayOptions display{280.0, 330.0};
  for (const bool black_hot : {false, true}) {
    const auto half = picture_settings(sensor_of(0.5F, 0.5F, black_hot), display);
    EXPECT_FLOAT_EQ(half.low_k, 280.0F);
    EXPECT_FLOAT_EQ(half.high_k, 330.0F);
    EXPECT_EQ(half.black_hot, black_hot);
    EXPECT_TRUE(half.on);
    EXPECT_FALSE(half.automatic_gain);
  }
  const auto high = picture_settings(sensor_of(1.0F, 0.5F), display);
  EXPECT_NEAR(high.low_k, 302.5F, 1e-3F);
  EXPECT_NEAR(high.high_k, 307.5F, 1e-3F);
  const auto low = picture_settings(sensor_of(0.0F, 0.5F), display);
  EXPECT_NEAR(low.high_k - low.low_k, 500.0F, 1e-3F);
}

/// Brightness of a body in the picture, 0 to 1 between the limits: the ends of the colours.
double brightness_of(double body_k, const PictureSettings& picture) {
  const double place = (body_k - picture.low_k) / (picture.high_k - picture.low_k);
  return picture.black_hot ? 1.0 - place : place;
}

TEST(CigiPicture, MoreLevelIsBrighterAndMoreGainHasMoreContrastInEitherPolarity) {
  const scene::DisplayOptions display{250.0, 310.0};
  for (const bool black_hot : {false, true}) {
    double before = -1e9;
    for (const float level : {0.0F, 0.25F, 0.5F, 0.75F, 1.0F}) {
      const auto picture = picture_settings(sensor_of(0.7F, level, black_hot), display);
      EXPECT_GT(brightness_of(290.0, picture), before) << level;
      before = brightness_of(290.0, picture);
    }
    double contrast = 0.0;
    for (const float gain : {0.0F, 0.5F, 1.0F}) {
      const auto picture = picture_settings(sensor_of(gain, 0.3F, black_hot), display);
      const double step = std::abs(brightness_of(291.0, picture) - brightness_of(290.0, picture));
      EXPECT_GT(step, 9.9 * contrast);
      contrast = step;
    }
    // The level leads mid grey from one end of the display to the other.
    const auto darkest = picture_settings(sensor_of(0.5F, 0.0F, black_hot), display);
    EXPECT_NEAR(0.5 * (darkest.low_k + darkest.high_k), black_hot ? 250.0 : 310.0, 1e-3);
  }
}

/// A host of either version, whose sensor has a pose.
class CigiSensorTest : public testing::TestWithParam<cigi::Version> {
 protected:
  struct Heard {
    cigi::StartOfFrame start;
    std::vector<cigi::SensorResponse> responses;
    std::vector<cigi::SensorExtendedResponse> extended;
    std::vector<std::string> texts;
  };
  std::unique_ptr<CigiHost> make() {
    CigiHost::Options options;
    options.rate_hz = 1.0;
    options.picture = &board_;
    return std::make_unique<CigiHost>(options, nullptr, counters_, events_);
  }
  /// Sends a message with the pose of the sensor and returns the host frame that comes of it.
  std::unique_ptr<protocol::HostFrameData> send(CigiHost& host, std::vector<cigi::Packet> packets) {
    if (GetParam() == cigi::Version::v3_3) {
      cigi::EntityControl seeker;
      seeker.state = cigi::EntityState::active;
      packets.insert(packets.begin(), seeker);
    } else {
      packets.insert(packets.begin(), cigi::EntityPosition{});
    }
    std::array<std::byte, 4096> memory;
    cigi::Writer writer(memory, GetParam(), cigi::ByteOrder::big);
    cigi::IgControl control;
    control.mode = cigi::IgMode::operate;
    control.host_frame = ++host_frame_;
    EXPECT_FALSE(writer.add(control));
    for (const cigi::Packet& packet : packets) EXPECT_FALSE(writer.add(packet));
    host.take(writer.message(), now_ns_);
    auto frame = std::make_unique<protocol::HostFrameData>();
    EXPECT_TRUE(host.next(*frame, now_ns_));
    host.report({GatewayReport::Kind::published, frame->frame_number});
    return frame;
  }
  Heard hear(CigiHost& host) {
    now_ns_ += 1'000'000'000;
    Heard out;
    cigi::Reader reader(host.message(now_ns_), cigi::Sender::ig);
    cigi::Packet packet;
    while (reader.next(packet) == cigi::Step::packet) {
      if (const auto* start = std::get_if<cigi::StartOfFrame>(&packet)) out.start = *start;
      if (const auto* one = std::get_if<cigi::SensorResponse>(&packet)) {
        out.responses.push_back(*one);
      }
      if (const auto* one = std::get_if<cigi::SensorExtendedResponse>(&packet)) {
        out.extended.push_back(*one);
      }
      if (const auto* text = std::get_if<cigi::ImageGeneratorMessage>(&packet)) {
        out.texts.emplace_back(text->view());
      }
    }
    return out;
  }
  [[nodiscard]] std::uint64_t unused() const {
    return counters_.get(Counter::gateway_packets_unused);
  }

  Counters counters_;
  EventLog events_{256, counters_};
  PictureBoard board_;
  std::int64_t now_ns_ = 1'800'000'000'000'000'000;
  std::uint32_t host_frame_ = 0;
};

TEST_P(CigiSensorTest, SensorControlIsOnTheBoardUntilStandbyAndASecondViewIsNot) {
  const auto host = make();
  send(*host, {});
  EXPECT_FALSE(board_.get()) << "the host has said nothing";
  cigi::SensorControl packet = sensor_of(0.75F, 0.25F, true);
  packet.sensor_id = 3;
  send(*host, {packet});
  EXPECT_EQ(board_.get(), picture_settings(packet, {}));
  cigi::SensorControl other = sensor_of(0.1F, 0.1F);
  other.view_id = 9;
  send(*host, {other});
  EXPECT_EQ(board_.get(), picture_settings(packet, {}));
  EXPECT_EQ(unused(), 1U);
  host->report({GatewayReport::Kind::reset, 0});
  send(*host, {});
  EXPECT_EQ(board_.get(), picture_settings(packet, {})) << "the host does not send it again";
  packet.automatic_gain = true;
  packet.on = false;
  send(*host, {packet});
  EXPECT_EQ(board_.get(), picture_settings(packet, {}));
  EXPECT_FALSE(board_.get()->on);
  EXPECT_TRUE(board_.get()->automatic_gain);
  EXPECT_EQ(unused(), 1U) << "all else has an effect";
  std::array<std::byte, 64> memory;
  cigi::Writer writer(memory, GetParam(), cigi::ByteOrder::little);
  cigi::IgControl standby;
  standby.host_frame = ++host_frame_;
  EXPECT_FALSE(writer.add(standby));
  host->take(writer.message(), now_ns_);
  EXPECT_FALSE(board_.get());
}

TEST_P(CigiSensorTest, TheHostFramesAreThoseOfAHostWithoutSensorControl) {
  const auto plain = make();
  const auto talker = make();
  for (const float gain : {0.0F, 0.3F, 1.0F}) {
    cigi::SensorControl packet = sensor_of(gain, 1.0F - gain, gain > 0.2F);
    packet.on = gain < 0.9F;
    packet.line_dropout = packet.automatic_gain = packet.track_black = true;
    packet.track_mode = cigi::TrackMode::target;
    packet.noise = gain;
    const std::uint32_t number = host_frame_;
    const auto with = send(*talker, {packet});
    host_frame_ = number;
    const auto without = send(*plain, {});
    EXPECT_EQ(with->frame_number, without->frame_number);
    EXPECT_EQ(with->sim_time_ns, without->sim_time_ns);
    EXPECT_EQ(with->seeker.position_world_m, without->seeker.position_world_m);
    EXPECT_EQ(with->seeker.world_from_body, without->seeker.world_from_body);
    EXPECT_EQ(with->entity_count, 0U);
    EXPECT_EQ(with->part_count, 0U);
    EXPECT_FALSE(with->environment);
    EXPECT_FALSE(with->fov_h_rad);
    EXPECT_FALSE(with->gimbal_rad);
  }
}

TEST_P(CigiSensorTest, ATrackModeIsAnsweredInEveryFrameUntilItEnds) {
  const auto host = make();
  cigi::SensorControl packet = sensor_of(0.5F, 0.5F);
  packet.sensor_id = 5;
  send(*host, {packet});
  EXPECT_TRUE(hear(*host).responses.empty());
  packet.track_mode = cigi::TrackMode::force_correlate;
  send(*host, {packet});
  std::size_t texts = 0;
  for (int frame = 0; frame < 3; ++frame) {
    const Heard heard = hear(*host);
    ASSERT_EQ(heard.responses.size(), 1U);
    EXPECT_TRUE(heard.extended.empty());
    EXPECT_EQ(heard.responses[0].view_id, packet.view_id);
    EXPECT_EQ(heard.responses[0].sensor_id, 5);
    EXPECT_EQ(heard.responses[0].state, cigi::TrackState::searching);
    EXPECT_EQ(heard.responses[0].gate_x_px, 0);
    EXPECT_EQ(heard.responses[0].ig_frame, heard.start.ig_frame);
    texts += heard.texts.size();
    send(*host, {packet});
  }
  EXPECT_EQ(texts, 1U) << "the host is told once";
  packet.extended_response = true;
  send(*host, {packet});
  const Heard heard = hear(*host);
  EXPECT_TRUE(heard.responses.empty());
  ASSERT_EQ(heard.extended.size(), 1U);
  EXPECT_FALSE(heard.extended[0].entity_valid);
  EXPECT_EQ(heard.extended[0].state, cigi::TrackState::searching);
  packet.on = false;
  send(*host, {packet});
  EXPECT_TRUE(hear(*host).extended.empty()) << "a sensor that is off tracks nothing";
  packet.on = true;
  packet.track_mode = cigi::TrackMode::off;
  send(*host, {packet});
  EXPECT_TRUE(hear(*host).extended.empty());
}

INSTANTIATE_TEST_SUITE_P(Versions, CigiSensorTest,
                         testing::Values(cigi::Version::v3_3, cigi::Version::v4_0));

}  // namespace
}  // namespace emit::server
