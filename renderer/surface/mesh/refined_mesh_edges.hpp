// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "surface/mesh/refined_mesh.hpp"

namespace emit::renderer {

/// Returns, for each vertex, the index of the first vertex at the same position. Zeros of either
/// sign are equal. O(n); it takes 4 to 8 B per vertex while it runs.
[[nodiscard]] std::vector<std::uint32_t> weld_positions(
    std::span<const RefinedMesh::Vertex> vertices);

/// Returns, for each half-edge (3 triangle + corner that it starts from), the next one between the
/// same two positions in either direction. They form rings of rising index. Half-edges of triangles
/// with two corners at one position stand alone. `position_id` is from weld_positions(). It takes
/// 24 B per triangle while it runs.
[[nodiscard]] std::vector<std::uint32_t> link_edges(
    std::span<const std::array<std::uint32_t, 3>> triangles,
    std::span<const std::uint32_t> position_id);

/// Computes, for each vertex on a rim, the mean direction into its leaves: unit length, axes of the
/// mesh. A rim is a border of the surface, or a crease whose sides have vertices of their own. The
/// direction is zero inside a surface, however uneven the leaves are, and if the directions of the
/// leaves cancel. `inward` is filled from vertex `first` on; earlier entries are not used and stay.
/// O(n), mostly for the vertices that are filled.
void find_inward(const RefinedMesh& mesh, std::uint32_t first, std::vector<glm::vec3>& inward);

}  // namespace emit::renderer
