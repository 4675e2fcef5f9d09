// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/matrix_double3x3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "gltf_file.hpp"

namespace emit::scene {

/// Continuation of an image beyond its edges (glTF 2.0, sampler.wrapS and wrapT).
enum class Wrap : std::uint8_t { clamp, repeat, mirror };

/// Image of opacity by which `alphaMode` MASK keeps a surface: where the bilinear value is at least
/// the cutoff.
struct AlphaMask {
  int width_px = 0;
  int height_px = 0;
  std::vector<float> alpha;  ///< row by row from v = 0, factor of the material included
  float cutoff = 0.5F;
  Wrap wrap_u = Wrap::repeat;
  Wrap wrap_v = Wrap::repeat;
  int tex_coord = 0;              ///< N of the attribute TEXCOORD_N
  glm::dmat3 image_from_uv{1.0};  ///< KHR_texture_transform
  bool one_colour = false;        ///< the image has one colour: it shows nothing but the outline
  [[nodiscard]] float at(int x, int y) const {
    return alpha[static_cast<std::size_t>(y) * static_cast<std::size_t>(width_px) +
                 static_cast<std::size_t>(x)];
  }
};

/// Bilinear opacity at a place in texels, the middle of the first texel being (0.5, 0.5).
[[nodiscard]] double alpha_at(const AlphaMask& mask, double x_px, double y_px);

/// Reads what cuts out the surfaces of a material.
/// @return nothing where the material is not of `alphaMode` MASK. A mask of one texel stands for a
/// material without an image, or with one that is opaque everywhere (JPEG).
/// Errors name the image: not_found, io, parse, unsupported (neither PNG nor JPEG, more than 8192
/// px).
[[nodiscard]] physics::Result<std::optional<AlphaMask>> read_alpha_mask(const GltfFile& file,
                                                                        int material);

}  // namespace emit::scene
