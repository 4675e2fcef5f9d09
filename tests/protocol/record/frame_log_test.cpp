// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/record/frame_log.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "emit/protocol/frame_header.hpp"
#include "emit/v1/frame.pb.h"
#include "protocol/journals.hpp"

namespace emit::protocol {
namespace {

using ::testing::HasSubstr;

constexpr std::uint32_t kWidthPx = 40;
constexpr std::uint32_t kHeightPx = 30;

std::vector<float> smooth_pixels() {
  std::vector<float> out(std::size_t{kWidthPx} * kHeightPx);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = 20.0F + 0.25F * static_cast<float>(i % 7);
  return out;
}

/// Pixels that do not become smaller: any bits, those of NaN included.
std::vector<float> random_pixels() {
  std::vector<float> out(std::size_t{kWidthPx} * kHeightPx);
  std::mt19937 random(5);
  for (float& pixel : out) pixel = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
  return out;
}

v1::RecordedFrame image(std::uint64_t number, std::span<const float> pixels) {
  v1::RecordedFrame frame;
  frame.set_run_id(3);
  frame.set_frame_number(number);
  frame.set_width_px(kWidthPx);
  frame.set_height_px(kHeightPx);
  PixelEncoder encoder(pixels.size_bytes());
  set_pixels(frame, pixels, encoder);
  return frame;
}

class FrameLog : public ::testing::Test {
 protected:
  void write(const std::vector<v1::RecordedFrame>& frames) {
    auto log = LogWriter::create(file_, {.frames = true});
    ASSERT_TRUE(log) << log.error().text;
    HostFrameData pose;
    ASSERT_TRUE(log->write_host(pose, 1));
    for (const v1::RecordedFrame& frame : frames) ASSERT_TRUE(log->write_frame(frame, 2));
    ASSERT_TRUE(log->close());
  }
  [[nodiscard]] std::string error_of(const v1::RecordedFrame& frame) {
    write({frame});
    auto log = FrameLogReader::open(file_);
    EXPECT_TRUE(log);
    const auto more = log->next();
    return more ? "" : more.error().text;
  }
  test::LogFolder folder_;
  std::filesystem::path file_ = folder_.file("frames.mcap");
};

TEST_F(FrameLog, keeps_every_bit) {
  const std::vector<std::vector<float>> images{smooth_pixels(), random_pixels(), smooth_pixels()};
  std::vector<v1::RecordedFrame> frames;
  for (const auto& pixels : images) frames.push_back(image(frames.size() + 1, pixels));
  EXPECT_EQ(frames[0].compression(), v1::COMPRESSION_SHUFFLED_LZ4);
  EXPECT_LT(frames[0].pixels().size(), images[0].size() * sizeof(float) / 2);
  EXPECT_EQ(frames[1].compression(), v1::COMPRESSION_NONE) << "noise does not become smaller";
  write(frames);
  auto log = FrameLogReader::open(file_);
  ASSERT_TRUE(log) << log.error().text;
  for (const auto& pixels : images) {
    const auto more = log->next();
    ASSERT_TRUE(more && *more);
    EXPECT_TRUE(std::ranges::equal(std::as_bytes(log->pixels()), std::as_bytes(std::span(pixels))));
  }
  EXPECT_FALSE(*log->next());
}

TEST_F(FrameLog, other_readers_pass_the_images_over) {
  write({image(1, smooth_pixels())});
  auto log = LogReader::open(file_);
  ASSERT_TRUE(log);
  ASSERT_TRUE(*log->next());
  EXPECT_EQ(log->topic(), LogTopic::host);
  EXPECT_FALSE(*log->next());
}

TEST_F(FrameLog, refuses_pixels_that_do_not_fit) {
  const v1::RecordedFrame good = image(8, smooth_pixels());
  EXPECT_EQ(error_of(good), "");
  v1::RecordedFrame bad = good;
  bad.set_crc32c(good.crc32c() ^ 1U);
  EXPECT_THAT(error_of(bad), HasSubstr("image of frame 8: CRC "));
  bad = good;
  bad.set_height_px(kHeightPx + 1);
  EXPECT_THAT(error_of(bad), HasSubstr("do not decompress"));
  bad = good;
  bad.set_width_px(0);
  EXPECT_THAT(error_of(bad), HasSubstr("0 x 30 px"));
  bad = good;
  bad.set_width_px(10'000);
  bad.set_height_px(10'000);
  EXPECT_THAT(error_of(bad), HasSubstr("bytes for 100000000 pixels")) << "before memory is taken";
  bad = image(8, random_pixels());
  bad.mutable_pixels()->pop_back();
  EXPECT_THAT(error_of(bad), HasSubstr("4799 bytes for 1200 pixels"));
  bad = good;
  bad.set_compression(static_cast<v1::Compression>(9));
  EXPECT_THAT(error_of(bad), HasSubstr("compression 9"));
}

TEST_F(FrameLog, only_a_log_made_for_images_takes_them) {
  auto log = LogWriter::create(file_, {});
  ASSERT_TRUE(log);
  EXPECT_EQ(log->write_frame(image(1, smooth_pixels()), 2).error().code,
            physics::ErrorCode::invalid_argument);
}

}  // namespace
}  // namespace emit::protocol
