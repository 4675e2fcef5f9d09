// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/limits.hpp"

/// Header in front of every frame's pixels: fixed size, little endian, versioned (docs/wire.md).
namespace emit::protocol {

inline constexpr std::uint32_t kFrameMagic = 0x524D4645;  ///< "EFMR" as bytes E F M R
inline constexpr std::uint8_t kFrameHeaderVersion = 1;
inline constexpr std::size_t kFrameHeaderBytes = 320;

enum class PixelFormat : std::uint8_t { float32 = 1 };
enum class PixelQuantity : std::uint8_t { radiance_w_m2_sr = 1, temperature_k = 2 };

/// How the pixels travel. Only clients that asked for another than raw get it.
enum class PixelEncoding : std::uint8_t {
  raw = 0,
  shuffled_lz4 = 1,  ///< pixel_codec.hpp
};

/// Set on a frame whenever it is not simply right and on time. Names are part of the contract.
enum FrameFlags : std::uint32_t {
  kFlagLate = 1u << 0,           ///< finished after its deadline
  kFlagRepeated = 1u << 1,       ///< the previous frame's pixels sent again at this slot
  kFlagStale = 1u << 2,          ///< rendered on a pose older than the extrapolation horizon
  kFlagDegraded = 1u << 3,       ///< less than full quality; see quality_rung, estimated_error_k
  kFlagPartial = 1u << 4,        ///< set by a receiver: pixels are missing
  kFlagHold = 1u << 5,           ///< thermal clock frozen by the host
  kFlagNonFinite = 1u << 6,      ///< nonfinite_px > 0: those pixels are written as 0
  kFlagClamped = 1u << 7,        ///< clamped_px > 0
  kFlagExtrapolated = 1u << 8,   ///< pose predicted beyond the newest one received
  kFlagGapBefore = 1u << 9,      ///< frames in front of this one were not sent to this client
  kFlagCanned = 1u << 10,        ///< pre-rendered pixels
  kFlagTimeUnset = 1u << 11,     ///< kernel TAI offset unknown: wall instants are UTC
  kFlagTriggerFault = 1u << 12,  ///< trigger late, or others before it missing or refused
  kFlagCorrupt = 1u << 13,     ///< set by a receiver: nothing is missing, but the checksum is wrong
  kFlagLostBefore = 1u << 14,  ///< set by a receiver: frames before it were lost on the way
};
/// What a receiver alone can say: it drops these where a sender claims them.
inline constexpr std::uint32_t kReceiverFlags = kFlagPartial | kFlagCorrupt | kFlagLostBefore;

struct FrameHeader {
  PixelFormat format = PixelFormat::float32;
  PixelQuantity quantity = PixelQuantity::radiance_w_m2_sr;
  std::uint8_t channel_kind = 0;  ///< scene::ChannelKind: 0 injection, 1 projector
  std::uint8_t quality_rung = 0;  ///< 0 = full quality
  std::uint16_t channel_index = 0;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  // Where these pixels lie in the sensor's image. Size 0: an older daemon, all of it.
  std::uint32_t window_x_px = 0;
  std::uint32_t window_y_px = 0;
  std::uint32_t sensor_width_px = 0;
  std::uint32_t sensor_height_px = 0;
  float band_lo_um = 0.0F;
  float band_hi_um = 0.0F;
  std::uint32_t flags = 0;         ///< FrameFlags
  float estimated_error_k = 0.0F;  ///< NaN: not known; Inf: not to be trusted
  std::uint32_t nonfinite_px = 0;
  std::uint32_t clamped_px = 0;
  std::uint64_t run_id = 0;             ///< changes at every start and reset of the daemon
  std::uint64_t frame_number = 0;       ///< counts frames of this run, no gaps at the source
  std::uint64_t host_frame_number = 0;  ///< of the newest host frame used; 0 = none yet
  std::int64_t sim_time_ns = 0;         ///< instant that the image shows
  std::int64_t pose_sim_time_ns = 0;    ///< time stamp of the newest pose used
  // Wall instants, int64 ns TAI; 0 = did not happen.
  std::int64_t host_received_ns = 0;  ///< kernel receive stamp of that host frame
  std::int64_t deadline_ns = 0;       ///< 0 in host-step without a budget
  std::int64_t render_start_ns = 0;
  std::int64_t render_end_ns = 0;      ///< device finished
  std::int64_t readback_end_ns = 0;    ///< pixels visible to the CPU
  std::int64_t send_start_ns = 0;      ///< first byte handed to the kernel
  std::int64_t previous_age_ns = 0;    ///< last completed frame: sim-time age at its last byte
  std::int64_t previous_delay_ns = 0;  ///< last completed frame: pose received to last byte sent
  std::uint64_t previous_frame_number = 0;
  /// Smoothed jitter of previous_delay_ns on this client's stream, as in RFC 3550: |difference of
  /// two consecutive delays|, each with a weight of 1/16.
  std::int64_t previous_jitter_ns = 0;
  std::int64_t slot_begin_ns = 0;     ///< ig-clock, trigger: wall instant the slot began; else 0
  std::uint64_t trigger_number = 0;   ///< trigger: of the trigger that asked for it; else 0
  float prediction_error_m = 0.0F;    ///< of the newest predicted sensor pose whose truth has come
  float prediction_error_rad = 0.0F;  ///< likewise
  std::uint32_t predictions = 0;      ///< predicted poses of this run whose truth has come
  physics::Pose pose;                 ///< of the sensor, as used
  std::uint64_t payload_bytes = 0;    ///< of the pixels, whatever the encoding
  std::uint32_t payload_crc32c = 0;   ///< of the pixels, whatever the encoding
  PixelEncoding encoding = PixelEncoding::raw;
  std::uint32_t encoded_bytes = 0;  ///< that follow the header in their place; raw: 0
};

/// Most that a client may ask for as "every n-th frame".
inline constexpr std::uint32_t kMaxEveryNth = physics::limits::kMaxEveryNth;

/// True for frames 1, 1 + n, 1 + 2 n, ... of a run: who takes every n-th frame takes these, so that
/// all who do have the same ones, and know which number comes next. Precondition: every_nth > 0.
[[nodiscard]] constexpr bool is_every_nth(std::uint64_t frame_number,
                                          std::uint32_t every_nth) noexcept {
  return every_nth == 1 || frame_number % every_nth == 1;
}

/// Writes the header with its own CRC32C in the last four bytes. RT-safe.
void encode(const FrameHeader& header, std::span<std::byte, kFrameHeaderBytes> out) noexcept;

/// Errors (protocol): short input, wrong magic, unknown version, size or CRC mismatch, a payload
/// size that does not match the format.
[[nodiscard]] physics::Result<FrameHeader> decode_frame_header(std::span<const std::byte> bytes);

/// CRC-32C (Castagnoli), as in iSCSI; `crc` continues an earlier call. RT-safe.
[[nodiscard]] std::uint32_t crc32c(std::span<const std::byte> bytes,
                                   std::uint32_t crc = 0) noexcept;

}  // namespace emit::protocol
