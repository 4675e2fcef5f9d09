// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstring>
#include <random>
#include <vector>

#include "support/channel_clients.hpp"

namespace emit::server {
namespace {

using test::ChannelClients;
using Numbers = std::vector<std::uint64_t>;

constexpr std::size_t kAll = 0;  // the channel of the whole field

std::vector<std::byte> bytes_of(const std::vector<float>& pixels) {
  std::vector<std::byte> out(pixels.size() * sizeof(float));
  std::memcpy(out.data(), pixels.data(), out.size());
  return out;
}

TEST(Compression, EveryBitArrivesAndTheOthersGetTheirFrameFirst) {
  ChannelClients rig;
  rig.sender().allow_compression();
  const auto& raw = rig.connect(kAll);
  const auto& one = rig.connect(kAll, 1, true);
  const auto& two = rig.connect(kAll, 1, true);
  rig.publish(1);
  while (raw.numbers.empty()) {
    ASSERT_GT(rig.turn(), 0);
    EXPECT_TRUE(one.numbers.empty() && two.numbers.empty());
  }
  rig.settle();
  for (const auto* peer : {&one, &two}) {
    EXPECT_EQ(peer->numbers, (Numbers{1}));
    EXPECT_EQ(peer->encoded, (Numbers{1}));
    EXPECT_EQ(peer->pixels, bytes_of(rig.pixels()));
  }
  EXPECT_TRUE(raw.encoded.empty());
}

/// Needs several turns for a frame.
class SlowClient final : public SenderClient {
 public:
  void begin(const protocol::FrameHeader& header, const Image& /*image*/,
             std::int64_t now_ns) noexcept override {
    start(header, now_ns);
    left = 4;
  }
  Progress send(UdpBatch& /*batch*/, Context& /*context*/, Turn /*turn*/) noexcept override {
    if (left == 0) return Progress::idle;
    return --left == 0 ? Progress::finished : Progress::more;
  }
  void spill() noexcept override {}
  [[nodiscard]] std::uint32_t connection() const noexcept override { return 99; }
  int left = 0;
};

TEST(Compression, IsForWhenNobodyElseHasAnythingToSend) {
  SlowClient slow;  // the sender lets go of it last
  ChannelClients rig;
  rig.sender().allow_compression();
  const auto& peer = rig.connect(kAll, 1, true);
  rig.add(slow);
  rig.publish(1);
  ASSERT_GT(rig.turn(), 0);
  int turns = 0;
  for (; slow.left > 0; ++turns) {
    EXPECT_TRUE(peer.numbers.empty());
    ASSERT_GT(rig.turn(), 0);
  }
  EXPECT_GT(turns, 0);
  EXPECT_TRUE(peer.numbers.empty()) << "not even encoded";
  rig.settle();
  EXPECT_EQ(peer.encoded, (Numbers{1}));
}

TEST(Compression, ThePlacesOfTheWindowAreUsedAnewByEveryPublication) {
  ChannelClients rig;
  rig.sender().allow_compression();
  const auto& whole = rig.connect(kAll, 1, true);
  const auto& gate = rig.connect(1, 1, true);
  for (std::uint64_t k = 1; k <= 20; ++k) {
    rig.pixels().assign(rig.pixels().size(), static_cast<float>(k));
    rig.publish(3);
    rig.settle();
    ASSERT_EQ(whole.numbers.back(), k);
    EXPECT_EQ(whole.pixels, bytes_of(rig.pixels())) << k;
    EXPECT_EQ(gate.pixels, bytes_of(std::vector<float>(6, static_cast<float>(k))));
  }
  EXPECT_EQ(whole.encoded.size(), 20U);
}

TEST(Compression, NoiseComesAsItIs) {
  ChannelClients rig;
  rig.sender().allow_compression();
  std::mt19937 random(3);
  for (float& pixel : rig.pixels()) {
    const auto bits = static_cast<std::uint32_t>(random());
    std::memcpy(&pixel, &bits, sizeof bits);
  }
  const auto& peer = rig.connect(kAll, 1, true);
  rig.publish(1);
  rig.settle();
  EXPECT_EQ(peer.numbers, (Numbers{1}));
  EXPECT_TRUE(peer.encoded.empty());
  EXPECT_EQ(peer.pixels, bytes_of(rig.pixels()));
}

TEST(Compression, APictureThatLeavesTheWindowBeforeItsTurnGoesOutAsItIs) {
  ChannelClients rig;
  rig.sender().allow_compression();
  const auto& peer = rig.connect(kAll, 1, true);
  // The frames are more than the window holds, before anybody has time to encode.
  for (int i = 0; i < 8; ++i) rig.publish(1);
  rig.settle();
  EXPECT_EQ(peer.numbers.front(), 1U);
  EXPECT_EQ(peer.numbers.back(), 8U);
  EXPECT_NE(peer.encoded, peer.numbers) << "the first one did not get its turn";
  EXPECT_EQ(peer.encoded.back(), 8U);
}

}  // namespace
}  // namespace emit::server
