// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "config/config_support.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"

namespace emit::config::testing {
namespace {

constexpr const char* kWeather = "[weather]\nfile = \"w.csv\"\n";
constexpr const char* kWeatherHeader =
    "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac\n";

TEST_F(ConfigTest, weather_is_read_with_columns_in_any_order) {
  write("w.csv",
        "# measured\r\nair_k, time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,wind_m_s,cloud_frac,"
        "environment_k,relative_humidity_frac\r\n290,0,800,100,330,2,0,,0.5\r\n\r\n"
        "291.5,60.5,810,101,331,2.5,0.1,288,\r\n");
  const auto loaded =
      scenario("epoch_utc = 2014-06-21T06:00:00Z\n" + std::string(kWeather) +
               "[place]\nlat_deg = 48\nlon_deg = 11\n[thermal]\nhistory_start_s = 0\n"
               "spin_up_s = 0\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_THAT(loaded->warnings, ::testing::IsEmpty());
  ASSERT_EQ(loaded->weather.size(), 2U);
  EXPECT_EQ(loaded->weather[0].air_k, 290.0);
  EXPECT_FALSE(loaded->weather[0].environment_k.has_value());
  EXPECT_EQ(loaded->weather[1].sim_time_ns, 60'500'000'000);
  EXPECT_EQ(loaded->weather[1].direct_normal_w_m2, 810.0);
  EXPECT_EQ(loaded->weather[1].diffuse_horizontal_w_m2, 101.0);
  EXPECT_EQ(loaded->weather[1].longwave_down_w_m2, 331.0);
  EXPECT_EQ(loaded->weather[1].wind_m_s, 2.5);
  EXPECT_EQ(loaded->weather[1].cloud_frac, 0.1);
  EXPECT_EQ(loaded->weather[1].environment_k, 288.0);
  EXPECT_FALSE(loaded->weather[1].film_w_m2_k.has_value());
  EXPECT_EQ(loaded->weather[0].relative_humidity_frac, 0.5);
  EXPECT_FALSE(loaded->weather[1].relative_humidity_frac.has_value());
}

TEST_F(ConfigTest, a_film_stands_for_the_wind_and_measured_sun_for_its_clouds) {
  write("w.csv",
        "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,film_w_m2_k\n0,500,100,330,290,13.3\n"
        "600,500,100,330,290,2\n");
  const auto loaded = scenario("[weather]\nfile = \"w.csv\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  // Rows of the clear-sky models lie around those of the table.
  const auto row = std::ranges::find(loaded->weather, 0, &scene::WeatherSample::sim_time_ns);
  ASSERT_LT(row + 1, loaded->weather.end());
  EXPECT_EQ(row->film_w_m2_k, 13.3);
  EXPECT_NEAR(physics::film_coefficient_w_m2_k(row->wind_m_s), 13.3, 1e-9);
  EXPECT_EQ(row->cloud_frac, 0.0);
  EXPECT_NEAR((row + 1)->wind_m_s, 0.0, 1e-9);
  const std::string sample =
      "[[weather.sample]]\ntime_s = 0\ndni_w_m2 = 0\ndhi_w_m2 = 0\nlongwave_down_w_m2 = 300\n"
      "air_k = 290\n";
  const auto table = scenario(sample + "film_w_m2_k = 13.3\n");
  ASSERT_TRUE(table.has_value()) << table.error().text;
  const auto sampled = std::ranges::find(table->weather, 0, &scene::WeatherSample::sim_time_ns);
  ASSERT_NE(sampled, table->weather.end());
  EXPECT_NEAR(physics::film_coefficient_w_m2_k(sampled->wind_m_s), 13.3, 1e-9);
  EXPECT_EQ(scenario_error(sample),
            "s.toml:2:1: 'wind_m_s' is needed where 'film_w_m2_k' is not given");
}

struct CsvCase {
  const char* name;
  std::string text;
  std::string error;
};

const std::vector<CsvCase>& csv_cases() {
  static const std::vector<CsvCase> all = {
      {"missing_column", "time_s,dni_w_m2\n0,1\n",
       "w.csv:1:1: columns 'dhi_w_m2', 'longwave_down_w_m2', 'air_k' are missing"},
      {"one_missing_column", "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,wind_m_s\n",
       "w.csv:1:1: column 'air_k' is missing"},
      {"neither_wind_nor_film",
       "time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,film_w_m2_k\n0,0,0,300,290,12\n"
       "60,0,0,300,290,\n",
       "w.csv:3: 'wind_m_s' is needed where 'film_w_m2_k' is not given"},
      {"foreign_table", "date,temp,rh\n",
       "w.csv:1:1: unknown columns 'date', 'temp', 'rh' (known: 'time_s', "},
      {"unknown_column", "time_s,dni_wm2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac\n",
       "w.csv:1:8: unknown column 'dni_wm2', did you mean 'dni_w_m2'?"},
      {"column_twice",
       "time_s,time_s,dni_w_m2,dhi_w_m2,longwave_down_w_m2,air_k,wind_m_s,cloud_frac\n",
       "w.csv:1:8: column 'time_s' appears twice"},
      {"not_a_number", std::string(kWeatherHeader) + "0,8x0,100,330,290,2,0\n",
       "w.csv:2:3: 'dni_w_m2': '8x0' is not a number"},
      {"decimal_comma", std::string(kWeatherHeader) + "0,\"8,5\",100,330,290,2,0\n",
       "w.csv:2:3: 'dni_w_m2': '8,5' is not a number; write '.' for the decimal point"},
      {"date", std::string(kWeatherHeader) + "2014-06-21 06:00,0,100,330,290,2,0\n",
       "w.csv:2:1: 'time_s': '2014-06-21 06:00' is not a number; dates"},
      {"unix_time", std::string(kWeatherHeader) + "1403330400,0,100,330,290,2,0\n",
       "w.csv:2:1: 'time_s' is 1403330400, must be -1000000000 .. 1000000000; this looks like UNIX "
       "time in seconds (2014-06-21)"},
      {"utf_16", std::string("\xFF\xFEt\0i\0", 6), "w.csv: the file is UTF-16 text"},
      {"semicolons", "time_s;dni_w_m2\n0;1\n", "w.csv:1:1: cells are separated by ';'"},
      {"indented_comment", "  # measured\n" + std::string(kWeatherHeader),
       "w.csv:1:3: a comment has to begin in the first column"},
      {"empty_value", std::string(kWeatherHeader) + "0,,100,330,290,2,0\n",
       "w.csv:2:3: 'dni_w_m2' is empty"},
      {"out_of_range", std::string(kWeatherHeader) + "0,800,100,330,20,2,0\n",
       "w.csv:2:15: 'air_k' is 20, must be 180 .. 340"},
      {"nan", std::string(kWeatherHeader) + "0,nan,100,330,290,2,0\n",
       "w.csv:2:3: 'dni_w_m2' is nan, must be 0 .. 2000"},
      {"too_few_values", std::string(kWeatherHeader) + "# c\n0,800,100\n",
       "w.csv:3:1: 3 values, the header has 7"},
      {"time_stands_still", std::string(kWeatherHeader) + "0,1,1,300,290,2,0\n0,1,1,300,290,2,0\n",
       "w.csv:3: 'time_s' is not later than in the row before"},
      {"empty_file", "", "w.csv: the file has no header row"},
      {"header_alone", kWeatherHeader, "w.csv: the file has no rows"},
  };
  return all;
}

class CsvError : public ConfigTest, public ::testing::WithParamInterface<std::size_t> {};

TEST_P(CsvError, names_file_and_line) {
  const CsvCase& test = csv_cases()[GetParam()];
  write("w.csv", test.text);
  EXPECT_THAT(scenario_error(kWeather), ::testing::StartsWith("s.toml:3:8: 'file': " + test.error));
}

/// Test that a fault of every row gives one line.
TEST_F(ConfigTest, faults_of_a_column_are_counted) {
  write("w.csv",
        std::string(kWeatherHeader) + "1,x,100,330,90,2,0\n2,y,100,330,90,2,0\n3,z,1,330,90,2,0\n");
  EXPECT_EQ(scenario_error(kWeather),
            "s.toml:3:8: 'file': w.csv:2:3: 'dni_w_m2': 'x' is not a number (and 2 other rows)\n"
            "w.csv:2:13: 'air_k' is 90, must be 180 .. 340 (and 2 other rows)");
}

/// Test that tables as spreadsheets write them are read like plain ones.
TEST_F(ConfigTest, weather_in_other_spellings_is_read_alike) {
  const std::string plain = std::string(kWeatherHeader) + "0,800,100,330,290,2,0\n";
  std::string cr = plain;
  std::replace(cr.begin(), cr.end(), '\n', '\r');
  for (const std::string& text :
       {cr, "\xEF\xBB\xBF" + plain,
        std::string("\"time_s\",\"dni_w_m2\",\"dhi_w_m2\",\"longwave_down_w_m2\",\"air_k\","
                    "\"wind_m_s\",\"cloud_frac\"\r\n\"0\",+800,1e2,\"330\",290,2,0\r\n")}) {
    write("w.csv", text);
    const auto loaded = scenario(kWeather);
    ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
    ASSERT_EQ(loaded->weather.size(), 1U);
    EXPECT_EQ(loaded->weather[0].direct_normal_w_m2, 800.0);
    EXPECT_EQ(loaded->weather[0].longwave_down_w_m2, 330.0);
  }
}

INSTANTIATE_TEST_SUITE_P(Each, CsvError, ::testing::Range<std::size_t>(0, csv_cases().size()),
                         [](const auto& each) {
                           return std::string(csv_cases()[each.param].name);
                         });

TEST_F(ConfigTest, a_missing_weather_file_is_reported_where_it_is_named) {
  EXPECT_EQ(scenario_error(kWeather), "s.toml:3:8: 'file': w.csv: no such file");
}

TEST_F(ConfigTest, clear_sky_options_beside_a_table_are_refused) {
  write("w.csv", std::string(kWeatherHeader) + "0,800,100,330,290,2,0\n");
  EXPECT_EQ(scenario_error(std::string(kWeather) + "cloud_frac = 0.5\n"),
            "s.toml:4:1: 'cloud_frac' has no effect: the weather comes from a file");
}

TEST_F(ConfigTest, trajectories_come_from_csv) {
  write("t.csv",
        "time_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg,on\n0,1,2,3,0,0,0,1\n1.5,4,5,6,90,0,0,"
        "0\n");
  const auto loaded =
      scenario("[[object]]\ngltf = \"a.glb\"\nentity_id = 4\ntrajectory_file = \"t.csv\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const scene::Trajectory& trajectory = loaded->objects[0].trajectory;
  ASSERT_EQ(trajectory.size(), 2U);
  EXPECT_EQ(trajectory[0].pose.position_world_m, glm::dvec3(1, 2, 3));
  EXPECT_EQ(trajectory[1].sim_time_ns, 1'500'000'000);
  EXPECT_FALSE(trajectory[1].on);
  // Heading 90 deg: the nose (body x) points east.
  const glm::dvec3 nose = trajectory[1].pose.world_from_body * glm::dvec3(1, 0, 0);
  EXPECT_NEAR(nose.x, 1.0, 1e-12);
  ASSERT_EQ(loaded->objects[0].instances.size(), 1U);
  EXPECT_EQ(loaded->objects[0].instances[0].position_world_m, glm::dvec3(1, 2, 3));
}

TEST_F(ConfigTest, trajectory_csv_faults_name_the_line) {
  write("t.csv", "time_s,x_m,y_m,z_m,heading_deg,pitch_deg,roll_deg,on\n0,1,2,3,0,0,0,0.5\n");
  EXPECT_EQ(scenario_error("[sensor]\ntrajectory_file = \"t.csv\"\n"),
            "s.toml:3:19: 'trajectory_file': t.csv:2: 'on' must be 0 or 1");
}

TEST_F(ConfigTest, responses_come_from_csv) {
  write("r.csv", "wavelength_um,response_frac\n3.0,0\n4,1\n5.5,0.25\n");
  const auto loaded = scenario(
      "[[band]]\nname = \"det\"\nresponse_file = \"r.csv\"\n[[channel]]\nname = \"c\"\nband = "
      "\"det\"\n[[atmosphere.band]]\nband = \"det\"\nterms = [[1, 0.2]]\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_EQ(loaded->bands.size(), 1U);
  EXPECT_EQ(loaded->bands[0].lo_um, 3.0);
  EXPECT_EQ(loaded->bands[0].hi_um, 5.5);
  ASSERT_EQ(loaded->bands[0].response.size(), 3U);
  EXPECT_EQ(loaded->bands[0].response[2].response_frac, 0.25);
  ASSERT_EQ(loaded->atmosphere.bands.size(), 1U);
  EXPECT_EQ(loaded->atmosphere.bands[0].terms[0].extinction_per_km, 0.2);
}

TEST_F(ConfigTest, a_band_that_no_channel_shows_is_not_handed_over) {
  const auto loaded = scenario(
      "[[band]]\nname = \"spare\"\nlo_um = 4\nhi_um = 5\n"
      "[[channel]]\nname = \"c\"\nband = \"3-5\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_EQ(loaded->bands.size(), 1U);
  EXPECT_EQ(loaded->bands[0].name, "3-5");
}

TEST_F(ConfigTest, atmosphere_terms_come_from_csv_for_its_bands_only) {
  write("a.csv",
        "band,amplitude_frac,extinction_per_km,vertical_transmittance_frac\n"
        "8-12,0.75,0.1,0.6\n8-12,0.25,1.0,0.6\n");
  const auto loaded = scenario("[atmosphere]\nfile = \"a.csv\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_EQ(loaded->atmosphere.bands.size(), 2U);
  EXPECT_EQ(loaded->atmosphere.bands[0].band, "8-12");
  EXPECT_EQ(loaded->atmosphere.bands[0].terms.size(), 2U);
  EXPECT_EQ(loaded->atmosphere.bands[0].vertical_transmittance_frac, 0.6);
  EXPECT_EQ(loaded->atmosphere.bands[1].band, "3-5");
  EXPECT_TRUE(loaded->atmosphere.bands[1].model);
}

TEST_F(ConfigTest, atmosphere_csv_amplitudes_must_add_up) {
  write("a.csv",
        "band,amplitude_frac,extinction_per_km,vertical_transmittance_frac\n8-12,0.75,0.1,0.6\n");
  EXPECT_EQ(
      scenario_error("[atmosphere]\nfile = \"a.csv\"\n"),
      "s.toml:3:8: 'file': a.csv:2: the amplitudes of band '8-12' add up to 0.75 over 1 rows, "
      "must be 1 over at most 4");
}

/// Test against LOWTRAN7's horizontal transmittances of the mid-latitude summer, 23 km. The
/// tolerances bound the errors of both fits.
TEST_F(ConfigTest, built_in_atmosphere_meets_the_tabulated_transmittance) {
  const auto loaded = scenario("[atmosphere]\nmodel = \"midlatitude_summer\"\nwater_ratio = 1\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const auto tau = [&](const scene::BandAtmosphere& band, double range_km) {
    const auto named = [&](const scene::SpectralBand& desc) { return desc.name == band.band; };
    const auto desc = std::ranges::find_if(loaded->bands, named);
    const auto column = physics::AirColumn::build(band.model.value());
    EXPECT_TRUE(column.has_value());
    return physics::BandAir::build(scene::spectral_band(*desc))
        ->transmittance(physics::AirPath::between(*column, 0.0, 0.0, range_km * 1e3),
                        physics::AirSource::black_300k);
  };
  ASSERT_EQ(loaded->atmosphere.bands.size(), 2U);
  const scene::BandAtmosphere& lwir = loaded->atmosphere.bands[0];
  const scene::BandAtmosphere& mwir = loaded->atmosphere.bands[1];
  EXPECT_NEAR(tau(lwir, 0.0), 1.0, 1e-6);
  EXPECT_NEAR(tau(lwir, 1.0), 0.733, 0.008);
  EXPECT_NEAR(tau(lwir, 5.0), 0.294, 0.008);
  EXPECT_NEAR(tau(lwir, 10.0), 0.105, 0.008);
  EXPECT_NEAR(tau(mwir, 1.0), 0.483, 0.017);
  EXPECT_NEAR(tau(mwir, 5.0), 0.208, 0.017);
}

TEST_F(ConfigTest, own_bands_take_the_emissivity_of_the_listed_band_that_is_most_like_them) {
  const auto loaded = scenario(
      "[[band]]\nname = \"wide\"\nlo_um = 3.7\nhi_um = 4.8\n"
      "[[band]]\nname = \"narrow\"\nlo_um = 8\nhi_um = 9\n"
      "[[band]]\nname = \"apart\"\nlo_um = 2\nhi_um = 2.5\n"
      "[[band]]\nname = \"stated\"\nlo_um = 3.7\nhi_um = 4.8\n"
      "[[channel]]\nname = \"a\"\nband = \"wide\"\n[[channel]]\nname = \"b\"\nband = \"narrow\"\n"
      "[[channel]]\nname = \"c\"\nband = \"apart\"\n[[channel]]\nname = \"d\"\nband = \"stated\"\n"
      "[[material]]\nname = \"m\"\nsolar_absorptance_frac = 0.5\nemissivity_frac = 0.9\n"
      "prescribed_k = 300\n"
      "band_emissivity_frac = { \"3-5\" = 0.8, \"3.4-4.1\" = 0.7, \"8-12\" = 0.6, \"7.7-9.3\" = "
      "0.5, "
      "\"stated\" = 0.4 }\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const auto material = std::ranges::find(loaded->materials, "m", &scene::Material::name);
  ASSERT_NE(material, loaded->materials.end());
  const auto emissivity_frac = [&](std::string_view band) {
    const auto entry =
        std::ranges::find(material->band_emissivity, band, &scene::BandEmissivity::band);
    return entry == material->band_emissivity.end() ? material->emissivity_frac
                                                    : entry->emissivity_frac;
  };
  EXPECT_EQ(emissivity_frac("wide"), 0.8);
  EXPECT_EQ(emissivity_frac("narrow"), 0.5);
  EXPECT_EQ(emissivity_frac("apart"), 0.9);
  EXPECT_EQ(emissivity_frac("stated"), 0.4);
}

TEST_F(ConfigTest, own_bands_have_built_in_air_where_it_reaches) {
  const auto bands = [&](const std::string& limits) {
    return scenario("[[band]]\nname = \"own\"\n" + limits +
                    "[[channel]]\nname = \"c\"\nband = \"own\"\n");
  };
  const auto flat = bands("lo_um = 3.7\nhi_um = 4.8\n");
  ASSERT_TRUE(flat.has_value()) << flat.error().text;
  ASSERT_EQ(flat->atmosphere.bands.size(), 1U);
  EXPECT_TRUE(flat->atmosphere.bands[0].model.has_value());
  const auto response = bands("response = [[7.5, 0], [8.5, 1], [12, 1], [14, 0]]\n");
  ASSERT_TRUE(response.has_value()) << response.error().text;
  EXPECT_TRUE(response->atmosphere.bands[0].model.has_value());
  // A response that reaches beyond is cut by the limits of its band.
  EXPECT_FALSE(bands("response = [[7.5, 0], [8.5, 1], [12, 1], [15, 0]]\n").has_value());
  EXPECT_TRUE(bands("hi_um = 14\nresponse = [[7.5, 0], [8.5, 1], [12, 1], [15, 0]]\n").has_value());
}

}  // namespace
}  // namespace emit::config::testing
