// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "gl/objects.hpp"
#include "shared/frame_params.glsl.h"

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
  };
  struct MeshRange {
    DrawRange whole;  ///< all submeshes, for depth-only passes; one-sided if closed
    std::vector<DrawRange> submeshes;
    std::int32_t base_vertex = 0;
    std::uint32_t first_instance = 0;  ///< instances() are grouped by mesh
    std::uint32_t instance_count = 0;
  };

  explicit SceneBuffers(scene::SceneGeometry geometry);

  [[nodiscard]] std::span<const MeshRange> meshes() const noexcept { return meshes_; }
  [[nodiscard]] std::span<const scene::Instance> instances() const noexcept { return instances_; }
  [[nodiscard]] const scene::Aabb& mesh_bounds(std::uint32_t mesh) const noexcept {
    return mesh_bounds_[mesh];
  }
  [[nodiscard]] GLuint positions() const noexcept { return positions_.id(); }
  [[nodiscard]] GLuint normals() const noexcept { return normals_.id(); }
  [[nodiscard]] GLuint indices() const noexcept { return indices_.id(); }

 private:
  std::vector<MeshRange> meshes_;
  std::vector<scene::Instance> instances_;
  std::vector<scene::Aabb> mesh_bounds_;
  gl::Buffer positions_;  ///< float32 x 3
  gl::Buffer normals_;    ///< snorm16 x 4
  gl::Buffer indices_;    ///< uint32
};

/// One drawn instance: slot in the instance table and material, read per instance by the vertex
/// shader.
struct DrawRecord {
  std::uint32_t slot = 0;
  std::uint32_t material = 0;
};

/// One instance drawn into a shadow map: rows of the affine clip_from_mesh, depth in 0..1.
struct LightRecord {
  glm::vec4 clip_from_mesh_row[3];
};

}  // namespace emit::renderer
