// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "config/config_support.hpp"
#include "emit/physics/surface/emissivity_spectrum.hpp"

namespace emit::config::testing {
namespace {

/// A material of a given temperature with a spectrum; `more` replaces the total emissivity.
std::string skin(const std::string& spectrum, const std::string& more = "emissivity_frac = 0.9\n") {
  return "[[material]]\nname = \"x\"\nsolar_absorptance_frac = 0.5\nprescribed_k = 300\n" + more +
         spectrum + "\n";
}
constexpr const char* kSlope = "emissivity_spectrum = [[2.5, 0.6], [8, 0.9], [14, 0.97]]";
const std::vector<physics::EmissivityPoint> kSlopePoints{{2.5, 0.6}, {8.0, 0.9}, {14.0, 0.97}};

class EmissivitySpectrum : public ConfigTest {
 protected:
  scene::Material loaded(const std::string& text, const std::vector<std::string>& overrides = {}) {
    auto all = scenario(text, overrides);
    EXPECT_TRUE(all.has_value()) << all.error().text;
    if (!all) return {};
    warnings_.clear();
    for (const std::string& warning : all->warnings) {
      if (warning.find("material 'x'") != std::string::npos) warnings_ += warning + "\n";
    }
    return all->materials.back();
  }
  std::string warnings_;  ///< of the material that was loaded last
};

double of(const scene::Material& material, const std::string& band) {
  const auto found =
      std::ranges::find(material.band_emissivity, band, &scene::BandEmissivity::band);
  EXPECT_NE(found, material.band_emissivity.end()) << band;
  return found == material.band_emissivity.end() ? -1.0 : found->emissivity_frac;
}

/// Emissivity of the slope in a band, folded without air.
double dry_frac(const physics::Band& band, double kelvin) {
  return physics::EmissivityFold(kSlopePoints, band, physics::Kelvin(kelvin))
      .at(physics::Kelvin(kelvin))
      .emissivity_frac;
}

TEST_F(EmissivitySpectrum, a_grey_one_gives_its_value_in_all_bands) {
  const scene::Material x = loaded(skin("emissivity_spectrum = [[2, 0.83], [20, 0.83]]", ""));
  EXPECT_NEAR(x.emissivity_frac, 0.83, 1e-14);
  EXPECT_NEAR(of(x, "8-12"), 0.83, 1e-14);
  EXPECT_NEAR(of(x, "3-5"), 0.83, 1e-14);
  // 26 % of what a blackbody of 300 K emits lies beyond 20 um.
  EXPECT_THAT(warnings_, ::testing::HasSubstr("26 % of the total emissivity's weight lies beyond "
                                              "the spectrum (2 to 20 um)"));
  EXPECT_EQ(std::ranges::count(warnings_, '\n'), 1);
}

TEST_F(EmissivitySpectrum, files_of_emissivity_and_of_reflectance_are_the_array) {
  write("e.csv", "# measured\nwavelength_um,emissivity_frac\n2.5,0.6\n8,0.9\n14,0.97\n");
  write("r.csv", "reflectance_frac,wavelength_um\n0.4,2.5\n0.1,8\n0.03,14\n");
  const scene::Material array = loaded(skin(kSlope));
  for (const char* file : {"e.csv", "r.csv"}) {
    const scene::Material x =
        loaded(skin("emissivity_spectrum_file = \"" + std::string(file) + "\""));
    ASSERT_EQ(x.emissivity_spectrum.samples.size(), 3U);
    EXPECT_EQ(x.emissivity_spectrum.file.filename(), file);
    EXPECT_NEAR(of(x, "8-12"), of(array, "8-12"), 1e-15);
    EXPECT_NEAR(of(x, "3-5"), of(array, "3-5"), 1e-15);
  }
}

TEST_F(EmissivitySpectrum, numbers_that_the_material_states_win) {
  const scene::Material x = loaded(
      skin(kSlope, "emissivity_frac = 0.5\nband_emissivity_frac = { \"3-5\" = 0.25 }\n") +
      "[[band]]\nname = \"own\"\nlo_um = 3.2\nhi_um = 4.8\n[[channel]]\nname = \"a\"\nband = "
      "\"3-5\"\n[[channel]]\nname = \"b\"\nband = \"own\"\n");
  EXPECT_EQ(x.emissivity_frac, 0.5);
  EXPECT_FALSE(x.emissivity_spectrum.total);
  EXPECT_EQ(of(x, "3-5"), 0.25);
  // The spectrum knows a band of one's own better than the listed band that is like it.
  EXPECT_GT(of(x, "own"), 0.6);
  ASSERT_EQ(x.emissivity_spectrum.bands.size(), 1U);
  EXPECT_EQ(x.emissivity_spectrum.bands[0].band, "own");
}

TEST_F(EmissivitySpectrum, the_response_of_a_band_weights_it) {
  const physics::Band bell{7.5, 13.0, {{7.5, 0.0}, {8.5, 1.0}, {13.0, 0.1}}};
  const scene::Material x =
      loaded(skin(kSlope) +
                 "[[band]]\nname = \"own\"\nresponse = [[7.5, 0], [8.5, 1], [13, 0.1]]\n"
                 "[[channel]]\nname = \"a\"\nband = \"own\"\n",
             {"atmosphere.enabled=false"});
  EXPECT_NEAR(of(x, "own"), dry_frac(bell, 300.0), 1e-15);
  EXPECT_GT(std::abs(of(x, "own") - dry_frac({7.5, 13.0, {}}, 300.0)), 1e-3);
}

TEST_F(EmissivitySpectrum, the_air_of_the_scenario_weights_it_where_pictures_have_air) {
  // The air is that of a kilometre at the height of the place.
  const std::string place =
      "[place]\nheight_m = 300\n[atmosphere]\nmodel = \"tropical\"\n"
      "visibility_km = 10\nwater_ratio = 0.75\n";
  const scene::Material x = loaded(skin(kSlope) + place);
  const auto column = physics::AirColumn::build({physics::AirClimate::tropical, 10.0, 0.75});
  const physics::SpectralAir air(physics::AirPath::between(*column, 300.0, 300.0, 1000.0));
  const physics::EmissivityFold fold(kSlopePoints, {3.0, 5.0, {}}, physics::Kelvin(300.0));
  EXPECT_NEAR(of(x, "3-5"), fold.at(physics::Kelvin(300.0), air).emissivity_frac, 1e-15);
  const scene::Material without = loaded(skin(kSlope) + place, {"atmosphere.enabled=false"});
  EXPECT_NEAR(of(without, "3-5"), dry_frac({3.0, 5.0, {}}, 300.0), 1e-15);
  EXPECT_GT(std::abs(of(x, "3-5") - of(without, "3-5")), 1e-3);
  // Air that is stated without its spectrum absorbs like that of place and date.
  const scene::Material own =
      loaded(skin(kSlope) + "[[atmosphere.band]]\nband = \"3-5\"\nterms = [[1, 0.2]]\n");
  const scene::Material built_in = loaded(skin(kSlope));
  EXPECT_EQ(of(own, "3-5"), of(built_in, "3-5"));
}

TEST_F(EmissivitySpectrum, hot_materials_take_their_own_temperature) {
  const std::vector<std::string> dry = {"atmosphere.enabled=false"};
  const physics::Band mwir{3.0, 5.0, {}};
  const scene::Material hot = loaded(skin(kSlope), {dry[0], "material[x].prescribed_k=800"});
  EXPECT_NEAR(of(hot, "3-5"), dry_frac(mwir, 800.0), 1e-15);
  EXPECT_EQ(hot.emissivity_spectrum.bands[0].temperature_k, 0.0) << "it has one temperature";
  // A part goes from cold to full, and is folded between idle and full.
  const std::string part =
      "[[object]]\ngltf = \"a.glb\"\nentity_id = 7\n[[object.parts]]\nname = \"a\"\nmaterial = "
      "\"x\"\nidle_k = 500\nfull_k = 700\ncold_k = 290\n";
  const std::string layers =
      "emissivity_frac = 0.9\nbase_k = 290\nlayers = [{ thickness_m = 0.1, conductivity_w_m_k = 1, "
      "density_kg_m3 = 2000, specific_heat_j_kg_k = 900 }]\n";
  std::string material = skin(kSlope, layers);
  material.erase(material.find("prescribed_k"), std::string("prescribed_k = 300\n").size());
  const scene::Material engine = loaded(material + part, dry);
  EXPECT_NEAR(of(engine, "3-5"), dry_frac(mwir, 600.0), 1e-15);
  EXPECT_EQ(engine.emissivity_spectrum.least_k, 290.0);
  EXPECT_EQ(engine.emissivity_spectrum.greatest_k, 700.0);
  EXPECT_THAT(warnings_, ::testing::HasSubstr("290 to 700 K"));
  const scene::Material cold = loaded(material, dry);
  EXPECT_NEAR(of(cold, "3-5"), dry_frac(mwir, 300.0), 1e-15);
  EXPECT_EQ(cold.emissivity_spectrum.least_k, 250.0);
  EXPECT_EQ(cold.emissivity_spectrum.greatest_k, 350.0);
}

TEST_F(EmissivitySpectrum, an_error_above_a_fifth_of_a_kelvin_is_a_warning) {
  const std::string steep = "emissivity_spectrum = [[2.5, 0.9], [3.9, 0.9], [4.1, 0.5], [14, 0.5]]";
  const scene::Material x = loaded(skin(steep));
  EXPECT_THAT(warnings_, ::testing::HasSubstr("s.toml: material 'x', band '3-5': the emissivity "));
  EXPECT_THAT(warnings_, ::testing::HasSubstr("K too much or too little"));
  EXPECT_THAT(warnings_, ::testing::HasSubstr("reflects full sunlight"));
  EXPECT_THAT(warnings_, ::testing::Not(::testing::HasSubstr("band '8-12'")));
  const auto bands = x.emissivity_spectrum.bands;
  const auto mwir = std::ranges::find(bands, "3-5", &scene::FoldedBand::band);
  ASSERT_NE(mwir, bands.end());
  EXPECT_GT(mwir->largest_k, 0.2);
  loaded(skin("emissivity_spectrum = [[2.5, 0.9], [14, 0.91]]"));
  EXPECT_EQ(warnings_, "");
}

TEST_F(EmissivitySpectrum, what_lies_beyond_the_spectrum_is_a_warning_or_a_fault) {
  loaded(skin("emissivity_spectrum = [[2.5, 0.9], [11, 0.9]]"));
  EXPECT_THAT(warnings_, ::testing::HasSubstr("band '8-12': "));
  EXPECT_THAT(warnings_, ::testing::HasSubstr("% of the weight lies beyond the spectrum (2.5 to 11 "
                                              "um), whose end values count there"));
  const std::string lwir = "emissivity_spectrum = [[7, 0.9], [14, 0.9]]";
  EXPECT_EQ(scenario_error(skin(lwir)),
            "s.toml:7:23: 'emissivity_spectrum' (7 to 14 um) has nothing of band '3-5': extend it, "
            "or list the band in 'band_emissivity_frac'");
  loaded(skin(lwir, "emissivity_frac = 0.9\nband_emissivity_frac = { \"3-5\" = 0.8 }\n"));
  EXPECT_EQ(warnings_, "");
}

TEST_F(EmissivitySpectrum, gives_the_total_emissivity_where_it_covers_enough) {
  const scene::Material x =
      loaded(skin("emissivity_spectrum = [[2.5, 0.6], [8, 0.9], [50, 1]]", ""));
  const std::vector<physics::EmissivityPoint> points{{2.5, 0.6}, {8.0, 0.9}, {50.0, 1.0}};
  EXPECT_NEAR(x.emissivity_frac,
              physics::total_emissivity(points, physics::Kelvin(300.0)).emissivity_frac, 1e-15);
  ASSERT_TRUE(x.emissivity_spectrum.total);
  EXPECT_LT(x.emissivity_spectrum.total->beyond_frac, 0.05);
  EXPECT_EQ(scenario_error(skin("emissivity_spectrum = [[2.5, 0.6], [14, 0.9]]", "")),
            "s.toml:2:1: key 'emissivity_frac' is missing: the spectrum (2.5 to 14 um) covers 52 % "
            "of what a blackbody of 300 K emits, and 60 % are needed");
  EXPECT_EQ(scenario_error(skin("", "")), "s.toml:2:1: key 'emissivity_frac' is missing");
}

TEST_F(EmissivitySpectrum, a_printed_scenario_has_what_was_folded) {
  write("e.csv", "wavelength_um,emissivity_frac\n2.5,0.6\n8,0.9\n50,0.97\n");
  const auto first = scenario(skin("emissivity_spectrum_file = \"e.csv\"", ""));
  ASSERT_TRUE(first.has_value()) << first.error().text;
  const std::string printed = print_scenario(*first);
  const auto again = load_scenario(write("p.toml", printed), {}, options_);
  ASSERT_TRUE(again.has_value()) << again.error().text;
  EXPECT_EQ(print_scenario(*again), printed);
  EXPECT_EQ(of(again->materials.back(), "3-5"), of(first->materials.back(), "3-5"));
  EXPECT_EQ(again->materials.back().emissivity_frac, first->materials.back().emissivity_frac);
}

TEST_F(EmissivitySpectrum, a_library_is_folded_over_the_built_in_bands_that_it_covers) {
  const auto all =
      load_materials(write("l.toml", skin("emissivity_spectrum = [[7, 0.9], [14, 0.9]]")));
  ASSERT_TRUE(all.has_value()) << all.error().text;
  const scene::Material& x = all->front();
  ASSERT_EQ(x.emissivity_spectrum.bands.size(), 2U);
  EXPECT_EQ(x.emissivity_spectrum.bands[0].band, "8-12");
  EXPECT_EQ(x.emissivity_spectrum.bands[1].band, "7.7-9.3");
}

TEST_F(EmissivitySpectrum, must_not_exceed_what_a_gloss_lets_through) {
  const std::string gloss =
      "gloss = { wavelength_um = [10], refractive_index = [3], extinction_index = [0] }\n";
  EXPECT_EQ(scenario_error(skin("emissivity_spectrum = [[2, 0.9], [20, 0.9]]",
                                "emissivity_frac = 0.7\n" + gloss)),
            "s.toml:7:9: material 'x': its emissivity of 0.900 in band '3-5' is more than the "
            "interface of 'gloss' lets through along the normal, 0.750");
  EXPECT_EQ(scenario_error(skin("emissivity_spectrum = [[2, 0.7], [20, 0.7]]", gloss)),
            "s.toml:2:1: key 'emissivity_frac' is missing: with 'gloss' a spectrum is that along "
            "the normal, and the total emissivity is hemispherical");
  loaded(skin("emissivity_spectrum = [[2, 0.7], [20, 0.7]]", "emissivity_frac = 0.7\n" + gloss));
}

TEST_F(EmissivitySpectrum, clutter_keeps_it_within_0_and_1) {
  const std::string clutter =
      "[[clutter]]\nmaterial = \"x\"\nshortest_m = 0.1\nlongest_m = 1\n"
      "band_emissivity_sd_frac = { \"8-12\" = 0.02 }\n";
  loaded(skin("emissivity_spectrum = [[2, 0.9], [20, 0.9]]") + clutter);
  EXPECT_THAT(scenario_error(skin("emissivity_spectrum = [[2, 0.97], [20, 0.97]]") + clutter),
              ::testing::HasSubstr("'band_emissivity_sd_frac' leads out of 0 to 1"));
}

/// One wrong spectrum and its error.
struct SpectrumCase {
  const char* name;
  std::string keys;
  std::string csv;
  std::string error;
};

const std::vector<SpectrumCase>& spectrum_cases() {
  const std::string file = "emissivity_spectrum_file = \"e.csv\"";
  const std::string at_file = "s.toml:7:28: 'emissivity_spectrum_file': ";
  const std::string head = "wavelength_um,emissivity_frac\n";
  static const std::vector<SpectrumCase> all = {
      {"no_array", "emissivity_spectrum = 0.9", "",
       "s.toml:7:23: 'emissivity_spectrum' must be an array of pairs [um, frac]"},
      {"no_pair", "emissivity_spectrum = [[8, 0.9], [9]]", "",
       "s.toml:7:34: 'emissivity_spectrum' must be an array of 2 numbers, not of 1"},
      {"nan", "emissivity_spectrum = [[8, 0.9], [9, nan]]", "",
       "s.toml:7:38: 'emissivity_spectrum' must be finite"},
      {"one_point", "emissivity_spectrum = [[8, 0.9]]", "",
       "s.toml:7:23: 'emissivity_spectrum' needs at least two samples"},
      {"descends", "emissivity_spectrum = [[9, 0.9], [8, 0.9]]", "",
       "s.toml:7:23: the wavelengths of 'emissivity_spectrum' must ascend (8 um follows 9)"},
      {"above_1", "emissivity_spectrum = [[8, 0.9], [9, 1.1]]", "",
       "s.toml:7:23: the emissivity at 9 um is 1.1, must be 0 .. 1"},
      {"below_0", "emissivity_spectrum = [[8, -0.1], [9, 1]]", "",
       "s.toml:7:23: the emissivity at 8 um is -0.1, must be 0 .. 1"},
      {"nanometres", "emissivity_spectrum = [[8000, 0.9], [12000, 0.9]]", "",
       "s.toml:7:23: a wavelength of 'emissivity_spectrum' is 8000, must be 0.2 .. 100; this looks "
       "like nanometres or wavenumbers, wanted are micrometres"},
      {"both", "emissivity_spectrum = [[8, 0.9], [9, 0.9]]\n" + file, "",
       "s.toml:8:28: use only one of 'emissivity_spectrum' and 'emissivity_spectrum_file'"},
      {"no_file", file, "", at_file + "e.csv: no such file"},
      {"csv_one_point", file, head + "8,0.9\n",
       "s.toml:7:28: 'emissivity_spectrum_file' needs at least two samples"},
      {"csv_nan", file, head + "8,nan\n9,0.9\n",
       at_file + "e.csv:2:3: 'emissivity_frac' is nan, must be 0 .. 1"},
      {"csv_descends", file, head + "9,0.9\n8,0.9\n",
       at_file + "e.csv:3: 'wavelength_um' is not above the row before"},
      {"csv_per_cent", file, head + "8,0.9\n9,95\n",
       at_file + "e.csv:3:3: 'emissivity_frac' is 95, must be 0 .. 1"},
      {"csv_nanometres", file, head + "8000,0.9\n9000,0.9\n",
       at_file + "e.csv:2:1: 'wavelength_um' is 8000, must be 0.2 .. 100; this looks like "
                 "nanometres or wavenumbers, wanted are micrometres (and 1 other row)"},
      {"csv_column", file, "wavelength_um,emissivity\n8,0.9\n9,0.9\n",
       at_file + "e.csv:1:15: unknown column 'emissivity', did you mean 'emissivity_frac'?"},
      {"csv_neither", file, "wavelength_um\n8\n9\n",
       at_file + "e.csv:2: neither 'emissivity_frac' nor 'reflectance_frac' is given"},
      {"csv_both", file, "wavelength_um,emissivity_frac,reflectance_frac\n8,0.9,0.1\n9,0.9,0.1\n",
       at_file + "e.csv:2: use only one of 'emissivity_frac' and 'reflectance_frac'"},
      {"csv_change", file, "wavelength_um,emissivity_frac,reflectance_frac\n8,0.9,\n9,,0.1\n",
       at_file + "e.csv:3: 'emissivity_frac' and 'reflectance_frac' change places"},
  };
  return all;
}

class EmissivityError : public ConfigTest, public ::testing::WithParamInterface<std::size_t> {};

TEST_P(EmissivityError, names_file_line_and_key) {
  const SpectrumCase& test = spectrum_cases()[GetParam()];
  if (!test.csv.empty()) write("e.csv", test.csv);
  EXPECT_EQ(scenario_error(skin(test.keys)), test.error);
}

INSTANTIATE_TEST_SUITE_P(All, EmissivityError,
                         ::testing::Range(std::size_t{0}, spectrum_cases().size()),
                         [](const auto& one) {
                           return std::string(spectrum_cases()[one.param].name);
                         });

/// Test that responses of bands share the checks.
TEST_F(ConfigTest, a_response_in_nanometres_is_found) {
  EXPECT_EQ(scenario_error("[[band]]\nname = \"w\"\nresponse = [[8000, 1], [12000, 1]]\n"),
            "s.toml:4:12: a wavelength of a response is 8000, must be 0.2 .. 100; this looks like "
            "nanometres or wavenumbers, wanted are micrometres");
}

}  // namespace
}  // namespace emit::config::testing
