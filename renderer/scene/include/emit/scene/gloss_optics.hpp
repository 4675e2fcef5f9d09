// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/planck.hpp"
#include "emit/physics/surface/facets.hpp"
#include "emit/physics/surface/optical_constants.hpp"
#include "emit/scene/scene_desc.hpp"

/// Glossy surfaces (physics.md section 5): emission by angle, and a lobe around the mirror
/// direction. Setup only; any thread.
namespace emit::scene {

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

/// Checks the emissivities of a glossy material against its facets, which no body can outshine:
/// that of a band along the normal, and the total over the hemisphere.
/// @pre the gloss is valid; bands of the list `band_emissivity` that are not in `bands` are skipped
[[nodiscard]] physics::Result<void> check_emissivities(const Material& material,
                                                       const physics::Facets& facets,
                                                       const std::vector<SpectralBand>& bands);

/// Greatest wind that Cox and Munk measured, m/s, and that up to which a sea gets rougher here.
inline constexpr double kMeasuredSeaWindMS = 14.0;
inline constexpr double kMostSeaWindMS = 20.0;
/// Returns the wind over a sea: the stated one, else that of the weather at time 0.
[[nodiscard]] double sea_wind_m_s(const Gloss& gloss, const ScenarioDesc& scenario);
/// Returns the facets of a glossy material. @pre material.gloss
[[nodiscard]] physics::Facets facets_of(const Material& material, const ScenarioDesc& scenario);

/// Returns the optics of a glossy material's facets in a band. A listed emissivity of the band is
/// that of the rough surface along its normal; without one the body absorbs what gives it the total
/// hemispherical emissivity. @pre material.gloss is valid
[[nodiscard]] physics::FacetOptics facet_optics(const Material& material,
                                                const physics::Facets& facets,
                                                const SpectralBand& band);

}  // namespace emit::scene
