// SPDX-License-Identifier: Apache-2.0
// Clouds in band (physics.md eq. 84): a black base behind the air, in every kind of air, even and
// with structure, in the picture and in what surfaces see of the sky.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "emit/physics/air_model.hpp"
#include "emit/physics/air_view.hpp"
#include "emit/physics/apparent_temperature.hpp"
#include "emit/physics/atmosphere_table.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/csv.hpp"
#include "emit/physics/planck.hpp"
#include "stages/band_model.hpp"

namespace emit::renderer {
namespace {

constexpr double kPlaceM = 380.0;
constexpr double kAirK = 295.0;
constexpr double kBaseM = 1400.0;
constexpr double kBaseK = kAirK - 6.5e-3 * kBaseM;

enum class AirKind : std::uint8_t { terms, table, built_in };

/// Scenario with one band and air of a kind. `vertical_frac` is the transmittance of terms.
scene::ScenarioDesc sky_of(AirKind kind, const scene::SpectralBand& band, double vertical_frac,
                           bool structure) {
  scene::ScenarioDesc s;
  s.place.height_m = kPlaceM;
  s.clear_sky.dew_point_k = 284.0;
  s.clear_sky.cloud_base.height_m = kBaseM;
  s.bands = {band};
  s.materials.emplace_back();
  s.atmosphere.enabled = true;
  scene::BandAtmosphere air;
  air.band = band.name;
  if (kind == AirKind::terms) {
    air.terms = {{1.0, 0.2}};
    air.vertical_transmittance_frac = vertical_frac;
  } else if (kind == AirKind::table) {
    air.table.range_m = {500.0, 2000.0, 9000.0, 80000.0};
    air.table.elevation_rad = {-0.2, 0.0, 0.4, physics::kPi / 2.0};
    air.table.transmittance_frac = {0.8, 0.5, 0.1, 0.0, 0.8,  0.5, 0.2,  0.01,
                                    0.9, 0.7, 0.4, 0.3, 0.92, 0.8, 0.66, 0.6};
    const double air_w_m2_sr =
        physics::band_radiance({band.lo_um, band.hi_um, {}}, physics::Kelvin(kAirK - 4.0))
            .radiance_w_m2_sr;
    for (const double tau : air.table.transmittance_frac) {
      air.table.path_radiance_w_m2_sr.push_back((1.0 - tau) * air_w_m2_sr);
    }
  } else {
    air.model = physics::AirSpec{};
  }
  s.atmosphere.bands = {air};
  if (structure) {
    physics::Clouds clouds;
    clouds.base_m = kBaseM;
    s.clouds = clouds;
  }
  return s;
}

/// Weather of a cover whose long-wave irradiance is that of eq. 12.
physics::Forcing weather_of(const scene::ScenarioDesc& s, double cover_frac) {
  physics::Forcing f;
  f.air_k = f.environment_k = kAirK;
  f.cloud_frac = cover_frac;
  f.longwave_down_w_m2 =
      physics::sky_longwave_w_m2(physics::Kelvin(kAirK), physics::Kelvin(s.clear_sky.dew_point_k),
                                 cover_frac, s.clear_sky.cloud_base);
  return f;
}

BandModel model_of(scene::ScenarioDesc& s, double cover_frac, double sensor_m,
                   const physics::SunPosition& sun = {}, double beam_w_m2 = 0.0) {
  if (s.clouds) s.clouds->cover_frac = cover_frac;
  auto model = BandModel::build(s, s.materials);
  EXPECT_TRUE(model) << model.error().text;
  physics::Forcing forcing = weather_of(s, cover_frac);
  forcing.direct_normal_w_m2 = beam_w_m2;
  model->update(forcing, sun, {}, sensor_m, {});
  return std::move(*model);
}

/// Pixel of the sky; in a cloud where those have structure.
BandModel::Seen sky_pixel(double sine, double sensor_m, double cloud_frac) {
  BandModel::Seen seen;
  seen.sin_elevation = static_cast<float>(sine);
  seen.sensor_height_m = static_cast<float>(sensor_m);
  seen.cloud_frac = static_cast<float>(cloud_frac);
  return seen;
}

const std::vector<scene::SpectralBand>& both_windows() {
  static const std::vector<scene::SpectralBand> kWindows{{"3-5", 3.0, 5.0, {}},
                                                         {"8-12", 8.0, 12.0, {}}};
  return kWindows;
}

TEST(CloudsInBand, AreTheirBaseBehindTheAirOfEveryKind) {
  for (const scene::SpectralBand& band : both_windows()) {
    const auto black = [&](double kelvin) {
      return physics::band_radiance({band.lo_um, band.hi_um, {}}, physics::Kelvin(kelvin))
          .radiance_w_m2_sr;
    };
    const auto column = physics::AirColumn::build({});
    const auto air = physics::BandAir::build({band.lo_um, band.hi_um, {}});
    ASSERT_TRUE(column && air);
    const double warmer_k =
        (kAirK - column->at(kPlaceM).kelvin) * std::exp(kPlaceM / physics::BandAir::kWarmthScaleM);
    for (const auto& [kind, vertical_frac] :
         {std::pair{AirKind::terms, 1.0}, std::pair{AirKind::terms, 0.5},
          std::pair{AirKind::terms, 0.0}, std::pair{AirKind::table, 0.0},
          std::pair{AirKind::built_in, 0.0}}) {
      for (const bool structure : {false, true}) {
        for (const double above_m : {2.0, 900.0}) {
          scene::ScenarioDesc s = sky_of(kind, band, vertical_frac, structure);
          const double sensor_m = kPlaceM + above_m;
          const BandModel model = model_of(s, 1.0, sensor_m);
          for (const double elevation_deg : {1.0, 4.0, 15.0, 40.0, 90.0}) {
            SCOPED_TRACE(testing::Message()
                         << band.name << ' ' << static_cast<int>(kind) << ' ' << vertical_frac
                         << ' ' << structure << ' ' << above_m << ' ' << elevation_deg);
            const double sine = std::sin(elevation_deg * physics::kDegree);
            // A round Earth: the ray, the radius to the sensor and that to the base.
            constexpr double kEarthM = 6371000.0;
            const double up_m = kBaseM - above_m;
            const double range_m =
                std::sqrt(std::pow(kEarthM * sine, 2.0) + up_m * (2.0 * kEarthM + up_m)) -
                kEarthM * sine;
            double through = 0.0;
            double path = 0.0;
            if (kind == AirKind::terms) {
              through = std::pow(
                  vertical_frac,
                  physics::relative_air_mass(physics::Radians(elevation_deg * physics::kDegree)));
              path = (1.0 - through) * black(kAirK);
            } else if (kind == AirKind::table) {
              const auto table = physics::AtmosphereTable::build(s.atmosphere.bands[0].table);
              const auto sight = table->along(range_m, sine);
              through = sight.transmittance_frac;
              path = sight.path_radiance_w_m2_sr;
            } else {
              const auto way =
                  physics::AirPath::between(*column, sensor_m, kPlaceM + kBaseM, range_m);
              through = air->transmittance(way, physics::AirSource::black_300k);
              path = air->path_radiance_w_m2_sr(way, warmer_k);
            }
            const double expected = through * black(kBaseK) + path;
            const double shown =
                model.terms(0, sky_pixel(sine, sensor_m, structure ? 1.0 : 0.0), 0).sum_w_m2_sr();
            // Tables of the air are interpolated, and so is the sky between its elevations.
            EXPECT_NEAR(shown / expected, 1.0, 0.02);
            if (kind == AirKind::terms && vertical_frac == 1.0) {
              EXPECT_NEAR(shown / black(kBaseK), 1.0, 1e-6);
            }
            if (kind == AirKind::terms && vertical_frac == 0.0) {
              EXPECT_NEAR(shown / black(kAirK), 1.0, 1e-6);
            }
          }
        }
      }
    }
  }
}

TEST(CloudsInBand, SurfacesSeeTheMeanOfThePictureWithAndWithoutStructure) {
  constexpr double kCover = 0.4;
  for (const scene::SpectralBand& band : both_windows()) {
    for (const AirKind kind : {AirKind::terms, AirKind::table, AirKind::built_in}) {
      SCOPED_TRACE(testing::Message() << band.name << ' ' << static_cast<int>(kind));
      std::vector<double> level;
      for (const bool structure : {false, true}) {
        scene::ScenarioDesc s = sky_of(kind, band, 0.6, structure);
        const BandModel model = model_of(s, kCover, kPlaceM);
        BandLight light;
        model.light_at(weather_of(s, kCover), {}, std::span(&light, 1));
        double mean = 0.0;
        constexpr int kRings = 4000;
        for (int i = 0; i < kRings; ++i) {
          const double sine = (i + 0.5) / kRings;
          mean +=
              2.0 * sine / kRings *
              model.terms(0, sky_pixel(sine, kPlaceM, structure ? kCover : 0.0), 0).sum_w_m2_sr();
        }
        EXPECT_NEAR(static_cast<double>(light.sky_w_m2_sr[0]) / mean, 1.0, 2e-3);
        level.push_back(light.sky_w_m2_sr[0]);
        // Clouds shine: the sky is darker without them.
        scene::ScenarioDesc clear = sky_of(kind, band, 0.6, false);
        BandLight open;
        model_of(clear, 0.0, kPlaceM).light_at(weather_of(clear, 0.0), {}, std::span(&open, 1));
        EXPECT_GT(light.sky_w_m2_sr[0], 1.02F * open.sky_w_m2_sr[0]);
      }
      EXPECT_NEAR(level[0] / level[1], 1.0, 1e-6);
    }
  }
}

TEST(CloudsInBand, AreNotThereForASensorAboveThem) {
  for (const AirKind kind : {AirKind::terms, AirKind::table, AirKind::built_in}) {
    scene::ScenarioDesc s = sky_of(kind, both_windows()[1], 0.6, false);
    const double high_m = kPlaceM + kBaseM + 10.0;
    const BandModel covered = model_of(s, 1.0, high_m);
    const BandModel clear = model_of(s, 0.0, high_m);
    EXPECT_EQ(covered.params()[0].cloud_cover_frac, 0.0F);
    EXPECT_EQ(covered.terms(0, sky_pixel(0.3, high_m, 0.0), 0).sum_w_m2_sr(),
              clear.terms(0, sky_pixel(0.3, high_m, 0.0), 0).sum_w_m2_sr());
  }
}

TEST(CloudsInBand, HideTheirShareOfTheSunlightThatTheAirScatters) {
  physics::SunPosition sun;
  sun.elevation = physics::Radians(0.7);
  sun.direction_enu = {0.0, -std::cos(0.7), std::sin(0.7)};
  for (const bool structure : {false, true}) {
    scene::ScenarioDesc s = sky_of(AirKind::built_in, both_windows()[0], 1.0, structure);
    const double sensor_m = kPlaceM + 2.0;
    const BandModel::Seen pixel = sky_pixel(0.5, sensor_m, structure ? 0.25 : 0.0);
    // The same beam arrives below the clouds.
    const BandModel some = model_of(s, 0.25, sensor_m, sun, 400.0 / 0.75);
    scene::ScenarioDesc open = sky_of(AirKind::built_in, both_windows()[0], 1.0, false);
    const BandModel none = model_of(open, 0.0, sensor_m, sun, 400.0);
    const double clear = none.terms(0, sky_pixel(0.5, sensor_m, 0.0), 0).scattered_w_m2_sr;
    ASSERT_GT(clear, 0.0);
    EXPECT_NEAR(some.terms(0, pixel, 0).scattered_w_m2_sr / clear, 0.75, 1e-5);
  }
}

/// Difference of two radiances as apparent temperatures.
class KelvinTally {
 public:
  void add(double off_k) {
    sum_ += off_k;
    square_ += off_k * off_k;
    worst_ = std::max(worst_, std::abs(off_k));
    ++count_;
  }
  [[nodiscard]] double rms() const { return std::sqrt(square_ / std::max(count_, 1)); }
  [[nodiscard]] double mean() const { return sum_ / std::max(count_, 1); }
  [[nodiscard]] double worst() const { return worst_; }
  [[nodiscard]] int count() const { return count_; }

 private:
  double sum_ = 0.0;
  double square_ = 0.0;
  double worst_ = 0.0;
  int count_ = 0;
};

TEST(CloudsInBand, LookAsWarmAsInLowtran) {
  const auto file =
      std::filesystem::path(EMIT_TEST_SOURCE_DIR) / "data" / "oracles" / "lowtran7_cloud_base.csv";
  const auto table = physics::CsvTable::read(file);
  ASSERT_TRUE(table) << table.error().text;
  const auto kind = *table->texts("kind");
  const auto model = *table->texts("model");
  const auto band_name = *table->texts("band");
  const auto visibility_km = *table->numbers("vis_km");
  const auto sensor_m = *table->numbers("h_sensor_m");
  const auto base_m = *table->numbers("h_base_m");
  const auto elevation_deg = *table->numbers("elevation_deg");
  const auto base_k = *table->numbers("base_k");
  const auto wanted = *table->numbers("radiance_w_m2_sr");
  const std::array<physics::Band, 2> bands{physics::Band{3.0, 5.0, {}},
                                           physics::Band{8.0, 12.0, {}}};
  const std::array<physics::BandAir, 2> airs{*physics::BandAir::build(bands[0]),
                                             *physics::BandAir::build(bands[1])};
  const std::array<physics::AirView::Subject, 2> subjects{
      physics::AirView::Subject{.band = airs.data()}, physics::AirView::Subject{.band = &airs[1]}};
  const std::array<physics::ApparentTemperature, 2> apparents{
      physics::ApparentTemperature(bands[0]), physics::ApparentTemperature(bands[1])};
  std::map<std::pair<std::string, double>, std::vector<physics::AirView>> views;
  std::map<std::pair<std::string, bool>, KelvinTally> tallies;
  for (std::size_t i = 0; i < table->rows(); ++i) {
    const std::size_t b = band_name[i] == "3-5" ? 0 : 1;
    const std::pair key{std::string(model[i]), visibility_km[i]};
    if (!views.contains(key)) {
      const auto column =
          physics::AirColumn::build({*physics::air_climate(model[i]), visibility_km[i], 1.0});
      ASSERT_TRUE(column) << column.error().text;
      views.emplace(key, physics::AirView::build(*column, subjects));
    }
    const double radiance =
        physics::band_radiance(bands[b], physics::Kelvin(base_k[i])).radiance_w_m2_sr;
    const auto sky = views.at(key)[b].layer_w_m2_sr(
        sensor_m[i], 0.0,
        {.height_m = base_m[i], .kelvin = base_k[i], .radiance_w_m2_sr = radiance});
    const auto sine = static_cast<float>(std::sin(elevation_deg[i] * physics::kDegree));
    const physics::ApparentTemperature& apparent = apparents[b];
    tallies[{std::string(band_name[i]), kind[i] == "black"}].add(
        static_cast<double>(apparent.k(physics::sky_at_elevation(sky, sine))) -
        static_cast<double>(apparent.k(static_cast<float>(wanted[i]))));
  }
  for (const auto& [key, tally] : tallies) {
    std::printf("%s, %s: %d rows, mean %.2f K, RMS %.2f K, worst %.2f K\n", key.first.c_str(),
                key.second ? "black base" : "its own clouds", tally.count(), tally.mean(),
                tally.rms(), tally.worst());
    EXPECT_GT(tally.count(), 50);
    // LOWTRAN's clouds are nearly opaque some ten metres below their base: they look warmer.
    EXPECT_LT(tally.rms(), key.second ? 0.25 : 0.8);
    EXPECT_LT(tally.worst(), key.second ? 0.7 : 1.6);
    EXPECT_LT(std::abs(tally.mean()), key.second ? 0.1 : 0.7);
  }
}

}  // namespace
}  // namespace emit::renderer
