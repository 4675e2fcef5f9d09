// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <string>
#include <vector>

#include "cut_outs.hpp"
#include "emit/scene/mesh.hpp"
#include "gltf_file.hpp"
#include "gltf_skin.hpp"

namespace emit::scene {

/// A mesh of the file as plain triangles.
struct ConvertedMesh {
  Mesh mesh;  ///< may be without triangles; Submesh::material is the glTF index or kNoGltfMaterial
  /// Place of the mesh's origin in the axes of the glTF mesh (of the scene for a skinned one). It
  /// is not zero where the vertices lie so far away that float32 arithmetic would lose detail.
  glm::dvec3 origin_m{0.0};
  /// Distance of neighbouring float32 numbers at the largest coordinate of the file's vertices, in
  /// the lengths of the mesh; 0 where the file holds whole numbers.
  double resolution = 0.0;
  double max_coordinate = 0.0;  ///< largest coordinate of the file's vertices, same lengths
  std::uint64_t dropped_triangles = 0;
};

/// Joins the triangle primitives of one glTF mesh, less what alpha masks cut out, parted by images
/// of materials. `warnings` gets a line, begun with the file's name, for each primitive or part of
/// one that is left out.
///
/// @param skin  null: the mesh has no skin. Otherwise its vertices come out in the axes of the
/// scene.
/// @pre the mesh exists.
/// Errors name mesh and primitive: parse, unsupported (coordinates beyond 1e9, 2^31 indices).
[[nodiscard]] physics::Result<ConvertedMesh> convert_mesh(const GltfFile& file, int mesh_index,
                                                          const SkinPose* skin, CutOuts& cut_outs,
                                                          std::vector<std::string>& warnings);

/// The mesh mirrored in x, with its winding turned so that fronts stay fronts. A mirroring node
/// shows this copy, with its matrix multiplied by mesh_from_mirrored().
[[nodiscard]] Mesh mirrored_copy(const Mesh& mesh);
/// Mirrors x.
[[nodiscard]] glm::dmat4 mesh_from_mirrored() noexcept;

}  // namespace emit::scene
