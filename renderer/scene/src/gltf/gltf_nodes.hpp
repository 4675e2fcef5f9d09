// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/matrix_double4x4.hpp>
#include <string>
#include <vector>

#include "gltf_file.hpp"

namespace emit::scene {

/// A node of the scene shown, with its transform.
struct PlacedNode {
  int node = 0;
  glm::dmat4 gltf_from_node{1.0};
};

/// Walks the default scene, else the first, else every node that is no child. Parents come before
/// their children.
/// Errors: parse (missing or cyclic nodes, two parents, transforms not finite or of a wrong size).
[[nodiscard]] physics::Result<std::vector<PlacedNode>> place_nodes(const GltfFile& file);

/// Transforms of all nodes of the file, by node: a skin may have joints outside the scene shown.
/// Errors as place_nodes().
[[nodiscard]] physics::Result<std::vector<glm::dmat4>> all_node_transforms(const GltfFile& file);

/// node_from_mesh for each instance of EXT_mesh_gpu_instancing; the identity alone without it.
/// @pre `node` exists.
/// Errors name the node: parse.
[[nodiscard]] physics::Result<std::vector<glm::dmat4>> node_instances(const GltfFile& file,
                                                                      int node);

}  // namespace emit::scene
