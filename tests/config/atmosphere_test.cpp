// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <cmath>

#include "config/config_support.hpp"
#include "emit/physics/air_model.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sky/fog.hpp"

namespace emit::config::testing {
namespace {

constexpr const char* kScenario = "[atmosphere]\nfile = \"a.csv\"\nmodel = \"none\"\n";
constexpr const char* kOneChannel = "[[channel]]\nname = \"c\"\nband = \"8-12\"\n";
constexpr const char* kAtmosphereHeader =
    "band,range_m,elevation_deg,transmittance_frac,path_radiance_w_m2_sr\n";

TEST_F(ConfigTest, an_atmosphere_table_becomes_a_grid_per_band) {
  // Bands, elevations and columns may come in any order.
  write("a.csv",
        "# from a model run\r\nelevation_deg,band,range_m,path_radiance_w_m2_sr,transmittance_frac"
        "\r\n10,8-12,100,0.5,0.98\r\n10,8-12,2000,8,0.7\r\n-10,8-12,100,0.6,0.97\r\n"
        "-10,8-12,2000,9,0.6\r\n0,3-5,500,0.1,0.8\r\n");
  const auto loaded = scenario(kScenario);
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_EQ(loaded->atmosphere.bands.size(), 2U);
  const physics::AtmosphereGrid& lwir = loaded->atmosphere.bands[0].table;
  EXPECT_EQ(loaded->atmosphere.bands[0].band, "8-12");
  EXPECT_EQ(lwir.range_m, (std::vector<double>{100.0, 2000.0}));
  EXPECT_EQ(lwir.elevation_rad,
            (std::vector<double>{-10.0 * physics::kDegree, 10.0 * physics::kDegree}));
  EXPECT_EQ(lwir.transmittance_frac, (std::vector<double>{0.97, 0.6, 0.98, 0.7}));
  EXPECT_EQ(lwir.path_radiance_w_m2_sr, (std::vector<double>{0.6, 9.0, 0.5, 8.0}));
  EXPECT_TRUE(loaded->atmosphere.bands[0].terms.empty());
  EXPECT_EQ(loaded->atmosphere.bands[1].table.range_m, std::vector<double>{500.0});
}

TEST_F(ConfigTest, an_atmosphere_table_is_printed_inline_and_reads_back) {
  write("a.csv", std::string(kAtmosphereHeader) +
                     "8-12,100,-7.3,0.97,0.6\n8-12,2000,-7.3,0.6,9.1\n"
                     "8-12,100,48.56,0.98,0.5\n8-12,2000,48.56,0.7,8.2\n");
  const auto first = scenario(kScenario + std::string(kOneChannel));
  ASSERT_TRUE(first.has_value()) << first.error().text;
  const std::string printed = print_scenario(*first);
  const auto second = load_scenario(write("printed.toml", printed), {}, options_);
  ASSERT_TRUE(second.has_value()) << second.error().text;
  EXPECT_EQ(print_scenario(*second), printed);
  const physics::AtmosphereGrid& a = first->atmosphere.bands[0].table;
  const physics::AtmosphereGrid& b = second->atmosphere.bands[0].table;
  EXPECT_EQ(a.range_m, b.range_m);
  EXPECT_EQ(a.elevation_rad, b.elevation_rad);
  EXPECT_EQ(a.transmittance_frac, b.transmittance_frac);
  EXPECT_EQ(a.path_radiance_w_m2_sr, b.path_radiance_w_m2_sr);
}

struct TableCase {
  const char* name;
  std::string rows;
  std::string error;
};

const std::vector<TableCase>& table_cases() {
  static const std::vector<TableCase> all = {
      {"range_twice", "8-12,100,0,0.9,1\n# c\n8-12,200,0,0.8,2\n8-12,100,0,0.9,1\n",
       "a.csv:5: band '8-12', elevation 0 deg, range 100 m is already in line 2"},
      {"range_descends", "8-12,200,0,0.9,1\n8-12,100,0,0.95,1\n",
       "a.csv:3: 'range_m' (100) is below that of line 2 (200) of the same band and elevation: "
       "ranges must ascend"},
      {"transmittance_rises", "8-12,100,0,0.8,1\n8-12,200,0,0.9,2\n",
       "a.csv:3: 'transmittance_frac' (0.9) rises with range: line 2 has 0.8"},
      {"not_clear_at_zero", "8-12,0,0,0.99,0\n8-12,200,0,0.9,2\n",
       "a.csv:2: at range 0 transmittance must be 1 and path radiance 0"},
      {"only_zero", "8-12,0,0,1,0\n", "a.csv:2: band '8-12' has no range beyond 0 m"},
      {"a_range_is_missing",
       "8-12,100,0,0.9,1\n8-12,200,0,0.8,2\n8-12,300,0,0.7,3\n8-12,100,5,0.9,1\n8-12,300,5,0.7,3\n",
       "a.csv:6: band '8-12': elevation 5 deg has no row of range 200 m, which elevation 0 deg has "
       "in line 3; all elevations of a band need the same ranges"},
      {"a_range_too_many", "8-12,100,0,0.9,1\n8-12,100,5,0.9,1\n8-12,300,5,0.7,3\n",
       "a.csv:4: band '8-12': elevation 0 deg has no row of range 300 m, which elevation 5 deg has "
       "here; all elevations of a band need the same ranges"},
      {"unknown_band", "8-12,100,0,0.9,1\n8-14,100,0,0.9,1\n",
       "a.csv:3: there is no band '8-14', did you mean '8-12'? (known: 3-5, 3.4-4.1, 8-12, "
       "7.7-9.3)"},
      {"elevation_out_of_range", "8-12,100,95,0.9,1\n",
       "a.csv:2:10: 'elevation_deg' is 95, must be -90 .. 90"},
      {"transmittance_out_of_range", "8-12,100,0,1.2,1\n",
       "a.csv:2:12: 'transmittance_frac' is 1.2, must be 0 .. 1"},
  };
  return all;
}

class AtmosphereTableError : public ConfigTest,
                             public ::testing::WithParamInterface<std::size_t> {};

TEST_P(AtmosphereTableError, names_file_and_line) {
  const TableCase& test = table_cases()[GetParam()];
  write("a.csv", kAtmosphereHeader + test.rows);
  EXPECT_EQ(scenario_error(kScenario + std::string(kOneChannel)),
            "s.toml:3:8: 'file': " + test.error);
}

INSTANTIATE_TEST_SUITE_P(Each, AtmosphereTableError,
                         ::testing::Range<std::size_t>(0, table_cases().size()),
                         [](const auto& each) {
                           return std::string(table_cases()[each.param].name);
                         });

TEST_F(ConfigTest, an_atmosphere_table_names_its_missing_columns) {
  write("a.csv", "band,range_m,elevation_deg,tau\n");
  const std::string error = scenario_error(kScenario);
  EXPECT_THAT(error, ::testing::HasSubstr("a.csv:1:28: unknown column 'tau'"));
  EXPECT_THAT(error, ::testing::HasSubstr(
                         "columns 'transmittance_frac', 'path_radiance_w_m2_sr' are missing"));
}

TEST_F(ConfigTest, a_band_without_rows_is_named_unless_a_model_stands_in) {
  write("a.csv", std::string(kAtmosphereHeader) + "8-12,100,0,0.9,1\n");
  EXPECT_EQ(scenario_error("[atmosphere]\nfile = \"a.csv\"\n"),
            "s.toml:3:8: 'file': a.csv has no rows of band '3-5': add them, or name the 'model' "
            "that stands in for it");
  const auto mixed = scenario("[atmosphere]\nfile = \"a.csv\"\nmodel = \"us_standard\"\n");
  ASSERT_TRUE(mixed.has_value()) << mixed.error().text;
  EXPECT_FALSE(mixed->atmosphere.bands[0].table.empty());
  ASSERT_TRUE(mixed->atmosphere.bands[1].model);
  EXPECT_EQ(mixed->atmosphere.bands[1].model->climate, physics::AirClimate::us_standard);
}

TEST_F(ConfigTest, built_in_air_follows_place_date_and_weather_unless_stated) {
  const auto air = [this](const std::string& text) {
    const auto loaded = scenario(text);
    EXPECT_TRUE(loaded.has_value()) << loaded.error().text;
    return *loaded->atmosphere.bands.at(0).model;
  };
  const auto at = [](const char* lat, const char* date) {
    return fmt::format("epoch_utc = {}T12:00:00Z\n[place]\nlat_deg = {}\nlon_deg = 0\n", date, lat);
  };
  using physics::AirClimate;
  EXPECT_EQ(air(at("5", "2025-01-15")).climate, AirClimate::tropical);
  EXPECT_EQ(air(at("48", "2025-07-15")).climate, AirClimate::midlatitude_summer);
  EXPECT_EQ(air(at("48", "2025-01-15")).climate, AirClimate::midlatitude_winter);
  EXPECT_EQ(air(at("-40", "2025-01-15")).climate, AirClimate::midlatitude_summer);
  EXPECT_EQ(air(at("68", "2025-01-15")).climate, AirClimate::subarctic_winter);
  EXPECT_EQ(air(at("5", "2025-01-15") + "[atmosphere]\nmodel = \"us_standard\"\n").climate,
            AirClimate::us_standard);
  // Drier air has a lower dew point. Stated water and visibility stay as they are.
  const std::string weather = "[weather]\nair_mean_k = 293\ndew_point_k = ";
  const double dry = air(at("48", "2025-07-15") + weather + "275\n").water_ratio;
  const double moist = air(at("48", "2025-07-15") + weather + "290\n").water_ratio;
  EXPECT_NEAR(moist / dry,
              physics::saturated_vapour_g_m3(290.0) / physics::saturated_vapour_g_m3(275.0), 1e-9);
  const auto stated =
      air(at("48", "2025-07-15") + "[atmosphere]\nwater_ratio = 0.5\nvisibility_km = 10\n");
  EXPECT_EQ(stated.water_ratio, 0.5);
  EXPECT_EQ(stated.visibility_km, 10.0);
}

TEST_F(ConfigTest, an_inline_table_must_hold_together) {
  const std::string head = std::string(kOneChannel) + "[[atmosphere.band]]\nband = \"8-12\"\n";
  const std::string axes = "range_m = [100, 200]\nelevation_deg = [0]\n";
  const auto good = scenario(
      head + axes + "transmittance_frac = [[0.9, 0.8]]\npath_radiance_w_m2_sr = [[1, 2]]\n");
  ASSERT_TRUE(good.has_value()) << good.error().text;
  EXPECT_EQ(good->atmosphere.bands[0].table.range_m.size(), 2U);
  EXPECT_EQ(scenario_error(head),
            "s.toml:5:1: key 'terms' is missing (or a table: 'range_m', 'elevation_deg', "
            "'transmittance_frac', 'path_radiance_w_m2_sr')");
  EXPECT_EQ(scenario_error(head + axes + "transmittance_frac = [[0.9, 0.8]]\n"),
            "s.toml:5:1: key 'path_radiance_w_m2_sr' is missing");
  EXPECT_THAT(scenario_error(head + axes +
                             "terms = [[1, 0.2]]\ntransmittance_frac = [[0.9, 0.8]]\n"
                             "path_radiance_w_m2_sr = [[1, 2]]\n"),
              ::testing::HasSubstr("'terms' and a table exclude each other"));
  EXPECT_THAT(scenario_error(head + axes +
                             "transmittance_frac = [[0.8, 0.9]]\n"
                             "path_radiance_w_m2_sr = [[1, 2]]\n"),
              ::testing::HasSubstr("transmittance rises at range 200 m, elevation 0 deg"));
  EXPECT_THAT(scenario_error(head + axes +
                             "transmittance_frac = [[0.9, 0.8], [0.9]]\n"
                             "path_radiance_w_m2_sr = [[1, 2]]\n"),
              ::testing::HasSubstr("rows of different length"));
}

/// Test of the shipped example. Level paths are those of the built-in fits. Vertical ones meet
/// LOWTRAN7's published transmittances (to 1 and 8 km) and the brightness of its zenith sky (240.8
/// K, 8-12 um).
TEST_F(ConfigTest, the_shipped_atmosphere_table_agrees_with_what_it_was_made_from) {
  const auto file = std::filesystem::path(EMIT_TEST_SOURCE_DIR) /
                    "../config/atmospheres/midlatitude_summer_ground.csv";
  const auto loaded =
      scenario("[atmosphere]\nmodel = \"none\"\nfile = \"" + file.string() + "\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const auto column =
      physics::AirColumn::build({physics::AirClimate::midlatitude_summer, 23.0, 1.0});
  ASSERT_TRUE(column.has_value()) << column.error().text;
  ASSERT_EQ(loaded->atmosphere.bands.size(), 2U);
  const double published[2][2] = {{0.782, 0.642}, {0.518, 0.356}};
  for (std::size_t b = 0; b < 2; ++b) {
    SCOPED_TRACE(loaded->bands[b].name);
    const auto table = physics::AtmosphereTable::build(loaded->atmosphere.bands[b].table);
    ASSERT_TRUE(table.has_value()) << table.error().text;
    for (const double range_km : {0.012, 0.07, 0.4, 1.2, 6.0, 10.0}) {
      const auto path = physics::AirPath::between(*column, 2.0, 2.0, range_km * 1e3);
      const double tau = physics::BandAir::build(scene::spectral_band(loaded->bands[b]))
                             ->transmittance(path, physics::AirSource::black_300k);
      // The sum of exponentials is not one exponential between rows: 0.01 is the cell's own error.
      EXPECT_NEAR(table->along(range_km * 1e3, -0.1).transmittance_frac, tau, 0.01) << range_km;
      EXPECT_NEAR(table->along(range_km * 1e3, 0.0).transmittance_frac, tau, 0.01) << range_km;
    }
    EXPECT_NEAR(table->along(1000.0, 1.0).transmittance_frac, published[b][0], 0.02);
    EXPECT_NEAR(table->along(8000.0, 1.0).transmittance_frac, published[b][1], 0.02);
    EXPECT_FALSE(table->along(8000.0, 1.0).clamped);
    const physics::Band band{loaded->bands[b].lo_um, loaded->bands[b].hi_um, {}};
    const auto apparent_k = [&](double sine) {
      double low = 150.0;
      double high = 350.0;
      while (high - low > 1e-3) {
        const double middle = 0.5 * (low + high);
        (physics::band_radiance(band, physics::Kelvin(middle)).radiance_w_m2_sr <
                 table->out(sine).path_radiance_w_m2_sr
             ? low
             : high) = middle;
      }
      return low;
    };
    EXPECT_NEAR(apparent_k(0.0), 294.2, 0.5) << "the horizon is the air itself";
    if (b == 0) {
      EXPECT_NEAR(apparent_k(1.0), 240.8, 6.0);
    }
  }
}

TEST_F(ConfigTest, fog_is_read_and_printed_and_shades_the_models_of_the_clear_sky) {
  constexpr const char* kFog =
      "[atmosphere.fog]\nkind = \"moderate_radiation\"\nvisibility_m = 400.0\ntop_m = 60.0\n";
  const auto clear = scenario("");
  ASSERT_TRUE(clear) << clear.error().text;
  EXPECT_FALSE(clear->atmosphere.fog);
  EXPECT_FALSE(clear->clear_sky.fog);
  const auto loaded = scenario(kFog);
  ASSERT_TRUE(loaded) << loaded.error().text;
  EXPECT_EQ(loaded->atmosphere.fog,
            (physics::Fog{physics::FogKind::moderate_radiation, 400.0, 60.0}));
  ASSERT_TRUE(loaded->clear_sky.fog);
  EXPECT_EQ(*loaded->clear_sky.fog, physics::fog_shade(*loaded->atmosphere.fog));
  const std::string printed = print_scenario(*loaded);
  const auto second = load_scenario(write("printed.toml", printed), {}, options_);
  ASSERT_TRUE(second) << second.error().text;
  EXPECT_EQ(second->atmosphere.fog, loaded->atmosphere.fog);
  EXPECT_EQ(print_scenario(*second), printed);
  // A weather table was measured below the fog.
  const auto measured =
      scenario(kFog + std::string("[[weather.sample]]\ntime_s = 0\ndni_w_m2 = 0\ndhi_w_m2 = 90\n"
                                  "longwave_down_w_m2 = 370\nair_k = 284\nwind_m_s = 1\n"));
  ASSERT_TRUE(measured) << measured.error().text;
  EXPECT_TRUE(measured->atmosphere.fog);
  EXPECT_FALSE(measured->clear_sky.fog);
}

TEST_F(ConfigTest, faults_of_fog_name_file_and_key) {
  const auto fault = [&](const std::string& text) {
    const auto loaded = scenario(text);
    return loaded ? std::string("none") : loaded.error().text;
  };
  using ::testing::HasSubstr;
  const std::string kind = "[atmosphere.fog]\nkind = \"heavy_advection\"\n";
  EXPECT_THAT(fault("[atmosphere.fog]\nkind = \"smog\"\nvisibility_m = 50\ntop_m = 9\n"),
              ::testing::AllOf(HasSubstr(".toml:"),
                               HasSubstr("'kind' is 'smog', must be one of: heavy_adv")));
  EXPECT_THAT(fault(kind + "top_m = 9\n"), HasSubstr("visibility_m"));
  EXPECT_THAT(fault(kind + "visibility_m = 50\n"), HasSubstr("top_m"));
  EXPECT_THAT(fault(kind + "visibility_m = 5\ntop_m = 9\n"), HasSubstr("'visibility_m' is 5"));
  EXPECT_THAT(fault(kind + "visibility_m = 50\ntop_m = 0\n"), HasSubstr("'top_m' is 0"));
  EXPECT_THAT(fault(kind + "visibility_m = 50\ntop_m = 9\ndepth_m = 9\n"), HasSubstr("depth_m"));
  EXPECT_THAT(fault("[atmosphere]\nenabled = false\n" + kind + "visibility_m = 50\ntop_m = 9\n"),
              HasSubstr("'fog' needs air"));
}

}  // namespace
}  // namespace emit::config::testing
