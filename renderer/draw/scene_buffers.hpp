// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

#include "emit/scene/clusters.hpp"
#include "emit/scene/mesh.hpp"
#include "gl/objects.hpp"
#include "draw/triangle_cull.hpp"
#include "shared/frame_params.glsl.h"
#include "surface/run/cached_surface.hpp"
#include "surface/mesh/cluster_levels.hpp"

namespace emit::renderer {

/// Vertex and index data of all meshes on the device, and which instances draw them.
/// Owner: Renderer. Setup only, then read only.
class SceneBuffers {
 public:
  struct DrawRange {
    std::uint32_t first_index = 0;
    std::uint32_t index_count = 0;
    std::uint32_t material = 0;
    bool double_sided = false;
    std::uint32_t first_cluster = 0;  ///< entries of clusters(); none: drawn whole or not at all
    std::uint32_t cluster_count = 0;
  };
  struct MeshRange {
    DrawRange whole;  ///< all submeshes, for depth-only passes; one-sided if closed
    std::vector<DrawRange> submeshes;
    std::uint32_t first_instance = 0;  ///< instances() are grouped by mesh
    std::uint32_t instance_count = 0;
  };

  /// One set of vertices per mesh, drawn whole.
  explicit SceneBuffers(scene::SceneGeometry geometry);
  /// Vertex i of the buffers is sample i. Meshes are cut into clusters of several levels of detail.
  /// `cull`: not null: gets to know them, and the index buffer has room behind for what it leaves.
  explicit SceneBuffers(SampledScene scene, TriangleCull* cull = nullptr);

  [[nodiscard]] std::span<const MeshRange> meshes() const noexcept { return meshes_; }
  [[nodiscard]] std::span<const scene::Instance> instances() const noexcept { return instances_; }
  /// Number of an instance's first vertex.
  [[nodiscard]] std::int32_t base_vertex(std::uint32_t instance) const noexcept {
    return base_vertex_[instance];
  }
  [[nodiscard]] const scene::Aabb& mesh_bounds(std::uint32_t mesh) const noexcept {
    return mesh_bounds_[mesh];
  }
  /// first_index of each counts from the start of the index buffer.
  [[nodiscard]] std::span<const scene::Cluster> clusters() const noexcept { return clusters_; }
  /// By cluster.
  [[nodiscard]] std::span<const ClusterLevel> levels() const noexcept { return levels_; }
  /// Sends what is left of a frame's clusters; their first index in the buffer.
  void upload_culled(std::span<const std::uint32_t> indices) const noexcept {
    indices_.upload(indices, first_culled_);
  }
  [[nodiscard]] std::uint32_t first_culled() const noexcept { return first_culled_; }
  [[nodiscard]] GLuint positions() const noexcept { return positions_.id(); }
  [[nodiscard]] GLuint normals() const noexcept { return normals_.id(); }
  [[nodiscard]] GLuint indices() const noexcept { return indices_.id(); }

 private:
  /// `room`: indices behind those of the meshes.
  void add_meshes(std::span<const scene::Mesh> meshes, std::size_t room);

  std::vector<MeshRange> meshes_;
  std::vector<scene::Instance> instances_;
  std::vector<std::int32_t> base_vertex_;
  std::vector<scene::Aabb> mesh_bounds_;
  std::vector<scene::Cluster> clusters_;
  std::vector<ClusterLevel> levels_;
  gl::Buffer positions_;  ///< float32 x 3
  gl::Buffer normals_;    ///< snorm16 x 4; the fourth is the share of the sky, if sampled
  gl::Buffer indices_;    ///< uint32
  std::uint32_t first_culled_ = 0;
};

/// One drawn instance as a uniform block: at offsets that every device allows.
struct alignas(256) DrawRecord {
  gpu::DrawParams params;
};

/// One instance drawn into a shadow map: rows of the affine clip_from_mesh, depth in 0..1.
struct LightRecord {
  glm::vec4 clip_from_mesh_row[3];
};

}  // namespace emit::renderer
