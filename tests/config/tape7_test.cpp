// SPDX-License-Identifier: Apache-2.0
// Output of MODTRAN as an atmosphere: files made here whose integrals have closed forms, and files
// that MODTRAN wrote.
#include "tables/tape7.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <iterator>
#include <sstream>

#include "config/config_support.hpp"

namespace emit::config {
namespace {

using testing::ConfigTest;

constexpr const char* kCards =
    "M F 1    3    2    1    1    1    1    1    1    1    1    0    0   0.0000.30000\n"
    "   36TROPICAL MODEL      \n";
constexpr const char* kNames =
    "    FREQ  TOT_TRANS  PTH_THRML  THRML_SCT  SURF_EMIS   SOL_SCAT  SING_SCAT  GRND_RFLT"
    "  DRCT_RFLT  TOTAL_RAD\n";

/// Run with a transmittance and a path radiance (W cm-2 sr-1 per cm-1) that are the same
/// everywhere.
std::string run_text(double zenith_deg, double range_km, double tau, double path, double low = 800,
                     double high = 1300) {
  // Only long paths leave the atmosphere.
  const double h2_km = range_km > 100.0 ? 100.0 : 3.0;
  // Fields of ten places that are full leave no blank between them.
  std::string text = kCards;
  text += fmt::format("{:10.5f}{:10.5f}{:10.5f}{:10.5f}{:10.5f}  6378.39000  0\n", 0.5, h2_km,
                      zenith_deg, range_km, 9.9);
  text += "  -99  -99  -99  -99\n";
  text += kNames;
  for (double v = low; v <= high; v += 5.0) {
    text += fmt::format("{:8.2f}{:11.8f}{:11.4E}{:11}{:11.4E}{:11.4E}{:11}{:11.4E}{:11}{:11.4E}\n",
                        v, tau, path, "", 3e-6, 0.0, "", 1e-6, "", path + 4e-6);
  }
  return text + " -9999.\n";
}

TEST_F(ConfigTest, tape7_runs_become_a_grid) {
  // Ranges may fill their fields, so that nothing separates them from the angle before.
  const std::string text = run_text(90.0, 1.0, 0.8, 2e-6) + run_text(90.0, 1117.88687, 0.2, 9e-6) +
                           run_text(60.0, 1.0, 0.9, 1e-6) + run_text(60.0, 1117.88687, 0.5, 5e-6);
  write("runs.tp7", text);
  const auto loaded = scenario("[atmosphere]\nmodel = \"tropical\"\nfile = \"runs.tp7\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  ASSERT_EQ(loaded->atmosphere.bands.size(), 2U);
  const auto& air = loaded->atmosphere.bands[0];
  ASSERT_EQ(air.band, "8-12");
  EXPECT_TRUE(loaded->atmosphere.bands[1].model) << "the runs do not cover 3-5";
  ASSERT_EQ(air.table.range_m.size(), 2U);
  EXPECT_NEAR(air.table.range_m[1], 1117886.87, 1e-3);
  ASSERT_EQ(air.table.elevation_rad.size(), 2U);
  EXPECT_NEAR(air.table.elevation_rad[1], 0.5235988, 1e-6);
  const std::vector<double> tau{0.8, 0.2, 0.9, 0.5};
  const std::vector<double> path{2e-6, 9e-6, 1e-6, 5e-6};
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_NEAR(air.table.transmittance_frac[i], tau[i], 1e-12);
    // The band is 8 to 12 um wide, which are 1250 - 833.33 cm-1; 1 W/cm2 is 1e4 W/m2.
    EXPECT_NEAR(air.table.path_radiance_w_m2_sr[i], path[i] * 1e4 * (1250.0 - 1e4 / 12.0), 1e-5);
  }
}

TEST_F(ConfigTest, tape7_transmittance_has_the_weight_of_a_blackbody_and_the_response) {
  Tape7Run run;
  run.has_radiance = true;
  for (double v = 800.0; v <= 1300.0; v += 0.5) {
    run.samples.push_back({v, v < 1000.0 ? 0.0 : 1.0, v < 1000.0 ? 0.0 : 1.0});
  }
  // The share of a blackbody's power below a wavelength, by the series of Planck's integral.
  const auto fraction = [](double um) {
    const double x = 14387.7688 / (um * 300.0);
    double sum = 0.0;
    for (int n = 1; n < 40; ++n) {
      sum += std::exp(-n * x) * (x * x * x / n + 3.0 * x * x / (n * n) + 6.0 * x / std::pow(n, 3) +
                                 6.0 / std::pow(n, 4));
    }
    return 15.0 / std::pow(3.14159265358979, 4) * sum;
  };
  const auto flat = tape7_air(run, {"8-12", 8.0, 12.0, {}});
  ASSERT_TRUE(flat);
  const double expected = (fraction(10.0) - fraction(8.0)) / (fraction(12.0) - fraction(8.0));
  EXPECT_NEAR(flat->transmittance_frac, expected, 2e-3 * expected);
  EXPECT_NEAR(flat->path_radiance_w_m2_sr, 250.0, 0.5);
  // A response that ends at 10 um sees what passes alone.
  const auto cut = tape7_air(run, {"own", 8.0, 9.9, {{8.0, 0.5}, {9.9, 0.5}}});
  ASSERT_TRUE(cut);
  EXPECT_NEAR(cut->transmittance_frac, 1.0, 1e-12);
  EXPECT_NEAR(cut->path_radiance_w_m2_sr, 0.5 * (1250.0 - 1e4 / 9.9), 1e-3);
  EXPECT_FALSE(tape7_air(run, {"wide", 7.0, 12.0, {}}));
}

TEST_F(ConfigTest, tape7_faults_name_file_and_line) {
  const auto error = [this](const std::string& text) {
    write("x.tp7", text);
    return scenario_error("[atmosphere]\nmodel = \"tropical\"\nfile = \"x.tp7\"\n");
  };
  EXPECT_THAT(error(run_text(90.0, 1.0, 1.8, 0.0)),
              ::testing::HasSubstr("x.tp7:6: the transmittance is 1.8"));
  std::string letters = run_text(90.0, 1.0, 0.5, 0.0);
  letters.replace(letters.find("0.50000000"), 10, "0.5000x000");
  EXPECT_THAT(error(letters), ::testing::HasSubstr("x.tp7:6: '0.5000x000' in column TOT_TRANS"));
  EXPECT_THAT(error(std::string(kCards) + kNames),
              ::testing::HasSubstr("x.tp7:3: no line of the cards"));
  const std::string sound = run_text(90.0, 1.0, 0.5, 0.0);
  const auto replaced = [&sound](const std::string& from, const std::string& to) {
    std::string text = sound;
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_THAT(error(replaced("0.50000000", std::string(10, ' '))),
              ::testing::HasSubstr("x.tp7:6: the field of column TOT_TRANS is blank"));
  EXPECT_THAT(error(replaced("0.50000000", "**********")),
              ::testing::HasSubstr("x.tp7:6: '**********' in column TOT_TRANS is not a number"));
  EXPECT_THAT(error(replaced(" 0.50000000", "0.50000000 ")),
              ::testing::HasSubstr("x.tp7:6: '0.50000000' in column TOT_TRANS does not end at "
                                   "place 19, where its name ends"));
  EXPECT_THAT(error(replaced("  805.00", "  795.00")),
              ::testing::HasSubstr("x.tp7:7: the wavenumber 795 is not above 800"));
  EXPECT_THAT(error(replaced("TOT_TRANS", "TRANSPAR.")),
              ::testing::HasSubstr("x.tp7:5: there is no column TOT_TRANS"));
  EXPECT_THAT(error(replaced("    FREQ ", "  WAVLEN ")),
              ::testing::HasSubstr("x.tp7:5: the columns are over wavelengths"));
  EXPECT_THAT(error(sound.substr(0, sound.find(" -9999"))),
              ::testing::HasSubstr("x.tp7:106: the file ends before the -9999"));
  EXPECT_THAT(error(sound.substr(0, sound.find("  805.00") + 30)),
              ::testing::HasSubstr("x.tp7:7: the field of column TOTAL_RAD is blank"));
  EXPECT_THAT(error(replaced(" -9999.", sound.substr(sound.find("    FREQ")))),
              ::testing::HasSubstr("x.tp7:107: a run begins before the -9999"));
  EXPECT_THAT(error(replaced("   0.50000   3.00000", "   0.70000   3.00000") + sound),
              ::testing::HasSubstr("this run is for a sensor at 500 m"));
  // Direct solar irradiance says nothing of a path.
  const std::string sun = std::string(kCards) +
                          "    FREQ   TRANS     SOL TR  SOLAR\n"
                          "  800.00  0.5000  1.00E-08 2.00E-08\n"
                          " -9999.\n";
  EXPECT_THAT(error(sun), ::testing::HasSubstr("x.tp7:3: all runs are of direct solar irradiance"));
  EXPECT_EQ(error(sun + sound), "(loaded)");
  EXPECT_THAT(error(run_text(90.0, 1.0, 0.5, 0.0, 900.0)),
              ::testing::HasSubstr("holds none of the bands"));
  EXPECT_THAT(error(run_text(90.0, 1.0, 0.5, 0.0) + run_text(60.0, 2.0, 0.5, 0.0)),
              ::testing::HasSubstr("all elevations of a band need the same ranges"));
}

/// An own band with a channel that shows it.
std::string band_text(const char* name, double lo_um, double hi_um, const char* response) {
  return fmt::format(
      "[[band]]\nname = \"{0}\"\nlo_um = {1}\nhi_um = {2}\n{3}"
      "[[channel]]\nname = \"{0}\"\nband = \"{0}\"\n",
      name, lo_um, hi_um, response);
}

/// Integrals of a band by an integration of its own: the midpoint rule over wavelengths in fine
/// steps, with numbers cut out of the lines at the places of MODTRAN's format.
struct OwnIntegral {
  double transmittance_frac = 0.0;
  double path_radiance_w_m2_sr = 0.0;
};
struct Places {
  std::size_t tau = 0;
  std::size_t tau_size = 0;
  std::size_t total = 0;  ///< 0: none, and then air of `air_k` emits
  std::size_t surface = 0;
  std::size_t ground = 0;
  double air_k = 0.0;
};
OwnIntegral own_integral(const std::string& text, const Places& at, double lo_um, double hi_um,
                         const std::function<double(double)>& response) {
  std::vector<std::array<double, 3>> rows;
  std::istringstream in(text);
  const auto field = [](const std::string& line, std::size_t begin, std::size_t size) {
    return std::strtod(line.substr(begin, size).c_str(), nullptr);
  };
  for (std::string line; std::getline(in, line);) {
    // Lines of numbers have the point of the wavenumber in the sixth place.
    if (line.size() < 20 || line[5] != '.' || line[8] != ' ') continue;
    double path = 0.0;
    if (at.total > 0) {
      path = field(line, at.total, 11) - field(line, at.surface, 11) - field(line, at.ground, 11);
    }
    rows.push_back({field(line, 0, 8), field(line, at.tau, at.tau_size), path * 1e4});
  }
  EXPECT_GT(rows.size(), 5U);
  const auto planck = [](double um, double kelvin) {
    return 1.191042972e8 / std::pow(um, 5.0) / std::expm1(14387.76877 / (um * kelvin));
  };
  constexpr int kSteps = 200000;
  double weights = 0.0;
  double passed = 0.0;
  double radiance = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    const double um = lo_um + (hi_um - lo_um) * (i + 0.5) / kSteps;
    const double v = 1e4 / um;
    std::size_t k = 1;
    const double step = rows[1][0] - rows[0][0];
    k = std::clamp<std::size_t>(static_cast<std::size_t>((v - rows[0][0]) / step) + 1, 1,
                                rows.size() - 1);
    const double f = (v - rows[k - 1][0]) / (rows[k][0] - rows[k - 1][0]);
    const double tau = rows[k - 1][1] + f * (rows[k][1] - rows[k - 1][1]);
    const double path = rows[k - 1][2] + f * (rows[k][2] - rows[k - 1][2]);
    const double d_um = (hi_um - lo_um) / kSteps * response(um);
    weights += planck(um, 300.0) * d_um;
    passed += planck(um, 300.0) * tau * d_um;
    // Per cm-1 becomes per um by 1e4 / um^2.
    radiance += (at.total > 0 ? path * 1e4 / (um * um) : (1.0 - tau) * planck(um, at.air_k)) * d_um;
  }
  return {passed / weights, radiance};
}

constexpr double kImportBarFrac = 0.002;

TEST_F(ConfigTest, tape7_integrals_agree_with_an_integration_of_their_own) {
  // Lines of absorption whose depth changes from one wavenumber to the next.
  std::string text = kCards;
  text += fmt::format("{:10.5f}{:10.5f}{:10.5f}{:10.5f}{:10.5f}  6378.39000  0\n", 0.5, 3.0, 80.0,
                      14.2, 0.1);
  text += kNames;
  for (double v = 1800.0; v <= 3500.0; v += 1.0) {
    const double tau = 0.5 + 0.49 * std::sin(0.37 * v) * std::cos(0.011 * v);
    const double planck = 1.191042972e-12 * v * v * v / std::expm1(1.438776877 * v / 290.0);
    const double path = (1.0 - tau) * planck;
    const double surface = tau * planck;
    const double ground = 0.05 * path;
    text += fmt::format("{:8.2f}{:11.8f}{:11.4E}{:11}{:11.4E}{:11.4E}{:11}{:11.4E}{:11}{:11.4E}\n",
                        v, tau, path, "", surface, 0.0, "", ground, "", path + surface + ground);
  }
  text += " -9999.\n";
  write("lines.tp7", text);
  write("filter.csv", "wavelength_um,response_frac\n3.1,0\n3.6,0.9\n4.4,0.7\n4.9,0\n");
  const auto loaded = scenario(band_text("wide", 3.0, 5.0, "") +
                               band_text("own", 3.1, 4.9, "response_file = \"filter.csv\"\n") +
                               "[atmosphere]\nfile = \"lines.tp7\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const Places places{8, 11, 96, 41, 74};
  const auto filter = [](double um) {
    return um < 3.6   ? 0.9 * (um - 3.1) / 0.5
           : um < 4.4 ? 0.9 - 0.2 * (um - 3.6) / 0.8
                      : 0.7 * (4.9 - um) / 0.5;
  };
  const auto flat = [](double) { return 1.0; };
  const std::array<OwnIntegral, 2> own{own_integral(text, places, 3.0, 5.0, flat),
                                       own_integral(text, places, 3.1, 4.9, filter)};
  ASSERT_EQ(loaded->atmosphere.bands.size(), 2U);
  for (std::size_t b = 0; b < 2; ++b) {
    const auto& table = loaded->atmosphere.bands[b].table;
    ASSERT_EQ(table.transmittance_frac.size(), 1U);
    EXPECT_NEAR(table.transmittance_frac[0], own[b].transmittance_frac,
                kImportBarFrac * own[b].transmittance_frac);
    EXPECT_NEAR(table.path_radiance_w_m2_sr[0], own[b].path_radiance_w_m2_sr,
                kImportBarFrac * own[b].path_radiance_w_m2_sr);
  }
}

TEST_F(ConfigTest, tape7_paths_out_of_the_atmosphere_share_a_column) {
  // The longer a path to 100 km, the lower it points; the table has one range for all of them.
  write("sky.tp7", run_text(30.0, 2.0, 0.9, 1e-6) + run_text(80.0, 2.0001, 0.8, 1e-6) +
                       run_text(30.0, 114.8, 0.7, 2e-6) + run_text(80.0, 472.1, 0.3, 2e-6));
  const auto loaded = scenario("[atmosphere]\nmodel = \"tropical\"\nfile = \"sky.tp7\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  const auto& table = loaded->atmosphere.bands[0].table;
  EXPECT_THAT(table.range_m, ::testing::ElementsAre(::testing::DoubleNear(2000.1, 0.11),
                                                    ::testing::DoubleNear(472100.0, 1e-6)));
  EXPECT_THAT(table.transmittance_frac,
              ::testing::Pointwise(::testing::DoubleNear(1e-12), {0.8, 0.3, 0.9, 0.7}));
}

TEST_F(ConfigTest, tape7_of_modtran_4_has_blanks_in_its_names) {
  std::string text = run_text(90.0, 1.0, 0.8, 2e-6);
  for (std::size_t at = text.find("FREQ"); text[at] != '\n'; ++at) {
    if (text[at] == '_') text[at] = ' ';
  }
  write("old.tp7", text);
  const auto loaded = scenario("[atmosphere]\nmodel = \"tropical\"\nfile = \"old.tp7\"\n");
  ASSERT_TRUE(loaded.has_value()) << loaded.error().text;
  EXPECT_NEAR(loaded->atmosphere.bands[0].table.transmittance_frac[0], 0.8, 1e-12);
}

TEST_F(ConfigTest, tape7_files_of_modtran_are_read) {
  const auto folder = std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "../../shared/atmosphere";
  if (!std::filesystem::exists(folder / "tape7-02c")) GTEST_SKIP() << "no files in " << folder;
  const auto text_of = [&folder](const char* name) {
    std::ifstream in(folder / name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
  };
  const auto flat = [](double) { return 1.0; };
  // The files end at 715 and 750 cm-1.
  const auto air_of = [&](const char* name) {
    return scenario(fmt::format("{}[atmosphere]\nfile = \"{}\"\n", band_text("co2", 14.0, 15.2, ""),
                                (folder / name).string()));
  };
  const auto radiance = air_of("tape7-02c");
  ASSERT_TRUE(radiance) << radiance.error().text;
  const auto& slant = radiance->atmosphere.bands.at(0).table;
  const OwnIntegral slant_own =
      own_integral(text_of("tape7-02c"), {8, 11, 96, 41, 74}, 14.0, 15.2, flat);
  EXPECT_NEAR(slant.elevation_rad.at(0), 0.5 * 3.14159265358979 / 180.0, 1e-9);
  EXPECT_NEAR(slant.range_m.at(0), 1117886.87, 1e-3);
  EXPECT_EQ(slant.transmittance_frac.at(0), 0.0);
  EXPECT_EQ(slant_own.transmittance_frac, 0.0);
  EXPECT_NEAR(slant.path_radiance_w_m2_sr.at(0), slant_own.path_radiance_w_m2_sr,
              kImportBarFrac * slant_own.path_radiance_w_m2_sr);
  // A level path of transmittances emits like the tropical air at the ground, 299.7 K.
  const auto tau = air_of("tape7-01b");
  ASSERT_TRUE(tau) << tau.error().text;
  const auto& level = tau->atmosphere.bands.at(0).table;
  const OwnIntegral level_own = own_integral(
      text_of("tape7-01b"), {.tau = 8, .tau_size = 7, .air_k = 299.7}, 14.0, 15.2, flat);
  EXPECT_NEAR(level.range_m.at(0), 1000.0, 1e-9);
  EXPECT_NEAR(level.transmittance_frac.at(0), level_own.transmittance_frac,
              kImportBarFrac * level_own.transmittance_frac);
  EXPECT_NEAR(level.path_radiance_w_m2_sr.at(0), level_own.path_radiance_w_m2_sr,
              kImportBarFrac * level_own.path_radiance_w_m2_sr);
}

}  // namespace
}  // namespace emit::config
