// SPDX-License-Identifier: Apache-2.0
// Frames of a material with a spectrum against those of the folded numbers by hand.
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "emit/config/load.hpp"
#include "emit/renderer/renderer.hpp"

namespace emit::test {
namespace {

/// A cube of one material in sunlight, two bands.
std::string cube(const std::string& emissivity) {
  return R"(
materials = []
epoch_utc = 2014-06-21T06:00:00Z
default_material = "x"
[place]
lat_deg = 48.0
lon_deg = 11.0
[thermal]
steps = 5
[sensor]
width_px = 96
height_px = 64
position_m = [-6.0, -5.0, 5.0]
look_at_m = [0.0, 0.0, 0.5]
[[band]]
name = "bell"
response = [[7.5, 0], [9, 1], [13, 0.2]]
[[channel]]
name = "a"
band = "3-5"
[[channel]]
name = "b"
band = "bell"
[[object]]
gltf = "share:scenes/box.glb"
material = "x"
[[material]]
name = "x"
solar_absorptance_frac = 0.6
base_k = 290
layers = [{ thickness_m = 0.1, conductivity_w_m_k = 1, density_kg_m3 = 2000, specific_heat_j_kg_k = 900 }]
)" + emissivity;
}

scene::ScenarioDesc load(const std::string& name, const std::string& emissivity) {
  const std::filesystem::path folder =
      std::filesystem::path(EMIT_TEST_BINARY_DIR) / "tests" / "renderer" / "emissivity_frames";
  std::filesystem::create_directories(folder);
  const std::filesystem::path file = folder / name;
  std::ofstream(file) << cube(emissivity);
  auto scenario = config::load_scenario(file);
  EXPECT_TRUE(scenario) << scenario.error().text;
  return scenario ? *scenario : scene::ScenarioDesc{};
}

/// Radiance of both bands, one behind the other.
std::vector<float> picture(const scene::ScenarioDesc& scenario) {
  auto renderer = renderer::Renderer::create(scenario, {}, {});
  EXPECT_TRUE(renderer) << renderer.error().text;
  if (!renderer) return {};
  renderer::FrameRequest request;
  request.sim_time_ns = request.thermal_time_ns = 12'600'000'000'000;
  request.sensor_pose = (*renderer)->scenario_sensor_pose_at(request.sim_time_ns);
  const int slot = (*renderer)->submit(request);
  EXPECT_GE(slot, 0);
  const auto& frame = (*renderer)->collect(static_cast<renderer::SlotIndex>(slot));
  std::vector<float> out;
  for (const auto& band : frame.radiance_w_m2_sr) out.insert(out.end(), band.begin(), band.end());
  (*renderer)->release(static_cast<renderer::SlotIndex>(slot));
  return out;
}

TEST(EmissivityFrames, a_spectrum_shows_what_its_folded_numbers_show) {
  const scene::ScenarioDesc folded =
      load("spectrum.toml",
           "emissivity_spectrum = [[2.5, 0.55], [4, 0.8], [8, 0.95], [9.5, 0.7], [40, 0.9]]\n");
  ASSERT_FALSE(folded.materials.empty());
  const scene::Material& x = folded.materials.back();
  ASSERT_EQ(x.emissivity_spectrum.bands.size(), 2U);
  ASSERT_TRUE(x.emissivity_spectrum.total);
  const auto by_hand = [&](double more_frac) {
    std::string text = fmt::format("emissivity_frac = {}\nband_emissivity_frac = {{ ",
                                   x.emissivity_spectrum.total->emissivity_frac);
    for (const scene::FoldedBand& band : x.emissivity_spectrum.bands) {
      text += fmt::format("{}\"{}\" = {}", band.band == "3-5" ? "" : ", ", band.band,
                          band.emissivity_frac + more_frac);
    }
    return text + " }\n";
  };
  const std::vector<float> a = picture(folded);
  const std::vector<float> b = picture(load("by_hand.toml", by_hand(0.0)));
  ASSERT_EQ(a.size(), 2U * 96U * 64U);
  ASSERT_EQ(a.size(), b.size());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(float)), 0);
  const std::vector<float> other = picture(load("other.toml", by_hand(0.01)));
  EXPECT_NE(std::memcmp(a.data(), other.data(), a.size() * sizeof(float)), 0);
}

}  // namespace
}  // namespace emit::test
