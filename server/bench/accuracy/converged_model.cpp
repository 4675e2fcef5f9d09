// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/converged_model.hpp"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <map>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/equilibrium.hpp"
#include "emit/physics/surface_balance.hpp"

namespace emit::tool {
namespace {

using physics::Result;
using renderer::SurfaceForcing;

/// Step of the spin-up. Nothing shades it, so a step of second order may be long.
constexpr std::int64_t kSpinUpStepNs = 120'000'000'000;
/// Error above which an interval of the history halves its steps once more.
constexpr double kToleranceK = 1e-3;
constexpr std::size_t kMaxModes = 2;

double direct_on_face_w_m2(const SurfaceForcing& f, const PointView& view) noexcept {
  return view.sun_frac * std::max(0.0, glm::dot(view.normal, f.sun_w_m2));
}

/// Computes physics.md eq. 1 and 4.
double equilibrium_k(const SurfaceForcing& f, const PointView& view,
                     const scene::Material& material) noexcept {
  physics::SurfaceFluxes<double> in;
  in.direct_w_m2 = direct_on_face_w_m2(f, view);
  in.sun_frac = 1.0;
  in.diffuse_w_m2 = physics::diffuse_input_w_m2(f.diffuse_w_m2);
  in.environment_w_m2 = material.emissivity_frac * f.environment_w_m2;
  in.longwave_w_m2 = 2.0 * f.longwave_w_m2 - f.environment_w_m2;
  in.sky_frac = view.sky_frac;
  physics::SurfaceExchange<double> exchange;
  exchange.emissivity_frac = material.emissivity_frac;
  exchange.core_k = material.base_k;
  if (material.core_conductance_w_m2_k) {
    exchange.core_conductance_w_m2_k = *material.core_conductance_w_m2_k;
  } else if (!material.layers.empty()) {
    exchange.core_conductance_w_m2_k =
        material.layers[0].conductivity_w_m_k / material.layers[0].thickness_m;
  }
  const double absorbed_w_m2 =
      physics::absorbed_flux_w_m2(in, material.solar_absorptance_frac, material.emissivity_frac);
  return physics::solve_equilibrium(physics::surface_balance(absorbed_w_m2, exchange))
      .temperature_k;
}

/// Computes physics.md eq. 16. The film is that of the temperature `offset_k` at the start of the
/// step.
physics::FosterDrive<double> drive(const SurfaceForcing& f, const PointView& view,
                                   const renderer::FosterMaterial& material,
                                   double offset_k) noexcept {
  const double around_frac = 1.0 - view.sky_frac;
  const double short_wave_w_m2 = direct_on_face_w_m2(f, view) + view.sky_frac * f.diffuse_w_m2 +
                                 around_frac * f.reflected_w_m2;
  const double long_wave_w_m2 = view.sky_frac * f.longwave_w_m2 + around_frac * f.environment_w_m2;
  physics::FosterDrive<double> out{
      .absorbed_w_m2 = material.solar_absorptance_frac * short_wave_w_m2 +
                       material.emissivity_frac * long_wave_w_m2,
      .film_w_m2_k = physics::film_w_m2_k(f.film, view.normal, material.skin,
                                          physics::kReferenceK + offset_k - f.air_k),
      .air_offset_k = f.air_k - physics::kReferenceK};
  physics::add_moisture(
      renderer::moisture_at(material, f, renderer::rain_by_tilt_frac(view.normal.z)), f.moist,
      short_wave_w_m2, out);
  return out;
}

}  // namespace

Result<ConvergedModel> ConvergedModel::create(const scene::ScenarioDesc& scenario,
                                              std::span<const scene::Material> materials,
                                              std::span<const std::int64_t> nodes_ns) {
  ConvergedModel out;
  out.model_ = scenario.thermal.model;
  out.initial_k_ = scenario.thermal.initial_k;
  out.materials_.assign(materials.begin(), materials.end());
  std::vector<std::int64_t> all_ns;
  const bool foster = out.model_ == scene::ThermalModel::foster;
  if (foster && scenario.thermal.spin_up_ns > 0) {
    const std::int64_t from_ns = nodes_ns.front() - scenario.thermal.spin_up_ns;
    for (std::int64_t t = from_ns; t < nodes_ns.front(); t += kSpinUpStepNs) all_ns.push_back(t);
  }
  out.history_ = all_ns.size();
  all_ns.insert(all_ns.end(), nodes_ns.begin(), nodes_ns.end());
  auto forcing = renderer::surface_forcing(scenario, all_ns, materials);
  if (!forcing) return tl::unexpected(std::move(forcing.error()));
  out.forcing_ = std::move(*forcing);
  if (foster) {
    auto networks = renderer::foster_materials(materials, scenario.thermal);
    if (!networks) return tl::unexpected(std::move(networks.error()));
    out.foster_ = std::move(*networks);
  }

  std::map<std::int64_t, std::uint32_t> index_of_length;
  std::vector<double> lengths_s;
  for (std::size_t i = 0; i + 1 < all_ns.size(); ++i) {
    const auto [entry, added] = index_of_length.try_emplace(
        all_ns[i + 1] - all_ns[i], static_cast<std::uint32_t>(lengths_s.size()));
    if (added) lengths_s.push_back(out.forcing_[i].dt_s);
    out.length_of_.push_back(entry->second);
  }
  out.lengths_ = lengths_s.size();
  for (std::size_t m = 0; m < materials.size(); ++m) {
    for (const double dt_s : lengths_s) {
      Gains gains;
      if (foster) {
        gains.ladder = physics::foster_ladder(dt_s, out.foster_[m].network);
      } else {
        for (const scene::RelaxationMode& mode : materials[m].modes) {
          gains.modes.push_back(physics::relaxation_gains(dt_s, mode.tau_s));
        }
      }
      out.gains_.push_back(std::move(gains));
    }
  }
  return out;
}

const glm::dvec3& ConvergedModel::sun_w_m2(std::size_t node) const noexcept {
  const std::size_t interval = history_ + node;
  return interval < forcing_.size() ? forcing_[interval].begin.sun_w_m2
                                    : forcing_[interval - 1].end.sun_w_m2;
}

double ConvergedModel::temperature_k(std::uint32_t material,
                                     std::span<const PointView> view) const {
  EMIT_CHECK_OP(view.size(), ==, node_count());
  if (materials_[material].prescribed_k) return *materials_[material].prescribed_k;
  return model_ == scene::ThermalModel::foster ? foster_k(material, view)
                                               : relaxed_k(material, view);
}

double ConvergedModel::relaxed_k(std::uint32_t index, std::span<const PointView> view) const {
  const scene::Material& material = materials_[index];
  const std::size_t modes = std::min(material.modes.size(), kMaxModes);
  std::array<double, kMaxModes> x_k{};
  x_k.fill(material.initial_k.value_or(initial_k_));
  for (std::size_t i = 0; i < forcing_.size(); ++i) {
    const double from_k = equilibrium_k(forcing_[i].begin, view[i], material);
    const double to_k = equilibrium_k(forcing_[i].end, view[i + 1], material);
    const Gains& step = gains(index, i);
    for (std::size_t m = 0; m < modes; ++m) {
      x_k[m] = physics::relax_linear(x_k[m], from_k, to_k, step.modes[m]);
    }
  }
  double kelvin = 0.0;
  for (std::size_t m = 0; m < modes; ++m) kelvin += material.modes[m].weight_frac * x_k[m];
  return kelvin;
}

double ConvergedModel::foster_k(std::uint32_t index, std::span<const PointView> view) const {
  const renderer::FosterMaterial& material = foster_[index];
  const auto surface = physics::foster_surface(material.network, material.emissivity_frac,
                                               material.base_k, physics::kReferenceK);
  physics::FosterState<double> x = physics::foster_steady(
      (material.initial_k - material.base_k) / material.network.resistance_m2k_w(), surface);
  const glm::dvec3& normal = view.front().normal;
  const PointView open{normal, 1.0, 0.5 * (1.0 + normal.z)};
  for (std::size_t i = 0; i < history_; ++i) {
    const double offset_k = physics::foster_offset_k(x, surface);
    physics::foster_step(x, drive(forcing_[i].begin, open, material, offset_k),
                         drive(forcing_[i].end, open, material, offset_k),
                         gains(index, i).ladder.level[0], surface);
  }
  for (std::size_t i = history_; i < forcing_.size(); ++i) {
    const std::size_t node = i - history_;
    const double offset_k = physics::foster_offset_k(x, surface);
    physics::foster_advance(x, drive(forcing_[i].begin, view[node], material, offset_k),
                            drive(forcing_[i].end, view[node + 1], material, offset_k),
                            gains(index, i).ladder, surface, kToleranceK);
  }
  return physics::kReferenceK + physics::foster_offset_k(x, surface);
}

}  // namespace emit::tool
