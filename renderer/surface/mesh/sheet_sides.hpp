// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/mesh/refined_mesh.hpp"

/// Second faces of sheets (scene/sheets.hpp). They are refined together with the first ones, but
/// sampled and drawn apart from them.
namespace emit::renderer {

/// Returns the vertices of sheets, ascending. They have a second sample for their back.
[[nodiscard]] std::vector<std::uint32_t> back_vertices(const RefinedMesh& mesh,
                                                       std::span<const scene::Material> materials);

/// Adds the backs of sheets to the mesh that `refined` was written into: a vertex for each of
/// back_vertices(), behind the others, and a single-sided submesh for each submesh of a sheet,
/// which becomes single-sided too. Setup only.
void add_backs(const RefinedMesh& refined, std::span<const scene::Material> materials,
               scene::Mesh& mesh);

}  // namespace emit::renderer
