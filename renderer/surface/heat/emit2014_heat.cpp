// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/emit2014_heat.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "emit/physics/constants.hpp"
#include "emit/physics/equilibrium.hpp"

namespace emit::renderer {
namespace {

/// Returns lambda/d to the core. If the material does not state it, that is the conductance of its
/// first layer, or 0 without layers.
double core_conductance_w_m2_k(const scene::Material& material) noexcept {
  if (material.core_conductance_w_m2_k) return *material.core_conductance_w_m2_k;
  if (material.layers.empty()) return 0.0;
  return material.layers.front().conductivity_w_m_k / material.layers.front().thickness_m;
}

}  // namespace

Emit2014Heat::Emit2014Heat(std::span<const scene::Material> materials, double initial_k,
                           double reference_k)
    : reference_k_(reference_k) {
  for (const scene::Material& material : materials) {
    Material& own = materials_.emplace_back();
    own.solar_absorptance_frac = material.solar_absorptance_frac;
    own.exchange.emissivity_frac = material.emissivity_frac;
    own.exchange.core_k = material.base_k;
    own.exchange.core_conductance_w_m2_k = core_conductance_w_m2_k(material);
    // Keep the first modes only: a sample has room for two.
    own.mode_count = std::min(material.modes.size(), kMaxRelaxationModes);
    std::copy_n(material.modes.begin(), own.mode_count, own.modes.begin());
    own.initial_k = material.initial_k.value_or(initial_k);
    own.prescribed_k = material.prescribed_k;
    own.sheet = material.sheet;
  }
}

void Emit2014Heat::prepare(HeatInterval& interval) const noexcept {
  for (std::size_t m = 0; m < materials_.size(); ++m) {
    for (std::size_t i = 0; i < materials_[m].mode_count; ++i) {
      interval.relaxation[m][i] =
          physics::relaxation_gains(interval.forcing.dt_s, materials_[m].modes[i].tau_s);
    }
  }
}

SampleState Emit2014Heat::start_state(const SurfaceSample& sample) const noexcept {
  SampleState state;
  const Material& material = materials_[sample.material];
  for (std::size_t i = 0; i < material.mode_count; ++i) {
    state.modes_k[i] = material.initial_k - reference_k_;
  }
  return state;
}

double Emit2014Heat::absorbed_w_m2(const SurfaceSample& sample, const glm::vec3& normal,
                                   const SurfaceForcing& forcing,
                                   const SampleDrive& drive) const noexcept {
  const Material& material = materials_[sample.material];
  physics::SurfaceFluxes<double> in;
  in.direct_w_m2 = std::max(0.0, glm::dot(glm::dvec3(normal), forcing.sun_w_m2));
  in.sun_frac = drive.sun_frac;
  // Convert the flux on a level surface to the inputs of physics.md eq. 1 by its eq. 3: open level
  // ground then absorbs exactly what the sky sends.
  in.diffuse_w_m2 = physics::diffuse_input_w_m2(forcing.diffuse_w_m2);
  in.environment_w_m2 = material.exchange.emissivity_frac * forcing.environment_w_m2;
  in.longwave_w_m2 = 2.0 * forcing.longwave_w_m2 - forcing.environment_w_m2;
  // Take the share behind entities from the sky: they count as surroundings.
  in.sky_frac = sample.sphere_sky_frac * (1.0 - drive.hidden_sky_frac);
  return physics::absorbed_flux_w_m2(in, material.solar_absorptance_frac,
                                     material.exchange.emissivity_frac);
}

double Emit2014Heat::equilibrium_k(const SurfaceSample& sample, const glm::vec3& normal,
                                   const SurfaceForcing& forcing, const SampleDrive& drive,
                                   const SheetBack* back) const noexcept {
  double flux_w_m2 = absorbed_w_m2(sample, normal, forcing, drive);
  // Average both faces of a sheet. A covered face keeps its heat, so the open one alone decides.
  if (back != nullptr && !back->sample.covered) {
    const double other_w_m2 = absorbed_w_m2(back->sample, -normal, forcing, back->drive);
    flux_w_m2 = sample.covered ? other_w_m2 : 0.5 * (flux_w_m2 + other_w_m2);
  }
  const physics::SurfaceExchange<double>& exchange = materials_[sample.material].exchange;
  return physics::solve_equilibrium(physics::surface_balance(flux_w_m2, exchange)).temperature_k;
}

SampleOutput Emit2014Heat::output(const SurfaceSample& sample, const SampleDrive& drive,
                                  const SampleState& state) const noexcept {
  const Material& material = materials_[sample.material];
  double offset_k = 0.0;
  // Sum the modes with their weights (physics.md eq. 5), unless the temperature is prescribed.
  if (material.prescribed_k) {
    offset_k = *material.prescribed_k - reference_k_;
  } else {
    for (std::size_t i = 0; i < material.mode_count; ++i) {
      offset_k += material.modes[i].weight_frac * state.modes_k[i];
    }
  }
  SampleOutput out;
  out.offset_k = static_cast<float>(offset_k);
  out.sun_frac = drive.sun_frac;
  return out;
}

void Emit2014Heat::advance(std::span<SampleAdvance> samples,
                           const HeatInterval& interval) const noexcept {
  for (SampleAdvance& each : samples) {
    const SurfaceSample& sample = *each.sample;
    const Material& material = materials_[sample.material];
    if (!material.prescribed_k) {
      // Find the equilibrium temperature at both ends of the interval, with the mean shade of the
      // interval.
      const auto target_k = [&](const SurfaceForcing& forcing) {
        return equilibrium_k(sample, each.normal, forcing, each.drive, each.back) - reference_k_;
      };
      const double begin_k = target_k(interval.forcing.begin);
      const double end_k = target_k(interval.forcing.end);
      // Relax every mode towards the line between them: exact for any length (physics.md eq. 6).
      for (std::size_t i = 0; i < material.mode_count; ++i) {
        double& mode_k = each.state->modes_k[i];
        mode_k =
            physics::relax_linear(mode_k, begin_k, end_k, interval.relaxation[sample.material][i]);
      }
    }
    each.output = output(sample, each.drive, *each.state);
  }
}

void Emit2014Heat::step_response(std::uint32_t material, const ResponseConditions& around,
                                 std::span<const double> times_s,
                                 std::span<double> response_m2k_w) const noexcept {
  const Material& m = materials_[material];
  std::ranges::fill(response_m2k_w, 0.0);
  if (m.prescribed_k || m.sheet) return;
  // Linearise the losses: conduction to the core and the slope of thermal emission.
  const double t = around.surface_k;
  const double h_w_m2_k =
      m.exchange.core_conductance_w_m2_k +
      4.0 * m.exchange.emissivity_frac * physics::kStefanBoltzmannWPerM2K4 * t * t * t;
  // Sum the step responses of the modes, 1 - exp(-t / tau). The function expm1 keeps short times
  // exact.
  for (std::size_t j = 0; j < times_s.size(); ++j) {
    for (std::size_t i = 0; i < m.mode_count; ++i) {
      response_m2k_w[j] += m.modes[i].weight_frac * -std::expm1(-times_s[j] / m.modes[i].tau_s);
    }
    response_m2k_w[j] *= m.solar_absorptance_frac / h_w_m2_k;
  }
}

}  // namespace emit::renderer
