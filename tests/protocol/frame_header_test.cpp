// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/frame_header.hpp"

#include <gmock/gmock.h>

#include <vector>

#include "protocol/hex.hpp"

namespace emit::protocol {
namespace {

using test::from_hex;
using test::to_hex;
using ::testing::HasSubstr;

// Bytes of golden_header(), written by another program after docs/wire.md, CRC included.
constexpr std::string_view kGolden =
    "45464d52020102018001030280020000000200000000004100004041090100000000803e03000000"
    "05000000d4c3b2a100001400000000008877665544332211e803000000000000e703000000000000"
    "00f2052a0100000000f7c2ffffffffff0000b49376e2fa180100b49376e2fa180200b49376e2fa18"
    "0300b49376e2fa180400b49376e2fa180500b49376e2fa18f9ffffffffffffff40e2010000000000"
    "e603000000000000000000000000f83f00000000000002c00000000000408f40000000000000e03f"
    "000000000000e0bf000000000000e03f000000000000e0bf04010000000000003412000000000000"
    "ffffb39376e2fa184d000000000000000000003f0000803e09000000020100004000000000050000"
    "0004000045230100000000000000000000000000000000000000000000000000000000000000003e"
    "00000000000000000000000000000000000000000000000000000000000000000000000000000000"
    "0000000000000000000000000000000000000000652da24b";
FrameHeader golden_header() {
  constexpr std::int64_t kWallNs = 1'800'000'000'000'000'000;
  FrameHeader header;
  header.quantity = PixelQuantity::temperature_k;
  header.channel_kind = 1;
  header.quality_rung = 4;
  header.channel_index = 0x0203;
  header.width_px = 640;
  header.height_px = 512;
  header.band_lo_um = 8.0F;
  header.band_hi_um = 12.0F;
  header.flags = kFlagLate | kFlagDegraded | kFlagExtrapolated;
  header.estimated_error_k = 0.25F;
  header.nonfinite_px = 3;
  header.clamped_px = 5;
  header.run_id = 0x1122334455667788;
  header.frame_number = 1000;
  header.host_frame_number = 999;
  header.sim_time_ns = 5'000'000'000;
  header.pose_sim_time_ns = -4'000'000;
  header.host_received_ns = kWallNs;
  header.deadline_ns = kWallNs + 1;
  header.render_start_ns = kWallNs + 2;
  header.render_end_ns = kWallNs + 3;
  header.readback_end_ns = kWallNs + 4;
  header.send_start_ns = kWallNs + 5;
  header.previous_age_ns = -7;
  header.previous_delay_ns = 123456;
  header.previous_frame_number = 998;
  header.previous_jitter_ns = 4660;
  header.slot_begin_ns = kWallNs - 1;
  header.trigger_number = 77;
  header.prediction_error_m = 0.5F;
  header.prediction_error_rad = 0.25F;
  header.predictions = 9;
  header.window_x_px = 0x102;
  header.window_y_px = 0x40;
  header.sensor_width_px = 1280;
  header.sensor_height_px = 1024;
  header.encoding = PixelEncoding::shuffled_lz4;
  header.encoded_bytes = 0x12345;
  header.pose.position_world_m = {1.5, -2.25, 1000.0};
  header.pose.world_from_body = {0.5, -0.5, 0.5, -0.5};
  header.payload_bytes = 640 * 512 * 4;
  header.payload_crc32c = 0xA1B2C3D4;
  header.fov_h_rad = 0.125F;
  return header;
}

std::vector<std::byte> encoded(const FrameHeader& header) {
  std::vector<std::byte> bytes(kFrameHeaderBytes, std::byte{0xEE});
  encode(header, std::span<std::byte, kFrameHeaderBytes>(bytes));
  return bytes;
}

/// Returns the golden bytes with one byte changed and a correct header CRC.
std::vector<std::byte> forged(std::size_t at, std::uint8_t value) {
  auto bytes = encoded(golden_header());
  bytes[at] = std::byte{value};
  const std::uint32_t crc = crc32c(std::span(bytes).first(380));
  for (std::size_t i = 0; i < 4; ++i) {
    bytes[380 + i] = static_cast<std::byte>((crc >> (8 * i)) & 0xFFu);
  }
  return bytes;
}

std::string error_of(std::span<const std::byte> bytes) {
  const auto header = decode_frame_header(bytes);
  if (header) return "decoded";
  EXPECT_EQ(header.error().code, physics::ErrorCode::protocol);
  return header.error().text;
}

TEST(FrameHeader, EncodesToTheGoldenBytes) {
  EXPECT_EQ(to_hex(encoded(golden_header())), kGolden);
}

TEST(FrameHeader, DecodesEveryFieldOfTheGoldenBytes) {
  const auto header = decode_frame_header(from_hex(kGolden));
  ASSERT_TRUE(header) << header.error().text;
  const FrameHeader expected = golden_header();
  EXPECT_EQ(header->format, expected.format);
  EXPECT_EQ(header->quantity, expected.quantity);
  EXPECT_EQ(header->channel_kind, expected.channel_kind);
  EXPECT_EQ(header->quality_rung, expected.quality_rung);
  EXPECT_EQ(header->channel_index, expected.channel_index);
  EXPECT_EQ(header->width_px, expected.width_px);
  EXPECT_EQ(header->height_px, expected.height_px);
  EXPECT_EQ(header->band_lo_um, expected.band_lo_um);
  EXPECT_EQ(header->band_hi_um, expected.band_hi_um);
  EXPECT_EQ(header->flags, expected.flags);
  EXPECT_EQ(header->estimated_error_k, expected.estimated_error_k);
  EXPECT_EQ(header->pose.position_world_m, expected.pose.position_world_m);
  EXPECT_EQ(header->pose.world_from_body, expected.pose.world_from_body);
  EXPECT_EQ(header->pose_sim_time_ns, expected.pose_sim_time_ns);
  EXPECT_EQ(header->previous_age_ns, expected.previous_age_ns);
  EXPECT_EQ(header->previous_jitter_ns, expected.previous_jitter_ns);
  EXPECT_EQ(header->slot_begin_ns, expected.slot_begin_ns);
  EXPECT_EQ(header->trigger_number, expected.trigger_number);
  EXPECT_EQ(header->prediction_error_m, expected.prediction_error_m);
  EXPECT_EQ(header->prediction_error_rad, expected.prediction_error_rad);
  EXPECT_EQ(header->predictions, expected.predictions);
  EXPECT_EQ(header->window_x_px, expected.window_x_px);
  EXPECT_EQ(header->window_y_px, expected.window_y_px);
  EXPECT_EQ(header->sensor_width_px, expected.sensor_width_px);
  EXPECT_EQ(header->sensor_height_px, expected.sensor_height_px);
  EXPECT_EQ(header->encoding, expected.encoding);
  EXPECT_EQ(header->encoded_bytes, expected.encoded_bytes);
  EXPECT_EQ(header->fov_h_rad, expected.fov_h_rad);
  // Fields that are not compared above would differ here.
  EXPECT_EQ(to_hex(encoded(*header)), kGolden);
}

TEST(FrameHeader, RefusesWhatIsNotAHeaderAndSaysWhy) {
  const auto good = from_hex(kGolden);
  EXPECT_THAT(error_of({}), HasSubstr("0 bytes, 384 needed"));
  EXPECT_THAT(error_of(std::span(good).first(383)), HasSubstr("383 bytes"));
  EXPECT_THAT(error_of(forged(0, 'X')), HasSubstr("magic"));
  EXPECT_THAT(error_of(forged(4, 1)), HasSubstr("version 1, this is version 2"));
  EXPECT_THAT(error_of(forged(8, 0x44)), HasSubstr("size field"));
  EXPECT_THAT(error_of(forged(5, 9)), HasSubstr("pixel format 9"));
  EXPECT_THAT(error_of(forged(6, 0)), HasSubstr("pixel quantity 0"));
  EXPECT_THAT(error_of(forged(12, 0x81)), HasSubstr("for 641x512"));
  EXPECT_THAT(error_of(forged(48, 4)), HasSubstr("payload bytes"));
  EXPECT_THAT(error_of(forged(225, 2)), HasSubstr("unknown pixel encoding 2"));
  EXPECT_THAT(error_of(forged(271, 1)), HasSubstr("640x512 pixels at 16777474, 64 of a sensor of "
                                                  "1280x1024"));
  EXPECT_THAT(error_of(forged(277, 2)), HasSubstr("of a sensor of 512x1024"));
  auto flipped = good;
  flipped[200] ^= std::byte{1};
  EXPECT_THAT(error_of(flipped), HasSubstr("CRC"));
}

TEST(FrameHeader, RefusesSizesWhosePixelsOverflow64Bits) {
  FrameHeader header = golden_header();
  header.width_px = 0x80000000u;
  header.height_px = 0x80000000u;
  header.payload_bytes = 0;  // 2^64 bytes, cut to 64 bits
  EXPECT_THAT(error_of(encoded(header)), HasSubstr("payload bytes"));
}

TEST(FrameHeader, IgnoresReservedBytesAndWhatFollows) {
  auto bytes = forged(340, 0x55);
  bytes.push_back(std::byte{1});
  EXPECT_EQ(error_of(bytes), "decoded");
}

/// Every field of the output chain at the offset that docs/wire.md states.
TEST(FrameHeader, SaysWhatWasDoneToThePixels) {
  FrameHeader header = golden_header();
  header.quantity = PixelQuantity::drive;
  header.output_steps = kOutputMirroredVertically | kOutputRotated90 | kOutputShifted;
  header.applied_shift_x_px = 1.5F;
  header.applied_shift_y_px = -0.25F;
  header.window_x_px = header.window_y_px = header.sensor_width_px = header.sensor_height_px = 0;
  const auto bytes = encoded(header);
  EXPECT_EQ(to_hex(std::span(bytes).subspan(6, 1)), "03");
  EXPECT_EQ(to_hex(std::span(bytes).subspan(226, 6)), "26000000c03f");
  EXPECT_EQ(to_hex(std::span(bytes).subspan(312, 4)), "000080be");
  const auto back = decode_frame_header(bytes);
  ASSERT_TRUE(back) << back.error().text;
  EXPECT_EQ(back->quantity, PixelQuantity::drive);
  EXPECT_EQ(back->output_steps, header.output_steps);
  EXPECT_EQ(back->applied_shift_x_px, 1.5F);
  EXPECT_EQ(back->applied_shift_y_px, -0.25F);
  EXPECT_THAT(error_of(forged(6, 6)), HasSubstr("pixel quantity 6"));
}

}  // namespace
}  // namespace emit::protocol
