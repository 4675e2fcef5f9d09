// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/equilibrium.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "emit/physics/air_film.hpp"
#include "emit/physics/constants.hpp"

namespace emit::tool {
namespace {

/// Slab of 0.1 m over a base: body (nothing flows into it) or of a stated temperature.
scene::Material slab(bool body, double base_k) {
  scene::Material out;
  out.name = "slab";
  out.solar_absorptance_frac = 0.8;
  out.emissivity_frac = 0.9;
  out.layers = {{0.1, 0.5, 2000.0, 900.0}};
  out.base = body ? scene::BaseKind::body : scene::BaseKind::ground;
  out.base_k = base_k;
  out.base_stated = !body;
  return out;
}

double equilibrium_of(const scene::Material& material, const renderer::SurfaceForcing& forcing,
                      const Equilibrium::Face& face) {
  scene::ScenarioDesc scenario;
  scenario.thermal.model = scene::ThermalModel::foster;
  const auto model = Equilibrium::create(scenario, std::span(&material, 1));
  EXPECT_TRUE(model) << model.error().text;
  return model ? model->at_k(0, forcing, face) : NAN;
}

renderer::SurfaceForcing calm(double film_w_m2_k, double air_k, double longwave_w_m2) {
  renderer::SurfaceForcing out;
  out.film = physics::stated_film(film_w_m2_k);
  out.air_k = air_k;
  out.longwave_w_m2 = longwave_w_m2;
  out.environment_w_m2 = longwave_w_m2;
  return out;
}

TEST(Equilibrium, IsTheRadiativeTemperatureWithoutAirAndBase) {
  const renderer::SurfaceForcing forcing = calm(0.0, 280.0, 320.0);
  const double absorbed_w_m2 = 0.8 * 600.0 + 0.9 * 320.0;
  const double want_k = std::pow(absorbed_w_m2 / (0.9 * physics::kStefanBoltzmannWPerM2K4), 0.25);
  EXPECT_NEAR(equilibrium_of(slab(true, 290.0), forcing, {{0.0, 0.0, 1.0}, 600.0, 1.0}), want_k,
              1e-9);
}

TEST(Equilibrium, IsThatOfEverythingAroundItWhereAllIsAlike) {
  constexpr double kAllK = 293.15;
  const double longwave_w_m2 = physics::kStefanBoltzmannWPerM2K4 * std::pow(kAllK, 4);
  for (const double sky_frac : {0.0, 0.4, 1.0}) {
    EXPECT_NEAR(equilibrium_of(slab(false, kAllK), calm(12.0, kAllK, longwave_w_m2),
                               {{0.0, 1.0, 0.0}, 0.0, sky_frac}),
                kAllK, 1e-9);
  }
}

TEST(Equilibrium, LosesToAirAndBaseWhatItTakesFromTheSun) {
  const renderer::SurfaceForcing forcing = calm(15.0, 300.0, 400.0);
  const double t_k = equilibrium_of(slab(false, 285.0), forcing, {{0.0, 0.0, 1.0}, 700.0, 1.0});
  const double gain_w_m2 = 0.8 * 700.0 + 0.9 * 400.0;
  const double loss_w_m2 = 0.9 * physics::kStefanBoltzmannWPerM2K4 * std::pow(t_k, 4) +
                           15.0 * (t_k - 300.0) + 0.5 / 0.1 * (t_k - 285.0);
  EXPECT_NEAR(gain_w_m2, loss_w_m2, 0.05);
}

TEST(Equilibrium, IsNotKnownWherePrescribed) {
  scene::Material material = slab(false, 285.0);
  material.prescribed_k = 310.0;
  EXPECT_TRUE(
      std::isnan(equilibrium_of(material, calm(1.0, 300.0, 400.0), {{0.0, 0.0, 1.0}, 0.0, 1.0})));
}

}  // namespace
}  // namespace emit::tool
