// SPDX-License-Identifier: Apache-2.0
#include "tool/support/recorded_frame.hpp"

#include <algorithm>
#include <vector>

#include "emit/v1/control.pb.h"
#include "emit/v1/frame.pb.h"

namespace emit::tool {

image::FrameMetadata metadata_of(const v1::RecordedFrame& frame,
                                 const protocol::FrameHeader& header) {
  const v1::ChannelInfo& channel = frame.channel();
  std::vector<physics::ResponsePoint> response;
  const int samples = std::min(channel.response_um_size(), channel.response_frac_size());
  for (int i = 0; i < samples; ++i) {
    response.push_back({channel.response_um(i), channel.response_frac(i)});
  }
  return {frame.sim_time_ns(),  frame.frame_number(), header.pose,  channel.band(),
          channel.band_lo_um(), channel.band_hi_um(), frame.unit(), response,
          header.fov_h_rad};
}

}  // namespace emit::tool
