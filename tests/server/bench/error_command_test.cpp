// SPDX-License-Identifier: Apache-2.0
// The program `emit bench error-vs-time` as a user runs it.
#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

TEST(CliBench, error_vs_time_compares_all_models_without_clutter_and_says_so) {
  const TemporaryFolder folder;
  write_text(folder.file("car.toml"), R"(
materials = ["share:materials/library.toml"]
name = "car"
epoch_utc = 2014-06-21T06:00:00Z
[place]
lat_deg = 48.56
lon_deg = 11.26
height_m = 380.0
[weather]
linke_turbidity = 3.5
air_mean_k = 294.95
air_amplitude_k = 6.05
dew_point_k = 285.15
[thermal]
history_start_s = 0.0
steps = 9
initial_k = 293.15
[sensor]
width_px = 32
height_px = 24
fov_h_deg = 45.0
trajectory = [{ time_s = 12600.0, position_m = [-6.4, -3.6, 5.0], look_at_m = [0, 0, 0.4] }]
[[clutter]]
material = "rubber"
inertia_sd_ln = 0.1
[[object]]
name = "car"
gltf = "share:scenes/car.glb"
)");
  const ProcessResult result =
      run_emit({"bench", "error-vs-time", "--scene", folder.file("car.toml"), "--quick", "--pixels",
                "8", "--rays", "16", "--frames", "1", "--width", "32", "--height", "24", "--json",
                folder.file("error.json")},
               std::chrono::seconds(280));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("[[clutter]] of rubber is left out of reference and settings"),
            std::string::npos)
      << result.err;
  const std::string json = read_text(folder.file("error.json"));
  // The models that refuse clutter ran too.
  for (const char* method : {"\"per-frame\"", "\"cached\"", "\"emit2014\"", "\"foster\""}) {
    EXPECT_NE(json.find(method), std::string::npos) << method;
  }
  EXPECT_NE(json.find("without [[clutter]] in all models"), std::string::npos) << json;
}

}  // namespace
}  // namespace emit::test
