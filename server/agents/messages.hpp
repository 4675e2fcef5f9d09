// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <span>

#include "agents/frame_source.hpp"
#include "emit/physics/constants.hpp"
#include "emit/protocol/control.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/protocol/host_frame.hpp"
#include "motion/feedback_track.hpp"
#include "motion/motion_table.hpp"
#include "motion/seeker_course.hpp"
#include "pacing/run_control.hpp"
#include "rt/connection_key.hpp"

/// Plain structs on the rings between agents; docs/threading.md shows the sender and receiver of
/// each.
namespace emit::server {

inline constexpr std::size_t kMaxPlanes = 16;
inline constexpr std::size_t kMaxSlots = 32;
inline constexpr std::size_t kMaxCameras = 4;
inline constexpr std::size_t kMaxPictures = 16;

/// Set of channels. Bit k stands for channel k.
using ChannelSet = std::uint64_t;
inline constexpr std::size_t kMaxChannels = 64;
inline constexpr ChannelSet kAllChannels = ~ChannelSet{0};

using protocol::StatusCode;

/// Address of an answer.
struct Origin {
  enum class Kind : std::uint8_t { none, udp, tcp, gateway, console };
  Kind kind = Kind::none;
  std::uint32_t connection = 0;  ///< tcp: index and generation in the receiver's table
  std::uint32_t generation = 0;
  std::uint32_t address_bytes = 0;  ///< udp: sockaddr of the sender
  alignas(8) std::array<std::byte, 32> address{};
};

/// Message of receiver to conductor, in order of arrival.
struct HostInput {
  enum class Kind : std::uint8_t { frame, command };
  Kind kind = Kind::frame;
  CommandKind command = CommandKind::start;
  Origin origin;
  protocol::HostFrameData frame;
};

/// Message of conductor to receiver: an answer to send.
struct StatusReply {
  Origin origin;
  StatusCode code = StatusCode::ok;
  std::uint64_t host_frame_number = 0;
  std::uint64_t count = 0;
  std::uint64_t detail = 0;  ///< unknown_entity: its id; ok: the command's kind; kDetailOldRun
};

/// Largest number of weather changes that come with one frame. Further ones replace the newest.
inline constexpr std::size_t kMaxWeatherPerFrame = 32;

/// Largest number of commands to parts that come with one frame. Further ones are refused.
inline constexpr std::size_t kMaxPartsPerJob = 128;

/// Command to a part of an entity, from an instant on.
struct TimedPart {
  std::int64_t sim_time_ns = 0;
  renderer::PartUpdate update;
};
/// Returns the renderer's form of a host's weather.
[[nodiscard]] inline scene::WeatherSample weather_sample(
    const protocol::EnvironmentData& environment, std::int64_t sim_time_ns) noexcept {
  scene::WeatherSample out;
  out.sim_time_ns = sim_time_ns;
  out.direct_normal_w_m2 = environment.direct_normal_w_m2;
  out.diffuse_horizontal_w_m2 = environment.diffuse_horizontal_w_m2;
  out.longwave_down_w_m2 = environment.longwave_down_w_m2;
  out.air_k = environment.air_k;
  out.wind_m_s = environment.wind_m_s;
  out.cloud_frac = environment.cloud_frac;
  out.environment_k = environment.environment_k;
  out.film_w_m2_k = environment.film_w_m2_k;
  if (environment.wind_from_deg) out.wind_from_rad = *environment.wind_from_deg * physics::kDegree;
  out.relative_humidity_frac = environment.relative_humidity_frac;
  out.rain_mm_h = environment.rain_mm_h;
  return out;
}

/// Returns the renderer's form of a host's command to a part.
[[nodiscard]] inline TimedPart timed_part(const protocol::PartCommandData& part,
                                          std::int64_t sim_time_ns) noexcept {
  using From = protocol::PartCommandData::Kind;
  using To = scene::PartCommand::Kind;
  const To kind = part.kind == From::temperature ? To::temperature
                  : part.kind == From::power     ? To::power
                  : part.kind == From::throttle  ? To::throttle
                                                 : To::off;
  return {sim_time_ns, {part.entity_id, part.part_id, {kind, part.value}}};
}

/// One camera's part in a frame.
struct CameraShot {
  bool due = false;    ///< false: no channel of this camera shows the frame
  bool ahead = false;  ///< it shows the instant RenderJob::ahead
  physics::Pose pose;
  double fov_h_rad = 0.0;      ///< horizontal; 0: that of the source
  scene::PixelRect window_px;  ///< part of the image that its channels are made of
};

/// Message of conductor to render agent, in the order in which the source must see it. The weather
/// of a frame is applied first, then its parts and its entities.
struct RenderJob {
  enum class Kind : std::uint8_t { frame, reset };
  Kind kind = Kind::frame;
  /// The part that all shots have in common, with the number of the first one; those that follow
  /// count on. The render agent chooses the quality level.
  renderer::FrameRequest request;
  std::array<CameraShot, kMaxCameras> shots;  ///< by camera
  std::uint64_t rendered_number = 0;          ///< of the frame, counting those that are rendered
  std::int64_t deadline_ns = 0;               ///< when the pixels are due; 0: whenever
  ChannelSet channels = kAllChannels;         ///< channels that the frame is for
  // Motion simulator: what the shift of the image follows from.
  ShownAttitude attitude;
  std::int64_t display_ns = 0;  ///< wall instant at which the frame is shown
  /// The later instant of the shots that look ahead, with the same for it, and where entities will
  /// be that do not stand.
  struct Ahead {
    std::int64_t sim_time_ns = 0;
    ShownAttitude attitude;
    std::int64_t display_ns = 0;
    std::uint32_t entity_count = 0;
    std::array<renderer::EntityUpdate, protocol::kMaxEntitiesPerFrame> entities;
    [[nodiscard]] std::span<const renderer::EntityUpdate> entity_span() const noexcept {
      return {entities.data(), entity_count};
    }
  };
  Ahead ahead;
  std::uint32_t weather_count = 0;
  std::array<scene::WeatherSample, kMaxWeatherPerFrame> weather;
  std::uint32_t part_count = 0;
  std::array<TimedPart, kMaxPartsPerJob> parts;
  std::uint32_t entity_count = 0;
  std::array<renderer::EntityUpdate, protocol::kMaxEntitiesPerFrame> entities;
};

/// Image of a camera in a finished frame.
struct CameraImage {
  bool shown = false;
  renderer::SlotIndex slot = 0;
  physics::Pose pose;
  double fov_h_rad = 0.0;
  std::uint32_t nonfinite_px = 0;
  std::uint32_t clamped_px = 0;
  bool coarse = false;  ///< not prepared for this camera, or small targets without windows
  std::uint8_t quality_level = 0;
  std::int64_t readback_end_ns = 0;  ///< its pixels were in memory
  std::uint32_t flags = 0;           ///< those of kCameraFlags that it has
  float estimated_error_k = 0.0F;
};
/// Flags that cameras of one frame have each for themselves.
inline constexpr std::uint32_t kCameraFlags = protocol::kFlagLate | protocol::kFlagDegraded |
                                              protocol::kFlagNonFinite | protocol::kFlagClamped;

/// Parts of a frame's header that are others for channels that look ahead.
struct AheadImage {
  std::int64_t sim_time_ns = 0;
  std::int64_t display_ns = 0;      ///< 0: not known
  std::uint32_t flags = 0;          ///< those of kAheadFlags that it has
  glm::vec2 wanted_shift_px{0.0F};  ///< by newest measurements, of which `shift_px` is a part
  glm::vec2 shift_px{0.0F};         ///< by which the pictures that shift were moved
};
/// Flags that depend on the instant that an image shows.
inline constexpr std::uint32_t kAheadFlags = protocol::kFlagExtrapolated | protocol::kFlagStale;

/// Pixels of one frame, in memory of the source or that of the images for the same slot.
struct Image {
  FrameSource* source = nullptr;
  renderer::SlotIndex slot = 0;  ///< of the first camera that shows it
  std::size_t camera_count = 1;  ///< above 1: `cameras` has what each showed, and the slots
  std::array<CameraImage, kMaxCameras> cameras;
  ChannelSet channels = kAllChannels;  ///< channels that show it; others have no image
  std::array<std::span<const float>, kMaxPictures> pictures;
  std::array<std::uint32_t, kMaxPictures> crc32c{};
  std::array<std::uint32_t, kMaxPictures> clamped_px{};  ///< by the outputs
  std::array<bool, kMaxPictures> cut{};  ///< shifted further than there is room around them
  /// Shift by which the pictures that shift were moved, right and down in the sensor's image.
  glm::vec2 shift_px{0.0F};
  AheadImage ahead;  ///< where cameras look ahead

  /// Gives the pixels back to the source. RT-safe.
  void release() const noexcept {
    if (camera_count == 1) {
      source->release(slot);
      return;
    }
    for (const CameraImage& camera : cameras) {
      if (camera.shown) source->release(camera.slot);
    }
  }
};

/// Message of render agent to conductor, in order of submission.
struct RenderDone {
  Image image;
  std::uint32_t nonfinite_px = 0;
  std::uint32_t clamped_px = 0;
  std::uint64_t dropped_poses = 0;  ///< of the histories, in this run
  bool coarse = false;              ///< not prepared for a camera, or small targets without windows
  bool warmed_up = false;           ///< the surface warmed up again within this frame
  std::uint8_t quality_level = 0;   ///< quality level, an index into the quality ladder
  float estimated_error_k = 0.0F;   ///< error of that level; NaN: not known
  bool device_failed = false;  ///< the driver reported an error: the pixels are not to be trusted
  /// False: no measurement of the axes is near, so nothing is moved.
  bool shift_known = true;
  bool ahead_shift_known = true;  ///< the same for the images that look ahead
  std::int64_t render_start_ns = 0;
  std::int64_t render_end_ns = 0;
  std::int64_t readback_end_ns = 0;
};

/// Message of conductor to motion agent.
struct MotionInput {
  /// forget: a run begins. reset: the host has asked for it, which closes the interlock too.
  enum class Kind : std::uint8_t { pose, target, forget, reset };
  Kind kind = Kind::pose;
  SeekerPose pose;
  TimedPoint target;
  std::int64_t received_ns = 0;  ///< arrival of the pose, wall
};

/// Message of motion agent to conductor: what the axes do, with a measurement or without.
struct MotionReport {
  std::int64_t at_ns = 0;  ///< when it was made, wall
  bool has_feedback = false;
  AxisFeedback feedback;
  protocol::MotionState state = protocol::MotionState::none;
  std::uint8_t faults = 0;  ///< protocol::MotionFaults
};

/// Message of conductor to sender. The header lacks the fields that depend on channel and client.
struct PublishFrame {
  /// True when the image published last is shown again, by those of image.channels that it has
  /// images for. Of the other members of `image` only `ahead` is set then.
  bool repeat = false;
  Image image;
  protocol::FrameHeader header;
};

}  // namespace emit::server
