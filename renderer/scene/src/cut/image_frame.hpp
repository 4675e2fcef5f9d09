// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/matrix_double3x3.hpp>

namespace emit::scene {

/// Continuation of an image beyond its edges (glTF 2.0, sampler.wrapS and wrapT).
enum class Wrap : std::uint8_t { clamp, repeat, mirror };

/// Size of an image, and the way in which it lies on a surface.
struct ImageFrame {
  int width_px = 0;
  int height_px = 0;
  Wrap wrap_u = Wrap::repeat;
  Wrap wrap_v = Wrap::repeat;
  int tex_coord = 0;              ///< N of the attribute TEXCOORD_N
  glm::dmat3 image_from_uv{1.0};  ///< KHR_texture_transform
};

/// Returns the same place of the image near its first copy, so that it fits into an int.
[[nodiscard]] double near_first(double px, int size, Wrap wrap);
/// Returns the texel that stands for texel `i` of an image that goes on beyond its edges.
[[nodiscard]] int wrapped(int i, int size, Wrap wrap);

}  // namespace emit::scene
