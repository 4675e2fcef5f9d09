// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <sstream>

#include "config/config_support.hpp"
#include "emit/config/slab_modes.hpp"
#include "emit/physics/constants.hpp"

namespace emit::config::testing {
namespace {

using physics::kDegree;

/// Every key of the table that does not exclude another one, with a value unlike its default.
const std::string kFull = R"(
name = "full"
epoch_utc = 2020-02-29T13:14:15.250+02:00
default_material = "hot"

[place]
lat_deg = -33.8568
lon_deg = 151.2153
height_m = 12.5

[weather]
linke_turbidity = 4.25
air_mean_k = 281.5
air_amplitude_k = 3.75
dew_point_k = 275.25
wind_m_s = 7.5
cloud_frac = 0.4

[atmosphere]
enabled = false
model = "tropical"
[[atmosphere.band]]
band = "det"
terms = [[0.25, 0.5], [0.75, 0.0625]]
vertical_transmittance_frac = 0.55

[thermal]
model = "foster"
method = "per-frame"
tolerance_k = 0.25
initial_k = 288.5
history_start_s = -1800.5
spin_up_s = 90000.5
surroundings_material = "deep"
foster_modes = 3
steps = 90
spacing = "uniform"
first_step_s = 12.5
shadow_map_px = 512
max_cascades = 3
blocker_taps = 4
filter_taps = 16
obscurance_radius_m = 0.75
state_file = "warm.emitstate"

[sensor]
name = "cam"
width_px = 320
height_px = 256
fov_h_deg = 12.3
fov_h_min_deg = 6.0
near_m = 0.25
[[sensor.trajectory]]
time_s = 0.0
position_m = [1.0, 2.0, 3.0]
look_at_m = [10.0, 5.0, 0.0]
[[sensor.trajectory]]
time_s = 2.5
position_m = [1.5, 2.5, 3.5]
heading_deg = 33.0
pitch_deg = -7.0
roll_deg = 2.0
teleport = true

[display]
min_k = 270.5
max_k = 350.5

[[band]]
name = "det"
lo_um = 3.2
hi_um = 4.9
response = [[3.0, 0.0], [4.0, 1.0], [5.0, 0.5]]

[[channel]]
name = "a"
kind = "projector"
band = "det"
[[channel]]
name = "b"
kind = "injection"
band = "7.7-9.3"
window_px = [8, 16, 48, 32]
every_nth = 4
fov_h_deg = 8.0
offset_m = [1.0, -2.0, 0.5]
yaw_pitch_roll_deg = [90.0, -45.0, 0.0]
carrier_entity = 11
[[channel]]
name = "array"
kind = "projector"
band = "det"
mirror = "both"
rotate_deg = 270
distortion_file = "map.exr"
outside_w_m2_sr = 1.5
apply_shift = true
nuc_file = "nuc.exr"
drive_table_file = "drive.csv"
[[channel]]
name = "barrel"
band = "det"
distortion_radial = [0.125, -0.25, 0.5]
distortion_tangential = [0.0625, -0.03125]
[[channel]]
name = "seen"
band = "det"
[channel.optics]
spot = "airy"
airy_px = 1.25
obscuration_frac = 0.375
vignetting = true
[channel.detector]
reference_k = 310.0
netd_k = 0.0625
photon_frac = 0.5
row_noise_k = 0.03125
column_noise_k = 0.015625
gain_spread_frac = 0.25
offset_spread_k = 0.75
bad_px_frac = 0.125
seed = 77
counts_per_w_m2_sr = 512.0
counts_offset = 64.0
counts_bits = 12

[[object]]
name = "ground"
gltf = "ground.glb"
material = "concrete"
scale = 2.5
instances = [
  { position_m = [1.0, 2.0, 3.0], heading_deg = 45.0 },
  { position_m = [4.0, 5.0, 6.0], attitude_wxyz = [0.5, 0.5, 0.5, 0.5] },
]
[[object]]
name = "truck"
gltf = "truck.gltf"
entity_id = 11
on = false
position_m = [7.0, 8.0, 9.0]
heading_deg = 123.4
pitch_deg = 5.0
roll_deg = -6.0
material_map = { body = "hot", "wheel left" = "concrete" }
[[object.material_images]]
material = "Body"
image = "parts.png"
legend = { "#4A5d23" = "hot", "#000000" = "concrete" }
smallest_patch_px = 8
[[object]]
name = "jet"
gltf = "jet.glb"
entity_id = 12
trajectory = [
  { time_s = -1.0, position_m = [0.0, 0.0, 100.0], heading_deg = 90.0, on = false },
  { time_s = 4.0, position_m = [50.0, 0.0, 100.0], heading_deg = 100.0, teleport = true },
]
[[object.parts]]
name = "engine"
material = "concrete"
id = 9
idle_k = 350.5
full_k = 450.25
cold_k = 280.5
up_s = 60.5
down_s = 300.25
commands = [
  { time_s = -1.0, throttle = 0.25 },
  { time_s = 2.5, off = true },
]
[[object.parts]]
name = "pipe"
material = "deep"
commands = [
  { time_s = 0.0, temperature_k = 600.5 },
  { time_s = 1.5, power_w_m2 = 900.25 },
]

[[material]]
name = "hot"
solar_absorptance_frac = 0.7
emissivity_frac = 0.85
band_emissivity_frac = { det = 0.8, "3-5" = 0.75 }
prescribed_k = 450.5
family = "parts"
source = "s \"quoted\""
spread = { solar_absorptance_frac = 0.125, emissivity_frac = 0.0625, band_emissivity_frac = { det = 0.25 }, conductivity_frac = 0.5, heat_capacity_frac = 0.375 }
uncertainty = "u"
[[material]]
name = "deep"
solar_absorptance_frac = 0.3
emissivity_frac = 0.95
base_k = 285.5
initial_k = 287.25
core_conductance_w_m2_k = 7.5
modes = [{ tau_s = 100.5, weight_frac = 0.375 }, { tau_s = 2000.0, weight_frac = 0.625 }]
foster_modes = [{ tau_s = 50.5, resistance_m2k_w = 0.0714 }, { tau_s = 9000.0, resistance_m2k_w = 0.25 }]
foster_fit = { horizon_s = 99000.0, rms_k = 0.125, max_k = 0.75 }
wetness_frac = 0.625
surface_resistance_s_m = 90.5
night_resistance_s_m = 300.25
water_store_mm = 1.75
dry_layers_valid = false
gloss = { wavelength_um = [4.0, 10.0], refractive_index = [1.25, 1.125], extinction_index = [0.0, 0.0625], lobe_frac = 0.75, facet_slope = 0.125 }
layers = [
  { thickness_m = 0.05, conductivity_w_m_k = 0.7, density_kg_m3 = 2120.0, specific_heat_j_kg_k = 920.0 },
  { thickness_m = 0.5, conductivity_w_m_k = 2.0, density_kg_m3 = 1900.0, specific_heat_j_kg_k = 850.0 },
]
)";

TEST_F(ConfigTest, every_scenario_key_reaches_its_field) {
  const auto loaded = scenario(kFull);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const scene::ScenarioDesc& s = *loaded;
  EXPECT_EQ(s.name, "full");
  EXPECT_EQ(s.file, folder_ / "s.toml");
  EXPECT_EQ(s.epoch_utc_ns, 1'582'974'855'250'000'000);
  EXPECT_EQ(s.default_material, "hot");
  EXPECT_EQ(s.place.lat_rad, -33.8568 * kDegree);
  EXPECT_EQ(s.place.lon_rad, 151.2153 * kDegree);
  EXPECT_EQ(s.place.height_m, 12.5);
  EXPECT_TRUE(s.weather.empty());
  EXPECT_EQ(s.clear_sky.linke_turbidity, 4.25);
  EXPECT_EQ(s.clear_sky.air_mean_k, 281.5);
  EXPECT_EQ(s.clear_sky.air_amplitude_k, 3.75);
  EXPECT_EQ(s.clear_sky.dew_point_k, 275.25);
  EXPECT_EQ(s.clear_sky.wind_m_s, 7.5);
  EXPECT_EQ(s.clear_sky.cloud_frac, 0.4);
  EXPECT_FALSE(s.atmosphere.enabled);
  ASSERT_EQ(s.atmosphere.bands.size(), 2U);
  EXPECT_EQ(s.atmosphere.bands[0].terms[1].amplitude_frac, 0.75);
  EXPECT_EQ(s.atmosphere.bands[0].vertical_transmittance_frac, 0.55);
  ASSERT_TRUE(s.atmosphere.bands[1].model);
  EXPECT_EQ(s.atmosphere.bands[1].model->climate, physics::AirClimate::tropical);
  EXPECT_EQ(s.thermal.tolerance_k, 0.25);
  EXPECT_EQ(s.thermal.initial_k, 288.5);
  EXPECT_EQ(s.thermal.history_start_ns, -1'800'500'000'000);
  EXPECT_EQ(s.thermal.model, scene::ThermalModel::foster);
  EXPECT_EQ(s.thermal.spin_up_ns, 90'000'500'000'000);
  EXPECT_EQ(s.thermal.surroundings_material, "deep");
  EXPECT_EQ(s.thermal.foster_modes, 3U);
  EXPECT_EQ(s.thermal.steps, 90U);
  EXPECT_EQ(s.thermal.spacing, scene::StepSpacing::uniform);
  EXPECT_EQ(s.thermal.first_step_s, 12.5);
  EXPECT_EQ(s.thermal.shadow_map_px, 512U);
  EXPECT_EQ(s.thermal.max_cascades, 3U);
  EXPECT_EQ(s.thermal.blocker_taps, 4U);
  EXPECT_EQ(s.thermal.filter_taps, 16U);
  EXPECT_EQ(s.thermal.obscurance_radius_m, 0.75);
  EXPECT_EQ(s.thermal.state_file, s.file.parent_path() / "warm.emitstate");
  EXPECT_EQ(s.sensor.name, "cam");
  EXPECT_EQ(s.sensor.width_px, 320U);
  EXPECT_EQ(s.sensor.height_px, 256U);
  EXPECT_EQ(s.sensor.fov_h_rad, 12.3 * kDegree);
  EXPECT_EQ(s.sensor.near_m, 0.25);
  ASSERT_EQ(s.sensor.trajectory.size(), 2U);
  EXPECT_EQ(s.sensor.trajectory[1].sim_time_ns, 2'500'000'000);
  EXPECT_TRUE(s.sensor.trajectory[1].teleport);
  EXPECT_EQ(s.display.min_k, 270.5);
  EXPECT_EQ(s.display.max_k, 350.5);
  ASSERT_EQ(s.bands.size(), 2U);
  EXPECT_EQ(s.bands[0].name, "det");
  EXPECT_EQ(s.bands[0].lo_um, 3.2);
  EXPECT_EQ(s.bands[0].hi_um, 4.9);
  EXPECT_EQ(s.bands[0].response.size(), 3U);
  EXPECT_EQ(s.bands[1].name, "7.7-9.3");
  EXPECT_EQ(s.bands[1].lo_um, 7.7);
  ASSERT_EQ(s.channels.size(), 5U);
  EXPECT_EQ(s.channels[0].kind, scene::ChannelKind::projector);
  EXPECT_EQ(s.channels[0].band, "det");
  EXPECT_TRUE(s.channels[0].window_px.empty());
  EXPECT_EQ(s.channels[0].every_nth, 1U);
  EXPECT_EQ(s.channels[1].window_px, (scene::PixelRect{8, 16, 48, 32}));
  EXPECT_EQ(s.channels[1].every_nth, 4U);
  EXPECT_EQ(s.channels[0].camera, scene::ChannelCamera{});
  EXPECT_EQ(s.channels[1].camera.fov_h_rad, 8.0 * kDegree);
  EXPECT_EQ(s.channels[1].camera.offset_body_m, glm::dvec3(1.0, -2.0, 0.5));
  EXPECT_EQ(s.channels[1].camera.yaw_pitch_roll_rad, glm::dvec3(90.0, -45.0, 0.0) * kDegree);
  EXPECT_EQ(s.channels[0].output, scene::ChannelOutput{});
  const scene::ChannelOutput& output = s.channels[2].output;
  EXPECT_EQ(output.mirror, scene::PictureMirror::both);
  EXPECT_EQ(output.rotate_deg, 270U);
  EXPECT_EQ(output.distortion_file, folder_ / "map.exr");
  EXPECT_EQ(output.outside_w_m2_sr, 1.5);
  EXPECT_TRUE(output.apply_shift);
  EXPECT_EQ(output.nuc_file, folder_ / "nuc.exr");
  EXPECT_EQ(output.drive_table_file, folder_ / "drive.csv");
  EXPECT_EQ(s.channels[3].output.distortion_radial, (std::array{0.125, -0.25, 0.5}));
  EXPECT_EQ(s.channels[3].output.distortion_tangential, (std::array{0.0625, -0.03125}));
  const scene::ChannelOutput& seen = s.channels[4].output;
  EXPECT_EQ(seen.optics, (scene::ChannelOptics{.spot = scene::SpotKind::airy,
                                               .airy_px = 1.25,
                                               .obscuration_frac = 0.375,
                                               .vignetting = true}));
  EXPECT_EQ(seen.detector, (scene::ChannelDetector{.reference_k = 310.0,
                                                   .netd_k = 0.0625,
                                                   .photon_frac = 0.5,
                                                   .row_noise_k = 0.03125,
                                                   .column_noise_k = 0.015625,
                                                   .gain_spread_frac = 0.25,
                                                   .offset_spread_k = 0.75,
                                                   .bad_px_frac = 0.125,
                                                   .seed = 77,
                                                   .counts_per_w_m2_sr = 512.0,
                                                   .counts_offset = 64.0,
                                                   .counts_bits = 12}));
  ASSERT_EQ(s.objects.size(), 3U);
  EXPECT_EQ(s.objects[0].gltf, folder_ / "ground.glb");
  EXPECT_EQ(s.objects[0].material, "concrete");
  EXPECT_EQ(s.objects[0].scale, 2.5);
  ASSERT_EQ(s.objects[0].instances.size(), 2U);
  EXPECT_EQ(s.objects[0].instances[1].position_world_m, glm::dvec3(4, 5, 6));
  EXPECT_EQ(s.objects[0].instances[1].world_from_body.z, 0.5);
  EXPECT_EQ(s.objects[1].entity_id, 11U);
  EXPECT_FALSE(s.objects[1].on);
  EXPECT_EQ(s.objects[1].material_map.at("wheel left"), "concrete");
  const scene::MaterialImage image{
      "Body", folder_ / "parts.png", {{{0, 0, 0}, "concrete"}, {{0x4a, 0x5d, 0x23}, "hot"}}, 8};
  EXPECT_EQ(s.objects[1].material_images, std::vector{image});
  ASSERT_EQ(s.objects[2].trajectory.size(), 2U);
  EXPECT_FALSE(s.objects[2].trajectory[0].on);
  EXPECT_TRUE(s.objects[2].trajectory[1].teleport);
  ASSERT_EQ(s.objects[2].parts.size(), 2U);
  using Kind = scene::PartCommand::Kind;
  const scene::PartDesc& engine = s.objects[2].parts[0];
  EXPECT_EQ(engine.id, 9U);
  EXPECT_EQ(engine.name, "engine");
  EXPECT_EQ(engine.material, "concrete");
  EXPECT_TRUE(engine.curve.given);
  EXPECT_EQ(engine.curve.idle_k, 350.5);
  EXPECT_EQ(engine.curve.full_k, 450.25);
  EXPECT_EQ(engine.curve.cold_k, 280.5);
  EXPECT_EQ(engine.curve.up_s, 60.5);
  EXPECT_EQ(engine.curve.down_s, 300.25);
  ASSERT_EQ(engine.commands.size(), 2U);
  EXPECT_EQ(engine.commands[0].sim_time_ns, -1'000'000'000);
  EXPECT_EQ(engine.commands[0].command, (scene::PartCommand{Kind::throttle, 0.25}));
  EXPECT_EQ(engine.commands[1].command, (scene::PartCommand{Kind::off, 0.0}));
  const scene::PartDesc& pipe = s.objects[2].parts[1];
  EXPECT_EQ(pipe.id, 2U) << "its place in the list";
  EXPECT_FALSE(pipe.curve.given);
  EXPECT_EQ(pipe.commands[0].command, (scene::PartCommand{Kind::temperature, 600.5}));
  EXPECT_EQ(pipe.commands[1].command, (scene::PartCommand{Kind::power, 900.25}));
  ASSERT_EQ(s.materials.size(), 3U);  // the library's concrete first
  EXPECT_EQ(s.materials[1].prescribed_k, 450.5);
  EXPECT_EQ(s.materials[1].source, "s \"quoted\"");
  ASSERT_EQ(s.materials[1].band_emissivity.size(), 2U);
  EXPECT_EQ(s.materials[1].family, "parts");
  ASSERT_TRUE(s.materials[1].spread.has_value());
  EXPECT_EQ(s.materials[1].spread->solar_absorptance_frac, 0.125);
  EXPECT_EQ(s.materials[1].spread->emissivity_frac, 0.0625);
  ASSERT_EQ(s.materials[1].spread->band_emissivity.size(), 1U);
  EXPECT_EQ(s.materials[1].spread->band_emissivity[0].emissivity_frac, 0.25);
  EXPECT_EQ(s.materials[1].spread->conductivity_frac, 0.5);
  EXPECT_EQ(s.materials[1].spread->heat_capacity_frac, 0.375);
  EXPECT_FALSE(s.materials[2].spread.has_value());
  EXPECT_EQ(s.materials[2].initial_k, 287.25);
  EXPECT_EQ(s.materials[2].base_k, 285.5);
  EXPECT_EQ(s.materials[2].layers[1].density_kg_m3, 1900.0);
  EXPECT_EQ(s.materials[2].modes[1].weight_frac, 0.625);
  EXPECT_EQ(s.materials[2].core_conductance_w_m2_k, 7.5);
  ASSERT_EQ(s.materials[2].foster_modes.size(), 2U);
  EXPECT_EQ(s.materials[2].foster_modes[1].tau_s, 9000.0);
  EXPECT_EQ(s.materials[2].foster_modes[1].resistance_m2k_w, 0.25);
  ASSERT_TRUE(s.materials[2].foster_fit.has_value());
  EXPECT_EQ(s.materials[2].foster_fit->max_k, 0.75);
  EXPECT_EQ(s.materials[2].wetness_frac, 0.625);
  EXPECT_EQ(s.materials[2].surface_resistance_s_m, 90.5);
  EXPECT_EQ(s.materials[2].night_resistance_s_m, 300.25);
  EXPECT_EQ(s.materials[2].water_store_mm, 1.75);
  EXPECT_FALSE(s.materials[2].readily_evaporable_mm);
  EXPECT_EQ(scene::water_store_of(s.materials[2]).kind, physics::WaterStore::Kind::film);
  EXPECT_EQ(scene::moisture_of(s.materials[2]).night_resistance_s_m, 300.25);
  EXPECT_TRUE(scene::moisture_of(s.materials[1]).dry());
  ASSERT_TRUE(s.materials[2].gloss.has_value());
  EXPECT_EQ(s.materials[2].gloss->refractive_index, (std::vector<double>{1.25, 1.125}));
  EXPECT_EQ(s.materials[2].gloss->extinction_index, (std::vector<double>{0.0, 0.0625}));
  EXPECT_EQ(s.materials[2].gloss->lobe_frac, 0.75);
  EXPECT_EQ(s.materials[2].gloss->facet_slope, 0.125);
  EXPECT_FALSE(s.materials[2].dry_layers_valid);
  EXPECT_TRUE(s.materials[1].dry_layers_valid);
}

TEST_F(ConfigTest, foster_is_the_default_and_a_short_history_spins_up_for_two_days) {
  const std::string object = "[[object]]\ngltf = \"a.glb\"\n";
  EXPECT_EQ(scenario(object)->thermal.model, scene::ThermalModel::foster);
  for (const char* const history :
       {"thermal.history_start_s=0", "thermal.steps=27", "thermal.method=per-frame"}) {
    SCOPED_TRACE(history);
    EXPECT_EQ(scenario(object, {history})->thermal.spin_up_ns, 172'800'000'000'000);
    EXPECT_EQ(scenario(object, {history, "thermal.model=emit2014"})->thermal.spin_up_ns, 0);
  }
  const auto none = scenario(object, {"thermal.model=foster", "thermal.spin_up_s=0"});
  EXPECT_EQ(none->thermal.spin_up_ns, 0);
}

TEST_F(ConfigTest, attitudes_point_where_the_keys_say) {
  const auto loaded = scenario(kFull);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const physics::Pose& looking = loaded->sensor.trajectory[0].pose;
  const glm::dvec3 axis = looking.world_from_body * glm::dvec3(1, 0, 0);
  const glm::dvec3 wanted = glm::normalize(glm::dvec3(9, 3, -3));
  EXPECT_NEAR(glm::distance(axis, wanted), 0.0, 1e-12);
  const glm::dvec3 nose = loaded->objects[1].instances[0].world_from_body * glm::dvec3(1, 0, 0);
  EXPECT_NEAR(nose.x, std::sin(123.4 * kDegree) * std::cos(5.0 * kDegree), 1e-12);
  EXPECT_NEAR(nose.y, std::cos(123.4 * kDegree) * std::cos(5.0 * kDegree), 1e-12);
  EXPECT_NEAR(nose.z, std::sin(5.0 * kDegree), 1e-12);
}

TEST_F(ConfigTest, a_printed_scenario_loads_to_the_same_values) {
  const auto first = scenario(kFull);
  ASSERT_TRUE(first.has_value()) << first.error().text;
  const std::string printed = print_scenario(*first);
  const auto second = load_scenario(write("printed.toml", printed), {}, options_);
  ASSERT_TRUE(second.has_value()) << second.error().text << "\n" << printed;
  EXPECT_EQ(print_scenario(*second), printed);
  EXPECT_EQ(second->place.lat_rad, first->place.lat_rad);
  EXPECT_EQ(second->place.lon_rad, first->place.lon_rad);
  EXPECT_EQ(second->sensor.fov_h_rad, first->sensor.fov_h_rad);
  EXPECT_EQ(second->epoch_utc_ns, first->epoch_utc_ns);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(second->sensor.trajectory[i].pose.world_from_body,
              first->sensor.trajectory[i].pose.world_from_body);
  }
  EXPECT_EQ(second->materials.size(), first->materials.size());
  EXPECT_EQ(second->materials[0].modes[0].tau_s, first->materials[0].modes[0].tau_s);
}

TEST_F(ConfigTest, every_listed_value_is_an_override_that_changes_nothing) {
  const auto first = scenario(kFull);
  ASSERT_TRUE(first.has_value()) << first.error().text;
  const std::string printed = print_scenario(*first);
  const auto file = write("printed.toml", printed);
  const std::vector<ConfigValue> values = list_values(printed);
  EXPECT_GT(values.size(), 60U);
  for (const ConfigValue& one : values) {
    const std::vector<std::string> overrides{one.key + "=" + one.value};
    const auto again = load_scenario(file, overrides, options_);
    ASSERT_TRUE(again.has_value()) << overrides[0] << "\n" << again.error().text;
    EXPECT_EQ(print_scenario(*again), printed) << overrides[0];
  }
}

TEST(ListValues, elements_go_by_a_name_of_their_own) {
  const auto values = list_values(
      "name = \"a\"\n[place]\nlat_deg = 1.0\n[[object]]\nname = \"truck\"\nscale = 1.0\n"
      "[[object]]\nname = \"twin\"\n[[object]]\nname = \"twin\"\n[[object]]\nname = \"7\"\n"
      "[[band]]\nname = \"8-12\"\nresponse = [\n  { um = 8.0 },\n  { um = 12.0 },\n]\n");
  std::vector<std::string> keys;
  for (const ConfigValue& one : values) keys.push_back(one.key);
  EXPECT_EQ(keys,
            (std::vector<std::string>{"name", "place.lat_deg", "object[truck].name",
                                      "object[truck].scale", "object[1].name", "object[2].name",
                                      "object[3].name", "band[8-12].name", "band[8-12].response"}));
  EXPECT_EQ(values.back().value, "[{ um = 8.0 }, { um = 12.0 },]");
}

TEST_F(ConfigTest, a_printed_weather_table_loads_to_the_same_values) {
  write("w.csv",
        "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac,environment_k,"
        "film_w_m2_k,relative_humidity_frac\n0.1,800.7,100,330,290.15,2,0,,,\n"
        "60,0,1,2,300,3,0.5,280.3,13.3,0.625\n");
  const auto first =
      scenario("[weather]\nfile = \"w.csv\"\n[thermal]\nhistory_start_s = 0\nspin_up_s = 0\n");
  ASSERT_TRUE(first.has_value()) << first.error().text;
  const std::string printed = print_scenario(*first);
  const auto second = load_scenario(write("printed.toml", printed), {}, options_);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  ASSERT_EQ(second->weather.size(), 2U);
  EXPECT_EQ(second->weather[0].sim_time_ns, 100'000'000);
  EXPECT_EQ(second->weather[0].direct_normal_w_m2, 800.7);
  EXPECT_FALSE(second->weather[0].film_w_m2_k.has_value());
  EXPECT_EQ(second->weather[1].environment_k, 280.3);
  EXPECT_EQ(second->weather[1].film_w_m2_k, 13.3);
  EXPECT_FALSE(second->weather[0].relative_humidity_frac.has_value());
  EXPECT_EQ(second->weather[1].relative_humidity_frac, 0.625);
}

TEST_F(ConfigTest, a_minimal_scenario_has_sensible_defaults) {
  const auto loaded = scenario("[[object]]\ngltf = \"a.glb\"\n[[object]]\ngltf = \"a.glb\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_EQ(loaded->name, "s");
  EXPECT_EQ(loaded->objects[0].name, "a");
  EXPECT_EQ(loaded->objects[1].name, "a_2");
  EXPECT_EQ(loaded->default_material, "concrete");
  ASSERT_EQ(loaded->channels.size(), 2U);
  EXPECT_EQ(loaded->bands[0].name, "8-12");
  EXPECT_EQ(loaded->bands[1].name, "3-5");
  EXPECT_TRUE(loaded->sensor.trajectory.empty());
  EXPECT_GT(loaded->sensor.fov_h_rad, 0.0);
  // The object is level and heads north.
  const glm::dvec3 nose = loaded->objects[0].instances[0].world_from_body * glm::dvec3(1, 0, 0);
  EXPECT_NEAR(nose.y, 1.0, 1e-15);
}

TEST_F(ConfigTest, overrides_reach_array_elements_and_library_materials) {
  const auto loaded = scenario(
      "[[object]]\nname = \"a\"\ngltf = \"a.glb\"\n[[channel]]\nname = \"c\"\nband = \"8-12\"\n",
      {"thermal.steps=90", "object[a].scale=2", "object[0].position_m=[1,2,3]",
       "channel[c].band=3-5", "material[concrete].base_k=300", "sensor.name=7",
       "name = \"quoted\""});
  ASSERT_FALSE(loaded.has_value());  // "name " with a blank is no key
  const auto again = scenario(
      "[[object]]\nname = \"a\"\ngltf = \"a.glb\"\n[[channel]]\nname = \"c\"\nband = \"8-12\"\n",
      {"thermal.steps=90", "object[a].scale=2", "object[0].position_m=[1,2,3]",
       "channel[c].band=3-5", "material[concrete].base_k=300", "sensor.name=7", "name=\"quoted\""});
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ(again->thermal.steps, 90U);
  EXPECT_EQ(again->objects[0].scale, 2.0);
  EXPECT_EQ(again->objects[0].instances[0].position_world_m, glm::dvec3(1, 2, 3));
  EXPECT_EQ(again->channels[0].band, "3-5");
  EXPECT_EQ(again->materials[0].base_k, 300.0);
  EXPECT_EQ(again->sensor.name, "7");
  EXPECT_EQ(again->name, "quoted");
  EXPECT_EQ(scenario_error("", {"object[x].scale=2"}),
            "--set object[x].scale=2: there is no object[x]");
  EXPECT_EQ(scenario_error("", {"material[gold].base_k=2"}),
            "--set material[gold].base_k=2: there is no material[gold]");
}

TEST_F(ConfigTest, the_environment_reaches_nested_scalars) {
  options_.environment = {"EMIT_THERMAL_STEPS=13", "EMIT_SENSOR_POSITION_M=[1, 2, 3]",
                          "EMIT_EPOCH_UTC=2015-01-01T00:00:00Z"};
  const auto loaded = scenario("[thermal]\nsteps = 27\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_EQ(loaded->thermal.steps, 13U);
  EXPECT_EQ(loaded->epoch_utc_ns, 1'420'070'400'000'000'000);
  ASSERT_EQ(loaded->sensor.trajectory.size(), 1U);
  EXPECT_EQ(loaded->sensor.trajectory[0].pose.position_world_m, glm::dvec3(1, 2, 3));
}

TEST_F(ConfigTest, a_model_has_a_rotation_and_an_offset_in_its_body) {
  const auto loaded = scenario(
      "[[object]]\ngltf = \"a.glb\"\nmodel_rotation_deg = [90, -33.3, 5]\n"
      "model_offset_m = [0.5, 0, -1.25]\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const scene::ObjectDesc& object = loaded->objects[0];
  EXPECT_EQ(object.model_rotation_rad, glm::dvec3(90.0, -33.3, 5.0) * kDegree);
  EXPECT_EQ(object.model_offset_m, glm::dvec3(0.5, 0.0, -1.25));
  const auto again = load_scenario(write("p.toml", print_scenario(*loaded)), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ(again->objects[0].model_rotation_rad, object.model_rotation_rad);
  EXPECT_EQ(again->objects[0].model_offset_m, object.model_offset_m);
  EXPECT_EQ(scenario_error("[[object]]\ngltf = \"a.glb\"\nmodel_rotation_deg = [400, 0, 0]\n"),
            "s.toml:4:22: 'model_rotation_deg' holds 400.0, must be -360 .. 360");
  EXPECT_THAT(scenario_error("[[object]]\ngltf = \"a.glb\"\nmodel_offset_m = [1, 2]\n"),
              ::testing::HasSubstr("'model_offset_m' must be an array of 3 numbers"));
}

TEST_F(ConfigTest, joints_name_two_bodies_by_object_or_material) {
  const std::string bodies =
      "[[object]]\nname = \"crate\"\ngltf = \"a.glb\"\n[[contact]]\nbetween = ";
  const auto loaded = scenario(bodies + "[\"crate\", \"concrete\"]\nresistance_m2_k_w = 0.05\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_EQ(loaded->contacts.size(), 1U);
  EXPECT_EQ(loaded->contacts[0].between[0], "crate");
  EXPECT_EQ(loaded->contacts[0].between[1], "concrete");
  EXPECT_EQ(loaded->contacts[0].resistance_m2k_w, 0.05);
  const auto again = load_scenario(write("p.toml", print_scenario(*loaded)), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  ASSERT_EQ(again->contacts.size(), 1U);
  EXPECT_EQ(again->contacts[0].between, loaded->contacts[0].between);
  EXPECT_EQ(scenario_error(bodies + "[\"create\", \"concrete\"]\nresistance_m2_k_w = 0.05\n"),
            "s.toml:6:11: no object and no material is named 'create', did you mean 'crate'?");
  EXPECT_EQ(scenario_error(bodies + "[\"crate\"]\nresistance_m2_k_w = 0.05\n"),
            "s.toml:6:11: 'between' must be an array of two names");
  EXPECT_THAT(scenario_error(bodies + "[\"crate\", \"concrete\"]\nresistance_m2_k_w = 0\n"),
              ::testing::HasSubstr("'resistance_m2_k_w'"));
  EXPECT_THAT(scenario_error(bodies + "[\"crate\", \"concrete\"]\n"),
              ::testing::HasSubstr("'resistance_m2_k_w'"));
}

TEST_F(ConfigTest, gas_is_read_checked_and_printed) {
  const std::string body =
      "[weather]\nwind_from_deg = 270\n[[object]]\nname = \"jet\"\nentity_id = 3\ngltf = "
      "\"a.glb\"\n[[object.parts]]\nname = \"engine\"\nmaterial = \"concrete\"\nidle_k = 500\n"
      "full_k = 900\n";
  const auto loaded = scenario(
      body +
      "[[plume]]\nobject = \"jet\"\npart = \"engine\"\nnozzle_m = [-5, 0.5, -1]\nexit_k = 1600\n"
      "[[object]]\nname = \"pellet\"\nentity_id = 4\ngltf = \"a.glb\"\non = false\n"
      "[[flare]]\nobject = \"pellet\"\nintensity_w_sr = { \"3-5\" = 2500.0 }\n"
      "[[smoke]]\nname = \"screen\"\nposition_m = [1, 2, 3]\nstart_s = -5\nstop_s = 20.5\n"
      "band_extinction_m2_g = { \"8-12\" = 0.38 }\n"
      "[[fire]]\nheat_release_w = 2e6\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const scene::GasDesc& gas = loaded->gas;
  ASSERT_EQ(gas.plumes.size(), 1U);
  EXPECT_EQ(gas.plumes[0].name, "plume_1");
  EXPECT_EQ(gas.plumes[0].nozzle_body_m, glm::dvec3(-5.0, 0.5, -1.0));
  EXPECT_EQ(gas.plumes[0].full.exit_k, 1600.0);
  EXPECT_EQ(gas.plumes[0].idle.exit_k, 1600.0);  // full power where the file says nothing else
  ASSERT_EQ(gas.flares.size(), 1U);
  ASSERT_EQ(gas.flares[0].intensity_w_sr.size(), 1U);
  EXPECT_EQ(gas.flares[0].intensity_w_sr[0].value, 2500.0);
  ASSERT_EQ(gas.smokes.size(), 1U);
  EXPECT_EQ(gas.smokes[0].start_ns, -5'000'000'000);
  EXPECT_EQ(gas.smokes[0].stop_ns, 20'500'000'000);
  EXPECT_EQ(gas.smokes[0].band_extinction_m2_g[0].value, 0.38);
  ASSERT_EQ(gas.fires.size(), 1U);
  EXPECT_EQ(gas.fires[0].heat_release_w, 2e6);
  EXPECT_EQ(gas.puffs(), 20U + 1U + 48U + 12U);
  const auto again = load_scenario(write("p.toml", print_scenario(*loaded)), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ(print_scenario(*again), print_scenario(*loaded));
  EXPECT_EQ(again->gas.smokes[0].stop_ns, gas.smokes[0].stop_ns);
  const std::vector<std::pair<std::string, std::string>> faults{
      {"[[plume]]\nobject = \"yet\"\n", "no object is named 'yet', did you mean 'jet'?"},
      {"[[plume]]\nobject = \"jet\"\npart = \"engines\"\n",
       "object 'jet' has no part 'engines', did you mean 'engine'?"},
      {"[[plume]]\nobject = \"jet\"\ndirection = [0, 0, 0]\n", "'direction' has no length"},
      {"[[plume]]\nobject = \"jet\"\nco2_frac = 0.6\nh2o_frac = 0.6\n",
       "'co2_frac' and 'h2o_frac' add up to above 1"},
      {"[[plume]]\n", "key 'object' is missing"},
      {"[[flare]]\nobject = \"jet\"\nintensity_w_sr = { \"3-6\" = 1.0 }\n",
       "'intensity_w_sr': there is no band '3-6', did you mean '3-5'?"},
      {"[[flare]]\nobject = \"jet\"\n", "entity 'jet' is there from the beginning"},
      {"[[smoke]]\nstart_s = 5\nstop_s = 5\n", "'stop_s' must be after 'start_s'"},
      {"[[fire]]\nflame_k = 20\n", "'flame_k' is 20, must be 600 .. 2500"},
      {"[[smoke]]\n[[smoke]]\n[[smoke]]\n[[smoke]]\n[[smoke]]\n[[smoke]]\n",
       "take 288 puffs of gas: 256 are possible"},
  };
  for (const auto& [text, message] : faults) {
    EXPECT_THAT(scenario_error(body + text), ::testing::HasSubstr(message)) << text;
  }
  const auto calm = scenario("[[smoke]]\n");
  ASSERT_TRUE(calm.has_value()) << calm.error().text;
  EXPECT_THAT(calm->warnings, ::testing::Contains(::testing::HasSubstr("smoke does not drift")));
}

TEST_F(ConfigTest, clutter_is_read_checked_and_printed) {
  const std::string body =
      "[[object]]\nname = \"lot\"\nmaterial = \"concrete\"\ngltf = \"a.glb\"\n";
  const auto loaded = scenario(body +
                               "[[clutter]]\nmaterial = \"concrete\"\nshortest_m = 0.5\n"
                               "longest_m = 16\nslope = 2\nseed = 7\ninertia_sd_ln = 0.2\n"
                               "solar_absorptance_sd_frac = -0.02\nemissivity_sd_frac = 0.01\n"
                               "band_emissivity_sd_frac = { \"8-12\" = 0.005 }\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_TRUE(loaded->materials[0].clutter.has_value());
  const scene::Clutter& clutter = *loaded->materials[0].clutter;
  EXPECT_EQ(clutter.longest_m, 16.0);
  EXPECT_EQ(clutter.seed, 7U);
  EXPECT_EQ(clutter.solar_absorptance_sd_frac, -0.02);
  EXPECT_EQ(scene::emissivity_sd_frac(clutter, "8-12"), 0.005);
  EXPECT_EQ(scene::emissivity_sd_frac(clutter, "3-5"), 0.01);
  const auto again = load_scenario(write("p.toml", print_scenario(*loaded)), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ(print_scenario(*again), print_scenario(*loaded));
  ASSERT_TRUE(again->materials[0].clutter.has_value());
  EXPECT_EQ(again->materials[0].clutter->inertia_sd_ln, 0.2);
  const std::string head = "[[clutter]]\nmaterial = \"concrete\"\n";
  const std::vector<std::pair<std::string, std::string>> faults{
      {"[[clutter]]\ninertia_sd_ln = 0.1\n", "key 'material' is missing"},
      {"[[clutter]]\nmaterial = \"concret\"\ninertia_sd_ln = 0.1\n",
       "there is no material 'concret', did you mean 'concrete'?"},
      {head, "[[clutter]] changes nothing"},
      {head + "inertia_sd_ln = 0.1\nlongest_m = 0.1\n",
       "'longest_m' (0.1) must be above 'shortest_m' (0.25), and at most 32.0 times it"},
      {head + "inertia_sd_ln = 0.1\nlongest_m = 9\n", "at most 32.0 times it"},
      {head + "emissivity_sd_frac = 0.05\n", "'emissivity_sd_frac' leads out of 0 to 1"},
      {head + "band_emissivity_sd_frac = { \"8-13\" = 0.001 }\n",
       "'band_emissivity_sd_frac': there is no band '8-13'"},
      {"[[clutter]]\nmaterial = \"plain\"\nband_emissivity_sd_frac = { \"8-12\" = 0.1 }\n"
       "[[material]]\nname = \"plain\"\nsolar_absorptance_frac = 0.5\nemissivity_frac = 0.95\n"
       "prescribed_k = 300\n",
       "'band_emissivity_sd_frac' leads out of 0 to 1"},
      {head + "inertia_sd_ln = 0.1\n" + head + "inertia_sd_ln = 0.2\n",
       "material 'concrete' has another [[clutter]] already"},
      {"[[clutter]]\nmaterial = \"shiny\"\nemissivity_sd_frac = 0.001\n[[material]]\nname = "
       "\"shiny\"\nsolar_absorptance_frac = 0.5\nemissivity_frac = 0.9\nprescribed_k = 300\ngloss "
       "= "
       "{ index = \"water\" }\n",
       "material 'shiny' has 'gloss', which gives its emissivity: that cannot vary"},
      {head + "inertia_sd_ln = 0.1\n[thermal]\nmethod = \"per-frame\"\n",
       "[[clutter]] needs thermal.method"},
      {head + "inertia_sd_ln = 0.1\n[[object]]\nname = \"jet\"\nentity_id = 3\ngltf = "
              "\"a.glb\"\n[[object.parts]]\nname = \"engine\"\nmaterial = \"concrete\"\n",
       "material 'concrete' varies: part 'engine' of object 'jet' cannot have it"},
  };
  for (const auto& [text, message] : faults) {
    EXPECT_THAT(scenario_error(body + text), ::testing::HasSubstr(message)) << text;
  }
}

TEST_F(ConfigTest, clouds_are_read_checked_and_printed) {
  const auto loaded = scenario(
      "[weather]\nwind_m_s = 4\nwind_from_deg = 270\n[clouds]\ncover_frac = 0.3\nbase_m = 1280\n"
      "seed = 9\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_TRUE(loaded->clouds.has_value());
  // The wind grows with the seventh root of the height: twice that of 10 m.
  EXPECT_NEAR(loaded->clouds->drift_m_s, 8.0, 1e-12);
  EXPECT_NEAR(loaded->clouds->velocity_m_s().x, 8.0, 1e-12);
  EXPECT_EQ(loaded->clouds->seed, 9U);
  EXPECT_EQ(loaded->clear_sky.cloud_frac, 0.3);
  EXPECT_EQ(loaded->clear_sky.cloud_transmission_frac, 0.1);
  EXPECT_EQ(loaded->clear_sky.cloud_base.height_m, 1280.0);
  const auto again = load_scenario(write("p.toml", print_scenario(*loaded)), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ(again->clouds, loaded->clouds);
  EXPECT_EQ(print_scenario(*again), print_scenario(*loaded));
  EXPECT_THAT(loaded->warnings,
              ::testing::Not(::testing::Contains(::testing::HasSubstr("above the clouds"))));
  const std::string head = "[clouds]\ncover_frac = 0.3\n";
  const std::string drift = "drift_m_s = 5\ndrift_from_deg = 90\n";
  const std::vector<std::pair<std::string, std::string>> faults{
      {"[clouds]\n" + drift, "key 'cover_frac' is missing"},
      {head, "'drift_from_deg' is missing"},
      {head + drift + "longest_m = 100\n",
       "'longest_m' (100.0) must be above 'shortest_m' (200.0), and at most 32.0 times it"},
      {head + drift + "[weather]\ncloud_frac = 0.2\n",
       "'cloud_frac' has no place beside [clouds], whose 'cover_frac' says it"},
      {head + drift + "[weather]\ncloud_base_m = 900\n",
       "'cloud_base_m' has no place beside [clouds], whose 'base_m' says it"},
      {head + drift + "[thermal]\nmethod = \"per-frame\"\n",
       "[clouds] needs thermal.method = \"cached\""},
      {head + drift + "[thermal]\nmodel = \"emit2014\"\n", "thermal.model = \"foster\""},
  };
  for (const auto& [text, message] : faults) {
    EXPECT_THAT(scenario_error(text), ::testing::HasSubstr(message)) << text;
  }
  const auto high = scenario(head + drift + "[sensor]\nposition_m = [0, 0, 2000]\n");
  ASSERT_TRUE(high.has_value()) << high.error().text;
  EXPECT_THAT(
      high->warnings,
      ::testing::Contains(::testing::HasSubstr("the sensor rises above the clouds (1500.0 m)")));
  // A step of heat in which clouds move 120 m is too long for those of 200 m, one of 90 m is not.
  const auto outrun = ::testing::Contains(::testing::HasSubstr("in a step of heat"));
  const std::string fast = head + "drift_m_s = 6\ndrift_from_deg = 90\n[thermal]\nfirst_step_s = ";
  const auto coarse = scenario(fast + "20\n");
  ASSERT_TRUE(coarse.has_value()) << coarse.error().text;
  EXPECT_THAT(coarse->warnings, outrun);
  EXPECT_THAT(coarse->warnings, ::testing::Contains(::testing::HasSubstr(
                                    "move 120 m in a step of heat (thermal.first_step_s = 20.0 s), "
                                    "more than half of clouds.shortest_m (200.0 m), which smears "
                                    "their shade in time; take 17 s")));
  const auto fine = scenario(fast + "15\n");
  ASSERT_TRUE(fine.has_value()) << fine.error().text;
  EXPECT_THAT(fine->warnings, ::testing::Not(outrun));
}

TEST_F(ConfigTest, endings_of_scene_files_may_be_upper_case) {
  for (const std::string name : {"TRUCK.GLB", "truck.Gltf"}) {
    const auto loaded = scenario("[[object]]\ngltf = \"" + name + "\"\n");
    EXPECT_TRUE(loaded.has_value()) << loaded.error().text;
  }
}

TEST_F(ConfigTest, a_scenario_material_replaces_the_library_one) {
  const auto loaded = scenario(
      "[[material]]\nname = \"concrete\"\nsolar_absorptance_frac = 0.1\nemissivity_frac = "
      "0.5\nprescribed_k = 310\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_EQ(loaded->materials.size(), 1U);
  EXPECT_EQ(loaded->materials[0].solar_absorptance_frac, 0.1);
}

/// Test of each mode's share and time constant as published with the slab formula. The tolerance is
/// that of the printed digits.
TEST(SlabModes, agree_with_the_tabulated_roots) {
  const auto asphalt = slab_modes({0.15, 0.7, 1950.0, 1000.0}, 19.0, 16);
  ASSERT_EQ(asphalt.size(), 16U);
  EXPECT_NEAR(asphalt[15].tau_s, 9438.0, 5.0);
  EXPECT_NEAR(asphalt[14].tau_s, 2181.0, 2.0);
  EXPECT_NEAR(asphalt[14].weight_frac / asphalt[15].weight_frac, 0.205 / 0.372, 0.003);
  const auto concrete = slab_modes({0.10, 1.28, 2020.0, 1000.0}, 19.0, 2);
  ASSERT_EQ(concrete.size(), 2U);
  EXPECT_NEAR(concrete[1].tau_s, 3356.0, 8.0);
  EXPECT_NEAR(concrete[0].tau_s, 632.0, 2.0);
  EXPECT_NEAR(concrete[0].weight_frac + concrete[1].weight_frac, 1.0, 1e-15);
  EXPECT_NEAR(concrete[1].weight_frac, 0.592 / (0.592 + 0.173), 0.002);
}

/// Test of thin or well conducting layers: one mode of tau = rho c d / (film + lambda / d), the
/// lumped sheet, up to pi^2/4 where the film does not matter.
TEST(SlabModes, of_an_insulated_slab_tend_to_the_diffusive_limit) {
  const auto modes = slab_modes({0.1, 50.0, 7800.0, 500.0}, 1e-3, 1);
  const double diffusive_s = 4.0 * 0.01 * 7800.0 * 500.0 / 50.0 / (physics::kPi * physics::kPi);
  EXPECT_NEAR(modes[0].tau_s / diffusive_s, 1.0, 1e-4);
}

}  // namespace
}  // namespace emit::config::testing
