// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/frame_header.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string>

#include "frame_header_parse.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {
namespace {

using physics::ErrorCode;
using physics::make_error;

// Offsets of the fields (docs/wire.md section 3). Reserved bytes are zero.
enum Offset : std::size_t {
  kMagicAt = 0,
  kVersionAt = 4,
  kFormatAt = 5,
  kQuantityAt = 6,
  kChannelKindAt = 7,
  kHeaderBytesAt = 8,
  kChannelIndexAt = 10,
  kWidthAt = 12,
  kHeightAt = 16,
  kBandLoAt = 20,
  kBandHiAt = 24,
  kFlagsAt = 28,
  kEstimatedErrorAt = 32,
  kNonfiniteAt = 36,
  kClampedAt = 40,
  kPayloadCrcAt = 44,
  kPayloadBytesAt = 48,
  kRunIdAt = 56,
  kFrameNumberAt = 64,
  kHostFrameNumberAt = 72,
  kSimTimeAt = 80,
  kPoseSimTimeAt = 88,
  kHostReceivedAt = 96,
  kDeadlineAt = 104,
  kRenderStartAt = 112,
  kRenderEndAt = 120,
  kReadbackEndAt = 128,
  kSendStartAt = 136,
  kPreviousAgeAt = 144,
  kPreviousDelayAt = 152,
  kPreviousFrameNumberAt = 160,
  kPositionAt = 168,
  kQuaternionAt = 192,
  kQualityRungAt = 224,
  kEncodingAt = 225,
  kOutputStepsAt = 226,
  kAppliedShiftXAt = 228,
  kPreviousJitterAt = 232,
  kSlotBeginAt = 240,
  kTriggerNumberAt = 248,
  kPredictionErrorMAt = 256,
  kPredictionErrorRadAt = 260,
  kPredictionsAt = 264,
  kWindowXAt = 268,
  kWindowYAt = 272,
  kSensorWidthAt = 276,
  kSensorHeightAt = 280,
  kEncodedBytesAt = 284,
  kMotionStateAt = 288,
  kMotionFaultsAt = 289,
  kReservedMotionAt = 290,
  kShiftXAt = 292,
  kShiftYAt = 296,
  kPointingErrorAt = 300,
  kDisplayAt = 304,
  kAppliedShiftYAt = 312,
  kFovAt = 316,
  kReservedGrowthAt = 320,
  kCrcAt = 380,
};
static_assert(kCrcAt + 4 == kFrameHeaderBytes);

/// Returns the length of the pixels, bytes, or 0 when it exceeds 64 bits or the frame is empty.
std::uint64_t expected_payload_bytes(std::uint32_t width_px, std::uint32_t height_px) noexcept {
  const std::uint64_t pixels = std::uint64_t{width_px} * height_px;
  return pixels > (std::uint64_t{1} << 61) ? 0 : pixels * sizeof(float);
}

/// Returns true when the window lies within the sensor's image, or when no window is given.
bool window_fits(const FrameHeader& header) noexcept {
  if (header.sensor_width_px == 0 && header.sensor_height_px == 0) return true;
  return std::uint64_t{header.window_x_px} + header.width_px <= header.sensor_width_px &&
         std::uint64_t{header.window_y_px} + header.height_px <= header.sensor_height_px;
}

/// Returns the text of an error message for a fault.
std::string describe(HeaderFault fault, std::span<const std::byte> bytes,
                     const FrameHeader& header) {
  switch (fault) {
    case HeaderFault::none:
      break;
    case HeaderFault::short_input:
      return fmt::format("{} bytes, {} needed", bytes.size(), kFrameHeaderBytes);
    case HeaderFault::magic:
      return fmt::format("magic {:#010x}, not {:#010x}", wire::get<std::uint32_t>(bytes, kMagicAt),
                         kFrameMagic);
    case HeaderFault::version:
      return fmt::format("version {}, this is version {}",
                         wire::get<std::uint8_t>(bytes, kVersionAt), kFrameHeaderVersion);
    case HeaderFault::size:
      return fmt::format("size field {}, not {}", wire::get<std::uint16_t>(bytes, kHeaderBytesAt),
                         kFrameHeaderBytes);
    case HeaderFault::crc:
      return fmt::format("CRC {:#010x}, computed {:#010x}", wire::get<std::uint32_t>(bytes, kCrcAt),
                         crc32c(bytes.first(kCrcAt)));
    case HeaderFault::format:
      return fmt::format("unknown pixel format {}", wire::get<std::uint8_t>(bytes, kFormatAt));
    case HeaderFault::quantity:
      return fmt::format("unknown pixel quantity {}", wire::get<std::uint8_t>(bytes, kQuantityAt));
    case HeaderFault::payload_size:
      return fmt::format("{} payload bytes for {}x{} float32 pixels", header.payload_bytes,
                         header.width_px, header.height_px);
    case HeaderFault::encoding:
      return fmt::format("unknown pixel encoding {}", wire::get<std::uint8_t>(bytes, kEncodingAt));
    case HeaderFault::window:
      return fmt::format("{}x{} pixels at {}, {} of a sensor of {}x{}", header.width_px,
                         header.height_px, header.window_x_px, header.window_y_px,
                         header.sensor_width_px, header.sensor_height_px);
  }
  return "unknown fault";
}

}  // namespace

void encode(const FrameHeader& header, std::span<std::byte, kFrameHeaderBytes> out) noexcept {
  const std::span<std::byte> to = out;
  wire::put(to, kMagicAt, kFrameMagic);
  wire::put(to, kVersionAt, kFrameHeaderVersion);
  wire::put(to, kFormatAt, static_cast<std::uint8_t>(header.format));
  wire::put(to, kQuantityAt, static_cast<std::uint8_t>(header.quantity));
  wire::put(to, kChannelKindAt, header.channel_kind);
  wire::put(to, kHeaderBytesAt, static_cast<std::uint16_t>(kFrameHeaderBytes));
  wire::put(to, kChannelIndexAt, header.channel_index);
  wire::put(to, kWidthAt, header.width_px);
  wire::put(to, kHeightAt, header.height_px);
  wire::put(to, kBandLoAt, header.band_lo_um);
  wire::put(to, kBandHiAt, header.band_hi_um);
  wire::put(to, kFlagsAt, header.flags);
  wire::put(to, kEstimatedErrorAt, header.estimated_error_k);
  wire::put(to, kNonfiniteAt, header.nonfinite_px);
  wire::put(to, kClampedAt, header.clamped_px);
  wire::put(to, kPayloadCrcAt, header.payload_crc32c);
  wire::put(to, kPayloadBytesAt, header.payload_bytes);
  wire::put(to, kRunIdAt, header.run_id);
  wire::put(to, kFrameNumberAt, header.frame_number);
  wire::put(to, kHostFrameNumberAt, header.host_frame_number);
  wire::put(to, kSimTimeAt, header.sim_time_ns);
  wire::put(to, kPoseSimTimeAt, header.pose_sim_time_ns);
  wire::put(to, kHostReceivedAt, header.host_received_ns);
  wire::put(to, kDeadlineAt, header.deadline_ns);
  wire::put(to, kRenderStartAt, header.render_start_ns);
  wire::put(to, kRenderEndAt, header.render_end_ns);
  wire::put(to, kReadbackEndAt, header.readback_end_ns);
  wire::put(to, kSendStartAt, header.send_start_ns);
  wire::put(to, kPreviousAgeAt, header.previous_age_ns);
  wire::put(to, kPreviousDelayAt, header.previous_delay_ns);
  wire::put(to, kPreviousFrameNumberAt, header.previous_frame_number);
  const auto& position = header.pose.position_world_m;
  wire::put(to, kPositionAt, position.x);
  wire::put(to, kPositionAt + 8, position.y);
  wire::put(to, kPositionAt + 16, position.z);
  const auto& attitude = header.pose.world_from_body;
  wire::put(to, kQuaternionAt, attitude.w);
  wire::put(to, kQuaternionAt + 8, attitude.x);
  wire::put(to, kQuaternionAt + 16, attitude.y);
  wire::put(to, kQuaternionAt + 24, attitude.z);
  wire::put(to, kQualityRungAt, header.quality_rung);
  wire::put(to, kEncodingAt, static_cast<std::uint8_t>(header.encoding));
  wire::put(to, kOutputStepsAt, header.output_steps);
  wire::put(to, kAppliedShiftXAt, header.applied_shift_x_px);
  wire::put(to, kPreviousJitterAt, header.previous_jitter_ns);
  wire::put(to, kSlotBeginAt, header.slot_begin_ns);
  wire::put(to, kTriggerNumberAt, header.trigger_number);
  wire::put(to, kPredictionErrorMAt, header.prediction_error_m);
  wire::put(to, kPredictionErrorRadAt, header.prediction_error_rad);
  wire::put(to, kPredictionsAt, header.predictions);
  wire::put(to, kWindowXAt, header.window_x_px);
  wire::put(to, kWindowYAt, header.window_y_px);
  wire::put(to, kSensorWidthAt, header.sensor_width_px);
  wire::put(to, kSensorHeightAt, header.sensor_height_px);
  wire::put(to, kEncodedBytesAt, header.encoded_bytes);
  wire::put(to, kMotionStateAt, static_cast<std::uint8_t>(header.motion_state));
  wire::put(to, kMotionFaultsAt, header.motion_faults);
  std::ranges::fill(to.subspan(kReservedMotionAt, kShiftXAt - kReservedMotionAt), std::byte{0});
  wire::put(to, kShiftXAt, header.shift_x_px);
  wire::put(to, kShiftYAt, header.shift_y_px);
  wire::put(to, kPointingErrorAt, header.pointing_error_px);
  wire::put(to, kDisplayAt, header.display_ns);
  wire::put(to, kAppliedShiftYAt, header.applied_shift_y_px);
  wire::put(to, kFovAt, header.fov_h_rad);
  std::ranges::fill(to.subspan(kReservedGrowthAt, kCrcAt - kReservedGrowthAt), std::byte{0});
  wire::put(to, kCrcAt, crc32c(to.first(kCrcAt)));
}

HeaderFault parse_frame_header(std::span<const std::byte> bytes, FrameHeader& header) noexcept {
  if (bytes.size() < kFrameHeaderBytes) return HeaderFault::short_input;
  if (wire::get<std::uint32_t>(bytes, kMagicAt) != kFrameMagic) return HeaderFault::magic;
  if (wire::get<std::uint8_t>(bytes, kVersionAt) != kFrameHeaderVersion) {
    return HeaderFault::version;
  }
  if (wire::get<std::uint16_t>(bytes, kHeaderBytesAt) != kFrameHeaderBytes) {
    return HeaderFault::size;
  }
  if (wire::get<std::uint32_t>(bytes, kCrcAt) != crc32c(bytes.first(kCrcAt))) {
    return HeaderFault::crc;
  }
  const auto format = wire::get<std::uint8_t>(bytes, kFormatAt);
  if (format != static_cast<std::uint8_t>(PixelFormat::float32)) return HeaderFault::format;
  const auto quantity = wire::get<std::uint8_t>(bytes, kQuantityAt);
  if (quantity != static_cast<std::uint8_t>(PixelQuantity::radiance_w_m2_sr) &&
      quantity != static_cast<std::uint8_t>(PixelQuantity::temperature_k) &&
      quantity != static_cast<std::uint8_t>(PixelQuantity::drive) &&
      quantity != static_cast<std::uint8_t>(PixelQuantity::counts) &&
      quantity != static_cast<std::uint8_t>(PixelQuantity::photon_radiance)) {
    return HeaderFault::quantity;
  }
  const auto encoding = wire::get<std::uint8_t>(bytes, kEncodingAt);
  if (encoding > static_cast<std::uint8_t>(PixelEncoding::shuffled_lz4)) {
    return HeaderFault::encoding;
  }

  header.format = static_cast<PixelFormat>(format);
  header.quantity = static_cast<PixelQuantity>(quantity);
  header.channel_kind = wire::get<std::uint8_t>(bytes, kChannelKindAt);
  header.channel_index = wire::get<std::uint16_t>(bytes, kChannelIndexAt);
  header.width_px = wire::get<std::uint32_t>(bytes, kWidthAt);
  header.height_px = wire::get<std::uint32_t>(bytes, kHeightAt);
  header.band_lo_um = wire::get<float>(bytes, kBandLoAt);
  header.band_hi_um = wire::get<float>(bytes, kBandHiAt);
  header.flags = wire::get<std::uint32_t>(bytes, kFlagsAt);
  header.estimated_error_k = wire::get<float>(bytes, kEstimatedErrorAt);
  header.nonfinite_px = wire::get<std::uint32_t>(bytes, kNonfiniteAt);
  header.clamped_px = wire::get<std::uint32_t>(bytes, kClampedAt);
  header.payload_crc32c = wire::get<std::uint32_t>(bytes, kPayloadCrcAt);
  header.payload_bytes = wire::get<std::uint64_t>(bytes, kPayloadBytesAt);
  header.run_id = wire::get<std::uint64_t>(bytes, kRunIdAt);
  header.frame_number = wire::get<std::uint64_t>(bytes, kFrameNumberAt);
  header.host_frame_number = wire::get<std::uint64_t>(bytes, kHostFrameNumberAt);
  header.sim_time_ns = wire::get<std::int64_t>(bytes, kSimTimeAt);
  header.pose_sim_time_ns = wire::get<std::int64_t>(bytes, kPoseSimTimeAt);
  header.host_received_ns = wire::get<std::int64_t>(bytes, kHostReceivedAt);
  header.deadline_ns = wire::get<std::int64_t>(bytes, kDeadlineAt);
  header.render_start_ns = wire::get<std::int64_t>(bytes, kRenderStartAt);
  header.render_end_ns = wire::get<std::int64_t>(bytes, kRenderEndAt);
  header.readback_end_ns = wire::get<std::int64_t>(bytes, kReadbackEndAt);
  header.send_start_ns = wire::get<std::int64_t>(bytes, kSendStartAt);
  header.previous_age_ns = wire::get<std::int64_t>(bytes, kPreviousAgeAt);
  header.previous_delay_ns = wire::get<std::int64_t>(bytes, kPreviousDelayAt);
  header.previous_frame_number = wire::get<std::uint64_t>(bytes, kPreviousFrameNumberAt);
  header.pose.position_world_m = {wire::get<double>(bytes, kPositionAt),
                                  wire::get<double>(bytes, kPositionAt + 8),
                                  wire::get<double>(bytes, kPositionAt + 16)};
  header.pose.world_from_body = {
      wire::get<double>(bytes, kQuaternionAt), wire::get<double>(bytes, kQuaternionAt + 8),
      wire::get<double>(bytes, kQuaternionAt + 16), wire::get<double>(bytes, kQuaternionAt + 24)};
  header.quality_rung = wire::get<std::uint8_t>(bytes, kQualityRungAt);
  header.previous_jitter_ns = wire::get<std::int64_t>(bytes, kPreviousJitterAt);
  header.slot_begin_ns = wire::get<std::int64_t>(bytes, kSlotBeginAt);
  header.trigger_number = wire::get<std::uint64_t>(bytes, kTriggerNumberAt);
  header.prediction_error_m = wire::get<float>(bytes, kPredictionErrorMAt);
  header.prediction_error_rad = wire::get<float>(bytes, kPredictionErrorRadAt);
  header.predictions = wire::get<std::uint32_t>(bytes, kPredictionsAt);
  header.encoding = static_cast<PixelEncoding>(encoding);
  header.window_x_px = wire::get<std::uint32_t>(bytes, kWindowXAt);
  header.window_y_px = wire::get<std::uint32_t>(bytes, kWindowYAt);
  header.sensor_width_px = wire::get<std::uint32_t>(bytes, kSensorWidthAt);
  header.sensor_height_px = wire::get<std::uint32_t>(bytes, kSensorHeightAt);
  header.encoded_bytes = wire::get<std::uint32_t>(bytes, kEncodedBytesAt);
  header.motion_state = static_cast<MotionState>(wire::get<std::uint8_t>(bytes, kMotionStateAt));
  header.motion_faults = wire::get<std::uint8_t>(bytes, kMotionFaultsAt);
  header.shift_x_px = wire::get<float>(bytes, kShiftXAt);
  header.shift_y_px = wire::get<float>(bytes, kShiftYAt);
  header.pointing_error_px = wire::get<float>(bytes, kPointingErrorAt);
  header.display_ns = wire::get<std::int64_t>(bytes, kDisplayAt);
  header.output_steps = wire::get<std::uint16_t>(bytes, kOutputStepsAt);
  header.applied_shift_x_px = wire::get<float>(bytes, kAppliedShiftXAt);
  header.applied_shift_y_px = wire::get<float>(bytes, kAppliedShiftYAt);
  header.fov_h_rad = wire::get<float>(bytes, kFovAt);

  const std::uint64_t expected = expected_payload_bytes(header.width_px, header.height_px);
  if (expected == 0 || header.payload_bytes != expected) return HeaderFault::payload_size;
  return window_fits(header) ? HeaderFault::none : HeaderFault::window;
}

physics::Result<FrameHeader> decode_frame_header(std::span<const std::byte> bytes) {
  FrameHeader header;
  const HeaderFault fault = parse_frame_header(bytes, header);
  if (fault == HeaderFault::none) return header;
  return make_error(ErrorCode::protocol, "frame header: " + describe(fault, bytes, header));
}

}  // namespace emit::protocol
