// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/matrix_double4x4.hpp>
#include <vector>

#include "gltf_file.hpp"

namespace emit::scene {

/// Pose in which a skinned mesh is shown.
struct SkinPose {
  /// Transform of each joint times its inverse bind matrix, by joint.
  std::vector<glm::dmat4> gltf_from_bind;
  /// Transform of the mesh's node. It counts only for primitives without joints.
  glm::dmat4 gltf_from_node{1.0};
};

/// Reads a skin in the pose that the file's nodes have.
///
/// @param gltf_from_node  transforms of all nodes, see all_node_transforms()
/// Errors name the skin: parse (skin, joint or accessor does not exist, too few matrices).
[[nodiscard]] physics::Result<SkinPose> read_skin(const GltfFile& file, int skin,
                                                  const std::vector<glm::dmat4>& gltf_from_node);

/// The matrix of each vertex: the weighted sum of its joints' matrices, weights brought to a sum of
/// one (glTF 2.0, 3.7.3.3). A vertex without weight follows its first joint.
/// Errors: parse (accessors that do not fit, a joint that the skin does not have).
struct VertexMatrices {
  std::vector<glm::dmat4> gltf_from_bind;  ///< by vertex; empty: the primitive has no joints
  std::size_t without_weight = 0;          ///< number of vertices whose weights are all zero
};
[[nodiscard]] physics::Result<VertexMatrices> vertex_matrices(const tinygltf::Model& model,
                                                              const tinygltf::Primitive& primitive,
                                                              const SkinPose& pose,
                                                              std::size_t vertices);

}  // namespace emit::scene
