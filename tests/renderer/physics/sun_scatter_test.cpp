// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky/sun_scatter.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <vector>

#include "emit/physics/air_view.hpp"
#include "emit/physics/constants.hpp"

namespace emit::physics {
namespace {

constexpr std::array kAllClimates{AirClimate::tropical,           AirClimate::midlatitude_summer,
                                  AirClimate::midlatitude_winter, AirClimate::subarctic_summer,
                                  AirClimate::subarctic_winter,   AirClimate::us_standard};
const Band kMidwave{3.0, 5.0, {}};

AirColumn hazy_column(AirClimate climate, double visibility_km) {
  auto column = AirColumn::build({climate, visibility_km, 1.0});
  EXPECT_TRUE(column) << column.error().text;
  return std::move(*column);
}

SunScatter::Kinds lit_path(const SunScatter& scatter, const AirColumn& column, const AirPath& path,
                           double sun_rad) {
  SunScatter::Kinds light{};
  scatter.scattered_w_m2(path, scatter.beams(column, std::span(&sun_rad, 1)), std::span(&light, 1));
  return light;
}
double towards_sensor(const SunScatter& scatter, const SunScatter::Kinds& light, double cosine) {
  const auto phase = scatter.phase_per_sr(cosine);
  return std::inner_product(light.begin(), light.end(), phase.begin(), 0.0);
}

TEST(SunScatter, a_thin_even_layer_sends_the_light_of_its_haze) {
  // Haze of 23 km visibility has 0.158 km-1 at 0.55 um on the ground. At the climate's 76 % of
  // humidity it scatters 0.096 of that at 3.95 um (Shettle and Fenn 1979, between 70 and 80 % and
  // between 3.75 and 4.5 um).
  const Band narrow{3.9, 4.0, {}};
  const AirColumn column = hazy_column(AirClimate::midlatitude_summer, 23.0);
  const auto scatter = SunScatter::build(column, narrow);
  ASSERT_TRUE(scatter);
  const BandAir air = *BandAir::build(narrow);
  for (const double sun_deg : {12.0, 35.0, 80.0}) {
    const double sun_w_m2 = air.sun_w_m2(AirPath::to_space(column, 0.0, sun_deg * kDegree));
    for (const double range_m : {10.0, 200.0}) {
      const AirPath path = AirPath::between(column, 0.0, 0.0, range_m);
      const auto light = lit_path(*scatter, column, path, sun_deg * kDegree);
      const double expected = sun_w_m2 * 0.158 * 0.096 * range_m * 1e-3;
      EXPECT_NEAR(light[0], expected, 0.04 * expected) << sun_deg << ' ' << range_m;
      EXPECT_EQ(light[1], 0.0);
      EXPECT_EQ(light[2], 0.0);
      // Rayleigh's law in the fourth power of the wavelength: 0.0125 km-1 at 0.55 um.
      const double molecules = sun_w_m2 * 0.0116 * std::pow(0.55 / 3.95, 4) * range_m * 1e-3;
      EXPECT_NEAR(light[3], molecules, 0.1 * molecules) << sun_deg << ' ' << range_m;
    }
  }
}

TEST(SunScatter, phase_functions_share_all_light_out) {
  const AirColumn column = hazy_column(AirClimate::us_standard, 10.0);
  const auto scatter = SunScatter::build(column, kMidwave);
  ASSERT_TRUE(scatter);
  SunScatter::Kinds sum{};
  constexpr int kSteps = 40000;
  for (int i = 0; i < kSteps; ++i) {
    const double angle = (i + 0.5) / kSteps * kPi;
    const auto phase = scatter->phase_per_sr(std::cos(angle));
    for (std::size_t k = 0; k < sum.size(); ++k) {
      ASSERT_GT(phase[k], 0.0);
      sum[k] += phase[k] * 2.0 * kPi * std::sin(angle) * kPi / kSteps;
    }
  }
  for (const double each : sum) EXPECT_NEAR(each, 1.0, 0.02);
  // Haze sends the light forward, and small particles send it evenly.
  EXPECT_GT(scatter->phase_per_sr(std::cos(0.1))[0], 30.0 * scatter->phase_per_sr(0.0)[0]);
  EXPECT_NEAR(scatter->phase_per_sr(1.0)[3], scatter->phase_per_sr(-1.0)[3], 1e-6);
}

TEST(SunScatter, no_more_light_is_scattered_than_the_beam_loses) {
  const double zenith_rad = kPi / 2.0;
  for (const AirClimate climate : kAllClimates) {
    for (const double visibility_km : {2.0, 5.0, 23.0, 50.0}) {
      const AirColumn column = hazy_column(climate, visibility_km);
      const auto scatter = SunScatter::build(column, kMidwave);
      ASSERT_TRUE(scatter);
      const BandAir air = *BandAir::build(kMidwave);
      const AirPath up = AirPath::to_space(column, 0.0, zenith_rad);
      const auto light = lit_path(*scatter, column, up, zenith_rad);
      const double sum = std::accumulate(light.begin(), light.end(), 0.0);
      EXPECT_GT(sum, 0.0);
      EXPECT_LT(sum, air.sun_outside_w_m2() - air.sun_w_m2(up));
    }
  }
}

TEST(SunScatter, more_haze_and_a_smaller_angle_are_brighter_and_a_lower_sun_is_darker) {
  const AirColumn clear = hazy_column(AirClimate::midlatitude_summer, 50.0);
  const AirColumn hazy = hazy_column(AirClimate::midlatitude_summer, 5.0);
  const auto in_clear = SunScatter::build(clear, kMidwave);
  const auto in_haze = SunScatter::build(hazy, kMidwave);
  ASSERT_TRUE(in_clear && in_haze);
  const auto at = [](const SunScatter& scatter, const AirColumn& column, double sun_deg) {
    return lit_path(scatter, column, AirPath::between(column, 10.0, 10.0, 1500.0),
                    sun_deg * kDegree);
  };
  EXPECT_GT(at(*in_haze, hazy, 40.0)[0], 2.0 * at(*in_clear, clear, 40.0)[0]);
  EXPECT_LT(at(*in_haze, hazy, 5.0)[0], 0.8 * at(*in_haze, hazy, 40.0)[0]);
  const auto light = at(*in_haze, hazy, 40.0);
  double last = 1e9;
  for (double angle_deg = 0.0; angle_deg < 120.0; angle_deg += 5.0) {
    const double now = towards_sensor(*in_haze, light, std::cos(angle_deg * kDegree));
    EXPECT_LT(now, last) << angle_deg;
    last = now;
  }
}

TEST(SunScatter, bands_in_which_the_sun_hardly_counts_have_none) {
  const AirColumn column = hazy_column(AirClimate::us_standard, 23.0);
  for (const auto& [lo_um, hi_um] : {std::pair{8.0, 12.0}, {7.7, 9.3}, {5.5, 12.0}, {1.5, 2.5}}) {
    EXPECT_FALSE(SunScatter::build(column, {lo_um, hi_um, {}})) << lo_um;
  }
  for (const auto& [lo_um, hi_um] : {std::pair{2.0, 2.5}, {3.0, 5.0}, {3.4, 4.1}, {4.5, 5.2}}) {
    EXPECT_TRUE(SunScatter::build(column, {lo_um, hi_um, {}})) << lo_um;
  }
}

/// Sunlight in 3-5 um that LOWTRAN7 rev 4.2 scatters once (5 cm-1, layers of 50 m at the ground,
/// its own phase functions), at 1 au: heights and range in m, or for the sky its elevation in deg
/// in place of the target's height and a range of 0; elevation of the sun and angle between it and
/// the line of sight in deg; thermal, then scattered radiance in W m-2 sr-1.
struct ScatteredRow {
  AirClimate climate;
  double visibility_km;
  double sensor_m;
  double target_m;
  double range_m;
  double sun_deg;
  double angle_deg;
  double thermal;
  double scattered;
};
constexpr ScatteredRow kScattered[] = {
    {AirClimate::midlatitude_winter, 5, 1000, 23.83, 0, 10.43, 91.61, 0.2889, 0.007993},
    {AirClimate::midlatitude_winter, 50, 0, 63.82, 0, 21.1, 43.97, 0.2883, 0.01035},
    {AirClimate::subarctic_summer, 5, 0, 2.82, 0, 36.84, 130.88, 1.106, 0.03195},
    {AirClimate::tropical, 5, 8000, 21.79, 0, 76.08, 72.14, 0.0562, 0.0004135},
    {AirClimate::subarctic_summer, 5, 0, 2.39, 0, 69.39, 75.23, 1.113, 0.09065},
    {AirClimate::midlatitude_summer, 50, 0, 17.57, 0, 47.02, 97.52, 1.138, 0.00283},
    {AirClimate::tropical, 50, 3000, 22.77, 0, 32.93, 84.56, 0.4777, 0.000827},
    {AirClimate::tropical, 50, 0, 21.1, 0, 42.23, 80.03, 1.39, 0.00357},
    {AirClimate::midlatitude_winter, 23, 3000, 67.25, 0, 32.12, 43.69, 0.1161, 0.001083},
    {AirClimate::midlatitude_summer, 50, 0, 2.73, 0, 27.52, 87.96, 1.426, 0.007232},
    {AirClimate::midlatitude_winter, 50, 1000, 5.98, 0, 78.51, 73.34, 0.3904, 0.01265},
    {AirClimate::subarctic_summer, 5, 100, 3.57, 0, 41.67, 38.62, 1.064, 0.5253},
    {AirClimate::us_standard, 5, 3000, 17.72, 0, 70.66, 62.52, 0.2332, 0.002739},
    {AirClimate::us_standard, 23, 3000, 13.25, 0, 64.77, 52.22, 0.2531, 0.004482},
    {AirClimate::tropical, 23, 1000, 28.4, 0, 9.87, 119.60, 0.9385, 0.001748},
    {AirClimate::midlatitude_winter, 50, 3000, 87.67, 0, 66.64, 21.97, 0.1134, 0.001227},
    {AirClimate::subarctic_summer, 50, 100, 2.18, 0, 39.63, 46.44, 1.048, 0.06458},
    {AirClimate::tropical, 23, 0, 4.59, 0, 26.56, 124.84, 1.712, 0.007091},
    {AirClimate::us_standard, 23, 48, 48, 13530, 15.72, 153.91, 1.017, 0.009635},
    {AirClimate::us_standard, 5, 1376, 1908, 1060, 17.11, 71.08, 0.2927, 0.003332},
    {AirClimate::tropical, 23, 3808, 727, 13910, 46.55, 92.07, 0.8437, 0.007308},
    {AirClimate::tropical, 5, 297, 297, 1700, 25.28, 33.86, 1.172, 0.1014},
    {AirClimate::subarctic_winter, 50, 1880, 762, 5920, 42.1, 75.52, 0.1622, 0.005223},
    {AirClimate::tropical, 50, 623, 1916, 1730, 11.64, 53.46, 0.835, 0.001659},
    {AirClimate::subarctic_summer, 5, 4712, 4712, 26580, 30.44, 98.22, 0.2558, 0.001473},
    {AirClimate::tropical, 5, 849, 849, 13120, 24.64, 40.03, 1.47, 0.3127},
    {AirClimate::midlatitude_summer, 23, 851, 215, 5000, 31.03, 38.47, 1.008, 0.04782},
    {AirClimate::midlatitude_summer, 50, 615, 615, 5130, 40.61, 138.01, 1.005, 0.001694},
    {AirClimate::subarctic_summer, 50, 43, 7182, 23350, 28.08, 36.94, 0.792, 0.0328},
};

TEST(SunScatter, agrees_with_lowtran_towards_the_sky_and_along_paths) {
  const BandAir air = *BandAir::build(kMidwave);
  double off2 = 0.0;
  double worst = 0.0;
  double part2 = 0.0;
  for (const ScatteredRow& row : kScattered) {
    const AirColumn column = hazy_column(row.climate, row.visibility_km);
    const auto scatter = SunScatter::build(column, kMidwave);
    ASSERT_TRUE(scatter);
    const AirPath path = row.range_m == 0.0
                             ? AirPath::to_space(column, row.sensor_m, row.target_m * kDegree)
                             : AirPath::between(column, row.sensor_m, row.target_m, row.range_m);
    const double scattered =
        towards_sensor(*scatter, lit_path(*scatter, column, path, row.sun_deg * kDegree),
                       std::cos(row.angle_deg * kDegree));
    const double total = row.thermal + row.scattered;
    const double off = (scattered + air.path_radiance_w_m2_sr(path)) / total - 1.0;
    off2 += off * off;
    worst = std::max(worst, std::abs(off));
    const double part = scattered / row.scattered - 1.0;
    part2 += part * part;
    EXPECT_LT(std::abs(part), 0.35) << row.sensor_m << ' ' << row.angle_deg;
  }
  EXPECT_LT(std::sqrt(off2 / std::size(kScattered)), 0.03);
  EXPECT_LT(worst, 0.08);
  EXPECT_LT(std::sqrt(part2 / std::size(kScattered)), 0.12);
}

TEST(SunScatter, tables_of_a_view_agree_with_the_model) {
  for (const double visibility_km : {5.0, 23.0}) {
    const AirColumn column = hazy_column(AirClimate::midlatitude_summer, visibility_km);
    const auto scatter = SunScatter::build(column, kMidwave);
    ASSERT_TRUE(scatter);
    const BandAir band = *BandAir::build(kMidwave);
    const AirView::Subject subject{.band = &band, .scatter = &*scatter};
    const auto views = AirView::build(column, std::span(&subject, 1));
    ASSERT_TRUE(views[0].scatters());
    std::vector<AirView::Node> air(AirView::kNodes);
    std::vector<AirView::Node> table(AirView::kSunNodes);
    // Errors count by all that the path sends.
    double worst = 0.0;
    double sum2 = 0.0;
    int count = 0;
    const auto check = [&](double shown, double expected, double thermal) {
      const double off = (shown - expected) / (thermal + expected);
      worst = std::max(worst, std::abs(off));
      sum2 += off * off;
      ++count;
    };
    for (const double sun_deg : {1.5, 6.0, 25.0, 64.0}) {
      const double sun_rad = sun_deg * kDegree;
      const auto beams = scatter->beams(column, std::span(&sun_rad, 1));
      for (const double sensor_m : {2.0, 130.0, 900.0, 3300.0, 9500.0}) {
        views[0].at(sensor_m, {}, air);
        views[0].sun_at(sensor_m, {.sin_elevation = std::sin(sun_rad), .share_frac = 0.5}, table);
        for (const double angle_deg : {3.0, 30.0, 110.0}) {
          const double cosine = std::cos(angle_deg * kDegree);
          const auto phase = air_sun_phase(table, static_cast<float>(cosine));
          const auto expect = [&](const AirPath& path) {
            SunScatter::Kinds light{};
            scatter->scattered_w_m2(path, beams, std::span(&light, 1));
            return 0.5 * towards_sensor(*scatter, light, cosine);
          };
          for (const double target_m : {0.0, 90.0, 1400.0, 7700.0}) {
            for (const double level_m : {15.0, 340.0, 2700.0, 21000.0}) {
              const double range_m = std::hypot(level_m, target_m - sensor_m);
              const AirPath path = AirPath::between(column, sensor_m, target_m, range_m);
              const auto target = static_cast<float>(target_m);
              const auto range = static_cast<float>(range_m);
              AirView::Node node = air_sight_node(air, target, range);
              node[3] = air_sun_w_m2_sr(air_sight_node(table, target, range), phase);
              check(air_path_w_m2_sr(node, range), expect(path), band.path_radiance_w_m2_sr(path));
            }
          }
          for (const double elevation_deg : {1.0, 4.0, 17.0, 60.0}) {
            const double radians = elevation_deg * kDegree;
            const AirPath path = AirPath::to_space(column, sensor_m, radians);
            check(
                air_sun_w_m2_sr(air_sky_node(table, static_cast<float>(std::sin(radians))), phase),
                expect(path), band.path_radiance_w_m2_sr(path));
          }
        }
      }
    }
    EXPECT_LT(std::sqrt(sum2 / count), 0.01) << visibility_km;
    EXPECT_LT(worst, 0.06) << visibility_km;
  }
}

TEST(SunScatter, a_view_has_light_for_faces_of_every_tilt) {
  const AirColumn column = hazy_column(AirClimate::midlatitude_summer, 23.0);
  const auto scatter = SunScatter::build(column, kMidwave);
  ASSERT_TRUE(scatter);
  const BandAir band = *BandAir::build(kMidwave);
  const AirView::Subject subject{.band = &band, .scatter = &*scatter};
  const auto views = AirView::build(column, std::span(&subject, 1));
  // Surfaces reflect its mean around the sky.
  const SkyByTilt around = views[0].scattered_sky_by_tilt_w_m2_sr(700.0, 0.6);
  for (const double each : around) EXPECT_GT(each, 0.0);
  EXPECT_LT(around[0], around[kSkyTilts / 2]);
}

}  // namespace
}  // namespace emit::physics
