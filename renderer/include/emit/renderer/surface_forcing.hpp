// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/foster.hpp"
#include "emit/scene/scene_desc.hpp"

/// What the thermal models of the renderer are driven by, for callers that integrate them by
/// themselves: with other steps, or with another visibility. Setup class.
namespace emit::renderer {

/// Everything that drives surfaces at an instant, whatever their material and direction
/// (physics.md eq. 16).
struct SurfaceForcing {
  glm::dvec3 sun_w_m2{0.0};     ///< towards the sun, as long as the direct normal flux after clouds
  double diffuse_w_m2 = 0.0;    ///< horizontal
  double longwave_w_m2 = 0.0;   ///< of the sky, horizontal
  double reflected_w_m2 = 0.0;  ///< sunlight from the surroundings
  double environment_w_m2 = 0.0;  ///< long-wave exitance of the surroundings
  double film_w_m2_k = 0.0;
  double air_k = 0.0;
};
/// Linear in between.
struct IntervalForcing {
  SurfaceForcing begin;
  SurfaceForcing end;
  double dt_s = 0.0;
};

/// Forcing over the intervals between `nodes_ns` (sim time), entry i from node i to node i + 1.
/// emit2014: the surroundings have the temperature that the weather gives them and reflect nothing.
/// foster: they are an open, level surface that starts steady at the first node and is carried
/// along.
/// Errors: invalid_argument (fewer than two nodes, or not ascending), config (no such surroundings
/// material).
[[nodiscard]] physics::Result<std::vector<IntervalForcing>> surface_forcing(
    const scene::ScenarioDesc& scenario, std::span<const std::int64_t> nodes_ns);

/// A surface that drives its states.
struct FosterMaterial {
  physics::FosterNetwork network;  ///< no modes: its temperature is prescribed
  double solar_absorptance_frac = 0.0;
  double emissivity_frac = 1.0;
  double base_k = 0.0;
  double initial_k = 0.0;
  double prescribed_k = 0.0;
  bool sheet = false;  ///< driven by the mean of what its two faces receive

  [[nodiscard]] bool prescribed() const noexcept { return network.count == 0; }
};

/// Networks and constants of materials: their own modes, or derived from their layers where they
/// have none or the scenario asks for another number. Errors (config) name the material.
[[nodiscard]] physics::Result<std::vector<FosterMaterial>> foster_materials(
    std::span<const scene::Material> materials, const scene::ThermalOptions& options);

}  // namespace emit::renderer
