// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::renderer {

/// Triangles to be made fewer. Vertices of the same place are copies: one for each side of a
/// crease.
struct CollapseInput {
  std::span<const glm::vec3> positions_m;
  std::span<const std::uint32_t> place;          ///< by vertex, below the number of vertices
  std::span<const std::uint32_t> indices;        ///< counter-clockwise triangles
  std::vector<std::span<const float>> values_k;  ///< what vertices carry, one or more of each
  float tolerance_k = 0.1F;                      ///< differences that count fully
};

/// Collapses edges until at most `triangles` are left or none can be collapsed. Places keep where
/// they are and vanish one after the other, those first that are missed from the nearest only: by
/// their distance from what is left, or by the size of the triangles that show another value there.
/// The rim of the surface stays, creases stay creases, no triangle turns over. Returns the indices
/// that are left, in the input's numbering and order. O(n log n). Setup only.
[[nodiscard]] std::vector<std::uint32_t> collapse_edges(const CollapseInput& input,
                                                        std::size_t triangles);

}  // namespace emit::renderer
