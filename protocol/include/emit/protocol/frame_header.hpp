// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "emit/physics/check.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/frames.hpp"
#include "emit/physics/limits.hpp"

/// Header in front of every frame's pixels: fixed size, little endian, versioned (docs/wire.md
/// section 3).
namespace emit::protocol {

inline constexpr std::uint32_t kFrameMagic = 0x524D4645;  ///< "EFMR" as bytes E F M R
inline constexpr std::uint8_t kFrameHeaderVersion = 2;
inline constexpr std::size_t kFrameHeaderBytes = 384;

/// Number format of a pixel.
enum class PixelFormat : std::uint8_t { float32 = 1 };
/// Physical quantity of a pixel.
enum class PixelQuantity : std::uint8_t {
  radiance_w_m2_sr = 1,  ///< radiance within the band, W m-2 sr-1
  temperature_k = 2,
  /// Command for an emitter of a projector: radiance after a correction of non-uniformity, or the
  /// drive that a table of the channel gives for it. It is not the radiance of the scene.
  drive = 3,
  /// Digital numbers of a detector: whole numbers from 0 to the full scale of its converter.
  counts = 4,
  photon_radiance = 5,  ///< photons within the band, s-1 m-2 sr-1
};

/// Steps that the pixels went through after they were cut out of the sensor's image, as bits. A
/// frame with one of the first five has no window in its header: its pixels do not lie as in the
/// sensor's image. docs/wire.md section 3 says where they come from.
enum OutputSteps : std::uint16_t {
  kOutputMirroredHorizontally = 1u << 0,  ///< columns are in reverse order
  kOutputMirroredVertically = 1u << 1,    ///< rows are in reverse order
  kOutputRotated90 = 1u << 2,             ///< rotated clockwise by 90 degrees, after the mirror
  kOutputRotated180 = 1u << 3,            ///< rotated by 180 degrees; with the bit before, by 270
  kOutputDistorted = 1u << 4,             ///< resampled by the channel's distortion map
  kOutputShifted = 1u << 5,               ///< moved by applied_shift_*_px
  kOutputCorrected = 1u << 6,             ///< gain and offset of each pixel were applied
  kOutputDriven = 1u << 7,                ///< a table made drive of radiance
  kOutputBlurred = 1u << 8,               ///< convolved with the spot of the channel's optics
  kOutputDetected = 1u << 9,              ///< fixed pattern and noise of the channel's detector
  kOutputCounted = 1u << 10,              ///< a converter made counts of radiance
};
/// Steps after which a pixel's place no longer tells its place in the sensor's image.
inline constexpr std::uint16_t kOutputMoved = kOutputMirroredHorizontally |
                                              kOutputMirroredVertically | kOutputRotated90 |
                                              kOutputRotated180 | kOutputDistorted;

/// Encoding of the pixels on the wire. Only clients that asked for another encoding than raw
/// receive one.
enum class PixelEncoding : std::uint8_t {
  raw = 0,
  shuffled_lz4 = 1,  ///< pixels in shuffled LZ4 blocks, see pixel_codec.hpp
};

/// Flags of a frame. A flag is set on every frame that is not both right and on time. The names are
/// part of the contract.
enum FrameFlags : std::uint32_t {
  kFlagLate = 1u << 0,          ///< finished after its deadline
  kFlagRepeated = 1u << 1,      ///< the previous frame's pixels are sent again in this slot
  kFlagStale = 1u << 2,         ///< the pose used is older than the extrapolation horizon
  kFlagDegraded = 1u << 3,      ///< quality is reduced; see quality_rung, estimated_error_k
  kFlagPartial = 1u << 4,       ///< set by a receiver: pixels are missing
  kFlagHold = 1u << 5,          ///< the host froze the thermal clock
  kFlagNonFinite = 1u << 6,     ///< nonfinite_px > 0: those pixels are written as 0
  kFlagClamped = 1u << 7,       ///< clamped_px > 0
  kFlagExtrapolated = 1u << 8,  ///< pose predicted beyond the newest one received
  kFlagGapBefore = 1u << 9,     ///< frames before this one were not sent to this client
  kFlagCanned = 1u << 10,       ///< the pixels were rendered in advance
  kFlagTimeUnset = 1u << 11,    ///< kernel TAI offset unknown: wall instants are UTC
  /// The trigger was late, or others before it were missing or refused.
  kFlagTriggerFault = 1u << 12,
  kFlagCorrupt = 1u << 13,  ///< set by a receiver: no pixel is missing, but the checksum is wrong
  /// Set by a receiver: frames before this one were lost on the network.
  kFlagLostBefore = 1u << 14,
  /// The motion simulator does not show what the frame assumes: motion_state and motion_faults say
  /// why. Or the applied shift is larger than the room around the window.
  kFlagMotionFault = 1u << 15,
};
/// Names of the flags by bit, as docs/wire.md section 3 has them.
inline constexpr std::array<std::string_view, 16> kFrameFlagNames{
    "late",          "repeated", "stale",        "degraded",    "partial", "hold",
    "non_finite",    "clamped",  "extrapolated", "gap_before",  "canned",  "time_unset",
    "trigger_fault", "corrupt",  "lost_before",  "motion_fault"};
/// Flags that only a receiver may set. A receiver clears them where a sender set them.
inline constexpr std::uint32_t kReceiverFlags = kFlagPartial | kFlagCorrupt | kFlagLostBefore;

/// State of the flight motion simulator, as emitd drives it.
enum class MotionState : std::uint8_t {
  none = 0,     ///< emitd drives no motion simulator
  waiting = 1,  ///< the controller sends no measurements
  parked = 2,
  parking = 3,
  capturing = 4,  ///< the axes approach the demands softly
  following = 5,
  fault = 6,  ///< the interlock of the controller is open
};
/// Reasons why the axes do not show what a frame assumes, as bits.
enum MotionFaults : std::uint8_t {
  kMotionNoFeedback = 1u << 0,       ///< no measurement for longer than motion.feedback_timeout_ms
  kMotionNoHost = 1u << 1,           ///< no pose for longer than pacing.horizon_ms
  kMotionInterlock = 1u << 2,        ///< the controller has switched the motors off
  kMotionLimit = 1u << 3,            ///< an axis is at a limit and cannot meet its demand
  kMotionLock = 1u << 4,             ///< two axes are nearly parallel, and rates are damped
  kMotionClock = 1u << 5,            ///< simulation time does not pass as fast as time
  kMotionControllerClock = 1u << 6,  ///< the clocks of controller and emitd differ
  kMotionIgnored = 1u << 7,          ///< the controller does not take or follow the commands
};

/// Contents of a frame header. The order and the offsets of the fields on the wire are in
/// docs/wire.md section 3.
struct FrameHeader {
  PixelFormat format = PixelFormat::float32;
  PixelQuantity quantity = PixelQuantity::radiance_w_m2_sr;
  std::uint8_t channel_kind = 0;  ///< scene::ChannelKind: 0 injection, 1 projector
  std::uint8_t quality_rung = 0;  ///< quality level; 0 is full quality
  std::uint16_t channel_index = 0;
  std::uint32_t width_px = 0;
  std::uint32_t height_px = 0;
  // Window of the channel within the sensor's image, px. A sensor size of 0 comes from an older
  // daemon: the window is the whole image.
  std::uint32_t window_x_px = 0;
  std::uint32_t window_y_px = 0;
  std::uint32_t sensor_width_px = 0;
  std::uint32_t sensor_height_px = 0;
  float band_lo_um = 0.0F;
  float band_hi_um = 0.0F;
  std::uint32_t flags = 0;         ///< FrameFlags
  float estimated_error_k = 0.0F;  ///< NaN: not known; infinite: the image is not to be trusted
  std::uint32_t nonfinite_px = 0;
  std::uint32_t clamped_px = 0;
  std::uint64_t run_id = 0;        ///< changes at every start and reset of the daemon
  std::uint64_t frame_number = 0;  ///< number of the frame in this run; the source leaves no gaps
  std::uint64_t host_frame_number = 0;  ///< number of the newest host frame used; 0 = none yet
  std::int64_t sim_time_ns = 0;         ///< instant that the image shows
  std::int64_t pose_sim_time_ns = 0;    ///< time stamp of the newest pose used
  // Wall instants, ns TAI. 0 means that the event did not happen.
  std::int64_t host_received_ns = 0;  ///< kernel receive stamp of the newest host frame used
  std::int64_t deadline_ns = 0;       ///< 0 in host-step without a budget
  std::int64_t render_start_ns = 0;
  std::int64_t render_end_ns = 0;    ///< instant at which the device finished the frame
  std::int64_t readback_end_ns = 0;  ///< instant at which the CPU could read the pixels
  std::int64_t send_start_ns = 0;    ///< instant at which the kernel took the first byte
  /// Frame completed last: its age in simulation time at its last byte.
  std::int64_t previous_age_ns = 0;
  /// Frame completed last: time from the receipt of its pose to its last byte.
  std::int64_t previous_delay_ns = 0;
  std::uint64_t previous_frame_number = 0;
  /// Smoothed jitter of previous_delay_ns on this client's stream, ns, as in RFC 3550: the mean of
  /// |difference of two consecutive delays|, in which the newest difference has the weight 1/16.
  std::int64_t previous_jitter_ns = 0;
  /// Ig-clock, trigger: wall instant at which the slot began; otherwise 0.
  std::int64_t slot_begin_ns = 0;
  /// Trigger: number of the trigger that started the frame; otherwise 0.
  std::uint64_t trigger_number = 0;
  /// Position error of the newest prediction whose true pose is known.
  float prediction_error_m = 0.0F;
  float prediction_error_rad = 0.0F;  ///< attitude error of the same prediction
  std::uint32_t predictions = 0;     ///< number of predictions of this run whose true pose is known
  physics::Pose pose;                ///< pose of the sensor that the frame was rendered with
  std::uint64_t payload_bytes = 0;   ///< length of the raw pixels, whatever the encoding is
  std::uint32_t payload_crc32c = 0;  ///< CRC-32C of the raw pixels, whatever the encoding is
  PixelEncoding encoding = PixelEncoding::raw;
  std::uint32_t encoded_bytes = 0;  ///< length of the encoded pixels behind the header; 0 when raw
  // The members below are 0 without a motion simulator.
  MotionState motion_state = MotionState::none;
  std::uint8_t motion_faults = 0;  ///< MotionFaults
  /// Projector: shift of the image, right and down, that brings it to where the axes are at
  /// display_ns, as far as they were known when the frame was published. It is what remains to be
  /// done: 0 where emitd has applied it, except in repeated frames.
  float shift_x_px = 0.0F;
  float shift_y_px = 0.0F;
  /// Projector: error of direction that the shift left in the centre of the newest frame whose
  /// axes were measured up to its display. NaN: none was.
  float pointing_error_px = 0.0F;
  std::int64_t display_ns = 0;     ///< wall instant for which the axes were predicted
  std::uint16_t output_steps = 0;  ///< OutputSteps
  /// Shift that emitd has applied, with kOutputShifted; right and down in the sensor's image.
  float applied_shift_x_px = 0.0F;
  float applied_shift_y_px = 0.0F;
  /// Horizontal field of view of the sensor's image (of which the frame may show a window), rad. 0:
  /// the source does not know it.
  float fov_h_rad = 0.0F;
};

/// Largest n that a client may ask for in "every n-th frame".
inline constexpr std::uint32_t kMaxEveryNth = physics::limits::kMaxEveryNth;

/// Returns true for the frames 1, 1 + n, 1 + 2 n, ... of a run. All clients that take every n-th
/// frame take these: they receive the same frames, and each knows which number comes next. RT-safe.
/// @pre every_nth > 0
[[nodiscard]] constexpr bool is_every_nth(std::uint64_t frame_number,
                                          std::uint32_t every_nth) noexcept {
  EMIT_CHECK_OP(every_nth, >, 0U);
  return every_nth == 1 || frame_number % every_nth == 1;
}

/// Writes the header, with its own CRC-32C in the last four bytes. RT-safe.
void encode(const FrameHeader& header, std::span<std::byte, kFrameHeaderBytes> out) noexcept;

/// Decodes and checks a frame header at the begin of `bytes`. It allocates only on an error.
/// Errors (protocol): the input is too short, the magic is wrong, the version, format, quantity or
/// encoding is unknown, the size or the CRC does not match, the payload size does not match the
/// image size, or the window lies outside the sensor's image.
[[nodiscard]] physics::Result<FrameHeader> decode_frame_header(std::span<const std::byte> bytes);

/// Returns the CRC-32C (Castagnoli, as in iSCSI, RFC 3720) of `bytes`. `crc` is the result of an
/// earlier call, which this one continues. RT-safe.
[[nodiscard]] std::uint32_t crc32c(std::span<const std::byte> bytes,
                                   std::uint32_t crc = 0) noexcept;

}  // namespace emit::protocol
