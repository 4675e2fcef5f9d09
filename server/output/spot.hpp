// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/channel_output.hpp"

namespace emit::server {

/// Greatest distance of a pixel that a spot lights by a share of its own, px.
inline constexpr std::uint32_t kMaxSpotRadiusPx = 24;

/// Image of a point on the pixels around it (docs/optics.md eq. 1 to 3). The shares of the pixels
/// and the veil add up to 1.
struct Spot {
  std::uint32_t radius_px = 0;
  std::vector<double> share_frac;  ///< of (2 radius + 1)^2 pixels, by row
  double veil_frac = 0.0;          ///< light that falls beyond them

  [[nodiscard]] std::size_t side() const noexcept { return 2 * std::size_t{radius_px} + 1; }
};

/// Returns the spot of some optics: the integral of a Gaussian or of an Airy pattern over each
/// pixel, or the shares of a file, scaled to 1. Setup only.
/// Errors: those of image::read_exr(); config, when a file lacks the channel `spot`, has no odd
/// size up to 2 kMaxSpotRadiusPx + 1 or the same height as width, or holds a value that is negative
/// or no number, or nothing but 0; when more than a tenth of the light of an Airy pattern lies
/// beyond the greatest radius.
/// @pre settings.spot is not SpotKind::none
[[nodiscard]] physics::Result<Spot> make_spot(const scene::ChannelOptics& settings);

}  // namespace emit::server
