// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "gltf_file.hpp"

namespace emit::scene {

struct ConvertedMesh {
  Mesh mesh;  ///< may be without triangles; Submesh::material is the glTF index or kNoGltfMaterial
  std::uint64_t dropped_triangles = 0;
};

/// Joins the triangle primitives of one glTF mesh. `warnings` gets a line, begun with the file's
/// name, for each primitive or part of one that is left out.
[[nodiscard]] physics::Result<ConvertedMesh> convert_mesh(const GltfFile& file, int mesh_index,
                                                          std::vector<std::string>& warnings);

/// The mesh mirrored in x, with its winding turned so that fronts stay fronts: what a mirroring
/// node shows when its matrix is multiplied by mesh_from_mirrored().
[[nodiscard]] Mesh mirrored_copy(const Mesh& mesh);
[[nodiscard]] glm::dmat4 mesh_from_mirrored() noexcept;

}  // namespace emit::scene
