// SPDX-License-Identifier: Apache-2.0
#include "config/config_support.hpp"

namespace emit::config::testing {
namespace {

/// One wrong scenario and its error. Line 1 is always `materials = ["m.toml"]`, so the text starts
/// on line 2.
struct Case {
  const char* name;
  std::string text;
  std::string error;  ///< exact
};

std::string object(const std::string& more) {
  return "[[object]]\ngltf = \"a.glb\"\n" + more;
}
std::string material(const std::string& more) {
  return "[[material]]\nname = \"x\"\nsolar_absorptance_frac = 0.5\nemissivity_frac = 0.9\n" + more;
}
/// Entity with a part.
std::string part(const std::string& keys) {
  return object("entity_id = 7\n[[object.parts]]\nname = \"a\"\n" + keys);
}
std::string image(const std::string& keys) {
  return object("[[object.material_images]]\nmaterial = \"Body\"\n" + keys);
}
const std::string kLayer =
    "layers = [{ thickness_m = 0.1, conductivity_w_m_k = 1, density_kg_m3 = 2000, "
    "specific_heat_j_kg_k = 900 }]\n";

const std::vector<Case>& cases() {
  static const std::vector<Case> all = {
      {"misspelt_key", "[sensor]\nheigth_px = 512\n",
       "s.toml:3:1: unknown key 'heigth_px', did you mean 'height_px'?"},
      {"key_without_unit", "[sensor]\n  near = 1\n",
       "s.toml:3:3: unknown key 'near', did you mean 'near_m'?"},
      {"misspelt_section", "[thermall]\nsteps = 3\n",
       "s.toml:2:2: unknown key 'thermall', did you mean 'thermal'?"},
      {"foreign_key", "zzzzzz = 1\n", "s.toml:2:1: unknown key 'zzzzzz'"},
      {"daemon_key", "[pacing]\nmode = \"host-step\"\n",
       "s.toml:2:2: unknown key 'pacing', which belongs to the configuration of the daemon "
       "(emitd --config)"},
      {"text_for_integer", "[thermal]\nsteps = \"many\"\n",
       "s.toml:3:9: 'steps' must be an integer, not a string"},
      {"float_for_integer", "[thermal]\nsteps = 27.0\n",
       "s.toml:3:9: 'steps' must be an integer, not a float"},
      {"text_for_number", "[thermal]\ninitial_k = \"warm\"\n",
       "s.toml:3:13: 'initial_k' must be a number, not a string"},
      {"number_for_text", "name = 3\n", "s.toml:2:8: 'name' must be a string, not an integer"},
      {"number_for_boolean", "[atmosphere]\nenabled = 1\n",
       "s.toml:3:11: 'enabled' must be true or false, not an integer"},
      {"array_for_table", "place = [1, 2]\n", "s.toml:2:9: 'place' must be a table, not an array"},
      {"table_for_array_of_tables", "[object]\ngltf = \"a.glb\"\n",
       "s.toml:2:1: 'object' must be an array of tables, not a table"},
      {"steps_zero", "[thermal]\nsteps = 0\n", "s.toml:3:9: 'steps' is 0, must be 1 .. 4096"},
      {"steps_too_many", "[thermal]\nsteps = 4097\n",
       "s.toml:3:9: 'steps' is 4097, must be 1 .. 4096"},
      {"latitude", "[place]\nlat_deg = 91\n", "s.toml:3:11: 'lat_deg' is 91, must be -90 .. 90"},
      {"nan", "[place]\nlat_deg = nan\n", "s.toml:3:11: 'lat_deg' is nan, must be -90 .. 90"},
      {"infinity", "[place]\nheight_m = inf\n",
       "s.toml:3:12: 'height_m' is inf, must be -500 .. 9000"},
      {"open_range", "[thermal]\ntolerance_k = 0\n",
       "s.toml:3:15: 'tolerance_k' is 0, must be > 0, <= 50"},
      {"word_not_offered", "[thermal]\nmodel = \"emit2015\"\n",
       "s.toml:3:9: 'model' is 'emit2015', must be one of: emit2014, foster"},
      {"instant_without_offset", "epoch_utc = 2014-06-21T06:00:00\n",
       "s.toml:2:13: 'epoch_utc' must be an instant with offset between the years 1900 and 2199, "
       "such as 2014-06-21T06:00:00Z"},
      {"instant_out_of_range", "epoch_utc = 2300-01-01T00:00:00Z\n",
       "s.toml:2:13: 'epoch_utc' must be an instant with offset between the years 1900 and 2199, "
       "such as 2014-06-21T06:00:00Z"},
      {"vector_too_short", "[sensor]\nposition_m = [1, 2]\n",
       "s.toml:3:14: 'position_m' must be an array of 3 numbers, not of 2"},
      {"vector_of_text", "[sensor]\nposition_m = [1, 2, \"3\"]\n",
       "s.toml:3:21: 'position_m' must be an array of numbers, not a string"},
      {"object_without_gltf", "[[object]]\nname = \"a\"\n", "s.toml:2:1: key 'gltf' is missing"},
      {"gltf_extension", "[[object]]\ngltf = \"a.obj\"\n",
       "s.toml:3:8: 'gltf' must name a .glb or .gltf file"},
      {"object_name_twice", object("name = \"a\"\n") + object("name = \"a\"\n"),
       "s.toml:7:8: object 'a' is defined twice"},
      {"entity_twice", object("entity_id = 7\nname = \"a\"\n") + object("entity_id = 7\n"),
       "s.toml:8:13: entity_id 7 is already that of object 'a'"},
      {"entity_id_too_large", object("entity_id = 4294967296\n"),
       "s.toml:4:13: 'entity_id' is 4294967296, must be 0 .. 4294967295"},
      {"object_material", object("material = \"concret\"\n"),
       "s.toml:4:12: there is no material 'concret', did you mean 'concrete'?"},
      {"material_map", object("material_map = { body = \"gold\" }\n"),
       "s.toml:4:25: there is no material 'gold'"},
      {"image_colour", image("legend = { \"green\" = \"concrete\" }\n"),
       "s.toml:6:22: 'legend': 'green' is not a colour, must be \"#rrggbb\" in hexadecimal digits"},
      {"image_colour_digits", image("legend = { \"#12345g\" = \"concrete\" }\n"),
       "s.toml:6:24: 'legend': '#12345g' is not a colour, must be \"#rrggbb\" in hexadecimal "
       "digits"},
      {"image_colour_twice",
       image("legend = { \"#0000AA\" = \"concrete\", \"#0000aa\" = \"concrete\" }\n"),
       "s.toml:6:10: 'legend' has a colour twice"},
      {"image_legend_empty", image("legend = {}\n"),
       "s.toml:6:10: 'legend' has 0 colours, must have 1 to 64"},
      {"image_without_legend", image(""), "s.toml:4:1: key 'legend' is missing"},
      {"image_material", image("legend = { \"#123456\" = \"concret\" }\n"),
       "s.toml:6:24: there is no material 'concret', did you mean 'concrete'?"},
      {"image_twice",
       image("legend = { \"#123456\" = \"concrete\" }\n") +
           "[[object.material_images]]\nmaterial = \"Body\"\n"
           "legend = { \"#123456\" = \"concrete\" }\n",
       "s.toml:8:12: material 'Body' has two images"},
      {"parts_of_scenery", object("parts = [{ name = \"a\", material = \"concrete\" }]\n"),
       "s.toml:4:9: 'parts' needs an entity_id: static scenery does not heat itself"},
      {"part_material", part("material = \"gold\"\n"), "s.toml:7:12: there is no material 'gold'"},
      {"part_twice",
       part("material = \"concrete\"\n") +
           "[[object.parts]]\nname = \"b\"\nmaterial = \"concrete\"\n",
       "s.toml:8:1: part 'b' has the id, name or material of part 'a'"},
      {"part_half_a_curve", part("material = \"concrete\"\nidle_k = 300\n"),
       "s.toml:5:1: 'idle_k' and 'full_k' go together"},
      {"part_throttle_without_curve",
       part("material = \"concrete\"\ncommands = [{ time_s = 0, throttle = 1 }]\n"),
       "s.toml:8:38: 'throttle' needs idle_k and full_k of part 'a'"},
      {"part_two_drives",
       part("material = \"concrete\"\ncommands = [{ time_s = 0, power_w_m2 = 1, off = true }]\n"),
       "s.toml:8:13: a command needs exactly one of 'temperature_k', 'power_w_m2', 'throttle' and "
       "'off = true'"},
      {"part_commands_descend",
       part("material = \"concrete\"\n"
            "commands = [{ time_s = 1, power_w_m2 = 1 }, { time_s = 1, off = true }]\n"),
       "s.toml:8:56: 'time_s' is not later than in the command before"},
      {"default_material_misspelt", "default_material = \"concret\"\n",
       "s.toml:2:20: there is no material 'concret', did you mean 'concrete'?"},
      {"surroundings_material_misspelt", "[thermal]\nsurroundings_material = \"concret\"\n",
       "s.toml:3:25: there is no material 'concret', did you mean 'concrete'?"},
      {"default_material", "default_material = \"gold\"\n",
       "s.toml:2:20: there is no material 'gold'"},
      {"attitude_twice",
       "[sensor]\nposition_m = [0, 0, 1]\nheading_deg = 3\nlook_at_m = [5, 0, 0]\n",
       "s.toml:5:13: use only one of 'look_at_m', 'attitude_wxyz' and heading_deg, pitch_deg, "
       "roll_deg"},
      {"looks_at_itself", "[sensor]\nposition_m = [0, 0, 1]\nlook_at_m = [0, 0, 1]\n",
       "s.toml:4:13: 'look_at_m' is the position itself"},
      {"quaternion_norm", "[sensor]\nattitude_wxyz = [1, 1, 0, 0]\n",
       "s.toml:3:17: 'attitude_wxyz' has norm 1.4142135623730951, must be 1"},
      {"keyframes_descend", "[sensor]\ntrajectory = [\n  { time_s = 2 },\n  { time_s = 1 },\n]\n",
       "s.toml:5:14: 'time_s' is not later than in the keyframe before"},
      {"keyframe_without_time", "[sensor]\ntrajectory = [\n  { position_m = [0, 0, 0] },\n]\n",
       "s.toml:4:3: key 'time_s' is missing"},
      {"sensor_switched_off", "[sensor]\ntrajectory = [{ time_s = 0, on = false }]\n",
       "s.toml:3:14: a sensor is always on: its keyframes take no on = false"},
      {"pose_beside_trajectory", "[sensor]\nheading_deg = 3\ntrajectory = [{ time_s = 0 }]\n",
       "s.toml:3:1: 'heading_deg' has no effect beside a trajectory"},
      {"static_trajectory", object("trajectory = [{ time_s = 0 }]\n"),
       "s.toml:4:14: 'trajectory' needs an entity_id: static scenery does not move"},
      {"static_off", object("on = false\n"),
       "s.toml:4:6: 'on' needs an entity_id: static scenery is always on"},
      {"entity_instances", object("entity_id = 1\ninstances = [{ heading_deg = 3 }]\n"),
       "s.toml:5:13: an entity has exactly one placement: 'instances' is for static scenery"},
      {"instances_and_position",
       object("position_m = [0, 0, 0]\ninstances = [{ heading_deg = 3 }]\n"),
       "s.toml:4:1: use only one of 'position_m' and 'instances'"},
      {"no_instances", object("instances = []\n"),
       "s.toml:4:13: 'instances' needs at least one placement"},
      {"both_trajectories",
       object("entity_id = 1\ntrajectory = [{ time_s = 0 }]\ntrajectory_file = \"t.csv\"\n"),
       "s.toml:6:19: use only one of 'trajectory' and 'trajectory_file'"},
      {"channel_band", "[[channel]]\nname = \"a\"\nband = \"9-12\"\n",
       "s.toml:4:8: there is no band '9-12', did you mean '8-12'? (known: 3-5, 3.4-4.1, 8-12, "
       "7.7-9.3)"},
      {"window_of_three_numbers",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nwindow_px = [1, 2, 3]\n",
       "s.toml:5:13: 'window_px' must be an array of 4 integers: x, y, width, height"},
      {"window_of_floats",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nwindow_px = [0, 0, 8.5, 8]\n",
       "s.toml:5:20: 'window_px' must be an integer, not a float"},
      {"window_empty", "[[channel]]\nname = \"a\"\nband = \"3-5\"\nwindow_px = [0, 0, 8, 0]\n",
       "s.toml:5:23: 'window_px' is 0, must be 1 .. 8192"},
      {"window_outside",
       "[sensor]\nwidth_px = 64\nheight_px = 48\n[[channel]]\nname = \"a\"\nband = \"3-5\"\n"
       "window_px = [60, 40, 5, 8]\n",
       "s.toml:8:13: 'window_px' reaches to column 65 and row 48; the sensor's image is 64 x 48"},
      {"window_below",
       "[sensor]\nwidth_px = 64\nheight_px = 48\n[[channel]]\nname = \"a\"\nband = \"3-5\"\n"
       "window_px = [0, 40, 64, 9]\n",
       "s.toml:8:13: 'window_px' reaches to column 64 and row 49; the sensor's image is 64 x 48"},
      {"camera_narrower_than_the_sensor_may_be",
       "[sensor]\nfov_h_deg = 20\nfov_h_min_deg = 5\n[[channel]]\nname = \"a\"\nband = \"3-5\"\n"
       "fov_h_deg = 4\n",
       "s.toml:8:13: 'fov_h_deg' is 4, must be 5 .. 20: the surface is prepared for "
       "'sensor.fov_h_min_deg' to 'sensor.fov_h_deg'"},
      {"camera_wider_than_the_sensor",
       "[sensor]\nfov_h_deg = 20\n[[channel]]\nname = \"a\"\nband = \"3-5\"\nfov_h_deg = 21\n",
       "s.toml:7:13: 'fov_h_deg' is 21, must be 20 .. 20: the surface is prepared for "
       "'sensor.fov_h_min_deg' to 'sensor.fov_h_deg'"},
      {"camera_without_carrier", "[[channel]]\nname = \"a\"\nband = \"3-5\"\ncarrier_entity = 9\n",
       "s.toml:5:18: the scenario has no entity 9"},
      {"rate_zero", "[[channel]]\nname = \"a\"\nband = \"3-5\"\nevery_nth = 0\n",
       "s.toml:5:13: 'every_nth' is 0, must be 1 .. 1000"},
      {"no_channel_at_the_full_rate",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nevery_nth = 2\n"
       "[[channel]]\nname = \"b\"\nband = \"3-5\"\nevery_nth = 4\n",
       "s.toml:5:13: no channel shows every frame at its own instant: 'every_nth' of one is 1, and "
       "its 'look_ahead_frames' 0"},
      {"every_channel_looks_ahead",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nlook_ahead_frames = 1\n",
       "s.toml:2:1: no channel shows every frame at its own instant: 'every_nth' of one is 1, and "
       "its 'look_ahead_frames' 0"},
      {"channels_look_ahead_by_different_times",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\n"
       "[[channel]]\nname = \"b\"\nband = \"3-5\"\nlook_ahead_frames = 1\n"
       "[[channel]]\nname = \"c\"\nband = \"3-5\"\nlook_ahead_frames = 2\n",
       "s.toml:12:21: 'look_ahead_frames' is 2, but another channel has 1: all channels that look "
       "ahead show one instant"},
      {"look_ahead_too_far", "[[channel]]\nname = \"a\"\nband = \"3-5\"\nlook_ahead_frames = 9\n",
       "s.toml:5:21: 'look_ahead_frames' is 9, must be 0 .. 8"},
      {"rotation_of_45_degrees", "[[channel]]\nname = \"a\"\nband = \"3-5\"\nrotate_deg = 45\n",
       "s.toml:5:14: 'rotate_deg' is 45, must be one of: 0, 90, 180, 270"},
      {"rotation_of_360_degrees", "[[channel]]\nname = \"a\"\nband = \"3-5\"\nrotate_deg = 360\n",
       "s.toml:5:14: 'rotate_deg' is 360, must be 0 .. 270"},
      {"unknown_mirror", "[[channel]]\nname = \"a\"\nband = \"3-5\"\nmirror = \"left\"\n",
       "s.toml:5:10: 'mirror' is 'left', must be one of: none, horizontal, vertical, both"},
      {"two_coefficients",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\ndistortion_radial = [0.1, 0.2]\n",
       "s.toml:5:21: 'distortion_radial' must be an array of 3 numbers, not of 2"},
      {"map_and_polynomial",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\ndistortion_file = \"m.exr\"\n"
       "distortion_tangential = [0.1, 0.2]\n",
       "s.toml:5:19: use only one of 'distortion_file' and the polynomial of "
       "'distortion_radial' and 'distortion_tangential'"},
      {"shift_of_an_injected_image",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\napply_shift = true\n",
       "s.toml:5:15: 'apply_shift' needs kind = \"projector\": an injected image has no shift"},
      {"photons_of_a_power_band",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nquantity = \"photon_radiance\"\n",
       "s.toml:5:12: \"photon_radiance\" needs a [[band]] with photons = true, and '3-5' has a "
       "response per power"},
      {"temperature_of_drive",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nquantity = \"apparent_temperature\"\n"
       "nuc_file = \"n.exr\"\n",
       "s.toml:5:12: 'quantity' is radiance where 'nuc_file', 'drive_table_file' or "
       "'detector.counts_per_w_m2_sr' makes something else of it"},
      {"optics_of_a_projector",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nkind = \"projector\"\n[channel.optics]\n"
       "vignetting = true\n",
       "s.toml:6:1: 'optics' needs kind = \"injection\": the seeker before a projector has its "
       "own"},
      {"spot_without_a_size",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\n[channel.optics]\nspot = \"airy\"\n",
       "s.toml:6:8: spot = \"airy\" needs 'airy_px'"},
      {"size_of_another_spot",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\n[channel.optics]\nspot = \"airy\"\n"
       "airy_px = 1\nsigma_px = 1\n",
       "s.toml:8:12: 'sigma_px' needs spot = \"gaussian\""},
      {"counts_and_drive",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\nnuc_file = \"n.exr\"\n[channel.detector]\n"
       "counts_per_w_m2_sr = 1\n",
       "s.toml:5:12: use only one of 'nuc_file' and 'detector.counts_per_w_m2_sr'"},
      {"bits_without_counts",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\n[channel.detector]\ncounts_bits = 12\n",
       "s.toml:6:15: 'counts_bits' needs 'counts_per_w_m2_sr'"},
      {"photons_without_noise",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\n[channel.detector]\nphoton_frac = 0.5\n",
       "s.toml:6:15: 'photon_frac' needs 'netd_k'"},
      {"outside_of_nothing", "[[channel]]\nname = \"a\"\nband = \"3-5\"\noutside_w_m2_sr = 2.0\n",
       "s.toml:5:19: 'outside_w_m2_sr' has no effect without a distortion or 'apply_shift'"},
      {"channel_twice",
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\n[[channel]]\nname = \"a\"\nband = \"8-12\"\n",
       "s.toml:6:8: channel 'a' is defined twice"},
      {"too_many_bands",
       "[[band]]\nname = \"w\"\nlo_um = 4\nhi_um = 5\n"
       "[[channel]]\nname = \"a\"\nband = \"3-5\"\n[[channel]]\nname = \"b\"\nband = "
       "\"8-12\"\n[[channel]]\nname = \"c\"\nband = \"7.7-9.3\"\n[[channel]]\nname = "
       "\"d\"\nband = \"3.4-4.1\"\n[[channel]]\nname = \"e\"\nband = \"w\"\n",
       "s.toml:20:8: channels use more than 4 bands"},
      {"too_many_atmosphere_terms",
       "[[atmosphere.band]]\nband = \"8-12\"\nterms = [[0.2, 1], [0.2, 2], [0.2, 3], [0.2, 4], "
       "[0.2, 5]]\n",
       "s.toml:4:9: 'terms' must be an array of 1 to 4 pairs [a, k]"},
      {"too_wide", "[sensor]\nwidth_px = 8193\n",
       "s.toml:3:12: 'width_px' is 8193, must be 1 .. 8192"},
      {"no_channel", "channel = []\n", "s.toml:2:11: at least one channel is needed"},
      {"band_upside_down", "[[band]]\nname = \"w\"\nlo_um = 5\nhi_um = 4\n",
       "s.toml:5:9: 'hi_um' (4) must be above 'lo_um' (5)"},
      {"band_without_limits", "[[band]]\nname = \"w\"\n",
       "s.toml:2:1: band 'w' needs 'lo_um' and 'hi_um', or a response"},
      {"response_descends", "[[band]]\nname = \"w\"\nresponse = [[3, 1], [2, 1]]\n",
       "s.toml:4:12: the wavelengths of a response must ascend (2 um follows 3)"},
      {"response_above_one", "[[band]]\nname = \"w\"\nresponse = [[3, 1], [4, 1.5]]\n",
       "s.toml:4:12: the response at 4 um is 1.5, must be 0 .. 1"},
      {"band_without_atmosphere",
       "[[band]]\nname = \"w\"\nlo_um = 1\nhi_um = 5\n[[channel]]\nname = \"c\"\nband = \"w\"\n",
       "s.toml:2:1: band 'w' has no atmosphere: add an [[atmosphere.band]] for it or set "
       "atmosphere.enabled = false (the built-in air covers 2 to 14.2857 um)"},
      {"atmosphere_sum", "[[atmosphere.band]]\nband = \"3-5\"\nterms = [[0.5, 0.1], [0.4, 1]]\n",
       "s.toml:4:9: the amplitudes of 'terms' add up to 0.9, must be 1"},
      {"display", "[display]\nmin_k = 300\nmax_k = 290\n",
       "s.toml:4:9: 'max_k' (290) must be above 'min_k' (300)"},
      {"weights",
       material("base_k = 290\n" + kLayer +
                "modes = [{ tau_s = 10, weight_frac = 0.5 }, { tau_s = 20, weight_frac "
                "= 0.4 }]\n"),
       "s.toml:8:9: the weights of 'modes' add up to 0.9, must be 1"},
      {"foster_sum",
       material("base_k = 290\n" + kLayer +
                "foster_modes = [{ tau_s = 10, resistance_m2k_w = 0.5 }]\n"),
       "s.toml:8:16: the resistances of 'foster_modes' add up to 0.5, those of 'layers' to 0.1: "
       "fit "
       "again"},
      {"foster_order",
       material("base_k = 290\n" + kLayer +
                "foster_modes = [{ tau_s = 10, resistance_m2k_w = 0.05 }, { tau_s = 9, "
                "resistance_m2k_w = 0.05 }]\n"),
       "s.toml:8:58: time constants of 'foster_modes' must increase"},
      {"surroundings", "[thermal]\nsurroundings_material = \"gras\"\n",
       "s.toml:3:25: there is no material 'gras'"},
      {"three_modes",
       material("base_k = 290\n" + kLayer +
                "modes = [{ tau_s = 1, weight_frac = 0.5 }, { tau_s = 2, "
                "weight_frac = 0.4 }, { tau_s = 3, weight_frac = 0.1 }]\n"),
       "s.toml:8:9: 'modes' has 3 entries, must have 1 or 2"},
      {"material_without_layers", material("base_k = 290\n"),
       "s.toml:2:1: key 'layers' is missing (material 'x' has no prescribed_k)"},
      {"material_without_base", material(kLayer),
       "s.toml:2:1: key 'base' is missing (material 'x' has neither base_k nor prescribed_k)"},
      {"room_without_temperature", material("base = \"room\"\n" + kLayer),
       "s.toml:6:8: 'base' is room: key 'base_k' is missing, which states its temperature"},
      {"unknown_base", material("base = \"cellar\"\n" + kLayer),
       "s.toml:6:8: 'base' is 'cellar', must be one of: ground, air, room, body"},
      {"interior_heat", "[[object]]\ngltf = \"a.glb\"\ninterior_heat_j_m2_k = 0\n",
       "s.toml:4:24: 'interior_heat_j_m2_k' is 0, must be 100 .. 10000000"},
      {"interior_ventilation",
       "[[object]]\ngltf = \"a.glb\"\ninterior_ventilation_w_m2_k = \"none\"\n",
       "s.toml:4:31: 'interior_ventilation_w_m2_k' must be a number, not a string"},
      {"material_without_name",
       "[[material]]\nsolar_absorptance_frac = 0.5\nemissivity_frac = "
       "0.9\nprescribed_k = 400\n",
       "s.toml:2:1: key 'name' is missing"},
      {"material_band", material("prescribed_k = 400\nband_emissivity_frac = { \"4-5\" = 0.5 }\n"),
       "s.toml:7:26: there is no band '4-5', did you mean '3-5'?"},
      {"spread_of_no_band",
       material("prescribed_k = 400\nspread = { band_emissivity_frac = { \"8-13\" = 0.05 } }\n"),
       "s.toml:7:37: there is no band '8-13', did you mean '8-12'?"},
      {"spread_key", material("prescribed_k = 400\nspread = { conductivity = 0.2 }\n"),
       "s.toml:7:12: unknown key 'conductivity', did you mean 'conductivity_frac'?"},
      {"spread_above_1", material("prescribed_k = 400\nspread = { conductivity_frac = 20 }\n"),
       "s.toml:7:32: 'conductivity_frac' is 20, must be 0 .. 1"},
      {"layer_thickness",
       material("base_k = 290\nlayers = [{ thickness_m = 0, conductivity_w_m_k = 1, "
                "density_kg_m3 = 2000, specific_heat_j_kg_k = 900 }]\n"),
       "s.toml:7:27: 'thickness_m' is 0, must be > 0, <= 100"},
      {"gloss_without_reflectance", material("prescribed_k = 400\ngloss = { facet_slope = 0.1 }\n"),
       "s.toml:7:9: 'gloss' needs one of: 'index'; 'wavelength_um', 'refractive_index' and "
       "'extinction_index'; 'angle_deg' and 'angle_emissivity_frac'"},
      {"gloss_of_uneven_lists",
       material("prescribed_k = 400\ngloss = { wavelength_um = [4, 10], refractive_index = [1.5], "
                "extinction_index = [0, 0] }\n"),
       "s.toml:7:9: 'wavelength_um', 'refractive_index' and 'extinction_index' differ in length"},
      {"gloss_slope_at_sea",
       material(
           "prescribed_k = 400\ngloss = { index = \"water\", sea = true, facet_slope = 0.1 }\n"),
       "s.toml:7:54: 'facet_slope' has no effect: with 'sea' the wind gives the slopes"},
      {"gloss_below_the_emissivity",
       material("prescribed_k = 400\ngloss = { wavelength_um = [10], refractive_index = [3], "
                "extinction_index = [0] }\n"),
       "s.toml:7:9: material 'x': 'emissivity_frac' of 0.900, which the heat balance uses, is more "
       "than the interface of 'gloss' lets through over the hemisphere, 0.729"},
      {"gloss_below_the_emissivity_of_an_own_band",
       "[[band]]\nname = \"own\"\nlo_um = 8.5\nhi_um = 11\n" +
           material("prescribed_k = 400\nband_emissivity_frac = { own = 0.99 }\n"
                    "gloss = { wavelength_um = [10], refractive_index = [1.6], "
                    "extinction_index = [0] }\n"),
       "s.toml:12:9: material 'x': its emissivity of 0.990 in band 'own' is more than the "
       "interface of 'gloss' lets through along the normal, 0.947"},
      {"wetness_above_1", material("base_k = 290\nwetness_frac = 1.5\n" + kLayer),
       "s.toml:7:16: 'wetness_frac' is 1.5, must be 0 .. 1"},
      {"resistance_below_0", material("base_k = 290\nsurface_resistance_s_m = -1\n" + kLayer),
       "s.toml:7:26: 'surface_resistance_s_m' is -1, must be 0 .. 10000"},
      {"resistance_of_a_given_temperature",
       material("prescribed_k = 400\nsurface_resistance_s_m = 70\n"),
       "s.toml:7:26: 'surface_resistance_s_m' has no effect: 'prescribed_k' gives the temperature"},
      {"night_without_day", material("base_k = 290\nnight_resistance_s_m = 200\n" + kLayer),
       "s.toml:7:24: 'night_resistance_s_m' needs 'surface_resistance_s_m'"},
      {"night_below_day",
       material("base_k = 290\nsurface_resistance_s_m = 70\nnight_resistance_s_m = 50\n" + kLayer),
       "s.toml:8:24: 'night_resistance_s_m' (50.0) is below 'surface_resistance_s_m' (70.0): "
       "stomata "
       "close at night"},
      {"night_of_open_water",
       material("base_k = 290\nsurface_resistance_s_m = 0\nnight_resistance_s_m = 50\n" + kLayer),
       "s.toml:8:24: 'night_resistance_s_m' has no effect: 'surface_resistance_s_m' is 0"},
      {"store_of_a_given_temperature", material("prescribed_k = 400\nwater_store_mm = 1\n"),
       "s.toml:7:18: 'water_store_mm' has no effect: 'prescribed_k' gives the temperature"},
      {"ready_without_store", material("base_k = 290\nreadily_evaporable_mm = 9\n" + kLayer),
       "s.toml:7:25: 'readily_evaporable_mm' needs 'water_store_mm'"},
      {"ready_above_store",
       material("base_k = 290\nwater_store_mm = 5\nreadily_evaporable_mm = 9\n" + kLayer),
       "s.toml:8:25: 'readily_evaporable_mm' (9.0) must be below 'water_store_mm' (5.0)"},
      {"soil_with_stomata",
       material("base_k = 290\nwater_store_mm = 19\nreadily_evaporable_mm = 9\n"
                "surface_resistance_s_m = 70\n" +
                kLayer),
       "s.toml:9:26: 'surface_resistance_s_m' has no effect: 'readily_evaporable_mm' makes the "
       "store that of bare soil"},
      {"humidity_above_1",
       "[[weather.sample]]\ntime_s = 5\ndni_w_m2 = 0\ndhi_w_m2 = 0\nlongwave_down_w_m2 = "
       "300\nair_k = 290\nwind_m_s = 0\nrelative_humidity_frac = 55\n",
       "s.toml:9:26: 'relative_humidity_frac' is 55, must be 0 .. 1"},
      {"material_twice", material("prescribed_k = 400\n") + material("prescribed_k = 400\n"),
       "s.toml:8:8: material 'x' is already defined at s.toml:2:1"},
      {"dew_point", "[weather]\nair_mean_k = 290\ndew_point_k = 310\n",
       "s.toml:4:15: 'dew_point_k' (310) is above the warmest air (296)"},
      {"weather_descends",
       "[[weather.sample]]\ntime_s = 5\ndni_w_m2 = 0\ndhi_w_m2 = 0\nlongwave_down_w_m2 = "
       "300\nair_k "
       "= 290\nwind_m_s = 0\ncloud_frac = 0\n[[weather.sample]]\ntime_s = 5\ndni_w_m2 = "
       "0\ndhi_w_m2 "
       "= 0\nlongwave_down_w_m2 = 300\nair_k = 290\nwind_m_s = 0\ncloud_frac = 0\n",
       "s.toml:11:10: 'time_s' is not later than in the sample before"},
  };
  return all;
}

class ScenarioError : public ConfigTest, public ::testing::WithParamInterface<std::size_t> {};

TEST_P(ScenarioError, names_file_line_column_and_key) {
  const Case& test = cases()[GetParam()];
  EXPECT_EQ(scenario_error(test.text), test.error);
}

INSTANTIATE_TEST_SUITE_P(Each, ScenarioError, ::testing::Range<std::size_t>(0, cases().size()),
                         [](const auto& each) { return std::string(cases()[each.param].name); });

class MalformedToml : public ConfigTest, public ::testing::WithParamInterface<std::size_t> {};

const std::vector<std::string>& malformed() {
  static const std::vector<std::string> all = {
      "a = \n",                        // no value
      "= 1\n",                         // no key
      "[place\nlat_deg = 1\n",         // header not closed
      "[place]]\n",                    // too many brackets
      "[place]\n[place]\n",            // table twice
      "name = \"a\"\nname = \"b\"\n",  // key twice
      "name = \"abc\n",                // string not closed
      "name = \"\\q\"\n",              // unknown escape
      "name = 'a' 'b'\n",              // two values
      "materials = [1, 2\n",           // array not closed
      "x = { a = 1, \n",               // inline table not closed
      "x = 01\n",                      // leading zero
      "x = 1__0\n",                    // double underscore
      "x = 2014-13-45T99:00:00Z\n",    // impossible instant
      "x = tru\n",                     // half a word
      "x = 99999999999999999999\n",    // beyond 64 bits
      "a b = 1\n",                     // blank in a bare key
      "[[object]]\n[object]\n",        // array of tables as table
      "\xFF\xFE = 1\n",                // not UTF-8
      "x = \"a\x01z\"\n",              // control character
  };
  return all;
}

TEST_P(MalformedToml, is_refused_with_its_position) {
  const auto loaded = load_scenario(write("bad.toml", malformed()[GetParam()]), {}, options_);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(loaded.error().code, physics::ErrorCode::config);
  EXPECT_THAT(without_folder(loaded.error().text),
              ::testing::ContainsRegex("^bad.toml:[123]:[0-9]+: "));
}

INSTANTIATE_TEST_SUITE_P(Each, MalformedToml, ::testing::Range<std::size_t>(0, malformed().size()));

TEST_F(ConfigTest, all_faults_of_a_file_are_reported_together) {
  EXPECT_EQ(scenario_error("[thermal]\nsteps = 0\nspacin = \"uniform\"\n[display]\nmin_k = -1\n"),
            "s.toml:3:9: 'steps' is 0, must be 1 .. 4096\n"
            "s.toml:4:1: unknown key 'spacin', did you mean 'spacing'?\n"
            "s.toml:6:9: 'min_k' is -1, must be 0 .. 5000");
}

TEST_F(ConfigTest, a_missing_file_is_not_found) {
  const auto loaded = load_scenario(folder_ / "none.toml", {}, options_);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(loaded.error().code, physics::ErrorCode::not_found);
  EXPECT_EQ(without_folder(loaded.error().text), "none.toml: no such file");
}

TEST_F(ConfigTest, a_folder_is_refused) {
  const auto loaded = load_scenario(folder_, {}, options_);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(loaded.error().code, physics::ErrorCode::io);
}

TEST_F(ConfigTest, a_missing_gltf_is_reported_where_it_is_named) {
  options_.require_scene_files = true;
  EXPECT_EQ(scenario_error("[[object]]\ngltf = \"none.glb\"\n"),
            "s.toml:3:8: 'gltf': none.glb: no such file");
}

TEST_F(ConfigTest, a_missing_image_of_materials_is_reported_where_it_is_named) {
  options_.require_scene_files = true;
  write("box.glb", "");
  EXPECT_EQ(scenario_error("[[object]]\ngltf = \"box.glb\"\n[[object.material_images]]\n"
                           "material = \"Body\"\nimage = \"none.png\"\n"
                           "legend = { \"#123456\" = \"concrete\" }\n"),
            "s.toml:6:9: 'image': none.png: no such file");
}

TEST_F(ConfigTest, a_missing_file_of_an_output_is_reported_where_it_is_named) {
  const std::string channel =
      "[[channel]]\nname = \"a\"\nband = \"8-12\"\ndrive_table_file = \"none.csv\"\n";
  EXPECT_EQ(scenario_error(channel), "(loaded)");
  options_.require_scene_files = true;
  EXPECT_EQ(scenario_error(channel), "s.toml:5:20: 'drive_table_file': none.csv: no such file");
}

TEST_F(ConfigTest, a_missing_spot_is_reported_where_it_is_named) {
  options_.require_scene_files = true;
  EXPECT_EQ(scenario_error("[[channel]]\nname = \"a\"\nband = \"8-12\"\n[channel.optics]\n"
                           "spot = \"file\"\nspot_file = \"none.exr\"\n"),
            "s.toml:7:13: 'spot_file': none.exr: no such file");
}

TEST_F(ConfigTest, a_fault_in_a_library_names_the_library) {
  write("bad_library.toml", "[[material]]\nname = \"y\"\nemissivity = 1\n");
  const auto loaded = load_scenario(
      write("t.toml", "materials = [\"m.toml\", \"bad_library.toml\"]\n"), {}, options_);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_THAT(without_folder(loaded.error().text),
              ::testing::HasSubstr("bad_library.toml:3:1: unknown key 'emissivity', did you mean "
                                   "'emissivity_frac'?"));
}

TEST_F(ConfigTest, a_missing_library_is_reported_where_it_is_named) {
  const auto loaded =
      load_scenario(write("t.toml", "materials = [\"m.toml\", \"none.toml\"]\n"), {}, options_);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(without_folder(loaded.error().text),
            "t.toml:1:13: 'materials': none.toml: no such file");
}

TEST_F(ConfigTest, two_libraries_with_one_name_are_refused) {
  std::filesystem::copy_file(folder_ / "m.toml", folder_ / "n.toml");
  const auto loaded =
      load_scenario(write("t.toml", "materials = [\"m.toml\", \"n.toml\"]\n"), {}, options_);
  ASSERT_FALSE(loaded.has_value());
  EXPECT_EQ(without_folder(loaded.error().text),
            "n.toml:1:1: material 'concrete' is already defined at m.toml:1:1");
}

}  // namespace
}  // namespace emit::config::testing
