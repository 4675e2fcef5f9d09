// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace emit::scene {

/// One point of a spectrum of emissivity.
struct EmissivitySample {
  double wavelength_um = 0.0;
  double emissivity_frac = 0.0;  ///< 0..1
};

/// Emissivity of a band that was folded from a spectrum, and its largest errors in kelvin of
/// apparent temperature (physics.md eq. 88).
struct FoldedBand {
  std::string band;  ///< name of a SpectralBand
  double emissivity_frac = 0.0;
  double beyond_frac = 0.0;    ///< share of the weight beyond the ends of the spectrum
  double temperature_k = 0.0;  ///< error over the temperatures, through the air of the folding
  double air_k = 0.0;          ///< error over the paths, at the temperature of the folding
  double largest_k = 0.0;      ///< error over temperatures and paths together
  double sunlight_k = 0.0;     ///< error of a face square to the sun by the sunlight it reflects
};

/// Total emissivity that was folded from a spectrum.
struct FoldedTotal {
  double emissivity_frac = 0.0;
  double beyond_frac = 0.0;
};

/// Emissivity of a material over wavelength, and what the loader made of it. Material has the
/// results in emissivity_frac and band_emissivity too, which is all that the renderer takes.
struct EmissivitySpectrum {
  std::vector<EmissivitySample> samples;  ///< ascending, linear in between; empty: no spectrum
  std::filesystem::path file;             ///< file that holds the samples; empty: none
  double reference_k = 300.0;             ///< temperature of the folding
  double least_k = 250.0;                 ///< temperatures over which the errors count
  double greatest_k = 350.0;
  std::vector<FoldedBand> bands;
  std::optional<FoldedTotal> total;  ///< absent: the material states its total emissivity
};

}  // namespace emit::scene
