// SPDX-License-Identifier: Apache-2.0
#pragma once

/// Scattering by homogeneous spheres after Mie (Bohren and Huffman 1983, chapter 4). Any thread;
/// setup only.
namespace emit::physics {

/// Cross-sections of a sphere by its geometric one, and the mean cosine of the scattered light.
struct MieEfficiencies {
  double extinction = 0.0;
  double scattering = 0.0;
  double asymmetry = 0.0;
};

/// Returns the efficiencies of a sphere of a size parameter 2 pi r / lambda, with the refractive
/// index n - i k by that of its surroundings. The logarithmic derivative runs downwards, the
/// Riccati-Bessel functions run upwards, to the number of terms of Wiscombe (1980).
/// @pre size_parameter > 0, refractive_index > 0 and extinction_index >= 0
[[nodiscard]] MieEfficiencies mie_efficiencies(double size_parameter, double refractive_index,
                                               double extinction_index);

}  // namespace emit::physics
