// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <glm/ext/vector_double3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// Temperatures that faces of scenery would take if they had no memory. With the difference from
/// the true temperature a thermal shadow explains itself: the one jumps with the sun, the other
/// follows.
class Equilibrium {
 public:
  /// A face and what reaches it at an instant, beside the weather.
  struct Face {
    glm::dvec3 normal{0.0, 0.0, 1.0};  ///< outward, unit length
    double sun_w_m2 = 0.0;             ///< direct sun on the face, shade and cosine included
    double sky_frac = 1.0;             ///< cosine-weighted share of the sky that it sees
  };

  /// Errors: those of renderer::foster_materials().
  /// @param materials  of the loaded scene, in its order
  [[nodiscard]] static physics::Result<Equilibrium> create(
      const scene::ScenarioDesc& scenario, std::span<const scene::Material> materials);

  /// Returns the temperature T at which the balance of physics.md eq. 16 and 47 holds with the
  /// steady flux into the base:
  ///
  ///   a_s S + eps L = eps sigma T^4 + h(T) (T - T_air) + latent(T) + (T - T_base) / R
  ///
  /// S is the sun on the face, the diffuse sun of the sky that it sees and what the surroundings
  /// reflect; L the long-wave flux of that sky and of surroundings for the rest. Other bodies count
  /// as surroundings. R is the resistance of the layers over a base that does not follow; without
  /// one, as over the interior of a body, nothing flows. NaN where the temperature is prescribed,
  /// on sheets, whose other face is not known, and with the model emit2014.
  [[nodiscard]] double at_k(std::size_t material, const renderer::SurfaceForcing& forcing,
                            const Face& face) const noexcept;

 private:
  explicit Equilibrium(std::vector<renderer::FosterMaterial> materials)
      : materials_(std::move(materials)) {}
  std::vector<renderer::FosterMaterial> materials_;  ///< empty: emit2014
};

}  // namespace emit::tool
