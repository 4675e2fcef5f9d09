// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "draw/cluster_view.hpp"
#include "draw/light_fit.hpp"
#include "draw/scene_buffers.hpp"
#include "draw/target_window.hpp"
#include "history/entity_stand.hpp"
#include "history/pose_history.hpp"

namespace emit::renderer {

/// Draw of the camera: entries [first, first + count) of ViewRanges with one record.
struct ViewDraw {
  std::uint32_t record = 0;  ///< entry of DrawLists::records()
  std::uint32_t first = 0;
  std::uint32_t count = 0;
};
/// Index ranges as glMultiDrawElementsBaseVertex takes them. The vectors have equal lengths.
struct ViewRanges {
  std::vector<std::int32_t> index_count;
  std::vector<const void*> index_offset;  ///< bytes from the start of the index buffer
  std::vector<std::int32_t> base_vertex;
};

/// Instanced draw of one mesh into a shadow map. Its instances have the light records
/// [first_record, first_record + count).
struct LightCommand {
  SceneBuffers::DrawRange range;
  std::int32_t base_vertex = 0;
  std::uint32_t first_record = 0;
  std::uint32_t count = 0;
};
/// The type says how draws of a material use the field of its clutter.
struct DrawnClutter {
  std::uint32_t field = 0;  ///< 1 + number of the field; 0: the material does not vary
  double tiles_per_m = 0.0;
  bool heat = false;  ///< its samples have twins
};

/// Draws of one frame. For each pass it holds the draws that culling by boxes and clusters leaves.
/// Owner: DrawnScene. Thread: the one of the renderer. Real time: the constructor allocates the
/// capacity for the worst case; all other functions are RT-safe.
class DrawLists {
 public:
  /// `history_of_object` holds the entity of each object, an index of the spans that begin() takes,
  /// or -1 for a static object. `max_passes` is the largest number of shadow passes (steps x
  /// cascades) of a frame. `cull` is null or the object that the buffers were made with. The lists
  /// keep references to `scene` and `cull`. `anchors` are the poses, by entity, for which the views
  /// of the samples were found; they are empty where vertices are no samples. `clutter` is by
  /// material; empty: none varies.
  /// @pre history_of_object has an entry for the object of every instance.
  DrawLists(const SceneBuffers& scene, std::span<const std::int32_t> history_of_object,
            std::uint32_t max_passes, TriangleCull* cull, std::vector<EntityAnchor> anchors = {},
            std::span<const DrawnClutter> clutter = {});

  /// Starts a frame. Places all instances at `sim_time_ns` around a camera at `camera_world_m`.
  /// @pre `entities` has an entry for every entity of the constructor.
  void begin(const glm::dvec3& camera_world_m, std::int64_t sim_time_ns,
             std::span<const PoseHistory> entities) noexcept;
  /// Finds the entities whose image is at most `limit_px` wide and high in an output image of
  /// `size_px`, and lists the draws of a window for each, at the levels of detail of full quality
  /// in its samples. cull_view() then leaves these entities out. Of more than EMIT_MAX_TARGETS, or
  /// where the memory of the lists is used up, the rest stays in the image; plain_targets() counts
  /// them. The result is valid until the next begin().
  std::span<const TargetWindow> find_targets(const ViewVolume& view, const glm::uvec2& size_px,
                                             double limit_px, const LevelLimits& limits) noexcept;
  /// Returns the number of small entities in the image that got no window from find_targets().
  [[nodiscard]] std::uint32_t plain_targets() const noexcept { return plain_targets_; }
  /// Lists the draws of the camera into an image of `size_px`, at the levels of detail that keep to
  /// `limits`. Single-sided and double-sided draws are separate parts of view_draws().
  void cull_view(const ViewVolume& view, const LevelLimits& limits, const glm::uvec2& size_px,
                 CommandRange& single_sided, CommandRange& double_sided) noexcept;
  /// Counts the triangles that cull_view() would draw under each of `limits`.
  /// @pre limits.size() == triangles.size(), and there is at least one.
  void count_triangles(const ViewVolume& view, std::span<const LevelLimits> limits,
                       std::span<std::uint32_t> triangles) noexcept;
  /// Moves entities to their poses at `sample_ns` for the shadow passes that follow. An entity that
  /// travels farther than its own size between `begin_ns` and `end_ns` is left out: its shade lasts
  /// a smaller share of the interval than size / way, and one pose would shade the whole interval.
  /// Returns the box around the entities that cast shadows, relative to the camera, in metres.
  /// @pre `entities` has an entry for every entity of the constructor.
  scene::Aabb pose_entities(std::int64_t sample_ns, std::int64_t begin_ns, std::int64_t end_ns,
                            std::span<const PoseHistory> entities) noexcept;
  /// Lists the draws into the shadow map of a light frustum. The result is a part of
  /// light_commands().
  /// @pre At most `max_passes` calls in a frame.
  [[nodiscard]] CommandRange cull_light(const LightFrustum& frustum) noexcept;

  /// Records of the camera's draws.
  [[nodiscard]] std::span<const DrawRecord> records() const noexcept { return records_; }
  /// Records of all instances in shadow maps.
  [[nodiscard]] std::span<const LightRecord> light_records() const noexcept {
    return light_records_;
  }
  /// Draws of the camera in a part that cull_view() returned.
  [[nodiscard]] std::span<const ViewDraw> view_draws(CommandRange range) const noexcept {
    return std::span(view_draws_).subspan(range.first, range.count);
  }
  /// Index ranges of all draws of the camera.
  [[nodiscard]] const ViewRanges& view_ranges() const noexcept { return view_ranges_; }
  /// Draws into a shadow map in a part that cull_light() returned.
  [[nodiscard]] std::span<const LightCommand> light_commands(CommandRange range) const noexcept {
    return std::span(light_commands_).subspan(range.first, range.count);
  }
  /// Largest numbers of records and of light records of a frame.
  [[nodiscard]] std::size_t max_records() const noexcept { return records_.capacity(); }
  [[nodiscard]] std::size_t max_light_records() const noexcept { return light_records_.capacity(); }
  /// Box around all instances at the instant of the frame, relative to the camera, in metres.
  [[nodiscard]] const scene::Aabb& bounds() const noexcept { return bounds_; }

 private:
  /// Instance at an instant.
  struct Placed {
    glm::dmat4 world_from_mesh{1.0};
    scene::Aabb box_world;
    bool on = true;  ///< false: it is not in the scene, or it has no vertices
    bool in_view = false;
    bool in_window = false;  ///< it belongs to a small target
  };
  /// Instance at a placement.
  [[nodiscard]] Placed place(std::uint32_t instance, const glm::dmat4& world_from_mesh,
                             bool on) const noexcept;
  [[nodiscard]] glm::dmat4 relworld_from_mesh(const Placed& placed) const noexcept;
  /// Sets Placed::in_view of all instances.
  void find_in_view(const ViewVolume& view) noexcept;
  /// Lists the draws of a window. Returns false when they do not fit into the lists.
  [[nodiscard]] bool cull_window(TargetWindow& window, const ViewVolume& view,
                                 const glm::uvec2& size_px, LevelLimits limits) noexcept;
  /// Appends the draw of an instance's submesh that `view` shows, with culling of triangles or
  /// without.
  void add_draw(std::uint32_t instance, const SceneBuffers::DrawRange& submesh,
                const ViewVolume& view, const LevelLimits& limits, TriangleCull* cull) noexcept;
  /// Number of indices of a submesh that `seen` shows.
  [[nodiscard]] std::uint32_t indices_in_view(const SceneBuffers::DrawRange& submesh,
                                              const ClusterView& seen) const noexcept;
  /// Appends the index ranges of an instance's submesh that `seen` shows.
  void add_ranges(std::uint32_t instance, const SceneBuffers::DrawRange& submesh,
                  const ClusterView& seen, const glm::mat4& clip_from_mesh,
                  TriangleCull* cull) noexcept;
  /// Removes empty ranges, because Mesa also leaves out the ranges behind an empty one.
  void drop_empty_ranges() noexcept;
  void add_range(std::uint32_t first_index, std::uint32_t index_count,
                 std::int32_t base_vertex) noexcept;

  const SceneBuffers& scene_;
  TriangleCull* cull_ = nullptr;
  std::size_t entities_ = 0;                       ///< entities that begin() needs
  std::size_t light_passes_ = 0;                   ///< shadow passes of the frame so far
  std::size_t max_passes_ = 0;                     ///< largest number of shadow passes
  std::vector<std::int32_t> history_of_instance_;  ///< entity of each instance; -1: static
  std::vector<std::uint32_t> moving_;              ///< instances of entities
  std::vector<double> size_of_instance_m_;         ///< longest side of its box
  std::vector<Placed> view_placed_;  ///< one per instance, for the camera; static ones never change
  std::vector<Placed> light_placed_;   ///< one per instance, for the shadow passes that follow
  std::vector<EntityAnchor> anchors_;  ///< by entity, or empty
  std::vector<EntityStand> stands_;    ///< by entity, at the instant of the frame
  std::uint32_t plain_targets_ = 0;
  std::vector<TargetWindow> windows_;  ///< by entity; find_targets() moves the targets to the front
  std::vector<std::uint32_t> near_window_;  ///< instances that a window may show
  std::size_t window_ranges_ = 0;           ///< entries of view_ranges_ that windows may use
  std::size_t window_records_ = 0;          ///< entries of records_ that windows may use
  scene::Aabb static_bounds_world_;
  std::vector<DrawRecord> records_;
  std::vector<DrawnClutter> clutter_;  ///< by material; empty: none varies
  std::vector<LightRecord> light_records_;
  std::vector<ViewDraw> view_draws_;
  ViewRanges view_ranges_;
  std::vector<LightCommand> light_commands_;
  glm::dvec3 camera_world_m_{0.0};
  scene::Aabb bounds_;
};

}  // namespace emit::renderer
