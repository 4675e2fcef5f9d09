// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "emit/protocol/record/log.hpp"
#include "emit/v1/control.pb.h"

/// A scenario that renders in moments, and what its journals hold.
namespace emit::test {

/// Scenario of a block that casts a shadow on a road, and a box that drives by.
inline std::string small_world(const std::string& method) {
  return R"(epoch_utc = 2020-06-21T10:00:00Z
[place]
lat_deg = 48.0
lon_deg = 11.0
[[object]]
gltf = "share:scenes/block-on-road.glb"
[[object]]
entity_id = 1
gltf = "share:scenes/box.glb"
trajectory = [
  { time_s = -3600, position_m = [5, 5, 0], heading_deg = 90 },
  { time_s = 0, position_m = [5, 5, 0], heading_deg = 90 },
  { time_s = 5, position_m = [4, 2, 0], heading_deg = 180 },
  { time_s = 40, position_m = [-6, 2, 0], heading_deg = 270 },
]
[sensor]
width_px = 48
height_px = 36
trajectory = [
  { time_s = 0, position_m = [-16, -15, 15], look_at_m = [0, 0, 0] },
  { time_s = 40, position_m = [-10, -15, 15], look_at_m = [0, 0, 0] },
]
[thermal]
max_samples = 4000
shadow_map_px = 256
history_start_s = -600
spin_up_s = 3600
method = ")" +
         method + "\"\n";
}

/// Key of a frame in a journal: its run and its number.
using FrameKey = std::pair<std::uint64_t, std::uint64_t>;

/// CRCs of a journal's frames, and its runs in their order.
struct Journal {
  std::map<FrameKey, std::uint32_t> crcs;
  std::vector<std::uint64_t> runs;

  explicit Journal(const std::string& file) {
    auto log = protocol::LogReader::open(file);
    EXPECT_TRUE(log.has_value()) << log.error().text;
    std::uint64_t run_id = 0;
    for (auto more = log->next(); more && *more; more = log->next()) {
      const v1::JournalEntry& entry = log->journal();
      if (entry.has_run_start()) run_id = entry.run_start().run_id();
      if (!entry.has_frame()) continue;
      if (runs.empty() || runs.back() != run_id) runs.push_back(run_id);
      crcs[{run_id, entry.frame().frame_number()}] = entry.frame().radiance_crc32c();
    }
  }
};

}  // namespace emit::test
