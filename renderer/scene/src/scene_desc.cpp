// SPDX-License-Identifier: Apache-2.0
#include "emit/scene/scene_desc.hpp"

namespace emit::scene {

physics::Band spectral_band(const SpectralBand& desc) {
  physics::Band band{desc.lo_um, desc.hi_um, {}};
  for (const ResponseSample& sample : desc.response) {
    band.response.push_back({sample.wavelength_um, sample.response_frac});
  }
  return band;
}

}  // namespace emit::scene
