// SPDX-License-Identifier: Apache-2.0
// The reference's sky, which has formulas of its own, against the one that the renderer shows.
#include "solve_radiance.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>
#include <tuple>
#include <vector>

#include "emit/physics/air_view.hpp"
#include "emit/physics/clear_sky.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/sky_state.hpp"

namespace emit::reference {
namespace {

const std::vector<physics::CloudBase> kBases{
    {}, {.height_m = 300.0}, {.kelvin = 265.0}, {.height_m = 2000.0, .kelvin = 280.0}};

TEST(ReferenceSky, bisection_finds_the_sky_of_the_closed_form) {
  for (const physics::CloudBase& base : kBases) {
    for (double longwave_w_m2 = 200.0; longwave_w_m2 < 480.0; longwave_w_m2 += 9.0) {
      SCOPED_TRACE(longwave_w_m2);
      for (const double stated_frac : {0.0, 0.5, 1.0}) {
        const physics::SkyState own =
            sky_by_bisection(longwave_w_m2, 288.0, 279.0, stated_frac, base);
        const physics::SkyState shown =
            physics::sky_state(longwave_w_m2, 288.0, 279.0, stated_frac, base);
        EXPECT_NEAR(own.cloud_cover_frac, shown.cloud_cover_frac, 1e-9);
        EXPECT_NEAR(own.cloud_k, shown.cloud_k, 1e-6);
        EXPECT_NEAR(own.cloud_base_m, shown.cloud_base_m, 0.1);
        EXPECT_NEAR(own.cloud_base_k, shown.cloud_base_k, 1e-3);
        EXPECT_NEAR(own.warmer_k, shown.warmer_k, 1e-6);
      }
    }
  }
}

TEST(ReferenceSky, agrees_with_the_tables_of_the_renderer_under_clouds) {
  scene::ScenarioDesc scenario;
  scenario.place.height_m = 380.0;
  scenario.atmosphere.enabled = true;
  const physics::AirSpec spec{physics::AirClimate::midlatitude_summer, 23.0, 1.0};
  for (const auto& [name, lo_um, hi_um] :
       {std::tuple{"3-5", 3.0, 5.0}, std::tuple{"8-12", 8.0, 12.0}}) {
    scenario.bands.push_back({name, lo_um, hi_um, {}});
    scene::BandAtmosphere air;
    air.band = name;
    air.model = spec;
    scenario.atmosphere.bands.push_back(air);
  }
  const auto column = physics::AirColumn::build(spec);
  ASSERT_TRUE(column) << column.error().text;
  const double air_k = 291.0;
  const double fade = std::exp(scenario.place.height_m / physics::BandAir::kWarmthScaleM);
  const double warmer_k = (air_k - column->at(scenario.place.height_m).kelvin) * fade;
  for (std::size_t b = 0; b < scenario.bands.size(); ++b) {
    const auto& band = scenario.bands[b];
    auto own = BandRadiance::create(scenario, b);
    ASSERT_TRUE(own) << own.error().text;
    const physics::BandAir terms = *physics::BandAir::build(scene::spectral_band(band));
    const physics::AirView::Subject subject{&terms};
    const auto views = physics::AirView::build(*column, std::span(&subject, 1));
    std::vector<physics::AirView::Node> table(physics::AirView::kNodes);
    // Colder than a clear sky, half covered, overcast, and warmer than the air.
    for (const double longwave_w_m2 : {290.0, 350.0, 385.0, 420.0}) {
      const auto sky_now = physics::sky_state(longwave_w_m2, air_k, 280.0, 0.0, {});
      own->set_air(air_k, {}, 0.0, 0.0, sky_now);
      const physics::AirView::BlackLayer base{
          .height_m = scenario.place.height_m + sky_now.cloud_base_m,
          .kelvin = sky_now.cloud_base_k,
          .radiance_w_m2_sr = physics::band_radiance({band.lo_um, band.hi_um, {}},
                                                     physics::Kelvin(sky_now.cloud_base_k))
                                  .radiance_w_m2_sr};
      const double sky_warmer_k = warmer_k + sky_now.warmer_k * fade;
      const double cover = sky_now.cloud_cover_frac;
      views[0].at(scenario.place.height_m + 20.0,
                  {.warmer_k = warmer_k, .sky_warmer_k = sky_warmer_k}, table);
      const auto clouds =
          views[0].layer_w_m2_sr(scenario.place.height_m + 20.0, sky_warmer_k, base);
      for (const double elevation_deg : {1.0, 5.0, 20.0, 60.0, 90.0}) {
        const double sine = std::sin(elevation_deg * physics::kDegree);
        const double expected =
            own->sky(20.0, {std::sqrt(1.0 - std::min(1.0, sine * sine)), 0.0, sine});
        const double shown =
            (1.0 - cover) *
                physics::air_sky(table, static_cast<float>(sine)).path_radiance_w_m2_sr +
            cover * physics::sky_at_elevation(clouds, static_cast<float>(sine));
        EXPECT_NEAR(shown, expected, 0.02 * expected)
            << band.name << ' ' << longwave_w_m2 << ' ' << elevation_deg;
      }
      const physics::SkyByTilt clear =
          views[0].clear_sky_by_tilt_w_m2_sr(scenario.place.height_m, sky_warmer_k);
      const physics::SkyByTilt covered = physics::sky_by_tilt_of(
          views[0].layer_w_m2_sr(scenario.place.height_m, sky_warmer_k, base));
      for (const double normal_up : {1.0, 0.9, 0.5, 0.0, -0.5, -0.9}) {
        const double mean = (1.0 - cover) * physics::sky_at_tilt(clear, normal_up) +
                            cover * physics::sky_at_tilt(covered, normal_up);
        EXPECT_NEAR(mean, own->sky_mean(normal_up), 0.01 * own->sky_mean(normal_up))
            << band.name << ' ' << longwave_w_m2 << ", normal up " << normal_up;
      }
    }
  }
}

TEST(ReferenceSky, agrees_with_the_tables_of_the_renderer_in_scattered_sunlight) {
  scene::ScenarioDesc scenario;
  scenario.place.height_m = 120.0;
  scenario.atmosphere.enabled = true;
  const physics::AirSpec spec{physics::AirClimate::midlatitude_winter, 10.0, 1.0};
  scenario.bands.push_back({"3-5", 3.0, 5.0, {}});
  scene::BandAtmosphere air;
  air.band = "3-5";
  air.model = spec;
  scenario.atmosphere.bands.push_back(air);
  const physics::Band band{3.0, 5.0, {}};
  const auto column = physics::AirColumn::build(spec);
  ASSERT_TRUE(column) << column.error().text;
  auto own = BandRadiance::create(scenario, 0);
  ASSERT_TRUE(own) << own.error().text;
  const physics::BandAir terms = *physics::BandAir::build(band);
  const auto scatter = physics::SunScatter::build(*column, band);
  ASSERT_TRUE(scatter);
  const physics::AirView::Subject subject{.band = &terms, .scatter = &*scatter};
  const auto views = physics::AirView::build(*column, std::span(&subject, 1));
  const double air_k = column->at(120.0).kelvin;
  const physics::SkyState clear{.cloud_base_m = 1000.0};
  for (const double sun_deg : {8.0, 40.0}) {
    physics::SunPosition sun;
    sun.elevation = physics::Radians(sun_deg * physics::kDegree);
    sun.direction_enu = {0.0, std::cos(sun.elevation.value()), std::sin(sun.elevation.value())};
    sun.distance_au = 1.01;
    const double shown_sine = std::sin(physics::apparent_elevation(sun.elevation).value());
    const double share = 0.8 / (1.01 * 1.01);
    std::vector<physics::AirView::Node> table(physics::AirView::kSunNodes);
    views[0].sun_at(140.0, {.sin_elevation = shown_sine, .share_frac = share}, table);
    BandRadiance dark = *own;
    dark.set_air(air_k, sun, 0.0, 0.0, clear);
    own->set_air(air_k, sun, 0.8, 0.8, clear);
    for (const double azimuth_deg : {0.0, 15.0, 90.0, 180.0}) {
      for (const double elevation_deg : {2.0, 10.0, 45.0, 80.0}) {
        const double sine = std::sin(elevation_deg * physics::kDegree);
        const double cosine = std::cos(elevation_deg * physics::kDegree);
        const glm::dvec3 ray{cosine * std::sin(azimuth_deg * physics::kDegree),
                             cosine * std::cos(azimuth_deg * physics::kDegree), sine};
        const double emitted = dark.sky(20.0, ray);
        const auto shown = static_cast<double>(physics::air_sun_w_m2_sr(
            physics::air_sky_node(table, static_cast<float>(sine)),
            physics::air_sun_phase(table, static_cast<float>(glm::dot(ray, sun.direction_enu)))));
        EXPECT_NEAR(emitted + shown, own->sky(20.0, ray), 0.02 * own->sky(20.0, ray))
            << sun_deg << ' ' << azimuth_deg << ' ' << elevation_deg;
      }
    }
    // Surfaces reflect the mean around the sky.
    const auto tilts = views[0].scattered_sky_by_tilt_w_m2_sr(120.0, shown_sine);
    for (const double normal_up : {1.0, 0.5, 0.0}) {
      const double gained = own->sky_mean(normal_up) - dark.sky_mean(normal_up);
      EXPECT_NEAR(share * physics::sky_at_tilt(tilts, normal_up), gained, 0.05 * gained)
          << sun_deg << ' ' << normal_up;
    }
    // A path adds its light to what comes through it.
    const glm::dvec3 level{0.0, 1.0, 0.0};
    EXPECT_GT(own->at_aperture({1.0, 0.0, 300.0}, 20.0, 3000.0, level),
              dark.at_aperture({1.0, 0.0, 300.0}, 20.0, 3000.0, level));
  }
}

}  // namespace
}  // namespace emit::reference
