// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/air_model.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/air_view.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/csv.hpp"
#include "emit/physics/planck.hpp"

namespace emit::physics {
namespace {

constexpr std::array<const char*, 4> kBands{"3-5", "3.4-4.1", "8-12", "7.7-9.3"};

/// Flat band of a name that states its limits in um.
Band flat_band(std::string_view name) {
  const std::size_t dash = name.find('-');
  return {std::stod(std::string(name.substr(0, dash))),
          std::stod(std::string(name.substr(dash + 1))),
          {}};
}
BandAir air_of(std::string_view name) {
  auto band = BandAir::build(flat_band(name));
  EXPECT_TRUE(band) << band.error().text;
  return std::move(*band);
}

/// A path as LOWTRAN7 rev 4.2 has it, on 34 levels (20 cm-1, no scattering): heights and range in
/// m, or for the sky the elevation in deg in place of the target's height. By band: transmittance
/// (300 K, for the sky flat), then thermal radiance in W m-2 sr-1.
struct LowtranPath {
  AirClimate climate;
  double visibility_km;
  double sensor_m;
  double target_m;
  double range_m;
  std::array<double, 8> tau_and_radiance;
};
constexpr LowtranPath kSights[] = {
    {AirClimate::tropical,
     23,
     357,
     7123,
     7739.4,
     {0.3262, 1.006, 0.7273, 0.06096, 0.5575, 14.84, 0.4426, 7.371}},
    {AirClimate::tropical,
     23,
     124,
     8570,
     14990.3,
     {0.2277, 1.222, 0.6118, 0.09111, 0.3759, 21.55, 0.3006, 9.579}},
    {AirClimate::tropical,
     5,
     576,
     515,
     14459.2,
     {0.0289, 1.598, 0.1134, 0.2543, 0.0142, 35.85, 0.0119, 14.01}},
    {AirClimate::midlatitude_summer,
     5,
     2,
     2,
     41871.1,
     {0.0006, 1.504, 0.0029, 0.2583, 0.0000, 34.94, 0.0000, 13.54}},
    {AirClimate::midlatitude_summer,
     5,
     5751,
     4734,
     1063.5,
     {0.7504, 0.1119, 0.9675, 0.002095, 0.9714, 0.5629, 0.9202, 0.5592}},
    {AirClimate::midlatitude_summer,
     5,
     5116,
     5116,
     3883.4,
     {0.6359, 0.1748, 0.9223, 0.005307, 0.9334, 1.343, 0.8376, 1.169}},
    {AirClimate::midlatitude_winter,
     5,
     1101,
     4,
     1358.2,
     {0.5478, 0.2486, 0.8161, 0.01518, 0.8372, 3.601, 0.7272, 2.166}},
    {AirClimate::midlatitude_winter,
     23,
     9617,
     10695,
     10753,
     {0.7242, 0.01024, 0.9578, 0.0001599, 0.9356, 0.3947, 0.9213, 0.1398}},
    {AirClimate::midlatitude_winter,
     23,
     2203,
     87,
     2371.4,
     {0.5481, 0.2207, 0.8648, 0.01004, 0.8801, 2.524, 0.7509, 1.853}},
    {AirClimate::subarctic_summer,
     5,
     0,
     0,
     1409.7,
     {0.4407, 0.6465, 0.7629, 0.04479, 0.7114, 8.906, 0.5801, 4.914}},
    {AirClimate::subarctic_summer,
     5,
     197,
     2,
     416.6,
     {0.6398, 0.4039, 0.9038, 0.0176, 0.8867, 3.449, 0.7895, 2.423}},
    {AirClimate::subarctic_summer,
     23,
     1308,
     1308,
     906.6,
     {0.6243, 0.3252, 0.9158, 0.01128, 0.9000, 2.685, 0.7930, 2.062}},
    {AirClimate::subarctic_winter,
     5,
     10964,
     233,
     13635.2,
     {0.4595, 0.08217, 0.7398, 0.008627, 0.7956, 2.875, 0.6716, 1.502}},
    {AirClimate::subarctic_winter,
     23,
     1617,
     1698,
     13104.5,
     {0.3548, 0.2023, 0.6591, 0.0143, 0.7596, 4.002, 0.5881, 2.375}},
    {AirClimate::subarctic_winter,
     23,
     1071,
     10386,
     32688.2,
     {0.3933, 0.1782, 0.7016, 0.009813, 0.7888, 2.943, 0.6414, 1.895}},
    {AirClimate::us_standard,
     5,
     440,
     440,
     10298.1,
     {0.1122, 0.9511, 0.2792, 0.1255, 0.2711, 21.78, 0.1793, 9.282}},
    {AirClimate::us_standard,
     5,
     2235,
     2235,
     219.4,
     {0.7915, 0.136, 0.9768, 0.002255, 0.9779, 0.5183, 0.9362, 0.5466}},
    {AirClimate::us_standard,
     23,
     1900,
     4933,
     3037.2,
     {0.6003, 0.2521, 0.9043, 0.007927, 0.9157, 1.854, 0.8011, 1.603}},
};
constexpr LowtranPath kSkies[] = {
    {AirClimate::tropical,
     5,
     2,
     2,
     0.0,
     {0.0005, 1.81, 0.0014, 0.311, 0.0000, 37.99, 0.0000, 14.94}},
    {AirClimate::tropical,
     5,
     2195,
     30,
     0.0,
     {0.4321, 0.6, 0.7534, 0.03019, 0.6849, 7.468, 0.5640, 4.363}},
    {AirClimate::midlatitude_summer,
     23,
     133,
     26.91,
     0.0,
     {0.2784, 1.011, 0.5794, 0.07584, 0.4064, 17.72, 0.3319, 8.085}},
    {AirClimate::midlatitude_summer,
     23,
     2,
     60,
     0.0,
     {0.3750, 0.8893, 0.6986, 0.05397, 0.5652, 12.76, 0.4599, 6.51}},
    {AirClimate::midlatitude_winter,
     5,
     2,
     15,
     0.0,
     {0.2028, 0.4626, 0.3948, 0.04627, 0.4203, 11.64, 0.3121, 5.272}},
    {AirClimate::midlatitude_winter,
     5,
     2,
     4.2,
     0.0,
     {0.0295, 0.5773, 0.0713, 0.0779, 0.0995, 19.92, 0.0524, 7.708}},
    {AirClimate::subarctic_summer,
     5,
     2,
     2,
     0.0,
     {0.0016, 1.118, 0.0045, 0.1769, 0.0008, 30.32, 0.0005, 11.56}},
    {AirClimate::subarctic_summer,
     23,
     2,
     7.54,
     0.0,
     {0.1182, 0.9569, 0.2932, 0.1013, 0.1596, 23.21, 0.1323, 9.336}},
    {AirClimate::subarctic_winter,
     23,
     1224,
     58.82,
     0.0,
     {0.6068, 0.1241, 0.8615, 0.004222, 0.8393, 1.687, 0.7636, 1.099}},
    {AirClimate::subarctic_winter,
     5,
     2,
     30,
     0.0,
     {0.3851, 0.1993, 0.6138, 0.01572, 0.6405, 5.226, 0.5338, 2.568}},
    {AirClimate::us_standard,
     23,
     2,
     3,
     0.0,
     {0.0494, 1.072, 0.1308, 0.1384, 0.0859, 26.16, 0.0602, 10.45}},
    {AirClimate::us_standard,
     23,
     2964,
     7.5,
     0.0,
     {0.3583, 0.3007, 0.6497, 0.0171, 0.6437, 5.088, 0.5229, 2.878}},
};
/// Sun at the ground by LOWTRAN7: elevation in deg, then W m-2 by band.
struct LowtranSun {
  AirClimate climate;
  double visibility_km;
  double elevation_deg;
  std::array<double, 4> sun_w_m2;
};
constexpr LowtranSun kSuns[] = {
    {AirClimate::tropical, 23, 7, {1.4768, 1.4165, 0.017695, 0.01103}},
    {AirClimate::midlatitude_summer, 5, 12, {2.205, 1.9699, 0.11571, 0.059322}},
    {AirClimate::midlatitude_winter, 23, 25, {8.3751, 5.5799, 0.67378, 0.36608}},
    {AirClimate::subarctic_summer, 23, 40, {7.9629, 5.6548, 0.61325, 0.32557}},
    {AirClimate::subarctic_winter, 5, 6, {1.7273, 1.3426, 0.22156, 0.10217}},
    {AirClimate::us_standard, 23, 70, {10.227, 6.4176, 0.77807, 0.42697}},
};

AirColumn column_of(AirClimate climate, double visibility_km, double water_ratio = 1.0) {
  auto column = AirColumn::build({climate, visibility_km, water_ratio});
  EXPECT_TRUE(column) << column.error().text;
  return *column;
}

/// Largest and root mean square of errors.
struct Tally {
  double sum = 0.0;
  double max = 0.0;
  int count = 0;
  void add(double error) {
    sum += error * error;
    max = std::max(max, std::abs(error));
    ++count;
  }
  [[nodiscard]] double rms() const { return std::sqrt(sum / count); }
};

TEST(AirModel, agrees_with_lowtran_along_paths_and_towards_the_sky) {
  std::vector<BandAir> bands;
  for (const char* name : kBands) bands.push_back(air_of(name));
  Tally tau;
  Tally radiance;
  for (const bool sky : {false, true}) {
    for (const LowtranPath& row :
         sky ? std::span<const LowtranPath>(kSkies) : std::span<const LowtranPath>(kSights)) {
      const AirColumn column = column_of(row.climate, row.visibility_km);
      const AirPath path = sky ? AirPath::to_space(column, row.sensor_m, row.target_m * kDegree)
                               : AirPath::between(column, row.sensor_m, row.target_m, row.range_m);
      for (std::size_t b = 0; b < kBands.size(); ++b) {
        const BandAir& band = bands[b];
        tau.add(band.transmittance(path, sky ? AirSource::flat : AirSource::black_300k) -
                row.tau_and_radiance[2 * b]);
        radiance.add(band.path_radiance_w_m2_sr(path) / row.tau_and_radiance[2 * b + 1] - 1.0);
      }
    }
  }
  EXPECT_LT(tau.rms(), 0.008);
  EXPECT_LT(tau.max, 0.04);
  EXPECT_LT(radiance.rms(), 0.03);
  EXPECT_LT(radiance.max, 0.08);
}

/// A path through air in bands of any shape, as LOWTRAN7 rev 4.2 has it (20 cm-1, 300 K): heights
/// and range in m; a range of 0 stands for the way to space, with the elevation in deg in place of
/// the target's height. The radiance in W m-2 sr-1 is that of level paths, whose air has one
/// temperature.
struct BandPath {
  AirClimate climate;
  double visibility_km;
  double sensor_m;
  double target_m;
  double range_m;
  std::array<double, 5> tau;
  std::array<double, 5> radiance;
};
constexpr BandPath kBandPaths[] = {
    {AirClimate::subarctic_summer,
     5,
     68,
     68,
     8786,
     {0.1165, 0.1167, 0.1423, 0.1395, 0.1621},
     {0.6734, 0.3006, 38.26, 0.000292, 31.68}},
    {AirClimate::subarctic_winter,
     23,
     2992,
     12.194,
     0,
     {0.3501, 0.4318, 0.6819, 0.7716, 0.7273},
     {}},
    {AirClimate::midlatitude_winter, 5, 0, 43.431, 0, {0.3249, 0.403, 0.5884, 0.5338, 0.6332}, {}},
    {AirClimate::midlatitude_winter,
     23,
     738,
     3.254,
     0,
     {0.0694, 0.0609, 0.2402, 0.2179, 0.2726},
     {}},
    {AirClimate::tropical, 10, 2146, 0, 7605, {0.19, 0.1703, 0.133, 0.2504, 0.1535}, {}},
    {AirClimate::tropical,
     50,
     11957,
     11957,
     3407,
     {0.7281, 0.932, 0.9716, 0.987, 0.9794},
     {0.008078, 0.001064, 0.3082, 1.136e-08, 0.2027}},
    {AirClimate::midlatitude_summer,
     23,
     0,
     0,
     38299,
     {0.0139, 0.0024, 0.0005, 0.0414, 0.0005},
     {1, 0.4449, 50.49, 0.0005508, 42.73}},
    {AirClimate::us_standard,
     23,
     2993,
     2993,
     208,
     {0.755, 0.9379, 0.9628, 0.9463, 0.9758},
     {0.08542, 0.01016, 1.139, 4.658e-06, 0.6535}},
    {AirClimate::midlatitude_summer, 23, 0, 206, 5249, {0.2501, 0.2439, 0.2253, 0.3325, 0.258}, {}},
    {AirClimate::midlatitude_summer, 50, 0, 45.13, 0, {0.3109, 0.3431, 0.4263, 0.4675, 0.4748}, {}},
    {AirClimate::midlatitude_winter, 23, 0, 275, 412, {0.6596, 0.8474, 0.9067, 0.8666, 0.9346}, {}},
    {AirClimate::subarctic_summer, 5, 0, 2515, 4562, {0.3295, 0.3957, 0.4898, 0.4221, 0.5375}, {}},
    {AirClimate::midlatitude_summer, 10, 0, 48.863, 0, {0.3009, 0.3362, 0.4178, 0.438, 0.4639}, {}},
    {AirClimate::us_standard,
     50,
     1883,
     1883,
     1117,
     {0.6072, 0.7861, 0.8678, 0.817, 0.9055},
     {0.1908, 0.04738, 4.732, 2.815e-05, 2.931}},
};
std::vector<Band> any_bands() {
  return {{3.7, 4.8, {}},
          {4.5, 4.8, {}},
          {7.5, 13.5, {}},
          {2.0, 2.5, {}},
          {7.5, 14.0, {{7.5, 0.0}, {8.5, 1.0}, {12.0, 1.0}, {14.0, 0.0}}}};
}

TEST(AirModel, bands_of_any_shape_agree_with_lowtran) {
  const std::vector<Band> bands = any_bands();
  for (std::size_t b = 0; b < bands.size(); ++b) {
    const auto air = BandAir::build(bands[b]);
    ASSERT_TRUE(air) << air.error().text;
    Tally tau;
    Tally radiance;
    for (const BandPath& row : kBandPaths) {
      const AirColumn column = column_of(row.climate, row.visibility_km);
      const AirPath path = row.range_m == 0.0
                               ? AirPath::to_space(column, row.sensor_m, row.target_m * kDegree)
                               : AirPath::between(column, row.sensor_m, row.target_m, row.range_m);
      tau.add(air->transmittance(path, AirSource::black_300k) - row.tau[b]);
      if (row.radiance[b] <= 0.0) continue;
      radiance.add(air->path_radiance_w_m2_sr(path) / row.radiance[b] - 1.0);
    }
    EXPECT_LT(tau.rms(), 0.006) << b;
    EXPECT_LT(tau.max, 0.012) << b;
    EXPECT_LT(radiance.rms(), 0.05) << b;
  }
}

TEST(AirModel, a_band_made_of_pieces_is_that_with_terms_of_its_own) {
  // A hair wider, the band is made of pieces of the spectrum.
  for (const char* name : kBands) {
    const BandAir own = air_of(name);
    Band wider = flat_band(name);
    wider.hi_um += 1e-6;
    const BandAir pieces = *BandAir::build(wider);
    EXPECT_NEAR(pieces.sun_outside_w_m2() / own.sun_outside_w_m2(), 1.0, 2e-3) << name;
    Tally tau;
    for (const LowtranPath& row : kSights) {
      const AirColumn column = column_of(row.climate, row.visibility_km);
      const AirPath path = AirPath::between(column, row.sensor_m, row.target_m, row.range_m);
      for (const AirSource source :
           {AirSource::black_300k, AirSource::black_800k, AirSource::sun_lowtran}) {
        tau.add(pieces.transmittance(path, source) - own.transmittance(path, source));
      }
    }
    EXPECT_LT(tau.rms(), 0.005) << name;
    EXPECT_LT(tau.max, 0.02) << name;
  }
}

TEST(AirModel, agrees_with_lowtran_on_the_sun_at_the_ground) {
  for (const LowtranSun& row : kSuns) {
    const AirColumn column = column_of(row.climate, row.visibility_km);
    const AirPath path = AirPath::to_space(column, 0.0, row.elevation_deg * kDegree);
    for (std::size_t b = 0; b < kBands.size(); ++b) {
      EXPECT_NEAR(air_of(kBands[b]).sun_w_m2(path) / row.sun_w_m2[b], 1.0, 0.05)
          << kBands[b] << " at " << row.elevation_deg << " deg";
    }
  }
}

/// Rows of a shared table of reference; empty where the table is absent.
std::optional<CsvTable> reference_table(const char* name) {
  const auto file = std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "../../shared/oracles" / name;
  if (!std::filesystem::exists(file)) return std::nullopt;
  auto table = CsvTable::read(file);
  EXPECT_TRUE(table) << table.error().text;
  return table ? std::optional(std::move(*table)) : std::nullopt;
}

TEST(AirModel, meets_its_bounds_over_the_reference_tables) {
  const auto sights = reference_table("lowtran7_slant.csv");
  const auto skies = reference_table("lowtran7_sky.csv");
  const auto suns = reference_table("lowtran7_sun.csv");
  if (!sights || !skies || !suns) GTEST_SKIP() << "no reference tables beside the checkout";
  std::map<std::pair<AirClimate, double>, AirColumn> columns;
  const auto column = [&](std::string_view model, double visibility_km) -> const AirColumn& {
    const auto key = std::pair{*air_climate(model), visibility_km};
    auto found = columns.find(key);
    if (found == columns.end())
      found = columns.emplace(key, column_of(key.first, key.second)).first;
    return found->second;
  };
  std::map<std::string, BandAir, std::less<>> bands;
  for (const char* name : kBands) bands.emplace(name, air_of(name));
  Tally tau;
  Tally radiance;
  for (const CsvTable* table : {&*sights, &*skies}) {
    const bool sky = table == &*skies;
    const auto model = *table->texts("model");
    const auto band = *table->texts("band");
    const auto visibility_km = *table->numbers("vis_km");
    const auto sensor_m = *table->numbers("h_sensor_m");
    const auto target = *table->numbers(sky ? "elevation_deg" : "h_target_m");
    const auto want_tau = *table->numbers(sky ? "tau_flat" : "tau_band");
    const auto want_radiance =
        *table->numbers(sky ? "sky_radiance_fine_w_m2_sr" : "path_radiance_fine_w_m2_sr");
    const auto source_name =
        sky ? std::vector<std::string_view>(table->rows(), "flat") : *table->texts("source");
    const auto range_m = sky ? std::vector<double>(table->rows(), 0.0) : *table->numbers("range_m");
    for (std::size_t i = 0; i < table->rows(); ++i) {
      const AirColumn& air = column(model[i], visibility_km[i]);
      const BandAir& terms = bands.find(band[i])->second;
      const AirSource source = source_name[i] == "300K"   ? AirSource::black_300k
                               : source_name[i] == "800K" ? AirSource::black_800k
                               : source_name[i] == "sun"  ? AirSource::sun_5772k
                                                          : AirSource::flat;
      const AirPath path = sky ? AirPath::to_space(air, sensor_m[i], target[i] * kDegree)
                               : AirPath::between(air, sensor_m[i], target[i], range_m[i]);
      tau.add(terms.transmittance(path, source) - want_tau[i]);
      radiance.add(terms.path_radiance_w_m2_sr(path) / want_radiance[i] - 1.0);
    }
  }
  EXPECT_LT(tau.rms(), 0.008);
  EXPECT_LT(tau.max, 0.04);
  EXPECT_LT(radiance.rms(), 0.03);
  EXPECT_LT(radiance.max, 0.08);
  const auto model = *suns->texts("model");
  const auto band = *suns->texts("band");
  const auto visibility_km = *suns->numbers("vis_km");
  const auto elevation_deg = *suns->numbers("sun_elevation_deg");
  const auto want = *suns->numbers("e_ground_w_m2");
  for (std::size_t i = 0; i < suns->rows(); ++i) {
    if (elevation_deg[i] < 5.0) continue;
    const auto path =
        AirPath::to_space(column(model[i], visibility_km[i]), 0.0, elevation_deg[i] * kDegree);
    EXPECT_NEAR(bands.find(band[i])->second.sun_w_m2(path) / want[i], 1.0, 0.05);
  }
}

TEST(AirModel, a_path_of_no_length_is_clear_and_a_long_one_radiates_like_its_air) {
  const AirColumn column = column_of(AirClimate::tropical, 5.0);
  for (const char* name : kBands) {
    const BandAir band = air_of(name);
    const AirPath none = AirPath::between(column, 100.0, 100.0, 0.0);
    EXPECT_NEAR(band.transmittance(none, AirSource::black_300k), 1.0, 1e-4);
    EXPECT_EQ(band.path_radiance_w_m2_sr(none), 0.0);
    // Level air of one temperature is opaque at 1000 km, so it radiates as a blackbody. The chord
    // of a plane of that size would leave the air, so its heights are held at the ground.
    const AirPath level = AirPath::between(column, 0.0, 0.0, 1e6);
    const double black =
        band_radiance(flat_band(name), Kelvin(column.at(0.0).kelvin)).radiance_w_m2_sr;
    EXPECT_NEAR(band.path_radiance_w_m2_sr(level) / black, 1.0, 0.005) << name;
    // Air that is 10 K warmer radiates as a blackbody of that temperature.
    const double warmer =
        band_radiance(flat_band(name), Kelvin(column.at(0.0).kelvin + 10.0)).radiance_w_m2_sr;
    EXPECT_NEAR(band.path_radiance_w_m2_sr(level, 10.0) / warmer, 1.0, 0.005) << name;
  }
}

TEST(AirModel, more_water_and_more_haze_let_less_through) {
  for (const char* name : kBands) {
    const BandAir band = air_of(name);
    const auto tau = [&](double visibility_km, double water_ratio) {
      const AirColumn column =
          column_of(AirClimate::midlatitude_summer, visibility_km, water_ratio);
      return band.transmittance(AirPath::between(column, 2.0, 2.0, 3000.0), AirSource::black_300k);
    };
    EXPECT_GT(tau(23.0, 0.5), tau(23.0, 1.0));
    EXPECT_GT(tau(23.0, 1.0), tau(10.0, 1.0));
    EXPECT_GT(tau(10.0, 1.0), tau(2.0, 1.0));
  }
}

TEST(AirModel, refuses_what_it_does_not_know) {
  EXPECT_FALSE(AirColumn::build({AirClimate::tropical, 1.0, 1.0}));
  EXPECT_FALSE(AirColumn::build({AirClimate::tropical, 23.0, -0.1}));
  EXPECT_FALSE(BandAir::build({1.9, 3.0, {}}));
  EXPECT_FALSE(BandAir::build({8.0, 14.3, {}}));
  EXPECT_FALSE(BandAir::build({5.0, 3.0, {}}));
  EXPECT_FALSE(air_climate("martian"));
}

TEST(AirView, the_air_of_the_sky_alone_may_be_warmer) {
  const AirColumn column = column_of(AirClimate::midlatitude_summer, 23.0);
  for (const char* name : kBands) {
    const BandAir band = air_of(name);
    const AirView::Subject subject{&band};
    const auto views = AirView::build(column, std::span(&subject, 1));
    std::vector<AirView::Node> all(AirView::kNodes);
    std::vector<AirView::Node> sky(AirView::kNodes);
    views[0].at(700.0, {.warmer_k = 7.0, .sky_warmer_k = 7.0}, all);
    views[0].at(700.0, {.warmer_k = 2.0, .sky_warmer_k = 7.0}, sky);
    EXPECT_EQ(sky.back(), all.back());
    EXPECT_NE(sky.front(), all.front());
  }
}

TEST(AirView, tables_agree_with_the_model) {
  const AirColumn column = column_of(AirClimate::midlatitude_summer, 23.0);
  std::vector<BandAir> bands;
  std::vector<AirView::Subject> subjects;
  for (const char* name : kBands) bands.push_back(air_of(name));
  for (const BandAir& band : bands) subjects.push_back({&band});
  const auto views = AirView::build(column, subjects);
  ASSERT_EQ(views.size(), kBands.size());
  std::vector<AirView::Node> table(AirView::kNodes);
  Tally tau;
  Tally radiance;
  Tally sky;
  for (std::size_t b = 0; b < kBands.size(); ++b) {
    for (const double sensor_m : {2.0, 130.0, 900.0, 3300.0, 9500.0}) {
      for (const double warmer_k : {-12.0, 0.0, 7.0}) {
        views[b].at(sensor_m, {.warmer_k = warmer_k, .sky_warmer_k = warmer_k}, table);
        for (const double target_m : {0.0, 90.0, 1400.0, 7700.0}) {
          for (const double level_m : {15.0, 340.0, 2700.0, 21000.0}) {
            const double range_m = std::hypot(level_m, target_m - sensor_m);
            const AirPath path = AirPath::between(column, sensor_m, target_m, range_m);
            const AirSight seen =
                air_sight(table, static_cast<float>(target_m), static_cast<float>(range_m));
            tau.add(seen.transmittance_frac[0] -
                    bands[b].transmittance(path, AirView::kPicture[0]));
            radiance.add(
                seen.path_radiance_w_m2_sr / bands[b].path_radiance_w_m2_sr(path, warmer_k) - 1.0);
          }
        }
        for (const double elevation_deg : {1.0, 4.0, 17.0, 60.0}) {
          const double radians = elevation_deg * kDegree;
          const AirPath path = AirPath::to_space(column, sensor_m, radians);
          sky.add(air_sky(table, static_cast<float>(std::sin(radians))).path_radiance_w_m2_sr /
                      bands[b].path_radiance_w_m2_sr(path, warmer_k) -
                  1.0);
        }
      }
    }
  }
  EXPECT_LT(tau.rms(), 0.001);
  EXPECT_LT(tau.max, 0.015);
  EXPECT_LT(radiance.rms(), 0.01);
  EXPECT_LT(radiance.max, 0.05);
  EXPECT_LT(sky.rms(), 0.012);
  EXPECT_LT(sky.max, 0.05);
}

}  // namespace
}  // namespace emit::physics
