// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/pixel_codec.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <random>
#include <vector>

namespace emit::protocol {
namespace {

using Bytes = std::vector<std::byte>;

Bytes bytes_of(const std::vector<float>& pixels) {
  Bytes out(pixels.size() * sizeof(float));
  std::memcpy(out.data(), pixels.data(), out.size());
  return out;
}

/// Returns radiance that changes slowly, with NaN payloads, a signed zero and a denormal in
/// between.
std::vector<float> smooth(std::size_t count) {
  std::vector<float> out(count);
  for (std::size_t i = 0; i < count; ++i) {
    out[i] = 30.0F + std::sin(static_cast<float>(i) * 1e-4F);
  }
  const std::uint32_t odd[] = {0x7fc12345, 0x80000000, 0x00000001, 0xff800000};
  for (std::size_t i = 0; i < 4 && i < count; ++i) {
    std::memcpy(&out[i * (count / 4)], &odd[i], sizeof(float));
  }
  return out;
}

Bytes encoded(const Bytes& pixels) {
  PixelEncoder encoder(pixels.size());
  encoder.begin(pixels);
  while (!encoder.encode_block()) {
  }
  return {encoder.bytes().begin(), encoder.bytes().end()};
}

TEST(PixelCodec, GivesEveryBitBackWhateverTheSize) {
  constexpr std::size_t kBlock = PixelEncoder::kBlockBytes / sizeof(float);
  PixelDecoder decoder;
  for (const std::size_t count : {kBlock - 1, kBlock, kBlock + 1, 3 * kBlock + 17}) {
    const Bytes pixels = bytes_of(smooth(count));
    const Bytes small = encoded(pixels);
    ASSERT_FALSE(small.empty());
    EXPECT_LT(small.size(), pixels.size() * 3 / 4) << count;
    Bytes back(pixels.size(), std::byte{0xEE});
    ASSERT_TRUE(decoder.decode(small, back)) << count;
    EXPECT_EQ(back, pixels) << count;
  }
}

TEST(PixelCodec, OneEncoderServesOnePictureAfterTheOther) {
  PixelEncoder encoder(1u << 20);
  PixelDecoder decoder;
  for (const std::size_t count :
       {std::size_t{200'000}, std::size_t{50'000}, std::size_t{100'000}}) {
    const Bytes pixels = bytes_of(smooth(count));
    encoder.begin(pixels);
    EXPECT_FALSE(encoder.done());
    std::size_t blocks = 1;
    while (!encoder.encode_block()) ++blocks;
    EXPECT_EQ(blocks, (pixels.size() + PixelEncoder::kBlockBytes - 1) / PixelEncoder::kBlockBytes);
    Bytes back(pixels.size());
    ASSERT_TRUE(decoder.decode(encoder.bytes(), back));
    EXPECT_EQ(back, pixels);
  }
}

TEST(PixelCodec, NoiseIsNotMadeLarger) {
  std::mt19937 random(1);
  for (const std::size_t bytes : {std::size_t{4}, std::size_t{4096}, std::size_t{300'000}}) {
    Bytes noise(bytes);
    for (std::byte& byte : noise) byte = static_cast<std::byte>(random());
    EXPECT_TRUE(encoded(noise).empty()) << bytes;
  }
  PixelEncoder small(100);
  const Bytes larger(200);
  small.begin(larger);
  EXPECT_TRUE(small.encode_block());
  EXPECT_TRUE(small.bytes().empty()) << "no room was taken for it";
}

TEST(PixelCodec, RefusesWhatDoesNotMakeExactlyThePicture) {
  const Bytes pixels = bytes_of(smooth(40'000));
  const Bytes good = encoded(pixels);
  PixelDecoder decoder;
  Bytes back(pixels.size());
  EXPECT_FALSE(decoder.decode({}, back));
  for (const std::size_t cut : {std::size_t{1}, std::size_t{5}, good.size() / 2, good.size() - 3}) {
    EXPECT_FALSE(decoder.decode(std::span(good).first(good.size() - cut), back)) << cut;
  }
  Bytes longer = good;
  longer.push_back(std::byte{0});
  EXPECT_FALSE(decoder.decode(longer, back));
  Bytes bigger(pixels.size() + 4);
  EXPECT_FALSE(decoder.decode(good, bigger));
  Bytes smaller(pixels.size() - 4);
  EXPECT_FALSE(decoder.decode(good, smaller));
  Bytes odd(pixels.size() - 1);
  EXPECT_FALSE(decoder.decode(good, odd));
  Bytes length = good;
  length[3] = std::byte{0xFF};
  EXPECT_FALSE(decoder.decode(length, back));
}

TEST(PixelCodec, DamagedBytesNeverWriteBeyondThePicture) {
  const Bytes pixels = bytes_of(smooth(20'000));
  const Bytes good = encoded(pixels);
  PixelDecoder decoder;
  std::mt19937 random(7);
  Bytes room(pixels.size() + 64);
  for (int round = 0; round < 3000; ++round) {
    Bytes damaged = good;
    for (int i = 0; i < 3; ++i)
      damaged[random() % damaged.size()] = static_cast<std::byte>(random());
    std::fill(room.end() - 64, room.end(), std::byte{0xA5});
    static_cast<void>(decoder.decode(damaged, std::span(room).first(pixels.size())));
    for (std::size_t i = pixels.size(); i < room.size(); ++i) ASSERT_EQ(room[i], std::byte{0xA5});
  }
}

}  // namespace
}  // namespace emit::protocol
