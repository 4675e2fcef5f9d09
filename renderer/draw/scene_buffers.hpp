// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

#include "draw/triangle_cull.hpp"
#include "emit/physics/check.hpp"
#include "emit/scene/clusters.hpp"
#include "emit/scene/mesh.hpp"
#include "gl/objects.hpp"
#include "shared/frame_params.glsl.h"
#include "surface/mesh/cluster_levels.hpp"
#include "surface/run/sampled_scene.hpp"

namespace emit::renderer {

/// Vertex and index data of all meshes on the device, and the instances that draw them.
/// Owner: DrawnScene. Thread: the one that owns the GL context. Real time: constructors are setup
/// only; all other functions are RT-safe.
class SceneBuffers {
 public:
  /// Part of the index buffer.
  struct DrawRange {
    std::uint32_t first_index = 0;
    std::uint32_t index_count = 0;
    std::uint32_t material = 0;
    bool double_sided = false;
    std::uint32_t first_cluster = 0;  ///< index of its first entry in clusters()
    std::uint32_t cluster_count = 0;  ///< 0: the range is drawn whole or not at all
  };
  /// Index ranges of one mesh and the instances that draw it.
  struct MeshRange {
    DrawRange whole;  ///< all submeshes, for depth-only passes; one-sided if the mesh is closed
    std::vector<DrawRange> submeshes;
    std::uint32_t first_instance = 0;  ///< entry of instances(), which are grouped by mesh
    std::uint32_t instance_count = 0;
  };

  /// Buffers with one set of vertices per mesh. Meshes are drawn whole.
  explicit SceneBuffers(scene::SceneGeometry geometry);
  /// Buffers of a sampled scene: vertex i is sample i. Meshes are cut into clusters of several
  /// levels of detail. If `cull` is not null, the clusters are added to it, and the index buffer
  /// has room for the triangles that it keeps.
  explicit SceneBuffers(SampledScene scene, TriangleCull* cull = nullptr);

  /// Index ranges by mesh.
  [[nodiscard]] std::span<const MeshRange> meshes() const noexcept { return meshes_; }
  /// Instances, grouped by mesh.
  [[nodiscard]] std::span<const scene::Instance> instances() const noexcept { return instances_; }
  /// Number of an instance's first vertex.
  /// @pre instance < instances().size()
  [[nodiscard]] std::int32_t base_vertex(std::uint32_t instance) const noexcept {
    EMIT_DCHECK_OP(instance, <, base_vertex_.size());
    return base_vertex_[instance];
  }
  /// Bounding box of a mesh in its own coordinates.
  /// @pre mesh < meshes().size()
  [[nodiscard]] const scene::Aabb& mesh_bounds(std::uint32_t mesh) const noexcept {
    EMIT_DCHECK_OP(mesh, <, mesh_bounds_.size());
    return mesh_bounds_[mesh];
  }
  /// Clusters of all submeshes. Their first_index counts from the start of the index buffer.
  [[nodiscard]] std::span<const scene::Cluster> clusters() const noexcept { return clusters_; }
  /// Level of detail of each entry of clusters().
  [[nodiscard]] std::span<const ClusterLevel> levels() const noexcept { return levels_; }
  /// Sends the indices of the triangles that culling kept to the device, from first_culled() on.
  /// @pre The constructor was given a TriangleCull; at most TriangleCull::kMaxIndices indices.
  void upload_culled(std::span<const std::uint32_t> indices) const noexcept;
  /// Index of the buffer at which the triangles that culling kept begin.
  [[nodiscard]] std::uint32_t first_culled() const noexcept { return first_culled_; }
  /// GL names of the buffers.
  [[nodiscard]] GLuint positions() const noexcept { return positions_.id(); }
  [[nodiscard]] GLuint normals() const noexcept { return normals_.id(); }
  [[nodiscard]] GLuint indices() const noexcept { return indices_.id(); }
  /// GL name of the openings of hulls; 0 in a scene without entities and where vertices are no
  /// samples.
  [[nodiscard]] GLuint hulls() const noexcept { return hulls_.id(); }

 private:
  /// Adds index ranges and indices of all meshes, with space for `room` more indices behind them.
  void add_meshes(std::span<const scene::Mesh> meshes, std::size_t room);

  std::vector<MeshRange> meshes_;
  std::vector<scene::Instance> instances_;
  std::vector<std::int32_t> base_vertex_;
  std::vector<scene::Aabb> mesh_bounds_;
  std::vector<scene::Cluster> clusters_;
  std::vector<ClusterLevel> levels_;
  gl::Buffer positions_;  ///< float32 x 3, mesh coordinates
  gl::Buffer normals_;    ///< snorm16 x 4; in a sampled scene the fourth is the share of the sky
  gl::Buffer hulls_;      ///< snorm16 x 4: SampledScene::hull
  gl::Buffer indices_;    ///< uint32
  std::uint32_t first_culled_ = 0;
  std::size_t culled_room_ = 0;  ///< indices that fit behind first_culled_
};

/// Uniform block of one drawn instance, padded to an offset that every device accepts.
struct alignas(256) DrawRecord {
  gpu::DrawParams params;
};

/// Instance drawn into a shadow map: rows of the affine clip_from_mesh, with depth in 0..1.
struct LightRecord {
  glm::vec4 clip_from_mesh_row[3];
};

}  // namespace emit::renderer
