// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <glm/ext/vector_float2.hpp>

#include "emit/physics/sky/moon.hpp"
#include "emit/physics/sun.hpp"
#include "shared/frame_params.glsl.h"

/// Discs of sun and moon in the sky (physics.md section 15). RT-safe.
namespace emit::renderer {

/// Fills the part of `params` that says where the discs lie. A disc that touches no pixel of the
/// image, or whose middle lies below the horizon, has the radius 0, so that shaders skip it.
/// @pre the camera of `params` is set
void set_sky_bodies(const physics::SunPosition& sun, const physics::MoonPosition& moon,
                    gpu::FrameParams& params) noexcept;

/// Twin of disc_cover_frac() of lib/sky_disc.glsl: share of a pixel that a disc covers, 0..1.
/// @param centre  of the disc, from the pixel's middle, px
[[nodiscard]] float disc_cover_frac(glm::vec2 centre_px, float radius_px) noexcept;

/// Sun and moon in a pixel of the sky.
struct SkyBodies {
  static constexpr std::size_t kMostPoints = 256;
  float sun_frac = 0.0F;  ///< share of the pixel
  float moon_frac = 0.0F;
  std::size_t moon_points = 0;                   ///< entries of the arrays in use
  std::array<float, kMostPoints> moon_k{};       ///< temperature of points of the moon
  std::array<float, kMostPoints> moon_cosine{};  ///< of the sun's incidence there
  std::array<float, kMostPoints> moon_weight{};  ///< of the points, not normalised
};
/// Twin of what radiance.comp does with the discs, for a pixel of the rendered image.
[[nodiscard]] SkyBodies sky_bodies_at(glm::ivec2 px, const gpu::FrameParams& params) noexcept;

}  // namespace emit::renderer
