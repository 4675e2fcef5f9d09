// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "config/config_support.hpp"

namespace emit::config::testing {
namespace {

const std::filesystem::path kConfig = std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "../config";

TEST_F(ConfigTest, readme_has_the_tables_of_the_key_table) {
  std::ifstream in(kConfig / "README.md", std::ios::binary);
  ASSERT_TRUE(in) << kConfig;
  std::ostringstream content;
  content << in.rdbuf();
  const std::string text = content.str();
  const std::string begin = "<!-- keys:begin -->\n";
  const std::size_t from = text.find(begin);
  const std::size_t to = text.find("<!-- keys:end -->");
  ASSERT_NE(from, std::string::npos);
  ASSERT_NE(to, std::string::npos);
  EXPECT_TRUE(text.substr(from + begin.size(), to - from - begin.size()) ==
              key_reference_markdown())
      << "run: config_doc config/README.md";
}

TEST_F(ConfigTest, the_shipped_library_is_complete_and_consistent) {
  const auto loaded = load_scenario(
      write("t.toml", "materials = [\"" + (kConfig / "materials/library.toml").string() + "\"]\n"),
      {}, options_);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  std::set<std::string> names;
  std::set<std::string> families;
  for (const scene::Material& material : loaded->materials) {
    SCOPED_TRACE(material.name);
    names.insert(material.name);
    EXPECT_FALSE(material.source.empty());
    EXPECT_EQ(material.band_emissivity.size(), 4U);
    families.insert(material.family);
    ASSERT_TRUE(material.spread.has_value());
    EXPECT_GT(material.spread->solar_absorptance_frac, 0.0);
    EXPECT_GT(material.spread->emissivity_frac, 0.0);
    ASSERT_EQ(material.spread->band_emissivity.size(), 4U);
    for (const scene::BandEmissivity& band : material.spread->band_emissivity) {
      EXPECT_GT(band.emissivity_frac, 0.0) << band.band;
    }
    EXPECT_FALSE(material.uncertainty.empty());
    // Frames of the library's materials are not flagged for what they are made of.
    EXPECT_TRUE(material.dry_layers_valid || material.prescribed_k);
    if (material.prescribed_k) {
      continue;
    }
    EXPECT_GT(material.spread->conductivity_frac, 0.0);
    EXPECT_GT(material.spread->heat_capacity_frac, 0.0);
    ASSERT_FALSE(material.layers.empty());
    EXPECT_GT(material.base_k, 0.0);
    ASSERT_FALSE(material.modes.empty());
    double sum = 0.0;
    for (const scene::RelaxationMode& mode : material.modes) {
      EXPECT_GT(mode.tau_s, 1.0);
      EXPECT_LT(mode.tau_s, 3e6);
      sum += mode.weight_frac;
    }
    EXPECT_NEAR(sum, 1.0, 1e-9);
  }
  for (const char* name : {"asphalt",
                           "concrete",
                           "brick",
                           "roof_bitumen",
                           "roof_tile_clay",
                           "roof_metal",
                           "vehicle_white",
                           "vehicle_black",
                           "camouflage_paint",
                           "camouflage_net",
                           "tarpaulin",
                           "rubber",
                           "glass",
                           "composite_carbon",
                           "gravel",
                           "sand",
                           "sand_wet",
                           "clay",
                           "loam",
                           "lawn",
                           "crops",
                           "canopy_needle",
                           "canopy_leaf",
                           "snow_fresh",
                           "snow_old",
                           "ice",
                           "water",
                           "aluminium",
                           "steel",
                           "painted_metal",
                           "runway_paint",
                           "paint_yellow",
                           "asphalt_new",
                           "asphalt_rubber",
                           "concrete_pavement_worn",
                           "concrete_pavement_old",
                           "aircraft_skin",
                           "fabric",
                           "stone",
                           "steel_sheet",
                           "asphalt_paper",
                           "concrete_paper",
                           "grass",
                           "soil",
                           "wood",
                           "roof_concrete"}) {
    EXPECT_EQ(names.count(name), 1U) << name;
  }
  EXPECT_EQ(families.count(""), 0U);
  EXPECT_GE(families.size(), 10U);
  // Plants, water and wet ground evaporate, and leaves have a film of their own.
  for (const scene::Material& material : loaded->materials) {
    const bool moist = material.family == "vegetation" || material.name == "water" ||
                       material.name == "sea" || material.name.ends_with("_wet");
    EXPECT_EQ(moist, !scene::moisture_of(material).dry()) << material.name;
    const bool leafy = material.name == "foliage" || material.name.starts_with("canopy_") ||
                       material.name == "camouflage_net";
    EXPECT_EQ(leafy, material.leaf_width_m.has_value()) << material.name;
  }
}

TEST_F(ConfigTest, table_1_materials_have_their_published_values) {
  const auto loaded = load_scenario(
      write("t.toml", "materials = [\"" + (kConfig / "materials/library.toml").string() + "\"]\n"),
      {}, options_);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const auto find = [&loaded](const std::string& name) {
    return *std::find_if(loaded->materials.begin(), loaded->materials.end(),
                         [&name](const scene::Material& m) { return m.name == name; });
  };
  const scene::Material asphalt = find("asphalt");
  EXPECT_EQ(asphalt.layers[0].thickness_m, 0.15);
  EXPECT_EQ(asphalt.layers[0].conductivity_w_m_k, 0.7);
  EXPECT_EQ(asphalt.emissivity_frac, 0.93);
  EXPECT_EQ(asphalt.solar_absorptance_frac, 0.75);
  EXPECT_EQ(asphalt.modes[0].tau_s, 609.0);
  EXPECT_EQ(find("asphalt_paper").solar_absorptance_frac, 0.25);
  const scene::Material concrete = find("concrete");
  EXPECT_EQ(concrete.layers[0].thickness_m, 0.10);
  EXPECT_EQ(concrete.layers[0].conductivity_w_m_k, 1.28);
  EXPECT_EQ(concrete.emissivity_frac, 0.88);
  EXPECT_EQ(concrete.solar_absorptance_frac, 0.60);
  EXPECT_EQ(concrete.modes[1].weight_frac, 0.676);
  EXPECT_EQ(find("concrete_paper").solar_absorptance_frac, 0.40);
}

class ShippedScenario : public ConfigTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(ShippedScenario, loads_prints_and_loads_again) {
  const std::string file = std::string(GetParam()) + ".toml";
  const auto first = load_scenario(kConfig / "scenarios" / file, {}, options_);
  ASSERT_TRUE(first.has_value()) << first.error().text;
  EXPECT_EQ(kind_of_file(kConfig / "scenarios" / file), FileKind::scenario);
  EXPECT_FALSE(first->objects.empty());
  EXPECT_FALSE(first->sensor.trajectory.empty());
  EXPECT_THAT(first->warnings, ::testing::IsEmpty());
  const std::string printed = print_scenario(*first);
  const auto second = load_scenario(write("printed.toml", printed), {}, options_);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  EXPECT_TRUE(print_scenario(*second) == printed);
}

INSTANTIATE_TEST_SUITE_P(Each, ShippedScenario,
                         ::testing::Values("box", "statue", "block-on-road", "ribbed", "airfield",
                                           "engage", "decoys", "sea", "fair-weather"),
                         [](const auto& each) {
                           std::string name = each.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST_F(ConfigTest, shipped_names_resolve_in_the_data_folder) {
  const std::filesystem::path data = folder_ / "data";
  std::filesystem::create_directories(data / "scenarios");
  std::ofstream(data / "scenarios/my.toml") << "";
  ASSERT_EQ(setenv("EMIT_DATA_DIR", data.c_str(), 1), 0);
  const auto by_name = resolve_scenario("my");
  const auto by_file = resolve_scenario((data / "scenarios/my.toml").string());
  const auto unknown = resolve_scenario("yours");
  const auto names = shipped_scenarios();
  unsetenv("EMIT_DATA_DIR");
  ASSERT_TRUE(by_name.has_value()) << by_name.error().text;
  EXPECT_EQ(*by_name, data / "scenarios/my.toml");
  EXPECT_TRUE(by_file.has_value());
  ASSERT_FALSE(unknown.has_value());
  EXPECT_EQ(unknown.error().code, physics::ErrorCode::not_found);
  EXPECT_THAT(names, ::testing::Contains("my"));
}

TEST_F(ConfigTest, share_paths_start_at_the_data_folder) {
  const std::filesystem::path data = folder_ / "data";
  std::filesystem::create_directories(data / "scenes");
  std::ofstream(data / "scenes/x.glb") << "";
  ASSERT_EQ(setenv("EMIT_DATA_DIR", data.c_str(), 1), 0);
  const auto good = scenario("[[object]]\ngltf = \"share:scenes/x.glb\"\n");
  const std::string bad = scenario_error("[[object]]\ngltf = \"share:scenes/y.glb\"\n");
  unsetenv("EMIT_DATA_DIR");
  ASSERT_TRUE(good.has_value()) << good.error().text;
  EXPECT_EQ(good->objects[0].gltf, data / "scenes/x.glb");
  EXPECT_THAT(
      bad, ::testing::StartsWith("s.toml:3:8: 'gltf': 'scenes/y.glb' is not among the data files"));
}

class ShippedProfile : public ConfigTest, public ::testing::WithParamInterface<const char*> {};

TEST_P(ShippedProfile, loads) {
  // Profiles name shipped scenarios; the source tree has the same folders as the installed one.
  ASSERT_EQ(setenv("EMIT_DATA_DIR", kConfig.c_str(), 1), 0);
  const auto loaded =
      load_daemon(kConfig / "profiles" / (std::string(GetParam()) + ".toml"), {}, options_);
  unsetenv("EMIT_DATA_DIR");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_EQ(kind_of_file(kConfig / "profiles" / (std::string(GetParam()) + ".toml")),
            FileKind::daemon);
}

TEST_F(ConfigTest, the_kind_of_a_file_is_that_of_all_its_keys) {
  EXPECT_EQ(kind_of_file(kConfig / "materials/library.toml"), FileKind::materials);
  EXPECT_EQ(kind_of_file(kConfig / "weather/warm_overcast.csv"), FileKind::unknown);
  EXPECT_EQ(kind_of_file(kConfig / "no_such_file.toml"), FileKind::unknown);
  EXPECT_EQ(kind_of_file(write("both.toml", "epoch_utc = 2014-06-21T06:00:00Z\n[pacing]\n")),
            FileKind::unknown);
  EXPECT_EQ(kind_of_file(write("none.toml", "")), FileKind::unknown);
}

TEST_F(ConfigTest, a_scenario_without_place_or_time_warns_of_the_defaults_it_takes) {
  const auto none = scenario("");
  ASSERT_TRUE(none.has_value()) << none.error().text;
  using ::testing::AllOf;
  using ::testing::HasSubstr;
  EXPECT_THAT(none->warnings,
              ::testing::ElementsAre(
                  AllOf(HasSubstr("s.toml: 'epoch_utc' is not given"), HasSubstr("2014-06-21T10")),
                  AllOf(HasSubstr("'place.lat_deg' is not given"), HasSubstr("48.56 is taken")),
                  AllOf(HasSubstr("'place.lon_deg' is not given"), HasSubstr("11.26 is taken")),
                  HasSubstr("place and date give weather.air_mean_k = ")));
  // Values from the command line count as given.
  const auto given =
      scenario("epoch_utc = 2014-06-21T06:00:00Z\n[place]\nlat_deg = 10\n",
               {{"place.lon_deg=20"}, {"weather.air_mean_k=300"}, {"weather.dew_point_k=290"}});
  ASSERT_TRUE(given.has_value()) << given.error().text;
  EXPECT_THAT(given->warnings, ::testing::IsEmpty());
}

INSTANTIATE_TEST_SUITE_P(Each, ShippedProfile,
                         ::testing::Values("default", "ci_llvmpipe", "canned", "low_latency"));

}  // namespace
}  // namespace emit::config::testing
