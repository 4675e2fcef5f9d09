// SPDX-License-Identifier: Apache-2.0
#include "draw/draw_lists.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_access.hpp>
#include <limits>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Record of one draw. Normals transform by the cofactors of the matrix. `stand` is null for static
/// objects.
DrawRecord record_of(const glm::dmat4& clip_from_relworld, const glm::dmat4& relworld_from_mesh,
                     std::uint32_t object, std::uint32_t material,
                     const EntityStand* stand) noexcept {
  DrawRecord record{};
  record.params.clip_from_mesh = glm::mat4(clip_from_relworld * relworld_from_mesh);
  const glm::dmat3 m(relworld_from_mesh);
  const std::array<glm::dvec3, 3> cofactors = {glm::cross(m[1], m[2]), glm::cross(m[2], m[0]),
                                               glm::cross(m[0], m[1])};
  for (std::size_t column = 0; column < cofactors.size(); ++column) {
    const float up = stand != nullptr ? stand->up_body[static_cast<glm::length_t>(column)] : 0.0F;
    record.params.normal_from_mesh[column] = glm::vec4(glm::vec3(cofactors[column]), up);
  }
  record.params.material = material;
  record.params.object = object + 1;
  record.params.moves = stand != nullptr ? 1U : 0U;
  record.params.moved_frac = stand != nullptr ? stand->moved_frac : 0.0F;
  return record;
}

/// Lets a draw look up the field of its material. The field lies in the axes of the body of an
/// entity, and in those of the world for everything else. Whole tiles are left out, so that places
/// far from the origin keep their resolution.
void set_clutter(const DrawnClutter& clutter, const glm::dmat4& place_from_mesh,
                 gpu::DrawParams& params) noexcept {
  params.field = clutter.field;
  params.twins = clutter.heat ? 1.0F : 0.0F;
  if (clutter.field == 0) return;
  for (glm::length_t row = 0; row < 3; ++row) {
    const glm::dvec4 tiles = clutter.tiles_per_m * glm::row(place_from_mesh, row);
    const double part = tiles.w - std::floor(tiles.w);
    params.tile_row[row] = glm::vec4(glm::dvec4(tiles.x, tiles.y, tiles.z, part));
  }
}

/// Offset of an index in the index buffer. GL takes the number of bytes as a pointer.
const void* index_address(std::uint32_t first_index) noexcept {
  return reinterpret_cast<const void*>(std::uintptr_t{first_index} * sizeof(std::uint32_t));
}

/// True when the box lies outside one plane of the pyramid.
bool outside(std::span<const glm::dvec3> inward_normals, const glm::dvec3& centre_m,
             const glm::dvec3& half_m) noexcept {
  for (const glm::dvec3& n : inward_normals) {
    if (glm::dot(n, centre_m) + glm::dot(glm::abs(n), half_m) < 0.0) return true;
  }
  return false;
}

/// True when the box lies beside the map of a light frustum.
bool outside(const LightFrustum& frustum, const glm::dvec3& centre_m,
             const glm::dvec3& half_m) noexcept {
  for (glm::length_t axis = 0; axis < 2; ++axis) {
    const glm::dvec3& a = frustum.axes[static_cast<std::size_t>(axis)];
    const double middle_m = glm::dot(a, centre_m) + frustum.offset_m[axis];
    const double reach_m = glm::dot(glm::abs(a), half_m);
    if (middle_m + reach_m < 0.0 || middle_m - reach_m > frustum.extent_m[axis]) return true;
  }
  return false;
}

/// Draws and index ranges of all windows besides those of one whole view.
constexpr std::size_t kMoreWindowRecords = 1024;
constexpr std::size_t kMoreWindowRanges = 16'384;

/// Box moved by a vector; an empty box stays empty.
scene::Aabb shifted(const scene::Aabb& box, const glm::dvec3& by_m) noexcept {
  return box.empty() ? box : scene::Aabb{box.min_m + by_m, box.max_m + by_m};
}

}  // namespace

DrawLists::DrawLists(const SceneBuffers& scene, std::span<const std::int32_t> history_of_object,
                     std::uint32_t max_passes, TriangleCull* cull,
                     std::vector<EntityAnchor> anchors, std::span<const DrawnClutter> clutter)
    : scene_(scene),
      cull_(cull),
      max_passes_(max_passes),
      anchors_(std::move(anchors)),
      clutter_(clutter.begin(), clutter.end()) {
  const auto instances = scene.instances();
  std::size_t view_ranges = 0;
  std::size_t submesh_instances = 0;
  for (const SceneBuffers::MeshRange& mesh : scene.meshes()) {
    submesh_instances += mesh.submeshes.size() * mesh.instance_count;
    for (const SceneBuffers::DrawRange& submesh : mesh.submeshes) {
      // Count every cluster as a range of its own, which is the worst case.
      view_ranges += mesh.instance_count * (1 + submesh.cluster_count);
    }
  }
  // Place all instances and separate entities from static objects.
  for (std::uint32_t i = 0; i < instances.size(); ++i) {
    EMIT_CHECK_OP(instances[i].object, <, history_of_object.size());
    const std::int32_t history = history_of_object[instances[i].object];
    history_of_instance_.push_back(history);
    const glm::dvec3 size = instances[i].world_bounds.empty()
                                ? glm::dvec3(0.0)
                                : instances[i].world_bounds.max_m - instances[i].world_bounds.min_m;
    size_of_instance_m_.push_back(std::max({size.x, size.y, size.z}));
    view_placed_.push_back(place(i, instances[i].world_from_mesh, history < 0));
    if (history >= 0) {
      moving_.push_back(i);
      entities_ = std::max(entities_, static_cast<std::size_t>(history) + 1);
    } else {
      static_bounds_world_.add(view_placed_.back().box_world);
    }
  }
  light_placed_ = view_placed_;
  stands_.resize(entities_);
  EMIT_CHECK(anchors_.empty() || anchors_.size() >= entities_);
  // Allocate for the worst case, so that a frame allocates nothing. Windows of targets have a
  // limit, because the worst case is the whole scene in each.
  if (entities_ > 0) {
    window_records_ = submesh_instances + kMoreWindowRecords;
    window_ranges_ = view_ranges + kMoreWindowRanges;
    windows_.resize(entities_);
    near_window_.reserve(instances.size());
  }
  records_.reserve(std::max<std::size_t>(1, submesh_instances + window_records_));
  light_records_.reserve(std::max<std::size_t>(1, instances.size() * max_passes));
  view_draws_.reserve(submesh_instances + window_records_);
  view_ranges_.index_count.reserve(view_ranges + window_ranges_);
  view_ranges_.index_offset.reserve(view_ranges + window_ranges_);
  view_ranges_.base_vertex.reserve(view_ranges + window_ranges_);
  light_commands_.reserve(instances.size() * max_passes);
}

DrawLists::Placed DrawLists::place(std::uint32_t instance, const glm::dmat4& world_from_mesh,
                                   bool on) const noexcept {
  const std::uint32_t mesh = scene_.instances()[instance].mesh;
  const scene::Aabb box = scene::transformed(scene_.mesh_bounds(mesh), world_from_mesh);
  return {world_from_mesh, box, on && !box.empty(), false};
}

glm::dmat4 DrawLists::relworld_from_mesh(const Placed& placed) const noexcept {
  glm::dmat4 matrix = placed.world_from_mesh;
  matrix[3] -= glm::dvec4(camera_world_m_, 0.0);
  return matrix;
}

void DrawLists::begin(const glm::dvec3& camera_world_m, std::int64_t sim_time_ns,
                      std::span<const PoseHistory> entities) noexcept {
  EMIT_CHECK_OP(entities.size(), >=, entities_);
  camera_world_m_ = camera_world_m;
  light_passes_ = 0;
  records_.clear();
  light_records_.clear();
  view_draws_.clear();
  view_ranges_.index_count.clear();
  view_ranges_.index_offset.clear();
  view_ranges_.base_vertex.clear();
  light_commands_.clear();
  // Move the entities to the instant.
  bounds_ = shifted(static_bounds_world_, -camera_world_m);
  const auto instances = scene_.instances();
  for (const std::uint32_t i : moving_) {
    const PoseHistory& entity = entities[static_cast<std::size_t>(history_of_instance_[i])];
    const TrajectoryState state = entity.at(sim_time_ns);
    const auto m = static_cast<std::size_t>(history_of_instance_[i]);
    if (!anchors_.empty()) stands_[m] = stand_of(state.pose, anchors_[m]);
    view_placed_[i] =
        place(i, scene::world_from_body_matrix(state.pose) * instances[i].body_from_mesh, state.on);
    light_placed_[i] = view_placed_[i];
    if (state.on) bounds_.add(shifted(view_placed_[i].box_world, -camera_world_m));
  }
}

void DrawLists::add_range(std::uint32_t first_index, std::uint32_t index_count,
                          std::int32_t base_vertex) noexcept {
  view_ranges_.index_count.push_back(static_cast<std::int32_t>(index_count));
  view_ranges_.index_offset.push_back(index_address(first_index));
  view_ranges_.base_vertex.push_back(base_vertex);
}

void DrawLists::add_ranges(std::uint32_t instance, const SceneBuffers::DrawRange& submesh,
                           const ClusterView& seen, const glm::mat4& clip_from_mesh,
                           TriangleCull* cull) noexcept {
  const std::int32_t base_vertex = scene_.base_vertex(instance);
  if (submesh.cluster_count == 0) {
    add_range(submesh.first_index, submesh.index_count, base_vertex);
    return;
  }
  std::uint32_t first_index = 0;
  // Join clusters that follow each other in the index buffer to one range.
  std::uint32_t index_count = 0;
  for (std::uint32_t c = submesh.first_cluster; c < submesh.first_cluster + submesh.cluster_count;
       ++c) {
    const scene::Cluster& cluster = scene_.clusters()[c];
    if (!seen.fits(scene_.levels()[c]) || !seen.shows(cluster, submesh.double_sided)) continue;
    if (cull != nullptr && cull->take(cluster, c, clip_from_mesh, !submesh.double_sided)) continue;
    if (index_count > 0 && cluster.first_index != first_index + index_count) {
      add_range(first_index, index_count, base_vertex);
      index_count = 0;
    }
    if (index_count == 0) first_index = cluster.first_index;
    index_count += cluster.index_count;
  }
  if (index_count > 0) add_range(first_index, index_count, base_vertex);
  // Reserve a range for the triangles that culling keeps; cull_view() fills it in.
  const auto range = static_cast<std::uint32_t>(view_ranges_.index_count.size());
  if (cull != nullptr && cull->close(range)) add_range(0, 0, base_vertex);
}

void DrawLists::find_in_view(const ViewVolume& view) noexcept {
  const std::array<glm::dvec3, 5> planes = view_planes(view);
  for (Placed& placed : view_placed_) {
    const scene::Aabb& box = placed.box_world;
    placed.in_view = placed.on && !outside(planes, 0.5 * (box.min_m + box.max_m) - camera_world_m_,
                                           0.5 * (box.max_m - box.min_m));
  }
}

void DrawLists::count_triangles(const ViewVolume& view, std::span<const LevelLimits> limits,
                                std::span<std::uint32_t> triangles) noexcept {
  EMIT_CHECK_OP(limits.size(), ==, triangles.size());
  EMIT_CHECK_OP(limits.size(), >=, std::size_t{1});
  std::ranges::fill(triangles, 0U);
  find_in_view(view);
  for (const SceneBuffers::MeshRange& mesh : scene_.meshes()) {
    for (std::uint32_t i = mesh.first_instance; i < mesh.first_instance + mesh.instance_count;
         ++i) {
      if (!view_placed_[i].in_view) continue;
      ClusterView seen(view, relworld_from_mesh(view_placed_[i]), limits[0]);
      for (const SceneBuffers::DrawRange& submesh : mesh.submeshes) {
        for (std::size_t l = 0; l < limits.size(); ++l) {
          seen.set_limits(limits[l]);
          triangles[l] += indices_in_view(submesh, seen) / 3;
        }
      }
    }
  }
}

std::uint32_t DrawLists::indices_in_view(const SceneBuffers::DrawRange& submesh,
                                         const ClusterView& seen) const noexcept {
  if (submesh.cluster_count == 0) return submesh.index_count;
  std::uint32_t indices = 0;
  for (std::uint32_t c = submesh.first_cluster; c < submesh.first_cluster + submesh.cluster_count;
       ++c) {
    const scene::Cluster& cluster = scene_.clusters()[c];
    if (seen.fits(scene_.levels()[c]) && seen.shows(cluster, submesh.double_sided)) {
      indices += cluster.index_count;
    }
  }
  return indices;
}

void DrawLists::add_draw(std::uint32_t instance, const SceneBuffers::DrawRange& submesh,
                         const ViewVolume& view, const LevelLimits& limits,
                         TriangleCull* cull) noexcept {
  // Append a record and the index ranges of the visible clusters.
  const glm::dmat4 matrix = relworld_from_mesh(view_placed_[instance]);
  const auto first = static_cast<std::uint32_t>(view_ranges_.index_count.size());
  const auto record = static_cast<std::uint32_t>(records_.size());
  const std::int32_t entity = history_of_instance_[instance];
  const EntityStand* stand = entity >= 0 ? &stands_[static_cast<std::size_t>(entity)] : nullptr;
  records_.push_back(record_of(view.clip_from_relworld, matrix, scene_.instances()[instance].object,
                               submesh.material, stand));
  if (!clutter_.empty()) {
    const scene::Instance& placed = scene_.instances()[instance];
    set_clutter(clutter_[submesh.material],
                entity >= 0 ? placed.body_from_mesh : placed.world_from_mesh,
                records_.back().params);
  }
  add_ranges(instance, submesh, ClusterView(view, matrix, limits),
             records_.back().params.clip_from_mesh, cull);
  const auto count = static_cast<std::uint32_t>(view_ranges_.index_count.size()) - first;
  // Drop the record of an instance that shows nothing.
  if (count == 0) {
    records_.pop_back();
    return;
  }
  view_draws_.push_back({record, first, count});
}

std::span<const TargetWindow> DrawLists::find_targets(const ViewVolume& view,
                                                      const glm::uvec2& size_px, double limit_px,
                                                      const LevelLimits& limits) noexcept {
  // Fit a window around every entity that is in front of the camera.
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (std::size_t m = 0; m < windows_.size(); ++m) {
    windows_[m] = {};
    windows_[m].entity = static_cast<std::uint32_t>(m);
    windows_[m].first_px = glm::dvec2(kInfinity);
    windows_[m].end_px = glm::dvec2(-kInfinity);
  }
  for (const std::uint32_t i : moving_) {
    const Placed& placed = view_placed_[i];
    const scene::Instance& instance = scene_.instances()[i];
    TargetWindow& window = windows_[static_cast<std::size_t>(history_of_instance_[i])];
    window.object = instance.object;
    if (!placed.on || window.end_px.x == kInfinity) continue;
    if (!add_box(window, view, relworld_from_mesh(placed), scene_.mesh_bounds(instance.mesh),
                 size_px)) {
      window.end_px = glm::dvec2(kInfinity);  // it is too near, whatever its other meshes are
    }
  }
  // Take those that are small, and list what each window shows.
  std::size_t targets = 0;
  plain_targets_ = 0;
  for (std::size_t m = 0; m < windows_.size(); ++m) {
    TargetWindow window = windows_[m];
    const glm::dvec2 extent_px = window.size_px();
    const double longer_px = std::max(extent_px.x, extent_px.y);
    const bool small = longer_px <= limit_px && std::min(extent_px.x, extent_px.y) > 0.0;
    const bool inside = window.end_px.x > 0.0 && window.end_px.y > 0.0 &&
                        window.first_px.x < size_px.x && window.first_px.y < size_px.y;
    if (!small || !inside) continue;
    window.samples = glm::uvec2(window_samples(longer_px));
    if (targets == EMIT_MAX_TARGETS || !cull_window(window, view, size_px, limits)) {
      ++plain_targets_;
      continue;
    }
    windows_[targets++] = window;
  }
  // Leave them out of the image.
  for (const std::uint32_t i : moving_) {
    view_placed_[i].in_window =
        std::ranges::any_of(std::span(windows_).first(targets), [&](const TargetWindow& window) {
          return static_cast<std::int32_t>(window.entity) == history_of_instance_[i];
        });
  }
  return std::span(windows_).first(targets);
}

bool DrawLists::cull_window(TargetWindow& window, const ViewVolume& view, const glm::uvec2& size_px,
                            LevelLimits limits) noexcept {
  const ViewVolume through = view_through(window, view, size_px);
  // Judge levels of detail by the samples of the window.
  const glm::dvec2 sample_px = window.size_px() / glm::dvec2(window.samples);
  limits.pixel_rad = 2.0 * view.tan_half_h / size_px.x * std::min(sample_px.x, sample_px.y);
  // Find the instances that reach into the window and are not behind the target.
  near_window_.clear();
  const std::array<glm::dvec3, 5> planes = view_planes(through);
  const glm::dvec3& forward = planes.back();
  for (std::uint32_t i = 0; i < view_placed_.size(); ++i) {
    const Placed& placed = view_placed_[i];
    if (!placed.on) continue;
    const glm::dvec3 centre_m =
        0.5 * (placed.box_world.min_m + placed.box_world.max_m) - camera_world_m_;
    const glm::dvec3 half_m = 0.5 * (placed.box_world.max_m - placed.box_world.min_m);
    const double nearest_m = glm::dot(forward, centre_m) - glm::dot(glm::abs(forward), half_m);
    if (nearest_m > window.farthest_m || outside(planes, centre_m, half_m)) continue;
    near_window_.push_back(i);
  }
  // List single-sided submeshes first, then double-sided ones.
  const std::size_t records = records_.size();
  const std::size_t draws = view_draws_.size();
  const std::size_t ranges = view_ranges_.index_count.size();
  for (const bool sheets : {false, true}) {
    CommandRange& range = sheets ? window.double_sided : window.single_sided;
    range.first = static_cast<std::uint32_t>(view_draws_.size());
    for (const std::uint32_t i : near_window_) {
      for (const SceneBuffers::DrawRange& submesh :
           scene_.meshes()[scene_.instances()[i].mesh].submeshes) {
        if (submesh.double_sided != sheets || submesh.index_count == 0) continue;
        if (records_.size() + 1 > window_records_ ||
            view_ranges_.index_count.size() + submesh.cluster_count + 1 > window_ranges_) {
          records_.resize(records);
          view_draws_.resize(draws);
          view_ranges_.index_count.resize(ranges);
          view_ranges_.index_offset.resize(ranges);
          view_ranges_.base_vertex.resize(ranges);
          return false;
        }
        add_draw(i, submesh, through, limits, nullptr);
      }
    }
    range.count = static_cast<std::uint32_t>(view_draws_.size()) - range.first;
  }
  return true;
}

void DrawLists::cull_view(const ViewVolume& view, const LevelLimits& limits,
                          const glm::uvec2& size_px, CommandRange& single_sided,
                          CommandRange& double_sided) noexcept {
  find_in_view(view);
  if (cull_ != nullptr) cull_->begin(size_px);
  // List single-sided submeshes first, then double-sided ones.
  for (const bool sheets : {false, true}) {
    CommandRange& range = sheets ? double_sided : single_sided;
    range.first = static_cast<std::uint32_t>(view_draws_.size());
    for (const SceneBuffers::MeshRange& mesh : scene_.meshes()) {
      for (const SceneBuffers::DrawRange& submesh : mesh.submeshes) {
        if (submesh.double_sided != sheets || submesh.index_count == 0) continue;
        for (std::uint32_t i = mesh.first_instance; i < mesh.first_instance + mesh.instance_count;
             ++i) {
          if (!view_placed_[i].in_view || view_placed_[i].in_window) continue;
          add_draw(i, submesh, view, limits, cull_);
        }
      }
    }
    range.count = static_cast<std::uint32_t>(view_draws_.size()) - range.first;
  }
  // Cull single triangles and fill in the ranges that were reserved for them.
  if (cull_ == nullptr) return;
  cull_->run();
  for (const TriangleCull::Part& part : cull_->parts()) {
    view_ranges_.index_count[part.range] = static_cast<std::int32_t>(part.count);
    view_ranges_.index_offset[part.range] = index_address(scene_.first_culled() + part.first);
  }
  drop_empty_ranges();
}

void DrawLists::drop_empty_ranges() noexcept {
  std::uint32_t used = 0;
  for (ViewDraw& draw : view_draws_) {
    const std::uint32_t first = used;
    for (std::uint32_t i = draw.first; i < draw.first + draw.count; ++i) {
      if (view_ranges_.index_count[i] == 0) continue;
      view_ranges_.index_count[used] = view_ranges_.index_count[i];
      view_ranges_.index_offset[used] = view_ranges_.index_offset[i];
      view_ranges_.base_vertex[used] = view_ranges_.base_vertex[i];
      ++used;
    }
    draw.first = first;
    draw.count = used - first;
  }
}

scene::Aabb DrawLists::pose_entities(std::int64_t sample_ns, std::int64_t begin_ns,
                                     std::int64_t end_ns,
                                     std::span<const PoseHistory> entities) noexcept {
  EMIT_CHECK_OP(entities.size(), >=, entities_);
  scene::Aabb box;
  for (const std::uint32_t i : moving_) {
    const PoseHistory& entity = entities[static_cast<std::size_t>(history_of_instance_[i])];
    const TrajectoryState state = entity.at(sample_ns);
    const bool passing = entity.path_m(begin_ns, end_ns) > size_of_instance_m_[i];
    light_placed_[i] =
        place(i, scene::world_from_body_matrix(state.pose) * scene_.instances()[i].body_from_mesh,
              state.on && !passing);
    if (light_placed_[i].on) box.add(shifted(light_placed_[i].box_world, -camera_world_m_));
  }
  return box;
}

CommandRange DrawLists::cull_light(const LightFrustum& frustum) noexcept {
  EMIT_CHECK_OP(light_passes_, <, max_passes_);
  ++light_passes_;
  // Scale light metres to -1..1 across the map and 0..1 in depth: the rows of clip_from_relworld.
  glm::dvec4 clip_rows[3];
  for (glm::length_t axis = 0; axis < 3; ++axis) {
    const double scale = (axis < 2 ? 2.0 : 1.0) / frustum.extent_m[axis];
    clip_rows[axis] = glm::dvec4(frustum.axes[static_cast<std::size_t>(axis)] * scale,
                                 frustum.offset_m[axis] * scale - (axis < 2 ? 1.0 : 0.0));
  }
  // Append one instanced draw per mesh with the instances that reach the map.
  CommandRange range{static_cast<std::uint32_t>(light_commands_.size()), 0};
  for (const SceneBuffers::MeshRange& mesh : scene_.meshes()) {
    const auto first = static_cast<std::uint32_t>(light_records_.size());
    for (std::uint32_t i = mesh.first_instance; i < mesh.first_instance + mesh.instance_count;
         ++i) {
      const Placed& placed = light_placed_[i];
      const scene::Aabb& box = placed.box_world;
      if (!placed.on || outside(frustum, 0.5 * (box.min_m + box.max_m) - camera_world_m_,
                                0.5 * (box.max_m - box.min_m))) {
        continue;
      }
      const glm::dmat4 matrix = relworld_from_mesh(placed);
      LightRecord& record = light_records_.emplace_back();
      for (int row = 0; row < 3; ++row) {
        record.clip_from_mesh_row[row] = glm::vec4(clip_rows[row] * matrix);
      }
    }
    const auto count = static_cast<std::uint32_t>(light_records_.size()) - first;
    if (count > 0) {
      light_commands_.push_back(
          {mesh.whole, scene_.base_vertex(mesh.first_instance), first, count});
    }
  }
  range.count = static_cast<std::uint32_t>(light_commands_.size()) - range.first;
  return range;
}

}  // namespace emit::renderer
