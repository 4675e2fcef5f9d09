// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/scene_desc.hpp"

#include <algorithm>
#include <cmath>

#include "emit/physics/constants.hpp"

namespace emit::scene {
namespace {

/// Longest piece of a response whose product with wavelength counts as linear, um.
constexpr double kPhotonPieceUm = 0.1;

/// Returns the response per power of a band whose response is per photon: times wavelength over the
/// longest one of the band, so that it stays within 1.
std::vector<physics::ResponsePoint> per_power(const SpectralBand& desc,
                                              const physics::Band& per_photon) {
  // The product with wavelength is linear where the response is even.
  // A table that ends within the band ends the response there, as in a band per power.
  const bool flat = per_photon.response.empty();
  const double first_um =
      flat ? desc.lo_um : std::max(desc.lo_um, per_photon.response.front().wavelength_um);
  const double last_um =
      flat ? desc.hi_um : std::min(desc.hi_um, per_photon.response.back().wavelength_um);
  std::vector<double> ends_um{first_um};
  for (const physics::ResponsePoint& point : per_photon.response) {
    if (point.wavelength_um > first_um && point.wavelength_um < last_um) {
      ends_um.push_back(point.wavelength_um);
    }
  }
  ends_um.push_back(last_um);
  std::vector<physics::ResponsePoint> out;
  const auto add = [&](double um) {
    out.push_back({um, physics::response_frac(per_photon, um) * um / desc.hi_um});
  };
  add(first_um);
  for (std::size_t i = 1; i < ends_um.size(); ++i) {
    const double length_um = ends_um[i] - ends_um[i - 1];
    const int pieces = flat ? 1 : static_cast<int>(std::ceil(length_um / kPhotonPieceUm));
    for (int k = 1; k < pieces; ++k) {
      add(std::lerp(ends_um[i - 1], ends_um[i], static_cast<double>(k) / pieces));
    }
    add(ends_um[i]);
  }
  return out;
}

}  // namespace

physics::Band spectral_band(const SpectralBand& desc) {
  physics::Band band{desc.lo_um, desc.hi_um, {}};
  for (const ResponseSample& sample : desc.response) {
    band.response.push_back({sample.wavelength_um, sample.response_frac});
  }
  if (desc.photons) band.response = per_power(desc, band);
  return band;
}

double photons_per_joule(const SpectralBand& desc) noexcept {
  return 1e-6 * desc.hi_um / (physics::kPlanckJS * physics::kSpeedOfLightMPerS);
}

}  // namespace emit::scene
