// SPDX-License-Identifier: Apache-2.0
// Each frame reports the delay of the frame before it on the same stream.
#include <gtest/gtest.h>

#include "agents/sender/sender_client.hpp"

namespace emit::server {
namespace {

constexpr std::int64_t kUs = 1'000;

class Client final : public SenderClient {
 public:
  void begin(const protocol::FrameHeader& header, const Image& /*image*/,
             std::int64_t now_ns) noexcept override {
    start(header, now_ns);
  }
  Progress send(UdpBatch& /*batch*/, Context& /*context*/, Turn /*turn*/) noexcept override {
    return Progress::finished;
  }
  void spill() noexcept override {}
  [[nodiscard]] std::uint32_t connection() const noexcept override { return 1; }

  /// Sends a frame of a pose received at `received_ns`, whose last byte goes `delay_ns` later.
  const protocol::FrameHeader& frame(std::int64_t received_ns, std::int64_t delay_ns) {
    protocol::FrameHeader header;
    header.frame_number = ++number_;
    header.host_received_ns = received_ns;
    header.sim_time_ns = 5 * kUs;
    header.pose_sim_time_ns = 3 * kUs;
    begin(header, {}, received_ns);
    complete(received_ns + delay_ns);
    return this->header();
  }

 private:
  std::uint64_t number_ = 0;
};

TEST(ClientDelay, EachHeaderTellsOfTheFrameBefore) {
  Client client;
  EXPECT_EQ(client.frame(1000 * kUs, 100 * kUs).previous_frame_number, 0U);
  const protocol::FrameHeader second = client.frame(2000 * kUs, 180 * kUs);
  EXPECT_EQ(second.previous_frame_number, 1U);
  EXPECT_EQ(second.previous_delay_ns, 100 * kUs);
  EXPECT_EQ(second.previous_age_ns, 98 * kUs) << "it was predicted 2 us ahead";
  EXPECT_EQ(second.previous_jitter_ns, 0) << "one frame has none";
  EXPECT_EQ(client.delay_change_ns(), 80 * kUs);
  const protocol::FrameHeader third = client.frame(3000 * kUs, 148 * kUs);
  EXPECT_EQ(third.previous_delay_ns, 180 * kUs);
  EXPECT_EQ(third.previous_jitter_ns, 5 * kUs) << "80 / 16";
  // The jitter is 5 + (32 - 5) / 16.
  EXPECT_EQ(client.jitter_ns(), 6687);
  EXPECT_EQ(client.frame(4000 * kUs, 148 * kUs).previous_jitter_ns, 6687);
}

TEST(ClientDelay, AFrameOfNoPoseChangesNothing) {
  Client client;
  client.frame(1000 * kUs, 100 * kUs);
  client.frame(2000 * kUs, 116 * kUs);
  EXPECT_EQ(client.jitter_ns(), 1 * kUs);
  client.frame(0, 5 * kUs);
  EXPECT_FALSE(client.delay_change_ns().has_value());
  EXPECT_EQ(client.jitter_ns(), 1 * kUs);
  const protocol::FrameHeader next = client.frame(3000 * kUs, 100 * kUs);
  EXPECT_EQ(next.previous_frame_number, 3U);
  EXPECT_EQ(next.previous_delay_ns, 116 * kUs) << "of the last frame that had a pose";
}

}  // namespace
}  // namespace emit::server
