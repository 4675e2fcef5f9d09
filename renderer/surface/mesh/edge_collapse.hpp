// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::renderer {

/// Input of collapse_edges(). Vertices at the same place are copies of each other: a crease has one
/// copy for each of its sides.
struct CollapseInput {
  std::span<const glm::vec3> positions_m;
  /// Number of the place of each vertex, below the number of vertices.
  std::span<const std::uint32_t> place;
  std::span<const std::uint32_t> indices;  ///< triangles, counter-clockwise
  /// Temperatures of the vertices, in one or more lists.
  std::vector<std::span<const float>> values_k;
  float tolerance_k = 0.1F;  ///< differences from this size on have full weight
};

/// Collapses edges until at most `triangles` are left or no edge can be collapsed. Places do not
/// move; they vanish one after the other. The first ones are those whose loss shows only from the
/// nearest distance, either by their distance from the surface that is left, or by the size of
/// triangles that show another temperature. The rim of the surface stays, creases stay creases, and
/// no triangle turns over.
/// Returns the indices that are left, in the numbering and the order of the input. O(n log n).
/// Setup only.
[[nodiscard]] std::vector<std::uint32_t> collapse_edges(const CollapseInput& input,
                                                        std::size_t triangles);

}  // namespace emit::renderer
