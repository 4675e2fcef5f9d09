// SPDX-License-Identifier: Apache-2.0
#include "passes/scene_buffers.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace emit::renderer {
namespace {

std::int16_t snorm16(float value) noexcept {
  return static_cast<std::int16_t>(std::lround(std::clamp(value, -1.0F, 1.0F) * 32767.0F));
}

}  // namespace

SceneBuffers::SceneBuffers(scene::SceneGeometry geometry)
    : instances_(std::move(geometry.instances)) {
  std::size_t vertex_count = 0;
  std::size_t index_count = 0;
  for (const scene::Mesh& mesh : geometry.meshes) {
    vertex_count += mesh.positions_m.size();
    index_count += mesh.indices.size();
  }
  std::vector<glm::vec3> positions;
  std::vector<std::array<std::int16_t, 4>> normals;
  std::vector<std::uint32_t> indices;
  positions.reserve(std::max<std::size_t>(vertex_count, 1));
  normals.reserve(std::max<std::size_t>(vertex_count, 1));
  indices.reserve(std::max<std::size_t>(index_count, 1));

  std::stable_sort(
      instances_.begin(), instances_.end(),
      [](const scene::Instance& a, const scene::Instance& b) { return a.mesh < b.mesh; });
  std::uint32_t next_instance = 0;
  for (std::uint32_t m = 0; m < geometry.meshes.size(); ++m) {
    const scene::Mesh& mesh = geometry.meshes[m];
    MeshRange range;
    range.base_vertex = static_cast<std::int32_t>(positions.size());
    const auto first = static_cast<std::uint32_t>(indices.size());
    for (const scene::Submesh& submesh : mesh.submeshes) {
      range.submeshes.push_back({first + submesh.first_index, submesh.index_count, submesh.material,
                                 submesh.double_sided});
    }
    range.whole = {first, static_cast<std::uint32_t>(mesh.indices.size()), 0, !mesh.closed};
    range.first_instance = next_instance;
    while (next_instance < instances_.size() && instances_[next_instance].mesh == m) {
      ++next_instance;
    }
    range.instance_count = next_instance - range.first_instance;

    positions.insert(positions.end(), mesh.positions_m.begin(), mesh.positions_m.end());
    for (const glm::vec3& n : mesh.normals) {
      normals.push_back({snorm16(n.x), snorm16(n.y), snorm16(n.z), 0});
    }
    indices.insert(indices.end(), mesh.indices.begin(), mesh.indices.end());
    meshes_.push_back(std::move(range));
    mesh_bounds_.push_back(mesh.bounds);
  }
  if (positions.empty()) positions.emplace_back(0.0F);  // GL knows no empty storage
  if (normals.empty()) normals.push_back({});
  if (indices.empty()) indices.push_back(0);
  positions_ = gl::Buffer::from(std::span<const glm::vec3>(positions));
  normals_ = gl::Buffer::from(std::span<const std::array<std::int16_t, 4>>(normals));
  indices_ = gl::Buffer::from(std::span<const std::uint32_t>(indices));
}

}  // namespace emit::renderer
