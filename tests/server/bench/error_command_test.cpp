// SPDX-License-Identifier: Apache-2.0
// The program `emit bench error-vs-time` as a user runs it.
#include <gtest/gtest.h>

#include <chrono>
#include <string>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

/// Place, weather and sensor of the scenes below.
constexpr const char* kPlace = R"(
materials = ["share:materials/library.toml"]
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
)";

TEST(CliBench, error_vs_time_compares_all_models_without_clutter_and_says_so) {
  const TemporaryFolder folder;
  write_text(folder.file("car.toml"), std::string(R"(
name = "car"
)") + kPlace + R"(
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

TEST(CliBench, error_vs_time_leaves_out_settings_that_a_scene_refuses_and_says_why) {
  // Draw one leaning sheet, which the method per-frame refuses with the model foster.
  const TemporaryFolder folder;
  write_text(folder.file("sheet.gltf"),
             R"({
"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
"materials": [{"name": "painted_metal", "doubleSided": true}],
"buffers": [{"byteLength": 60, "uri": "data:application/octet-stream;base64,)"
             "AACAv83MTD4AAAAAAACAP83MTD4AAAAAAACAP83MDEAAAAA/AACAv83MDEAAAAA/AAABAAIAAAACAAMA"
             R"("}],
"bufferViews": [{"buffer": 0, "byteLength": 48, "byteOffset": 0},
                {"buffer": 0, "byteLength": 12, "byteOffset": 48}],
"accessors": [{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
               "min": [-1, 0.2, 0], "max": [1, 2.2, 0.5]},
              {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}]})");
  write_text(folder.file("sheet.toml"), std::string(R"(
name = "sheet"
)") + kPlace + R"(
[[object]]
name = "sheet"
gltf = "sheet.gltf"
)");
  const ProcessResult result =
      run_emit({"bench", "error-vs-time", "--scene", folder.file("sheet.toml"), "--quick",
                "--pixels", "8", "--rays", "16", "--frames", "1", "--width", "32", "--height", "24",
                "--json", folder.file("error.json")},
               std::chrono::seconds(280));
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.err.find("sheet.toml: settings with it are left out: "), std::string::npos)
      << result.err;
  const std::string json = read_text(folder.file("error.json"));
  EXPECT_NE(json.find("\"cached\""), std::string::npos) << json;
  const std::size_t left_out = json.find("\"left_out\"");
  ASSERT_NE(left_out, std::string::npos) << json;
  EXPECT_NE(json.find("are sheets", left_out), std::string::npos) << json;
}

}  // namespace
}  // namespace emit::test
