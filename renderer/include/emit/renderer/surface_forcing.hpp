// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/physics/air_film.hpp"
#include "emit/physics/climate/surface_water.hpp"
#include "emit/physics/error.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/foster.hpp"
#include "emit/scene/scene_desc.hpp"

/// Drive of the renderer's thermal models, for callers that integrate the models themselves with
/// other steps or another visibility. Real time: setup only.
namespace emit::renderer {

/// Sun, sky, surroundings and air at an instant, independent of material and direction of a surface
/// (physics.md eq. 16). Fluxes are in W m-2.
struct SurfaceForcing {
  glm::dvec3 sun_w_m2{0.0};       ///< vector towards the sun; its length is the direct normal flux
  double diffuse_w_m2 = 0.0;      ///< diffuse sunlight on a level surface
  double longwave_w_m2 = 0.0;     ///< long-wave flux of the sky on a level surface
  double reflected_w_m2 = 0.0;    ///< sunlight that the surroundings reflect
  double environment_w_m2 = 0.0;  ///< long-wave exitance of the surroundings
  physics::AirFlow flow;          ///< air past what stands still
  physics::AirFilm film;          ///< film of scenery in that flow
  double air_k = 0.0;             ///< air temperature
  physics::MoistAir moist;        ///< moisture of the air
  // Share of open, level ground that rain has wetted, by slot (FosterMaterial::water_slot): of
  // ground that gets all of the rain, half of it, and none of it.
  std::array<double, physics::kWaterSlots> wet_frac{};
  std::array<double, physics::kWaterSlots> half_wet_frac{};
  std::array<double, physics::kWaterSlots> sheltered_wet_frac{};

  /// Returns the wetness of a face that gets a share of the rain, 0..1: linear between the three.
  [[nodiscard]] double wet_frac_at(std::size_t slot, double rain_frac) const noexcept {
    const double halves = 2.0 * std::clamp(rain_frac, 0.0, 1.0);
    return halves < 1.0 ? std::lerp(sheltered_wet_frac[slot], half_wet_frac[slot], halves)
                        : std::lerp(half_wet_frac[slot], wet_frac[slot], halves - 1.0);
  }
};
/// Returns the share of the rain on level ground that falls on a face without anything above it, by
/// the vertical part of its normal. Rain falls straight down.
[[nodiscard]] constexpr double rain_by_tilt_frac(double up) noexcept {
  return up > 0.0 ? up : 0.0;
}
/// Forcing over an interval. It goes linearly from begin to end.
struct IntervalForcing {
  SurfaceForcing begin;
  SurfaceForcing end;
  double dt_s = 0.0;     ///< length of the interval, > 0
  double rain_mm = 0.0;  ///< depth that falls in it
};

/// Forcing over the intervals between the instants `nodes_ns` (sim time). Entry i goes from node i
/// to node i + 1. With the model emit2014 the surroundings have the temperature of the weather and
/// reflect nothing. With foster they are an open, level surface that is steady at the first node
/// and is integrated along, as is the ground of those `materials` that hold water. Thread: any.
/// Errors: invalid_argument (fewer than two nodes, or nodes that do not ascend), config (the
/// material of the surroundings does not exist).
[[nodiscard]] physics::Result<std::vector<IntervalForcing>> surface_forcing(
    const scene::ScenarioDesc& scenario, std::span<const std::int64_t> nodes_ns,
    std::span<const scene::Material> materials = {});

/// Material of the extended thermal model.
struct FosterMaterial {
  physics::FosterNetwork network;  ///< no modes: the temperature is prescribed
  double solar_absorptance_frac = 0.0;
  double emissivity_frac = 1.0;
  double base_k = 0.0;
  double initial_k = 0.0;
  /// Nobody has stated initial_k: the surface begins in the balance of its own first day.
  bool starts_balanced = false;
  double prescribed_k = 0.0;
  physics::FilmSkin skin;          ///< what the film of the air takes from it
  physics::MoistSurface moisture;  ///< exchange of water with the air
  physics::WaterStore store;       ///< room for rain water
  int water_slot = -1;             ///< of SurfaceForcing::wet_frac; -1: it holds no water
  bool water_shared = false;       ///< too few slots: the ground of its slot is that of another one
  bool snow_or_ice = false;        ///< it cannot be above 0 C (scene/melting.hpp)
  bool sheet = false;              ///< driven by the mean of the fluxes that its two faces receive
  bool body = false;               ///< the base is the interior of a body, which starts at base_k
  /// Layers in which heat moves sideways; empty for sheets and for prescribed temperatures.
  std::vector<physics::StackLayer> layers;
  physics::FosterState<double> base_shares{};  ///< shares c_i of the modes in a change of the base
  /// Index of the first of its two twins, which have the properties where the clutter's field is
  /// -kTwinSd and +kTwinSd; 0: none.
  std::uint32_t first_twin = 0;

  [[nodiscard]] bool prescribed() const noexcept { return network.count == 0; }
};

/// Returns the exchange of water of a face that gets a share of the rain on open, level ground.
[[nodiscard]] inline physics::MoistSurface moisture_at(const FosterMaterial& material,
                                                       const SurfaceForcing& forcing,
                                                       double rain_frac) noexcept {
  physics::MoistSurface out = material.moisture;
  if (material.water_slot >= 0) {
    out.film_frac = forcing.wet_frac_at(static_cast<std::size_t>(material.water_slot), rain_frac);
  }
  return out;
}

/// Networks and constants of materials. A material uses its own modes; they are derived from its
/// layers where it has none or where the scenario asks for another number of modes. Thread: any.
/// Errors: config (names the material).
[[nodiscard]] physics::Result<std::vector<FosterMaterial>> foster_materials(
    std::span<const scene::Material> materials, const scene::ThermalOptions& options);

}  // namespace emit::renderer
