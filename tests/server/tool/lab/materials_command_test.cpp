// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "support/emit_process.hpp"

namespace emit::test {
namespace {

/// A library of two materials. The modes of the second one have the right resistance but are a
/// hundred times too slow.
constexpr char kLibrary[] = R"(
[[material]]
name = "good"
family = "plates"
solar_absorptance_frac = 0.8
emissivity_frac = 0.9
base = "air"
layers = [{ thickness_m = 0.1, conductivity_w_m_k = 1, density_kg_m3 = 2000, specific_heat_j_kg_k = 900 }]
source = "made up"
spread = { solar_absorptance_frac = 0.125, conductivity_frac = 0.25 }
[[material]]
name = "slow"
family = "plates"
solar_absorptance_frac = 0.3
emissivity_frac = 0.9
base = "air"
layers = [{ thickness_m = 0.1, conductivity_w_m_k = 1, density_kg_m3 = 2000, specific_heat_j_kg_k = 900 }]
foster_modes = [{ tau_s = 200000, resistance_m2k_w = 0.1 }]
)";

double number_after(const std::string& json, const std::string& name, const std::string& key) {
  const std::string rest = json.substr(json.find("\"name\": \"" + name + "\""));
  return std::strtod(json_value(rest, key).c_str(), nullptr);
}

TEST(CliMaterials, lists_the_shipped_library_by_family_with_its_uncertainty) {
  const TemporaryFolder folder;
  const ProcessResult result = run_emit({"materials", "--json", folder.file("m.json")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* text :
       {"roofing:", "vegetation:", "vehicle_black", "0.93 +-0.05", "snow_old *"}) {
    EXPECT_NE(result.out.find(text), std::string::npos) << text << "\n" << result.out;
  }
  const std::string json = read_text(folder.file("m.json"));
  EXPECT_NE(json.find("Oke 1987"), std::string::npos);
  EXPECT_NE(json.find("\"spread\""), std::string::npos);
}

TEST(CliMaterials, compares_a_black_and_a_white_panel_over_a_summers_day) {
  const TemporaryFolder folder;
  const ProcessResult result = run_emit({"materials", "vehicle_black", "vehicle_white", "--json",
                                         folder.file("m.json"), "--plot", folder.file("m.svg")});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("0.27 +-0.08"), std::string::npos) << result.out;
  EXPECT_NE(result.out.find("Incropera"), std::string::npos) << result.out;
  const std::string json = read_text(folder.file("m.json"));
  const double black_k = number_after(json, "vehicle_black", "day_greatest_k");
  const double white_k = number_after(json, "vehicle_white", "day_greatest_k");
  EXPECT_GT(black_k, white_k + 15.0);
  EXPECT_LT(black_k, 360.0);
  // Both radiate alike at night.
  EXPECT_NEAR(number_after(json, "vehicle_black", "day_least_k"),
              number_after(json, "vehicle_white", "day_least_k"), 1.0);
  const std::string svg = read_text(folder.file("m.svg"));
  EXPECT_NE(svg.find("paint: emissivity by band"), std::string::npos);
  EXPECT_NE(svg.find("temperate_summer"), std::string::npos);
}

TEST(CliMaterials, every_material_of_the_library_can_be_shown) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_emit({"materials", "--json", folder.file("m.json")}).exit_code, 0);
  const std::string json = read_text(folder.file("m.json"));
  std::vector<std::string> command{"materials"};
  const std::string key = "\"name\": \"";
  for (auto at = json.find(key); at != std::string::npos; at = json.find(key, at + 1)) {
    const auto begin = at + key.size();
    command.push_back(json.substr(begin, json.find('"', begin) - begin));
  }
  ASSERT_GT(command.size(), 60U);
  const ProcessResult result = run_emit(command);
  ASSERT_EQ(result.exit_code, 0) << result.err;
  for (const char* text : {"open water", "leaves 0.06 m, x 2", "snow_old"}) {
    EXPECT_NE(result.out.find(text), std::string::npos) << text;
  }
}

TEST(CliMaterials, a_family_is_shown_by_its_name) {
  const ProcessResult result = run_emit({"materials", "roofing", "--climate", "polar_overcast"});
  ASSERT_EQ(result.exit_code, 0) << result.err;
  EXPECT_NE(result.out.find("roof_slate"), std::string::npos);
  EXPECT_NE(result.out.find("polar_overcast"), std::string::npos);
  EXPECT_EQ(result.out.find("lawn"), std::string::npos);
}

TEST(CliMaterials, the_check_finds_modes_that_miss_the_reference) {
  const TemporaryFolder folder;
  write_text(folder.file("lib.toml"), kLibrary);
  const auto check = [&](const std::string& name) {
    return run_emit({"materials", name, "--library", folder.file("lib.toml"), "--check",
                     "--climate", "hot_desert"});
  };
  const ProcessResult good = check("good");
  EXPECT_EQ(good.exit_code, 0) << good.out << good.err;
  EXPECT_NE(good.out.find("0.80 +-0.12"), std::string::npos) << good.out;
  EXPECT_NE(good.out.find("+-25 %"), std::string::npos) << good.out;
  const ProcessResult slow = check("slow");
  EXPECT_EQ(slow.exit_code, 1) << slow.out << slow.err;
  EXPECT_NE(slow.out.find(" !"), std::string::npos) << slow.out;
}

TEST(CliMaterials, a_spectrum_is_shown_with_what_it_was_folded_to) {
  const TemporaryFolder folder;
  write_text(folder.file("e.csv"),
             "wavelength_um,reflectance_frac\n7,0.05\n9,0.1\n9.5,0.4\n14,0.02\n60,0.02\n");
  write_text(folder.file("lib.toml"), R"(
[[material]]
name = "sand"
family = "soils"
solar_absorptance_frac = 0.6
emissivity_spectrum_file = "e.csv"
prescribed_k = 300
)");
  const ProcessResult list = run_emit({"materials", "--library", folder.file("lib.toml")});
  ASSERT_EQ(list.exit_code, 0) << list.err;
  EXPECT_NE(list.out.find("not in spectrum"), std::string::npos) << list.out;
  EXPECT_NE(list.out.find("full sun K"), std::string::npos) << list.out;
  const ProcessResult one =
      run_emit({"materials", "sand", "--library", folder.file("lib.toml"), "--json",
                folder.file("m.json"), "--plot", folder.file("m.svg")});
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_NE(one.out.find("7 to 60 um"), std::string::npos) << one.out;
  const std::string json = read_text(folder.file("m.json"));
  const std::string spectrum = json.substr(json.find("\"emissivity_spectrum\""));
  const std::string lwir = spectrum.substr(spectrum.find("\"8-12\""));
  const double folded = std::strtod(json_value(lwir, "emissivity_frac").c_str(), nullptr);
  EXPECT_GT(folded, 0.6);
  EXPECT_LT(folded, 0.9);
  EXPECT_GT(std::strtod(json_value(lwir, "largest_error_k").c_str(), nullptr), 0.01);
  EXPECT_EQ(spectrum.find("\"3-5\""), std::string::npos);
  const std::string svg = read_text(folder.file("m.svg"));
  EXPECT_NE(svg.find("soils: emissivity over wavelength"), std::string::npos);
  EXPECT_NE(svg.find("sand, bands"), std::string::npos);
}

TEST(CliMaterials, a_wrong_name_or_climate_says_what_was_meant) {
  const ProcessResult name = run_emit({"materials", "lawm"});
  EXPECT_EQ(name.exit_code, 2);
  EXPECT_NE(name.err.find("did you mean 'lawn'"), std::string::npos) << name.err;
  const ProcessResult climate = run_emit({"materials", "lawn", "--climate", "no-such-place"});
  EXPECT_NE(climate.exit_code, 0);
  EXPECT_NE(climate.err.find("no-such-place"), std::string::npos) << climate.err;
}

}  // namespace
}  // namespace emit::test
