// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "surface/mesh/refined_mesh.hpp"

namespace emit::renderer {

/// Per vertex the index of the first vertex at the same position (zeros of either sign are equal).
/// O(n); 4..8 B a vertex while it runs.
[[nodiscard]] std::vector<std::uint32_t> weld_positions(
    std::span<const RefinedMesh::Vertex> vertices);

/// Per half-edge (3 triangle + corner it starts from) the next one between the same two positions,
/// in either direction, in rings of rising index. Half-edges of triangles with two corners at one
/// position stand alone. `position_id`: from weld_positions(). 24 B a triangle while it runs.
[[nodiscard]] std::vector<std::uint32_t> link_edges(
    std::span<const std::array<std::uint32_t, 3>> triangles,
    std::span<const std::uint32_t> position_id);

/// By vertex the mean direction into its leaves where it lies on a rim, a border of the surface or
/// a crease with vertices of each side's own: unit length, axes of the mesh. Zero inside, however
/// uneven the leaves are, and where the leaves' directions cancel. Fills `inward` from vertex
/// `first` on; what stands before is of no use. O(n), mostly of those.
void find_inward(const RefinedMesh& mesh, std::uint32_t first, std::vector<glm::vec3>& inward);

}  // namespace emit::renderer
