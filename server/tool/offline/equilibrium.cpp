// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/equilibrium.hpp"

#include <cmath>

#include "emit/physics/air_film.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/foster.hpp"

namespace emit::tool {

physics::Result<Equilibrium> Equilibrium::create(const scene::ScenarioDesc& scenario,
                                                 std::span<const scene::Material> materials) {
  if (scenario.thermal.model != scene::ThermalModel::foster) return Equilibrium({});
  auto built = renderer::foster_materials(materials, scenario.thermal);
  if (!built) return tl::unexpected(std::move(built.error()));
  return Equilibrium(std::move(*built));
}

double Equilibrium::at_k(std::size_t material, const renderer::SurfaceForcing& forcing,
                         const Face& face) const noexcept {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  if (material >= materials_.size() || std::isnan(face.sun_w_m2) || std::isnan(face.sky_frac)) {
    return kNan;
  }
  const renderer::FosterMaterial& m = materials_[material];
  if (m.prescribed() || m.sheet) return kNan;
  const double far_frac = 1.0 - face.sky_frac;
  const double shortwave_w_m2 =
      face.sun_w_m2 + face.sky_frac * forcing.diffuse_w_m2 + far_frac * forcing.reflected_w_m2;
  const double longwave_w_m2 =
      face.sky_frac * forcing.longwave_w_m2 + far_frac * forcing.environment_w_m2;
  const double absorbed_w_m2 =
      m.solar_absorptance_frac * shortwave_w_m2 + m.emissivity_frac * longwave_w_m2;
  const double into_base_w_m2_k = m.body ? 0.0 : 1.0 / m.network.resistance_m2k_w();
  const physics::MoistSurface moisture = renderer::moisture_at(m, forcing, face.normal.z);
  const auto gain_w_m2 = [&](double t_k) {
    physics::FosterDrive<double> drive{
        .absorbed_w_m2 = absorbed_w_m2,
        .film_w_m2_k = physics::film_w_m2_k(forcing.film, face.normal, m.skin, t_k - forcing.air_k),
        .air_offset_k = 0.0};
    physics::add_moisture(moisture, forcing.moist, shortwave_w_m2, drive);
    return absorbed_w_m2 -
           m.emissivity_frac * physics::kStefanBoltzmannWPerM2K4 * t_k * t_k * t_k * t_k -
           drive.film_w_m2_k * (t_k - forcing.air_k) - physics::latent_flux(t_k, drive).flux_w_m2 -
           into_base_w_m2_k * (t_k - m.base_k);
  };
  // Every loss grows with the temperature, so that halving finds the only root.
  double low_k = 100.0;
  double high_k = 1000.0;
  constexpr int kHalvings = 50;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle_k = 0.5 * (low_k + high_k);
    (gain_w_m2(middle_k) > 0.0 ? low_k : high_k) = middle_k;
  }
  return 0.5 * (low_k + high_k);
}

}  // namespace emit::tool
