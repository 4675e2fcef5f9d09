// SPDX-License-Identifier: Apache-2.0
#include "agents/sender_client.hpp"

namespace emit::server {

void SenderClient::start(const protocol::FrameHeader& header, std::int64_t now_ns) noexcept {
  header_ = header;
  if (gap) {
    header_.flags |= protocol::kFlagGapBefore;
    gap = false;
  }
  header_.send_start_ns = now_ns;
  header_.previous_age_ns = previous_age_ns_;
  header_.previous_delay_ns = previous_delay_ns_;
  header_.previous_frame_number = previous_frame_number_;
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
  out.payload_bytes = image.planes[channel.plane].size_bytes();
  out.payload_crc32c = image.crc32c[channel.plane];
  return out;
}

void SenderClient::complete(std::int64_t now_ns) noexcept {
  busy_ = false;
  spilled_ = false;
  previous_frame_number_ = header_.frame_number;
  if (header_.host_received_ns != 0) {
    previous_delay_ns_ = now_ns - header_.host_received_ns;
    previous_age_ns_ = previous_delay_ns_ - (header_.sim_time_ns - header_.pose_sim_time_ns);
  }
}

}  // namespace emit::server
