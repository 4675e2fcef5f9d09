// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/surface/facets.hpp"
#include "emit/physics/surface/optical_constants.hpp"

/// Glossy surfaces (physics.md section 5): emission by angle, and a lobe around the mirror
/// direction. Setup only; any thread.
namespace emit::scene {

struct Material;
struct ScenarioDesc;
struct SpectralBand;

/// Interface of a glossy surface. Its reflectance by angle comes from optical constants or from a
/// table, and its facets spread what it reflects.
struct Gloss {
  physics::IndexTable index = physics::IndexTable::none;
  // Constants of the user's own; all three lists have the same length.
  std::vector<double> wavelength_um;
  std::vector<double> refractive_index;
  std::vector<double> extinction_index;
  // Directional emissivity of a smooth surface by the angle to the normal, in place of constants.
  std::vector<double> angle_rad;  ///< ascending from 0, below 90 degrees; the reflectance at 90 is 1
  std::vector<double> angle_emissivity_frac;
  double lobe_frac = 1.0;     ///< share of what the interface reflects that goes into the lobe
  double facet_slope = 0.05;  ///< width of the GGX distribution of slopes
  bool sea = false;           ///< facets are wind waves
  std::optional<double> sea_wind_m_s;  ///< absent: the wind of the weather at simulation time 0

  [[nodiscard]] bool operator==(const Gloss&) const = default;
};

/// Returns the optical constants of a gloss; empty where it has a table by angle.
[[nodiscard]] std::vector<physics::OpticalConstants> constants_of(const Gloss& gloss);

/// Returns the reflectance of a gloss's interface in a band for light with the spectrum of a
/// blackbody, by the cosine of incidence. @pre the gloss is valid
[[nodiscard]] physics::LobeCurve interface_reflectance_frac(const Gloss& gloss,
                                                            const physics::Band& band,
                                                            physics::Kelvin source);

/// Checks a gloss by itself: one source of the reflectance, and lists that fit together.
/// Errors: invalid_argument, naming the key.
[[nodiscard]] physics::Result<void> validate(const Gloss& gloss);

/// Checks the emissivities of a glossy material against its interface, which no body can
/// outshine: that of a band along the normal, and the total over the hemisphere.
/// @pre the gloss is valid; bands of the list `band_emissivity` that are not in `bands` are skipped
[[nodiscard]] physics::Result<void> check_emissivities(const Material& material,
                                                       const std::vector<SpectralBand>& bands);

/// Returns the facets of a glossy material. @pre material.gloss
[[nodiscard]] physics::Facets facets_of(const Material& material, const ScenarioDesc& scenario);

/// Returns the optics of a glossy material's facets in a band. A listed emissivity of the band is
/// that along the normal; without one the body absorbs what gives the total hemispherical
/// emissivity. @pre material.gloss is valid
[[nodiscard]] physics::FacetOptics facet_optics(const Material& material,
                                                const SpectralBand& band);

}  // namespace emit::scene
