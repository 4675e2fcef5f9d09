// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <memory>

#include "emit/protocol/host_frame.hpp"

namespace emit::test {

/// Returns a host frame with this number of entities, on the heap because a HostFrameData is large.
inline std::unique_ptr<protocol::HostFrameData> make_host_frame(std::uint32_t entities) {
  auto frame = std::make_unique<protocol::HostFrameData>();
  frame->frame_number = 42;
  frame->sim_time_ns = -1'500'000'000;
  frame->run_id = 0xABCDEF;
  frame->seeker.position_world_m = {100.25, -200.5, 3000.125};
  frame->seeker.world_from_body = {0.5, 0.5, -0.5, 0.5};
  frame->seeker_rates = protocol::PoseRates{{250.0, 0.0, -3.5}, {0.01, -0.02, 0.03}};
  frame->entity_count = entities;
  for (std::uint32_t i = 0; i < entities; ++i) {
    auto& entity = frame->entities[i];
    entity.entity_id = i * 7;
    entity.has_pose = i % 3 != 1;
    if (entity.has_pose) {
      entity.pose.position_world_m = {i * 1.5, 0.0, -0.25 * i};
      entity.pose.world_from_body = {0.0, 0.6, 0.8, 0.0};
      if (i % 2 == 0) entity.rates = protocol::PoseRates{{1.0 * i, 2.0, 3.0}, {0.0, 0.0, 0.5}};
    }
    entity.on = i % 4 != 3;
    entity.teleport = i % 5 == 0;
  }
  frame->parts[0] = {7, 1, protocol::PartCommandData::Kind::temperature, 612.5};
  frame->parts[1] = {7, 2, protocol::PartCommandData::Kind::power, 0.1};
  frame->parts[2] = {14, 1, protocol::PartCommandData::Kind::throttle, 0.75};
  frame->parts[3] = {14, 65535, protocol::PartCommandData::Kind::off, 0.0};
  frame->part_count = 4;
  auto& environment = frame->environment.emplace();
  environment.direct_normal_w_m2 = 800.0;
  environment.diffuse_horizontal_w_m2 = 90.0;
  environment.longwave_down_w_m2 = 310.0;
  environment.air_k = 288.5;
  environment.wind_m_s = 3.0;
  environment.cloud_frac = 0.25;
  environment.film_w_m2_k = 12.0;
  environment.wind_from_deg = 215.0;
  environment.relative_humidity_frac = 0.65;
  environment.rain_mm_h = 1.5;
  return frame;
}

}  // namespace emit::test
