// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/physics/sky_state.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"

namespace emit::renderer {

/// Largest number of bands.
inline constexpr std::size_t kMostBands = 4;

/// Light that sky, surroundings and sun send to surfaces at an instant, in one band.
struct BandLight {
  std::array<float, physics::kSkyTilts> sky_w_m2_sr{};  ///< by the tilt of a face
  float surroundings_w_m2_sr = 0.0F;
  float sun_w_m2 = 0.0F;  ///< irradiance across the direction to the sun, at the ground
};

/// Light and materials in the bands of the picture. Any thread; RT-safe.
class BandLights {
 public:
  virtual ~BandLights() = default;
  /// Number of bands, 1 to kMostBands.
  [[nodiscard]] virtual std::size_t bands() const noexcept = 0;
  /// Fills the light of every band. @pre out.size() == bands()
  virtual void light_at(const physics::Forcing& forcing, const physics::SunPosition& sun,
                        std::span<BandLight> out) const noexcept = 0;
  /// Returns the radiance of a blackbody in a band, W m-2 sr-1. @pre band < bands()
  [[nodiscard]] virtual float black_w_m2_sr(std::size_t band,
                                            float temperature_k) const noexcept = 0;
  /// Returns the emissivity of a material in a band. @pre band < bands()
  [[nodiscard]] virtual float emissivity_frac(std::uint32_t material,
                                              std::size_t band) const noexcept = 0;
};

}  // namespace emit::renderer
