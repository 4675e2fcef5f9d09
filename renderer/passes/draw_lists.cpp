// SPDX-License-Identifier: Apache-2.0
#include "passes/draw_lists.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <cmath>

namespace emit::renderer {
namespace {

/// A float holds whole numbers up to 2^24 only: large ones go in two parts.
constexpr std::int64_t kSampleUnit = 4096;

gpu::InstanceParams params_from(const glm::dmat4& relworld_from_mesh, std::uint32_t object,
                                std::int64_t sample_offset) noexcept {
  const std::int64_t units = sample_offset / kSampleUnit;
  const auto row = [&relworld_from_mesh](glm::length_t r) {
    return glm::vec4(
        static_cast<float>(relworld_from_mesh[0][r]), static_cast<float>(relworld_from_mesh[1][r]),
        static_cast<float>(relworld_from_mesh[2][r]), static_cast<float>(relworld_from_mesh[3][r]));
  };
  return {row(0), row(1), row(2),
          glm::vec4(static_cast<float>(object + 1), static_cast<float>(units),
                    static_cast<float>(sample_offset - units * kSampleUnit), 0.0F)};
}

/// True when the box lies outside one plane of the pyramid.
bool outside(const ViewVolume& view, const scene::Aabb& box) noexcept {
  const glm::dmat3& m = view.relworld_from_sensor;
  const glm::dvec3 normals[] = {
      m * glm::dvec3(1.0, 0.0, view.tan_half_h), m * glm::dvec3(-1.0, 0.0, view.tan_half_h),
      m * glm::dvec3(0.0, 1.0, view.tan_half_v), m * glm::dvec3(0.0, -1.0, view.tan_half_v),
      m * glm::dvec3(0.0, 0.0, 1.0)};
  const glm::dvec3 centre = 0.5 * (box.min_m + box.max_m);
  const glm::dvec3 half = 0.5 * (box.max_m - box.min_m);
  for (const glm::dvec3& n : normals) {
    if (glm::dot(n, centre) + glm::dot(glm::abs(n), half) < 0.0) return true;
  }
  return false;
}

bool outside(const LightFrustum& frustum, const scene::Aabb& box) noexcept {
  const glm::dvec3 centre = 0.5 * (box.min_m + box.max_m);
  const glm::dvec3 half = 0.5 * (box.max_m - box.min_m);
  for (glm::length_t axis = 0; axis < 2; ++axis) {
    const glm::dvec3& a = frustum.axes[static_cast<std::size_t>(axis)];
    const double middle_m = glm::dot(a, centre) + frustum.offset_m[axis];
    const double reach_m = glm::dot(glm::abs(a), half);
    if (middle_m + reach_m < 0.0 || middle_m - reach_m > frustum.extent_m[axis]) return true;
  }
  return false;
}

}  // namespace

DrawLists::DrawLists(const SceneBuffers& scene, std::span<const std::int32_t> history_of_object,
                     std::uint32_t max_passes, std::vector<std::uint32_t> first_sample)
    : scene_(scene), sample_offset_(scene.instances().size(), 0) {
  for (std::size_t i = 0; i < first_sample.size(); ++i) {
    sample_offset_[i] = static_cast<std::int64_t>(first_sample[i]) -
                        scene.meshes()[scene.instances()[i].mesh].base_vertex;
  }
  const auto instances = scene.instances();
  std::size_t submeshes = 0;
  std::size_t submesh_instances = 0;
  for (const SceneBuffers::MeshRange& mesh : scene.meshes()) {
    submeshes += mesh.submeshes.size();
    submesh_instances += mesh.submeshes.size() * mesh.instance_count;
  }
  for (std::uint32_t i = 0; i < instances.size(); ++i) {
    const std::int32_t history = history_of_object[instances[i].object];
    history_of_instance_.push_back(history);
    if (history >= 0) moving_.push_back(i);
    const glm::dvec3 size = instances[i].world_bounds.empty()
                                ? glm::dvec3(0.0)
                                : instances[i].world_bounds.max_m - instances[i].world_bounds.min_m;
    size_of_instance_m_.push_back(std::max({size.x, size.y, size.z}));
  }
  view_placed_.resize(instances.size());
  light_placed_.resize(instances.size());
  params_.reserve(std::max<std::size_t>(1, instances.size()));
  records_.reserve(std::max<std::size_t>(1, submesh_instances));
  light_records_.reserve(std::max<std::size_t>(1, instances.size() * max_passes));
  commands_.reserve(submeshes + scene.meshes().size() * max_passes);
}

DrawLists::Placed DrawLists::place(std::uint32_t instance, const glm::dmat4& world_from_mesh,
                                   bool on) const noexcept {
  glm::dmat4 relworld_from_mesh = world_from_mesh;
  relworld_from_mesh[3] -= glm::dvec4(camera_world_m_, 0.0);
  const std::uint32_t mesh = scene_.instances()[instance].mesh;
  return {relworld_from_mesh, scene::transformed(scene_.mesh_bounds(mesh), relworld_from_mesh), on};
}

void DrawLists::begin(const glm::dvec3& camera_world_m, std::int64_t sim_time_ns,
                      std::span<const PoseHistory> entities) noexcept {
  camera_world_m_ = camera_world_m;
  params_.clear();
  records_.clear();
  light_records_.clear();
  commands_.clear();
  bounds_ = {};
  const auto instances = scene_.instances();
  for (std::uint32_t i = 0; i < instances.size(); ++i) {
    const std::int32_t history = history_of_instance_[i];
    if (history < 0) {
      view_placed_[i] = place(i, instances[i].world_from_mesh, true);
    } else {
      const TrajectoryState state = entities[static_cast<std::size_t>(history)].at(sim_time_ns);
      view_placed_[i] = place(
          i, scene::world_from_body_matrix(state.pose) * instances[i].body_from_mesh, state.on);
    }
    params_.push_back(
        params_from(view_placed_[i].relworld_from_mesh, instances[i].object, sample_offset_[i]));
    if (view_placed_[i].on) bounds_.add(view_placed_[i].box);
  }
  light_placed_ = view_placed_;
}

void DrawLists::cull_view(const ViewVolume& view, CommandRange& single_sided,
                          CommandRange& double_sided) noexcept {
  for (const bool sheets : {false, true}) {
    CommandRange& range = sheets ? double_sided : single_sided;
    range.first = static_cast<std::uint32_t>(commands_.size());
    for (const SceneBuffers::MeshRange& mesh : scene_.meshes()) {
      for (const SceneBuffers::DrawRange& submesh : mesh.submeshes) {
        if (submesh.double_sided != sheets) continue;
        const auto first = static_cast<std::uint32_t>(records_.size());
        for (std::uint32_t i = 0; i < mesh.instance_count; ++i) {
          const Placed& placed = view_placed_[mesh.first_instance + i];
          if (placed.on && !outside(view, placed.box)) {
            records_.push_back({mesh.first_instance + i, submesh.material});
          }
        }
        const auto count = static_cast<std::uint32_t>(records_.size()) - first;
        if (count > 0) commands_.push_back({submesh, mesh.base_vertex, first, count});
      }
    }
    range.count = static_cast<std::uint32_t>(commands_.size()) - range.first;
  }
}

scene::Aabb DrawLists::pose_casters(std::int64_t sample_ns, std::int64_t begin_ns,
                                    std::int64_t end_ns,
                                    std::span<const PoseHistory> entities) noexcept {
  scene::Aabb box;
  for (const std::uint32_t i : moving_) {
    const PoseHistory& entity = entities[static_cast<std::size_t>(history_of_instance_[i])];
    const TrajectoryState state = entity.at(sample_ns);
    const bool passing = entity.path_m(begin_ns, end_ns) > size_of_instance_m_[i];
    light_placed_[i] =
        place(i, scene::world_from_body_matrix(state.pose) * scene_.instances()[i].body_from_mesh,
              state.on && !passing);
    if (light_placed_[i].on) box.add(light_placed_[i].box);
  }
  return box;
}

CommandRange DrawLists::cull_light(const LightFrustum& frustum) noexcept {
  // Rows of clip_from_relworld: light metres scaled to -1..1 across the map and 0..1 in depth.
  glm::dvec4 clip_rows[3];
  for (glm::length_t axis = 0; axis < 3; ++axis) {
    const double scale = (axis < 2 ? 2.0 : 1.0) / frustum.extent_m[axis];
    clip_rows[axis] = glm::dvec4(frustum.axes[static_cast<std::size_t>(axis)] * scale,
                                 frustum.offset_m[axis] * scale - (axis < 2 ? 1.0 : 0.0));
  }
  CommandRange range{static_cast<std::uint32_t>(commands_.size()), 0};
  for (const SceneBuffers::MeshRange& mesh : scene_.meshes()) {
    const auto first = static_cast<std::uint32_t>(light_records_.size());
    for (std::uint32_t i = 0; i < mesh.instance_count; ++i) {
      const Placed& placed = light_placed_[mesh.first_instance + i];
      if (!placed.on || outside(frustum, placed.box)) continue;
      LightRecord& record = light_records_.emplace_back();
      for (int row = 0; row < 3; ++row) {
        record.clip_from_mesh_row[row] = glm::vec4(clip_rows[row] * placed.relworld_from_mesh);
      }
    }
    const auto count = static_cast<std::uint32_t>(light_records_.size()) - first;
    if (count > 0) commands_.push_back({mesh.whole, mesh.base_vertex, first, count});
  }
  range.count = static_cast<std::uint32_t>(commands_.size()) - range.first;
  return range;
}

}  // namespace emit::renderer
