// SPDX-License-Identifier: Apache-2.0
// Output of MODTRAN as an atmosphere: files made here whose integrals have closed forms, and files
// that MODTRAN wrote.
#include "tables/tape7.hpp"

#include <fmt/format.h>

#include <cmath>

#include "config/config_support.hpp"
#include "emit/physics/atmosphere_table.hpp"

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
  // Fields of ten places that are full leave no blank between them.
  std::string text = kCards;
  text += fmt::format("{:10.5f}{:10.5f}{:10.5f}{:10.5f}{:10.5f}  6378.39000  0\n", 0.5, 100.0,
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
  EXPECT_THAT(error(run_text(90.0, 1.0, 0.5, 0.0, 900.0)),
              ::testing::HasSubstr("holds none of the bands"));
  EXPECT_THAT(error(run_text(90.0, 1.0, 0.5, 0.0) + run_text(60.0, 2.0, 0.5, 0.0)),
              ::testing::HasSubstr("all elevations of a band need the same ranges"));
}

TEST_F(ConfigTest, tape7_files_of_modtran_are_read) {
  const auto folder = std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "../../shared/atmosphere";
  if (!std::filesystem::exists(folder / "tape7-02c")) GTEST_SKIP() << "no files in " << folder;
  const auto radiance = load_tape7(folder / "tape7-02c");
  ASSERT_TRUE(radiance) << radiance.error().text;
  ASSERT_EQ(radiance->size(), 1U);
  const Tape7Run& run = radiance->front();
  EXPECT_NEAR(run.elevation_deg, 0.5, 1e-9);
  EXPECT_NEAR(run.range_m, 1117886.87, 1e-3);
  ASSERT_EQ(run.samples.size(), 13U);
  EXPECT_EQ(run.samples.front().wavenumber_per_cm, 655.0);
  // The air of a level path in an opaque band is a blackbody of BBODY_T, 299.670 K there.
  const double v = 655.0;
  EXPECT_NEAR(run.samples.front().radiance_w_m2_sr_per_cm,
              1.191042972e-8 * v * v * v / std::expm1(1.438776877 * v / 299.670), 2e-5);
  const auto tau = load_tape7(folder / "tape7-01b");
  ASSERT_TRUE(tau) << tau.error().text;
  EXPECT_FALSE(tau->front().has_radiance);
  EXPECT_NEAR(tau->front().samples.back().transmittance_frac, 0.1665, 1e-12);
  EXPECT_NEAR(tau->front().range_m, 1000.0, 1e-9);
}

}  // namespace
}  // namespace emit::config
