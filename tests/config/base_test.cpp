// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/base.hpp"
#include "config_support.hpp"

namespace emit::config::testing {
namespace {

const char* const kLayers =
    "layers = [{ thickness_m = 2, conductivity_w_m_k = 1.2, density_kg_m3 = 1900, "
    "specific_heat_j_kg_k = 1158 }]\nsolar_absorptance_frac = 0.6\nemissivity_frac = 0.9\n";

class BaseTest : public ConfigTest {
 protected:
  /// Returns the temperature under a material in a scenario that begins with `head`.
  double base_k(const std::string& head, const std::string& base) {
    const auto loaded = scenario(head + "[[material]]\nname = \"x\"\n" + base + "\n" + kLayers);
    EXPECT_TRUE(loaded.has_value()) << loaded.error().text;
    return loaded ? loaded->materials.back().base_k : 0.0;
  }
};

const std::string kWinter =
    "epoch_utc = 2024-01-15T12:00:00Z\n[place]\nlat_deg = 60\nlon_deg = 0\n"
    "[weather]\nair_mean_k = 255\ndew_point_k = 250\n";
const std::string kSummer =
    "epoch_utc = 2024-07-15T12:00:00Z\n[place]\nlat_deg = 60\nlon_deg = 0\n"
    "[weather]\nair_mean_k = 290\ndew_point_k = 280\n";

TEST_F(BaseTest, ground_is_warmer_than_winter_air_and_colder_than_summer_air) {
  const double winter_k = base_k(kWinter, "base = \"ground\"");
  const double summer_k = base_k(kSummer, "base = \"ground\"");
  EXPECT_GT(winter_k, 265.0);
  EXPECT_LT(summer_k, 280.0);
  EXPECT_NE(winter_k, summer_k);
}

TEST_F(BaseTest, vehicles_and_walls_have_the_mean_of_the_air) {
  EXPECT_EQ(base_k(kWinter, "base = \"body\""), 255.0);
  EXPECT_EQ(base_k(kSummer, "base = \"air\""), 290.0);
}

TEST_F(BaseTest, a_stated_temperature_wins) {
  EXPECT_EQ(base_k(kWinter, "base = \"ground\"\nbase_k = 300"), 300.0);
  EXPECT_EQ(base_k(kWinter, "base = \"room\"\nbase_k = 294"), 294.0);
  EXPECT_EQ(base_k(kWinter, "base_k = 280"), 280.0);
}

TEST_F(BaseTest, a_table_of_weather_gives_the_day_before_the_run) {
  const std::string rest =
      "dni_w_m2 = 0\ndhi_w_m2 = 0\nlongwave_down_w_m2 = 300\nwind_m_s = 2\ncloud_frac = 0\n";
  const double mean_k = base_k(
      "[thermal]\nhistory_start_s = -86400\nspin_up_s = 0\n[weather]\n"
      "[[weather.sample]]\ntime_s = -86400\nair_k = 260\n" +
          rest + "[[weather.sample]]\ntime_s = 0\nair_k = 280\n" + rest,
      "base = \"air\"");
  EXPECT_NEAR(mean_k, 270.0, 0.2);
}

TEST_F(BaseTest, a_printed_scenario_keeps_kinds_and_stated_numbers) {
  const auto loaded = scenario(kWinter + "[[material]]\nname = \"x\"\nbase = \"ground\"\n" +
                               kLayers + "[[material]]\nname = \"y\"\nbase_k = 280\n" + kLayers);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const auto again = load_scenario(write("again.toml", print_scenario(*loaded)), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  for (const scene::Material& material : again->materials) {
    SCOPED_TRACE(material.name);
    EXPECT_EQ(material.base_stated, material.name != "x");
  }
}

TEST_F(BaseTest, objects_state_their_interior_and_print_it) {
  const auto loaded = scenario(
      "[[object]]\ngltf = \"a.glb\"\ninterior_heat_j_m2_k = 40000\n"
      "interior_ventilation_w_m2_k = 0\n[[object]]\ngltf = \"a.glb\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_EQ(loaded->objects[0].interior, (scene::BodyInterior{40'000.0, 0.0}));
  EXPECT_EQ(loaded->objects[1].interior, scene::BodyInterior{});
  const auto again = load_scenario(write("again.toml", print_scenario(*loaded)), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ(again->objects[0].interior, loaded->objects[0].interior);
}

TEST_F(BaseTest, without_weather_place_and_date_give_it_and_a_warning_says_so) {
  const auto loaded =
      scenario("epoch_utc = 2024-01-15T12:00:00Z\n[place]\nlat_deg = 70\nlon_deg = 0\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_LT(loaded->clear_sky.air_mean_k, 255.0);
  EXPECT_LT(loaded->clear_sky.dew_point_k, loaded->clear_sky.air_mean_k);
  EXPECT_EQ(loaded->thermal.initial_k, loaded->clear_sky.air_mean_k);
  ASSERT_EQ(loaded->warnings.size(), 1U);
  EXPECT_THAT(loaded->warnings[0], ::testing::HasSubstr("weather.air_mean_k = "));
}

TEST_F(BaseTest, shadows_act_for_days_unless_the_history_is_stated) {
  const auto open = scenario("");
  ASSERT_TRUE(open.has_value()) << open.error().text;
  EXPECT_EQ(open->thermal.history_start_ns, -302'400'000'000'000);
  EXPECT_EQ(open->thermal.spin_up_ns, 0);
  EXPECT_EQ(open->thermal.spacing, scene::StepSpacing::geometric);
  const auto stated = scenario("[thermal]\nhistory_start_s = 0\n");
  ASSERT_TRUE(stated.has_value()) << stated.error().text;
  EXPECT_EQ(stated->thermal.spin_up_ns, 172'800'000'000'000);
  EXPECT_EQ(stated->thermal.steps, 27U);
  for (const char* const otherwise : {"method = \"per-frame\"", "model = \"emit2014\""}) {
    const auto short_of = scenario("[thermal]\n" + std::string(otherwise) + "\n");
    ASSERT_TRUE(short_of.has_value()) << short_of.error().text;
    EXPECT_EQ(short_of->thermal.history_start_ns, -12'600'000'000'000);
    EXPECT_EQ(short_of->thermal.steps, 27U);
  }
}

}  // namespace
}  // namespace emit::config::testing
