// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>

#include "emit/scene/gloss_optics.hpp"

/// Emissivities that a glossy material states against those that its facets show.
namespace emit::scene {
namespace {

const SpectralBand kBand{"8-12", 8.0, 12.0, {}};

Material glossy(double refractive_index, double slope) {
  Material out;
  out.name = "paint";
  out.emissivity_frac = 0.7;
  out.gloss.emplace();
  out.gloss->wavelength_um = {4.0, 10.0};
  out.gloss->refractive_index = {refractive_index, refractive_index};
  out.gloss->extinction_index = {0.0, 0.0};
  out.gloss->facet_slope = slope;
  return out;
}

TEST(GlossOptics, TheStatedEmissivityHoldsHoweverRoughTheFacetsAre) {
  for (const double index : {1.5, 2.5}) {
    for (const double slope : {0.002, 0.1, 0.3, 0.6, 1.0}) {
      Material material = glossy(index, slope);
      const physics::Facets facets = facets_of(material, {});
      // If no list has the band, the total emissivity is that over the hemisphere.
      const physics::Lobe total = physics::make_lobe(facets, facet_optics(material, facets, kBand));
      EXPECT_NEAR(total.hemispherical_emissivity_frac, 0.7, 1e-9) << index << ", " << slope;
      // A listed one is that along the normal.
      material.band_emissivity = {{"8-12", 0.75}};
      const physics::Lobe listed =
          physics::make_lobe(facets, facet_optics(material, facets, kBand));
      EXPECT_NEAR(listed.emissivity_frac.back(), 0.75, 1e-9) << index << ", " << slope;
    }
  }
}

TEST(GlossOptics, FacetsLetThroughWhatABlackBodyUnderThemEmits) {
  for (const double slope : {0.05, 0.5, 1.0}) {
    Material material = glossy(2.5, slope);
    const physics::Facets facets = facets_of(material, {});
    const physics::LobeCurve passed = physics::passed_frac(
        facets,
        interface_reflectance_frac(*material.gloss, spectral_band(kBand), physics::Kelvin(300.0)));
    // The limits of the check are just there.
    material.band_emissivity = {{"8-12", passed.back()}};
    EXPECT_TRUE(check_emissivities(material, facets, {kBand}).has_value()) << slope;
    material.band_emissivity = {{"8-12", passed.back() + 0.021}};
    EXPECT_FALSE(check_emissivities(material, facets, {kBand}).has_value()) << slope;
  }
  // Light that facets send to each other has more than one chance to pass.
  const auto normal_of = [](double slope) {
    const Material material = glossy(2.5, slope);
    return physics::passed_frac(facets_of(material, {}),
                                interface_reflectance_frac(*material.gloss, spectral_band(kBand),
                                                           physics::Kelvin(300.0)))
        .back();
  };
  EXPECT_NEAR(normal_of(0.002), 1.0 - std::pow(1.5 / 3.5, 2), 0.002) << "Fresnel";
  EXPECT_GT(normal_of(1.0), normal_of(0.002) + 0.05);
}

TEST(GlossOptics, TheSeaHasTheWindOfTime0) {
  Material material = glossy(1.2, 0.1);
  material.gloss->sea = true;
  const auto slope2 = [&](const ScenarioDesc& scenario) {
    return std::pow(facets_of(material, scenario).slope, 2);
  };
  ScenarioDesc scenario;
  scenario.clear_sky.wind_m_s = 3.0;
  EXPECT_NEAR(slope2(scenario), physics::sea_mean_square_slope(3.0), 1e-12);
  // Weather is linear between its rows.
  physics::WeatherSample row;
  row.sim_time_ns = -3'600'000'000'000;
  row.wind_m_s = 1.0;
  scenario.weather.push_back(row);
  row.sim_time_ns = 3'600'000'000'000;
  row.wind_m_s = 12.0;
  scenario.weather.push_back(row);
  EXPECT_NEAR(slope2(scenario), physics::sea_mean_square_slope(6.5), 1e-12);
  material.gloss->sea_wind_m_s = 9.0;
  EXPECT_NEAR(slope2(scenario), physics::sea_mean_square_slope(9.0), 1e-12);
  // No sea is rougher than that of the greatest wind.
  material.gloss->sea_wind_m_s.reset();
  for (physics::WeatherSample& each : scenario.weather) each.wind_m_s = 60.0;
  EXPECT_NEAR(slope2(scenario), physics::sea_mean_square_slope(kMostSeaWindMS), 1e-12);
}

}  // namespace
}  // namespace emit::scene
