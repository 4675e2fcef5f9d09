// SPDX-License-Identifier: Apache-2.0
#include "agents/receiver/channel_info.hpp"

#include "emit/v1/control.pb.h"

namespace emit::server {

void fill(const Channel& channel, v1::ChannelInfo& out) {
  out.set_index(channel.index);
  out.set_name(channel.name);
  out.set_kind(std::string(to_string(channel.kind)));
  out.set_sensor(channel.sensor);
  out.set_band(channel.band);
  out.set_band_lo_um(channel.band_lo_um);
  out.set_band_hi_um(channel.band_hi_um);
  for (const scene::ResponseSample& sample : channel.response) {
    out.add_response_um(sample.wavelength_um);
    out.add_response_frac(sample.response_frac);
  }
  out.set_band_is_rectangle(channel.response.empty() && channel.band_hi_um > channel.band_lo_um);
  out.set_width_px(channel.width_px);
  out.set_height_px(channel.height_px);
  out.set_every_nth(channel.every_nth);
  out.set_look_ahead_frames(channel.look_ahead_frames);
  out.set_window_x_px(channel.window_px.x_px);
  out.set_window_y_px(channel.window_px.y_px);
  out.set_window_width_px(channel.window_px.width_px);
  out.set_window_height_px(channel.window_px.height_px);
  out.set_output_steps(channel.output_steps);
  out.set_quantity(static_cast<std::uint32_t>(channel.quantity));
  out.set_sensor_width_px(channel.sensor_width_px);
  out.set_sensor_height_px(channel.sensor_height_px);
}

}  // namespace emit::server
