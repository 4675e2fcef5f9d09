// SPDX-License-Identifier: Apache-2.0
#include "draw/scene_buffers.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace emit::renderer {
namespace {

/// Normal as snorm16; the fourth is the share of the sky.
using Normal = std::array<std::int16_t, 4>;

std::int16_t snorm16(float value) noexcept {
  return static_cast<std::int16_t>(std::lround(std::clamp(value, -1.0F, 1.0F) * 32767.0F));
}

Normal packed(const glm::vec3& n, float sky_frac) noexcept {
  return {snorm16(n.x), snorm16(n.y), snorm16(n.z), snorm16(sky_frac)};
}

/// Buffer that holds `data`, or one element if it is empty, because GL has no empty storage.
template <class T>
gl::Buffer storage(std::vector<T>& data) {
  if (data.empty()) data.emplace_back();
  return gl::Buffer::from(std::span<const T>(data));
}

}  // namespace

void SceneBuffers::add_meshes(std::span<const scene::Mesh> meshes, std::size_t room) {
  // Append the ranges and indices of each mesh. Its instances follow those of the mesh before.
  std::vector<std::uint32_t> indices;
  std::uint32_t next_instance = 0;
  for (std::uint32_t m = 0; m < meshes.size(); ++m) {
    const scene::Mesh& mesh = meshes[m];
    MeshRange range;
    const auto first = static_cast<std::uint32_t>(indices.size());
    for (const scene::Submesh& submesh : mesh.submeshes) {
      range.submeshes.push_back({first + submesh.first_index, submesh.index_count, submesh.material,
                                 submesh.double_sided, 0, 0});
    }
    std::uint32_t count = 0;
    for (const scene::Submesh& submesh : mesh.submeshes) count += submesh.index_count;
    range.whole = {first, count, 0, !mesh.closed, 0, 0};
    range.first_instance = next_instance;
    while (next_instance < instances_.size() && instances_[next_instance].mesh == m) {
      ++next_instance;
    }
    range.instance_count = next_instance - range.first_instance;
    indices.insert(indices.end(), mesh.indices.begin(), mesh.indices.end());
    meshes_.push_back(std::move(range));
    mesh_bounds_.push_back(mesh.bounds);
  }
  // Send the indices, with room behind them where culling writes.
  if (room == 0) {
    indices_ = storage(indices);
    return;
  }
  first_culled_ = static_cast<std::uint32_t>(indices.size());
  culled_room_ = room;
  indices_ = gl::Buffer::dynamic((indices.size() + room) * sizeof(std::uint32_t));
  indices_.upload(std::span<const std::uint32_t>(indices));
}

void SceneBuffers::upload_culled(std::span<const std::uint32_t> indices) const noexcept {
  EMIT_CHECK_OP(indices.size(), <=, culled_room_);
  indices_.upload(indices, first_culled_);
}

SceneBuffers::SceneBuffers(scene::SceneGeometry geometry)
    : instances_(std::move(geometry.instances)) {
  std::ranges::stable_sort(instances_, {}, &scene::Instance::mesh);
  std::vector<glm::vec3> positions;
  std::vector<Normal> normals;
  std::vector<std::int32_t> base_vertex_of_mesh;
  for (const scene::Mesh& mesh : geometry.meshes) {
    base_vertex_of_mesh.push_back(static_cast<std::int32_t>(positions.size()));
    positions.insert(positions.end(), mesh.positions_m.begin(), mesh.positions_m.end());
    for (const glm::vec3& n : mesh.normals) normals.push_back(packed(n, 0.0F));
  }
  for (const scene::Instance& instance : instances_) {
    base_vertex_.push_back(base_vertex_of_mesh[instance.mesh]);
  }
  positions_ = storage(positions);
  normals_ = storage(normals);
  add_meshes(geometry.meshes, 0);
}

SceneBuffers::SceneBuffers(SampledScene scene, TriangleCull* cull)
    : instances_(std::move(scene.geometry.instances)) {
  std::vector<scene::Mesh>& meshes = scene.geometry.meshes;
  std::vector<ClusterLevels>& levels = scene.levels;
  add_meshes(meshes, cull != nullptr ? TriangleCull::kMaxIndices : 0);
  // Append the clusters and let submeshes refer to them.
  for (std::size_t m = 0; m < meshes.size(); ++m) {
    const std::uint32_t first_index = meshes_[m].whole.first_index;
    for (scene::Cluster& cluster : levels[m].clusters) cluster.first_index += first_index;
    if (cull != nullptr) cull->add(meshes[m], levels[m].clusters, first_index);
    for (std::size_t k = 0; k < meshes_[m].submeshes.size(); ++k) {
      DrawRange& submesh = meshes_[m].submeshes[k];
      submesh.first_cluster =
          static_cast<std::uint32_t>(clusters_.size()) + levels[m].of_submesh[k].first;
      submesh.cluster_count = levels[m].of_submesh[k].count;
    }
    clusters_.insert(clusters_.end(), levels[m].clusters.begin(), levels[m].clusters.end());
    levels_.insert(levels_.end(), levels[m].levels.begin(), levels[m].levels.end());
  }
  if (cull != nullptr) cull->finish();

  // Give each instance vertices of its own: vertex i is sample i.
  std::vector<glm::vec3> positions(scene.sky_frac.size());
  std::vector<Normal> normals(scene.sky_frac.size());
  for (std::size_t i = 0; i < instances_.size(); ++i) {
    const scene::Mesh& mesh = meshes[instances_[i].mesh];
    const std::uint32_t first = scene.first_sample[i];
    base_vertex_.push_back(static_cast<std::int32_t>(first));
    for (std::size_t v = 0; v < mesh.positions_m.size(); ++v) {
      positions[first + v] = mesh.positions_m[v];
      normals[first + v] = packed(mesh.normals[v], scene.sky_frac[first + v]);
    }
  }
  positions_ = storage(positions);
  normals_ = storage(normals);
  if (scene.hull.empty()) return;
  std::vector<Normal> hulls;
  for (const glm::vec4& hull : scene.hull) hulls.push_back(packed(glm::vec3(hull), hull.w));
  hulls_ = storage(hulls);
}

}  // namespace emit::renderer
