// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

/// Random fields that stand for the small-scale variation of natural surfaces.
/// Thread: any.  Real time: setup only.
namespace emit::physics {

/// Spectrum of a stationary, isotropic field on a square tile that repeats.
struct PowerLaw {
  double period_m = 128.0;  ///< edge of the tile, > 0
  double shortest_m = 0.5;  ///< shortest wavelength of the field, at least two texels
  double longest_m = 16.0;  ///< longest wavelength, at most the period
  double slope = 3.0;       ///< the two-dimensional power spectral density goes with k^-slope
  std::uint64_t seed = 1;   ///< another seed gives another field of the same kind
};

/// Field at one resolution. Values are row by row, `side` x `side`; the middle of texel (0, 0) is
/// the origin.
struct FieldLevel {
  std::size_t side = 0;
  double variance = 0.0;  ///< of the values; the field itself has the variance 1
  std::vector<float> values;
};

/// Returns the field and its means over ever larger texels: levels of `side`, 3/4 `side`, `side`/2,
/// 3/8 `side` and so on, down to 4. The field has mean 0 and variance 1. Its Fourier coefficients
/// have random phases, and its values are nearly Gaussian. In all levels but the first a
/// coefficient of f waves per texel is multiplied by cos^2(pi/2 x) with x = (f - 0.05) / 0.25 held
/// in 0..1: little is left that bilinear interpolation would turn into ripples, and nothing is
/// aliased. At most the first `most_levels` are made.
/// @pre `side` is a power of two, 4..4096; two texels <= shortest_m < longest_m <= period_m
[[nodiscard]] std::vector<FieldLevel> power_law_field(const PowerLaw& law, std::size_t side,
                                                      std::size_t most_levels = 64);

}  // namespace emit::physics
