// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "history/pose_history.hpp"
#include "draw/cluster_view.hpp"
#include "draw/light_fit.hpp"
#include "draw/scene_buffers.hpp"

namespace emit::renderer {

/// Draws of the camera that share a record: entries [first, first + count) of ViewRanges.
struct ViewDraw {
  std::uint32_t record = 0;
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};
/// Index ranges, as glMultiDrawElementsBaseVertex takes them. Equal lengths.
struct ViewRanges {
  std::vector<std::int32_t> index_count;
  std::vector<const void*> index_offset;  ///< bytes
  std::vector<std::int32_t> base_vertex;
};

/// Instanced draw of one mesh into a shadow map: records [first_record, first_record + count).
struct LightCommand {
  SceneBuffers::DrawRange range;
  std::int32_t base_vertex = 0;
  std::uint32_t first_record = 0;
  std::uint32_t count = 0;
};
struct CommandRange {
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};

/// What is drawn in one frame: per pass the draws that survive culling by their boxes and clusters.
/// Owner: Renderer. Real time: all but the constructor RT-safe (capacity for the worst case is
/// taken there).
class DrawLists {
 public:
  /// `max_passes`: most shadow passes (steps x cascades) of a frame. `cull`: null, or what the
  /// buffers were made with.
  DrawLists(const SceneBuffers& scene, std::span<const std::int32_t> history_of_object,
            std::uint32_t max_passes, TriangleCull* cull);

  /// Starts a frame: all instances at `sim_time_ns` around a camera at `camera_world_m`.
  void begin(const glm::dvec3& camera_world_m, std::int64_t sim_time_ns,
             std::span<const PoseHistory> entities) noexcept;
  /// Draws of the camera into `size_px`, in levels of detail that keep to `limits`; double-sided
  /// ones apart: parts of view_draws().
  void cull_view(const ViewVolume& view, const LevelLimits& limits, const glm::uvec2& size_px,
                 CommandRange& single_sided, CommandRange& double_sided) noexcept;
  /// Triangles that cull_view() would draw under each of `limits`. Precondition: equal lengths.
  void count_triangles(const ViewVolume& view, std::span<const LevelLimits> limits,
                       std::span<std::uint32_t> triangles) noexcept;
  /// Moves entities to their poses at `sample_ns` for the shadow passes that follow. Casters that
  /// travel farther than their own size between the two instants are left out: what shade they cast
  /// lasts a smaller share of the interval than size / way, and one pose would paint all of it.
  /// Returns the box around the moved casters that are left, relative to the camera.
  scene::Aabb pose_casters(std::int64_t sample_ns, std::int64_t begin_ns, std::int64_t end_ns,
                           std::span<const PoseHistory> entities) noexcept;
  [[nodiscard]] CommandRange cull_light(const LightFrustum& frustum) noexcept;

  [[nodiscard]] std::span<const DrawRecord> records() const noexcept { return records_; }
  [[nodiscard]] std::span<const LightRecord> light_records() const noexcept {
    return light_records_;
  }
  [[nodiscard]] std::span<const ViewDraw> view_draws(CommandRange range) const noexcept {
    return std::span(view_draws_).subspan(range.first, range.count);
  }
  [[nodiscard]] const ViewRanges& view_ranges() const noexcept { return view_ranges_; }
  [[nodiscard]] std::span<const LightCommand> light_commands(CommandRange range) const noexcept {
    return std::span(light_commands_).subspan(range.first, range.count);
  }
  [[nodiscard]] std::size_t max_records() const noexcept { return records_.capacity(); }
  [[nodiscard]] std::size_t max_light_records() const noexcept { return light_records_.capacity(); }
  /// Box around everything, relative to the camera, at the frame's instant.
  [[nodiscard]] const scene::Aabb& bounds() const noexcept { return bounds_; }

 private:
  struct Placed {
    glm::dmat4 world_from_mesh{1.0};
    scene::Aabb box_world;
    bool on = true;
    bool in_view = false;
  };
  [[nodiscard]] Placed place(std::uint32_t instance, const glm::dmat4& world_from_mesh,
                             bool on) const noexcept;
  [[nodiscard]] glm::dmat4 relworld_from_mesh(const Placed& placed) const noexcept;
  void find_in_view(const ViewVolume& view) noexcept;
  [[nodiscard]] std::uint32_t indices_in_view(const SceneBuffers::DrawRange& submesh,
                                              const ClusterView& seen) const noexcept;
  /// Appends the index ranges of an instance's submesh that `seen` shows.
  void add_ranges(std::uint32_t instance, const SceneBuffers::DrawRange& submesh,
                  const ClusterView& seen, const glm::mat4& clip_from_mesh) noexcept;
  /// Where one is empty Mesa leaves out what follows, too.
  void drop_empty_ranges() noexcept;
  void add_range(std::uint32_t first_index, std::uint32_t index_count,
                 std::int32_t base_vertex) noexcept;

  const SceneBuffers& scene_;
  TriangleCull* cull_ = nullptr;
  std::vector<std::int32_t> history_of_instance_;  ///< -1: static
  std::vector<std::uint32_t> moving_;              ///< instances of entities
  std::vector<double> size_of_instance_m_;
  std::vector<Placed> view_placed_;   ///< static ones for good
  std::vector<Placed> light_placed_;  ///< for shadow passes
  scene::Aabb static_bounds_world_;
  std::vector<DrawRecord> records_;
  std::vector<LightRecord> light_records_;
  std::vector<ViewDraw> view_draws_;
  ViewRanges view_ranges_;
  std::vector<LightCommand> light_commands_;
  glm::dvec3 camera_world_m_{0.0};
  scene::Aabb bounds_;
};

}  // namespace emit::renderer
