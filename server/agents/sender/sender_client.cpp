// SPDX-License-Identifier: Apache-2.0
#include "agents/sender/sender_client.hpp"

#include <cstdlib>
#include <limits>

#include "emit/physics/check.hpp"

namespace emit::server {

void SenderClient::start(const protocol::FrameHeader& header, std::int64_t now_ns) noexcept {
  EMIT_CHECK(!busy_);
  header_ = header;
  if (gap) {
    header_.flags |= protocol::kFlagGapBefore;
    gap = false;
  }
  header_.send_start_ns = now_ns;
  header_.previous_age_ns = previous_age_ns_;
  header_.previous_delay_ns = previous_delay_ns_;
  header_.previous_frame_number = previous_frame_number_;
  header_.previous_jitter_ns = static_cast<std::int64_t>(jitter_ns_);
  busy_ = true;
  spilled_ = false;
}

protocol::FrameHeader SenderClient::header_for(const Channel& channel,
                                               const Image& image) const noexcept {
  protocol::FrameHeader out = header_;
  out.channel_kind = static_cast<std::uint8_t>(channel.kind);
  out.channel_index = channel.index;
  out.width_px = channel.width_px;
  out.height_px = channel.height_px;
  out.band_lo_um = static_cast<float>(channel.band_lo_um);
  out.band_hi_um = static_cast<float>(channel.band_hi_um);
  out.output_steps = channel.output_steps;
  if (image.camera_count > 1) {
    const CameraImage& camera = image.cameras[channel.camera];
    out.pose = camera.pose;
    out.fov_h_rad = static_cast<float>(camera.fov_h_rad);
    out.nonfinite_px = camera.nonfinite_px;
    out.clamped_px = camera.clamped_px;
    out.estimated_error_k = camera.estimated_error_k;
    out.readback_end_ns = camera.readback_end_ns;
    out.flags = (out.flags & ~kCameraFlags) | camera.flags;
    // A frame that is shown again is in time.
    if ((out.flags & protocol::kFlagRepeated) != 0) {
      out.flags &= ~std::uint32_t{protocol::kFlagLate};
    }
  }
  glm::vec2 shift_px = image.shift_px;
  if (channel.look_ahead_frames > 0) {
    out.sim_time_ns = image.ahead.sim_time_ns;
    out.display_ns = image.ahead.display_ns;
    out.flags = (out.flags & ~kAheadFlags) | image.ahead.flags;
    out.shift_x_px = image.ahead.wanted_shift_px.x;
    out.shift_y_px = image.ahead.wanted_shift_px.y;
    shift_px = image.ahead.shift_px;
  }
  if (channel.kind == scene::ChannelKind::injection && out.display_ns != 0) {
    // The axes do not stand between this image and its detector.
    out.shift_x_px = out.shift_y_px = 0.0F;
    out.pointing_error_px = std::numeric_limits<float>::quiet_NaN();
    out.display_ns = 0;
  }
  // Pixels that do not lie as in the sensor's image have no window there.
  if ((channel.output_steps & protocol::kOutputMoved) == 0) {
    out.window_x_px = channel.window_px.x_px;
    out.window_y_px = channel.window_px.y_px;
    out.sensor_width_px = channel.sensor_width_px;
    out.sensor_height_px = channel.sensor_height_px;
  }
  if ((channel.output_steps & protocol::kOutputShifted) != 0) {
    out.applied_shift_x_px = shift_px.x;
    out.applied_shift_y_px = shift_px.y;
    // 0 remains, unless the image is shown again and the axes have moved on.
    out.shift_x_px -= shift_px.x;
    out.shift_y_px -= shift_px.y;
  }
  out.quantity = channel.quantity;
  if (const std::uint32_t clamped_px = image.clamped_px[channel.picture]; clamped_px > 0) {
    out.clamped_px += clamped_px;
    out.flags |= protocol::kFlagClamped;
  }
  if (image.cut[channel.picture]) out.flags |= protocol::kFlagMotionFault;
  out.payload_bytes = image.pictures[channel.picture].size_bytes();
  out.payload_crc32c = image.crc32c[channel.picture];
  return out;
}

void SenderClient::complete(std::int64_t now_ns) noexcept {
  busy_ = false;
  spilled_ = false;
  previous_frame_number_ = header_.frame_number;
  delay_change_ns_.reset();
  if (header_.host_received_ns != 0) {
    const std::int64_t delay_ns = now_ns - header_.host_received_ns;
    if (have_delay_) {
      delay_change_ns_ = std::abs(delay_ns - previous_delay_ns_);
      jitter_ns_ += (static_cast<double>(*delay_change_ns_) - jitter_ns_) / 16.0;
    }
    have_delay_ = true;
    previous_delay_ns_ = delay_ns;
    previous_age_ns_ = previous_delay_ns_ - (header_.sim_time_ns - header_.pose_sim_time_ns);
  }
}

}  // namespace emit::server
