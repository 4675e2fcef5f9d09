// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdio>
#include <span>
#include <string>

#include "emit/scene/scene_desc.hpp"
#include "tool/support/json.hpp"
#include "tool/support/svg_plot.hpp"

/// Part of `emit materials` about spectra of emissivity. Any thread, setup only.
namespace emit::tool {

/// Returns what a spectrum was folded to in a band; null where the band is listed or not covered.
[[nodiscard]] const scene::FoldedBand* folded_band(const scene::Material& material,
                                                   const std::string& band);
/// Returns whether a material has a spectrum that says nothing of a band, nor lists the band.
[[nodiscard]] bool not_covered(const scene::Material& material, const std::string& band);
/// Returns the wavelengths of a spectrum; "-" without one.
[[nodiscard]] std::string spectrum_text(const scene::Material& material);

/// Prints what the spectra of materials were folded to, and the errors of that; nothing if none has
/// one.
void print_spectra(std::FILE* out, std::span<const scene::Material> materials);
[[nodiscard]] Json spectrum_json(const scene::EmissivitySpectrum& spectrum);
/// Returns the spectra of materials, and what they were folded to over each band; no series if none
/// has one.
[[nodiscard]] Plot spectrum_plot(std::span<const scene::Material> materials,
                                 const std::string& family);

}  // namespace emit::tool
