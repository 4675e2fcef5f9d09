// SPDX-License-Identifier: Apache-2.0
#include "emit/physics/sky/fog.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/physics/sky/mie.hpp"
#include "emit/physics/weather.hpp"

/// Fog against published scattering of spheres, the fogs of LOWTRAN7, and photons that walk through
/// a layer at random.
namespace emit::physics {
namespace {

struct PublishedSphere {
  double size, n, k, extinction, scattering, asymmetry;
};

TEST(Mie, SpheresScatterAsPublished) {
  // Bohren and Huffman 1983, appendix A, prints Q_ext = 3.10543 for a radius of 0.525 um, 0.6328 um
  // and an index of 1.55.
  const auto printed = mie_efficiencies(2.0 * kPi * 0.525 / 0.6328, 1.55, 0.0);
  EXPECT_NEAR(printed.extinction, 3.10543, 5e-6);
  EXPECT_NEAR(printed.scattering, 3.10543, 5e-6);
  // Wiscombe 1979 (NCAR/TN-140+STR), test cases of MIEV0: scattering and asymmetry, and extinction
  // where it differs.
  for (const PublishedSphere& s :
       std::vector<PublishedSphere>{{10, 0.75, 0, 2.232265, 2.232265, 0.896473},
                                    {1000, 0.75, 0, 1.997908, 1.997908, 0.844944},
                                    {1, 1.33, 1e-5, 0.093952, 0.093923, 0.184517},
                                    {100, 1.33, 1e-5, 2.101321, 2.096594, 0.868959},
                                    {10000, 1.33, 1e-5, 2.004089, 1.723857, 0.907840},
                                    {1, 1.5, 1, 2.336321, 0.663454, 0.192136},
                                    {100, 1.5, 1, 2.097502, 1.283697, 0.850252},
                                    {10000, 1.5, 1, 2.004368, 1.236574, 0.846310},
                                    {1, 10, 10, 2.532993, 2.049405, -0.110664},
                                    {100, 10, 10, 2.071124, 1.836785, 0.556215},
                                    {10000, 10, 10, 2.005914, 1.795393, 0.548194}}) {
    const auto found = mie_efficiencies(s.size, s.n, s.k);
    EXPECT_NEAR(found.extinction, s.extinction, 1.5e-6) << s.size << ' ' << s.n;
    EXPECT_NEAR(found.scattering, s.scattering, 1.5e-6) << s.size << ' ' << s.n;
    EXPECT_NEAR(found.asymmetry, s.asymmetry, 1.5e-6) << s.size << ' ' << s.n;
  }
  // Small spheres scatter by Rayleigh's law.
  const double small = mie_efficiencies(0.01, 1.33, 0.0).scattering;
  const double polarisability = (1.33 * 1.33 - 1.0) / (1.33 * 1.33 + 2.0);
  EXPECT_NEAR(small / (8.0 / 3.0 * std::pow(0.01, 4) * polarisability * polarisability), 1.0, 1e-4);
}

/// Extinction and absorption by the extinction at 0.55 um, and asymmetry.
struct FogRow {
  double um, extinction, absorption, asymmetry;
};

void expect_rows(FogKind kind, const std::vector<FogRow>& rows, double relative, double asymmetry) {
  const Fog fog{kind, kKoschmieder, 50.0};
  for (const FogRow& row : rows) {
    const FogOptics found = fog_optics_at(fog, row.um);
    EXPECT_NEAR(found.extinction_per_m / row.extinction, 1.0, relative) << row.um;
    EXPECT_NEAR(found.extinction_per_m * (1.0 - found.albedo_frac), row.absorption,
                relative * row.extinction)
        << row.um;
    EXPECT_NEAR(found.asymmetry, row.asymmetry, asymmetry) << row.um;
  }
}

TEST(Fog, IsThatOfLowtran7) {
  // Tables FG1 and FG2 of its block data: extinction, absorption and asymmetry of the heavy
  // advection fog and the moderate radiation fog of Shettle and Fenn.
  expect_rows(FogKind::moderate_radiation,
              {{2.25, 1.39203, 0.00620, 0.8393},
               {3.0, 1.10816, 0.57930, 0.8982},
               {3.75, 1.45272, 0.03475, 0.8082},
               {4.5, 1.18709, 0.09639, 0.8319},
               {5.0, 1.04367, 0.08000, 0.8243},
               {6.0, 0.71747, 0.34589, 0.8282},
               {7.9, 0.47677, 0.11816, 0.7528},
               {8.7, 0.36734, 0.11519, 0.7274},
               {10.0, 0.24139, 0.12329, 0.6790},
               {11.0, 0.24006, 0.18633, 0.6305},
               {12.5, 0.42671, 0.35411, 0.5475},
               {17.2, 0.57165, 0.44278, 0.3872}},
              0.003, 1e-3);
  expect_rows(FogKind::heavy_advection,
              {{2.25, 1.04696, 0.03892, 0.8689},
               {3.0, 1.04899, 0.49696, 0.9502},
               {3.75, 1.07804, 0.17918, 0.8544},
               {4.5, 1.09272, 0.37373, 0.9007},
               {5.0, 1.10367, 0.34601, 0.8885},
               {6.0, 1.10430, 0.55190, 0.9604},
               {7.9, 1.17209, 0.45943, 0.9039},
               {8.7, 1.20133, 0.46089, 0.9110},
               {10.0, 1.22677, 0.47196, 0.9381},
               {10.591, 1.15589, 0.48905, 0.9537},
               {11.0, 1.05684, 0.51468, 0.9595},
               {12.5, 1.01120, 0.55266, 0.9418},
               {17.2, 1.16247, 0.61158, 0.8898}},
              0.01, 2e-3);
}

TEST(Fog, AGreyBandIsCloseToTheBandItself) {
  for (const Band& band : {Band{3.0, 5.0, {}}, Band{8.0, 12.0, {}}}) {
    double worst = 0.0;
    for (const auto& [name, kind] : kFogKinds) {
      const Fog fog{kind, 200.0, 50.0};
      const FogOptics grey = fog_optics(fog, band);
      for (const double depth : {0.2, 1.0, 3.0}) {
        const double range_m = depth / grey.extinction_per_m;
        double through = 0.0;
        double weights = 0.0;
        for (int i = 0; i < 40; ++i) {
          const double um = band.lo_um + (band.hi_um - band.lo_um) * (i + 0.5) / 40;
          const double weight = spectral_radiance(Micrometres(um), Kelvin(285.0)).value();
          through += weight * std::exp(-fog_optics_at(fog, um).extinction_per_m * range_m);
          weights += weight;
        }
        worst = std::max(worst, std::abs(through / weights - std::exp(-depth)));
      }
    }
    RecordProperty("worst_" + std::to_string(static_cast<int>(band.lo_um)), std::to_string(worst));
    EXPECT_LT(worst, 0.02) << band.lo_um;
  }
}

TEST(Fog, AStretchIsThePartOfThePathBelowTheTop) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 300; ++i) {
    const double above_m = 200.0 * (unit(random) - 0.5);
    const double sine = i % 10 == 0 ? 0.0 : 2.0 * unit(random) - 1.0;
    const double range_m = 1000.0 * unit(random);
    const auto found = fog_stretch(above_m, sine, range_m);
    constexpr int kSteps = 20000;
    int inside = 0;
    double first_m = -1.0;
    for (int k = 0; k < kSteps; ++k) {
      const double s = range_m * (k + 0.5) / kSteps;
      if (!(s * sine < above_m)) continue;
      if (inside++ == 0) first_m = s;
    }
    EXPECT_NEAR(found.length_m, range_m * inside / kSteps, 0.11) << i;
    if (inside > 10) {
      EXPECT_NEAR(found.begin_m, first_m, 0.11) << i;
    }
  }
}

/// Shares of photons by where they end, on the way back from a sensor.
struct Ends {
  double target = 0.0;  ///< without having been scattered
  double sky = 0.0;
  double ground = 0.0;
  double fog = 0.0;
};

/// Walks photons through a layer, with the phase function of Henyey and Greenstein. A target stands
/// `range_m` away, seen by those that have not been scattered.
Ends walk(const FogOptics& of, double top_m, double height_m, double sine, double range_m) {
  constexpr int kPhotons = 40000;
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  Ends ends;
  for (int i = 0; i < kPhotons; ++i) {
    std::array<double, 3> d{std::sqrt(1.0 - sine * sine), 0.0, sine};
    double z = height_m;
    for (bool scattered = false;; scattered = true) {
      const double step_m = -std::log(1.0 - unit(random)) / of.extinction_per_m;
      if (!scattered && range_m <= step_m) {
        ends.target += 1.0 / kPhotons;
        break;
      }
      const double next = z + step_m * d[2];
      if (next >= top_m || next <= 0.0) {
        (next >= top_m ? ends.sky : ends.ground) += 1.0 / kPhotons;
        break;
      }
      z = next;
      if (unit(random) > of.albedo_frac) {
        ends.fog += 1.0 / kPhotons;
        break;
      }
      const double g = of.asymmetry;
      const double root = (1.0 - g * g) / (1.0 - g + 2.0 * g * unit(random));
      const double cosine = (1.0 + g * g - root * root) / (2.0 * g);
      const double across = std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
      const double turn = 2.0 * kPi * unit(random);
      const double level = std::sqrt(std::max(1e-12, 1.0 - d[2] * d[2]));
      const std::array<double, 3> side{-d[1] / level, d[0] / level, 0.0};
      const std::array<double, 3> up{-d[0] * d[2] / level, -d[1] * d[2] / level, level};
      for (std::size_t k = 0; k < 3; ++k) {
        d[k] = cosine * d[k] + across * (std::cos(turn) * side[k] + std::sin(turn) * up[k]);
      }
    }
  }
  return ends;
}

/// Share of the sky or the ground in a line of sight by the light of the layer.
double share_of(const FogOptics& of, double top_m, double height_m, double sine, double range_m,
                bool sky) {
  const auto light =
      fog_light(of, top_m, {.sky_w_m2_sr = sky ? 1.0 : 0.0, .ground_w_m2_sr = sky ? 0.0 : 1.0});
  const auto in = fog_stretch(top_m - height_m, sine, range_m);
  const bool out = range_m >= kFogFarM;
  const double per_m = out ? light.wide_per_m : light.extinction_per_m;
  return fog_glow_w_m2_sr(light, per_m, top_m - height_m, sine, in.length_m) +
         (out && sky ? std::exp(-per_m * in.length_m) : 0.0);
}

TEST(Fog, SkyAndGroundShineThroughALayerAsPhotonsWalk) {
  // The fog looks like a blackbody where no photon ends at the sky or the ground. Errors are
  // therefore shares of the difference between a blackbody and the sky.
  for (const Band& band : {Band{3.0, 5.0, {}}, Band{8.0, 12.0, {}}}) {
    double sky_square = 0.0;
    double sky_worst = 0.0;
    double level_worst = 0.0;
    double down_worst = 0.0;
    int cases = 0;
    for (const auto& [name, kind] : kFogKinds) {
      const FogOptics of = fog_optics({kind, 200.0, 50.0}, band);
      for (const double top_m : {10.0, 50.0, 200.0}) {
        for (const double sine : {1.0, 0.5, 0.15}) {
          const Ends up = walk(of, top_m, 1e-6, sine, kFogFarM);
          const double error = share_of(of, top_m, 0.0, sine, kFogFarM, true) - up.sky;
          sky_square += error * error;
          sky_worst = std::max(sky_worst, std::abs(error));
          ++cases;
        }
        const Ends level = walk(of, top_m, 2.0, 0.0, 150.0);
        EXPECT_NEAR(level.target, std::exp(-of.extinction_per_m * 150.0), 0.01) << name;
        level_worst =
            std::max(level_worst, std::abs(share_of(of, top_m, 2.0, 0.0, 150.0, true) - level.sky));
        const Ends down = walk(of, top_m, top_m - 1e-6, -0.5, 2.0 * top_m);
        down_worst = std::max(
            down_worst, std::abs(share_of(of, top_m, top_m, -0.5, 2.0 * top_m, true) - down.sky));
      }
    }
    const bool longwave = band.lo_um > 7.0;
    const std::string at = longwave ? "_8_12" : "_3_5";
    RecordProperty("sky_rms" + at, std::to_string(std::sqrt(sky_square / cases)));
    RecordProperty("sky_worst" + at, std::to_string(sky_worst));
    RecordProperty("level_worst" + at, std::to_string(level_worst));
    RecordProperty("down_worst" + at, std::to_string(down_worst));
    EXPECT_LT(std::sqrt(sky_square / cases), longwave ? 0.02 : 0.045);
    EXPECT_LT(sky_worst, longwave ? 0.07 : 0.14);
    EXPECT_LT(level_worst, longwave ? 0.11 : 0.12);
    EXPECT_LT(down_worst, longwave ? 0.03 : 0.155);
  }
}

TEST(Fog, ThickFogLooksLikeABlackbodyAndThinFogLikeNothing) {
  const FogArrivals night{.black_w_m2_sr = 30.0, .sky_w_m2_sr = 10.0, .ground_w_m2_sr = 32.0};
  for (const auto& [name, kind] : kFogKinds) {
    const FogOptics of = fog_optics({kind, 100.0, 50.0}, {8.0, 12.0, {}});
    const auto thick = fog_light(of, 40.0 / of.wide_extinction_per_m(), night);
    const double far = fog_glow_w_m2_sr(thick, thick.extinction_per_m, 0.5 * thick.depth_m, 0.0,
                                        50.0 / of.extinction_per_m);
    EXPECT_NEAR(far, 30.0, 1e-3) << name;
    const auto thin = fog_light(of, 1e-3, night);
    EXPECT_LT(fog_glow_w_m2_sr(thin, thin.wide_per_m, 1e-3, 1.0, 1e-3), 1e-2) << name;
  }
}

TEST(Fog, GlowIsTheSumOfShortStretches) {
  const FogOptics of = fog_optics({FogKind::heavy_radiation, 150.0, 50.0}, {3.0, 5.0, {}});
  const auto light = fog_light(of, 60.0,
                               {.black_w_m2_sr = 1.0,
                                .sky_w_m2_sr = 0.2,
                                .ground_w_m2_sr = 1.4,
                                .sun_w_m2 = 12.0,
                                .sin_sun = 0.4});
  for (const double per_m : {light.extinction_per_m, light.wide_per_m}) {
    for (const double sine : {-0.9, -0.2, 0.0, 0.3, 1.0}) {
      const double begin_m = sine > 0.0 ? 55.0 : 5.0;
      const double length_m = sine == 0.0 ? 300.0 : 50.0 / std::abs(sine);
      constexpr int kPieces = 4000;
      const double piece_m = length_m / kPieces;
      double sum = 0.0;
      for (int i = 0; i < kPieces; ++i) {
        sum += std::exp(-per_m * i * piece_m) *
               fog_glow_w_m2_sr(light, per_m, begin_m - sine * i * piece_m, sine, piece_m);
      }
      EXPECT_NEAR(fog_glow_w_m2_sr(light, per_m, begin_m, sine, length_m) / sum, 1.0, 1e-6) << sine;
      // Compare it in float32, as the shader has it.
      const FogLight<float> single{
          static_cast<float>(light.extinction_per_m), static_cast<float>(light.wide_per_m),
          static_cast<float>(light.black_w_m2_sr),    static_cast<float>(light.sky_w_m2_sr),
          static_cast<float>(light.ground_w_m2_sr),   static_cast<float>(light.sun_w_m2_sr),
          static_cast<float>(light.rate_per_m),       static_cast<float>(light.sun_rate_per_m),
          static_cast<float>(light.depth_m)};
      EXPECT_NEAR(fog_glow_w_m2_sr(single, static_cast<float>(per_m), static_cast<float>(begin_m),
                                   static_cast<float>(sine), static_cast<float>(length_m)) /
                      sum,
                  1.0, 1e-5)
          << sine;
    }
  }
}

TEST(Fog, SunlightReachesTheGroundAsPhotonsWalk) {
  double worst = 0.0;
  for (const double depth : {0.3, 1.0, 4.0, 15.0}) {
    for (const double sine : {0.3, 0.5, 0.9}) {
      const FogShade shade{depth, 0.87, 1.0};
      const Ends ends = walk({1.0, 1.0, 0.87}, depth, depth - 1e-9, -sine, kFogFarM);
      const double found = fog_sunlight_frac(shade, sine);
      EXPECT_GE(found, fog_beam_frac(shade, sine));
      worst = std::max(worst, std::abs(found - ends.ground));
    }
  }
  RecordProperty("worst", std::to_string(worst));
  EXPECT_LT(worst, 0.065);

  EXPECT_NEAR(fog_skylight_frac({0.0, 0.87, 1.0}), 1.0, 1e-12);
}

TEST(Fog, SunlitFogGivesBackWhatItTakesFromTheSun) {
  // Droplets that absorb nothing send the sun's light on, up and down.
  for (const double depth : {0.5, 2.0, 8.0}) {
    for (const double sine : {0.3, 0.8}) {
      const FogOptics of{1.0, 1.0 - 1e-9, 0.85};
      const auto light = fog_light(of, depth, {.sun_w_m2 = 1.0, .sin_sun = sine});
      double sum = sine * std::exp(-light.wide_per_m * depth / sine);
      constexpr int kRings = 400;
      for (int i = 0; i < kRings; ++i) {
        const double cosine = (i + 0.5) / kRings;
        const double weight = 2.0 * kPi * cosine / kRings;
        sum += weight * (fog_glow_w_m2_sr(light, light.wide_per_m, depth, cosine, depth / cosine) +
                         fog_glow_w_m2_sr(light, light.wide_per_m, 0.0, -cosine, depth / cosine));
      }
      EXPECT_NEAR(sum / sine, 1.0, 0.12) << depth << ' ' << sine;
    }
  }
}

TEST(Fog, TheClearSkysModelsHaveItsShade) {
  const GeoPlace place{degrees(48.0), degrees(11.0), Metres(400.0)};
  constexpr std::int64_t kNoonNs = 1'750'506'000'000'000'000;  // 21 June 2025, 11:40 UTC
  const SunPosition sun = sun_position(kNoonNs, place);
  ClearSky model;
  model.cloud_frac = 0.3;
  const Forcing clear = forcing_from_clear_sky(model, place, sun, kNoonNs);
  const Fog fog{FogKind::moderate_radiation, 300.0, 60.0};
  model.fog = fog_shade(fog);
  const Forcing below = forcing_from_clear_sky(model, place, sun, kNoonNs);
  EXPECT_NEAR(model.fog->sun_depth, kKoschmieder * 60.0 / 300.0, 1e-9);
  EXPECT_NEAR(below.direct_normal_w_m2 / clear.direct_normal_w_m2,
              std::exp(-kKoschmieder * 0.2 / sun.direction_enu.z), 1e-9);
  const auto global = [&](const Forcing& f) {
    return f.diffuse_horizontal_w_m2 +
           (1.0 - f.cloud_frac) * f.direct_normal_w_m2 * sun.direction_enu.z;
  };
  EXPECT_LT(global(below), global(clear));
  EXPECT_GT(global(below), 0.8 * global(clear));
  EXPECT_GT(below.diffuse_horizontal_w_m2, clear.diffuse_horizontal_w_m2);
  const double black = kStefanBoltzmannWPerM2K4 * std::pow(clear.air_k, 4.0);
  EXPECT_GT(below.longwave_down_w_m2, clear.longwave_down_w_m2);
  EXPECT_LT(below.longwave_down_w_m2, black);
  // Values at the ground lead back to those above the fog.
  EXPECT_NEAR(longwave_above_fog_w_m2(*model.fog, below.longwave_down_w_m2, clear.air_k, 0.0),
              clear.longwave_down_w_m2, 1e-6);
  EXPECT_NEAR(beam_above_fog_frac(*model.fog, fog_beam_frac(*model.fog, sun.direction_enu.z) * 0.7,
                                  sun.direction_enu.z, 0.0),
              0.7, 1e-9);
  // Endless fog hides sun and sky, and what it shows of the long-wave radiation is its own.
  model.fog = fog_shade({FogKind::heavy_advection, 20.0, 500.0});
  const Forcing dark = forcing_from_clear_sky(model, place, sun, kNoonNs);
  EXPECT_LT(dark.direct_normal_w_m2, 1e-9);
  // A few W m-2 of error at the ground say nothing of the sky above it, whatever the fog.
  for (const double visibility_m : {20.0, 50.0, 100.0, 300.0, 1000.0, 10'000.0}) {
    const FogShade shade = fog_shade({FogKind::heavy_advection, visibility_m, 50.0});
    for (const double error_w_m2 : {-8.0, -1.0, 0.0, 1.0, 8.0}) {
      const double above = longwave_above_fog_w_m2(shade, black + error_w_m2, clear.air_k, 300.0);
      EXPECT_GE(above, 299.9) << visibility_m << " m, " << error_w_m2 << " W/m2";
      EXPECT_LE(above, std::max(black, black + error_w_m2) + 1e-9) << visibility_m;
    }
  }
  EXPECT_NEAR(dark.longwave_down_w_m2, black, 0.01);
}

TEST(Fog, KindsHaveNames) {
  EXPECT_EQ(fog_kind("heavy_advection"), FogKind::heavy_advection);
  EXPECT_EQ(fog_kind("maritime_haze"), FogKind::maritime_haze);
  EXPECT_FALSE(fog_kind("fog"));
}

}  // namespace
}  // namespace emit::physics
