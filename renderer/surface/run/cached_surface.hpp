// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "history/step_plan.hpp"
#include "history/surface_history.hpp"
#include "surface/heat/surface_node.hpp"
#include "surface/model/entity_exitance.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/ray_offsets.hpp"
#include "surface/run/local_steps.hpp"
#include "surface/run/surface_step.hpp"
#include "surface/shade/entity_shadow_maps.hpp"
#include "surface/shade/exposure_tiles.hpp"
#include "surface/state/state_file.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Scene whose vertices are samples; every instance has its own samples.
struct SampledScene {
  /// Instances grouped by mesh. The indices of a mesh hold its submeshes, then the triangles of
  /// coarser levels of detail.
  scene::SceneGeometry geometry;
  std::vector<ClusterLevels> levels;        ///< levels of detail by mesh
  std::vector<std::uint32_t> first_sample;  ///< by instance: sample of its mesh's first vertex
  std::vector<float> sky_frac;              ///< by sample: share of the hemisphere that shows sky
};

/// The thermal method `cached`: temperatures live on samples of the surface. Time advances in
/// intervals of thermal.first_step_s, which are cut where the script moves an entity or the weather
/// changes. Frames interpolate between the two nodes of the current interval. Meanwhile the next
/// interval is computed, in each frame as much as sim time has moved. No frame does more than its
/// share, and the result depends on the inputs alone. LocalSteps follows entities that the host
/// moves. After the host has changed the weather, the current interval is computed anew, over
/// several frames, before the next one.
///
/// Owner: Renderer. Thread: the renderer's; computes on all cores. Real time: advance() allocates
/// nothing, on any thread; everything else is setup.
class CachedSurface {
 public:
  /// Weather and poses. Both must outlive the call that gets them.
  struct Inputs {
    const Environment& environment;
    std::span<const PoseHistory> entities;
  };

  /// Makes the surface without samples. `entity_of_object` holds the index of each object's
  /// PoseHistory, or -1 for static objects. `networks` are by material, and empty for emit2014.
  /// `detail` is given if meshes were simplified. Errors: config (an entity without triangles),
  /// those of CasterRays.
  [[nodiscard]] static physics::Result<std::unique_ptr<CachedSurface>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<std::int32_t> entity_of_object, std::span<const FosterMaterial> networks,
      double reference_k, std::optional<SurfaceDetail> detail = std::nullopt);

  /// The state file (thermal.state_file), and the requirements on the state in it.
  struct Saved {
    std::filesystem::path file;
    StateKey key{};  ///< hashes of the scenario, from scenario_key()
    /// The flag is true at the start of a run: a file that does not fit is an error, a missing file
    /// is written, and an earlier state is advanced. It is false after a jump of sim time: the file
    /// is used only if it holds the very instant, and is left as it is.
    bool start = true;
    /// Returns true if a surface that was refined for `eyes` will do for the first frame.
    std::function<bool(std::span<const RefineView::Eye> eyes)> fits_camera = {};
  };

  /// Samples the surface for `now_ns`, or takes it from `saved` and advances it to there. It also
  /// computes the interval that holds `now_ns`, and brings `plan` and `history` there. Setup:
  /// seconds. Errors: those of build_surface_model(), read_state() and write_state();
  /// config (the saved surface was refined for another camera).
  [[nodiscard]] physics::Result<void> prepare(std::int64_t now_ns, const RefineView& view,
                                              const Inputs& inputs, StepPlan& plan,
                                              SurfaceHistory& history,
                                              const std::optional<Saved>& saved,
                                              const SurfaceProgress& progress);

  /// Returns true if frames at `now_ns` need prepare() first: sim time went back behind the current
  /// interval, or it jumped far ahead of it.
  [[nodiscard]] bool stale(std::int64_t now_ns) const noexcept;

  /// Brings the samples to `now_ns`. @pre !stale(now_ns)
  void advance(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;

  /// Place of the time of the latest advance() between the two nodes, 0 to 1.
  [[nodiscard]] float fraction() const noexcept { return fraction_; }
  /// Values at the nodes before now (0) and after now (1), and at the node that is being computed
  /// (2).
  [[nodiscard]] std::span<const SampleVertex> vertices(std::size_t node) const noexcept {
    return nodes_[storage(node)].vertices;
  }
  /// Index of the storage that node 0, 1 or 2 has. It rotates when an interval ends.
  [[nodiscard]] std::size_t storage(std::size_t node) const noexcept { return (ring_ + node) % 3; }
  /// Ranges of vertices in a storage that have changed since forget_changes().
  [[nodiscard]] std::span<const ChangedRanges::Range> changes(std::size_t storage) const noexcept {
    return nodes_[storage].changes.ranges();
  }
  /// Forgets the changes of all nodes and of shade().
  void forget_changes() noexcept;
  /// Temperature of the surroundings in K; empty if the thermal model does not compute it.
  [[nodiscard]] std::optional<double> surroundings_now_k() const noexcept;
  /// Returns true while some samples lack a change of the weather by the host that matters.
  [[nodiscard]] bool lags() const noexcept { return lags_; }
  /// Number of blocks of samples that do not follow the intervals, because the host moves an
  /// entity. @pre prepare()
  [[nodiscard]] std::size_t local_blocks() const noexcept {
    EMIT_CHECK(local_.has_value());
    return local_->active();
  }

  /// Exposure tiles: recent shade of entities, finer than samples lie. @pre prepare()
  [[nodiscard]] const ExposureTiles& shade() const noexcept {
    EMIT_CHECK(shade_.has_value());
    return *shade_;
  }
  /// Entity shadow depth maps.
  [[nodiscard]] const EntityShadowMaps& shadow_maps() const noexcept { return shadow_maps_; }
  /// Space that an entity may shade, down to static surfaces.
  struct Shadow {
    bool on = false;  ///< the entity is there and the sun is up
    /// Points whose convex hull holds everything that is shaded, rel.
    std::array<glm::vec3, 12> hull_m;
  };
  [[nodiscard]] std::span<const Shadow> shadows() const noexcept { return shadows_; }
  /// Finds shadows() for the poses of the entities at `drawn_ns` and the sun of `sun_ns`.
  /// @pre prepare()
  void place_shadows(std::int64_t drawn_ns, std::int64_t sun_ns, const Inputs& inputs) noexcept;
  /// Brings the shadow depth map of an entity up to date, and places it. Call it for shadows that
  /// show in the frame.
  /// @pre place_shadows(); shadows()[entity].on
  [[nodiscard]] PlacedShadowMap cast_shadow(std::size_t entity) noexcept;
  /// Returns true if, since place_shadows(), more entities had turned than one frame can make maps
  /// for. Then some shadow has an outline of a while ago.
  [[nodiscard]] bool stale_shadow() const noexcept { return stale_shadow_; }
  /// Origin of rel in the world, m.
  [[nodiscard]] const glm::dvec3& origin_world_m() const noexcept {
    return rays().origin_world_m();
  }

  /// The samples. Their states have moved into the nodes. @pre prepare()
  [[nodiscard]] const SurfaceModel& model() const noexcept {
    EMIT_CHECK(model_.has_value());
    return *model_;
  }
  /// Main memory of the samples in bytes, without the meshes between them.
  [[nodiscard]] std::uint64_t sample_bytes() const noexcept;
  /// Takes the refined meshes as a scene whose instances are grouped by mesh. Their levels of
  /// detail leave the model. @pre prepare(), and no call since.
  [[nodiscard]] SampledScene take_drawn_scene();

 private:
  CachedSurface(const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
                std::vector<std::int32_t> entity_of_object,
                std::span<const FosterMaterial> networks, CasterRays places,
                std::optional<SurfaceDetail> detail, double reference_k);

  /// Input of making a model, for the start of the first interval shown.
  struct ModelWork {
    std::int64_t start_ns = 0;
    const RefineView& view;
    const Inputs& inputs;
    StepPlan& plan;
    SurfaceHistory& history;
    SurfaceModelOptions options;
    const SurfaceProgress& progress;
  };
  /// A model, and whether the state file is to be written from it.
  struct MadeModel {
    SurfaceModel model;
    bool to_save = false;
  };
  /// Takes a model from the state file, or makes it without levels of detail.
  [[nodiscard]] physics::Result<MadeModel> make_model(const ModelWork& work,
                                                      const std::optional<Saved>& saved) const;
  /// Makes the levels of detail for the temperatures of the first frame.
  /// @pre Nodes 0 and 1 are complete, and node 0 holds the outputs of the model.
  [[nodiscard]] std::vector<DrawnMesh> make_drawn_meshes() const;
  /// Writes the model with the states and outputs of node 0, which it lends to the model.
  [[nodiscard]] physics::Result<void> save(const ModelWork& work, const Saved& saved);
  /// Returns the share of the sun at a drawn sample in the first frame, without the shade of
  /// entities on static surfaces, which exposure tiles and shadow maps add.
  [[nodiscard]] float first_sun_frac(std::uint32_t sample) const;
  /// Samples the surface and integrates its history.
  [[nodiscard]] physics::Result<SurfaceModel> warm_up(const ModelWork& work) const;
  /// Returns the key of the state at the start of `work`: the scenario's and the host's input.
  [[nodiscard]] static StateKey key_of(const ModelWork& work, const Saved& saved);
  /// Returns the saved model. It is empty if it does not fit and this is no error.
  [[nodiscard]] physics::Result<std::optional<SurfaceModel>> take_saved(const ModelWork& work,
                                                                        const Saved& saved) const;
  [[nodiscard]] SurfaceInputs surface_inputs(const HistoryRecord& record,
                                             const SurfaceHistory& history,
                                             std::span<const std::vector<glm::vec3>> ways_m) const;
  [[nodiscard]] RecordInputs record_inputs(const Inputs& inputs) const {
    return {heat_, inputs.environment, inputs.entities, *interval_rays_, rays().origin_world_m()};
  }
  /// Fills entities_now_ with the poses of the entities.
  void place_entities(std::int64_t now_ns, std::span<const PoseHistory> entities);
  /// Places of each entity from `from_ns` on, by its script, rel.
  [[nodiscard]] std::vector<std::vector<glm::vec3>> ways_m(
      std::int64_t from_ns, std::span<const PoseHistory> entities) const;
  /// Makes the exposure tiles and the first shadow depth maps.
  void begin_shade(std::int64_t now_ns, const Inputs& inputs);
  /// Fills forcing, gains and rays from `node` to the next node, of which nothing is computed yet.
  void begin_interval(std::size_t node, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Advances the samples up to `last` from `node` to the next one.
  void compute(std::size_t node, std::uint32_t last) noexcept;
  void rotate() noexcept { ring_ = (ring_ + 1) % 3; }
  /// Chooses the time of the node after `node`, and begins the interval between them.
  void begin_anew(std::size_t node, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Time of the node after `from_ns`: the next instant of the grid, or an earlier one after
  /// `now_ns` at which an entity or the weather changes.
  [[nodiscard]] std::int64_t next_node_ns(std::int64_t from_ns, std::int64_t now_ns,
                                          const Inputs& inputs) const noexcept;
  /// Moves node 0 to `event_ns`, to the values between it and node 1. The vertices of node 1 move
  /// to `end_ns` along the same line; its states and outputs stay, because they are computed anew.
  void cut_at(std::int64_t event_ns, std::int64_t end_ns) noexcept;
  /// Reacts to weather that the host has changed.
  void take_weather(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Begins to compute node 1 anew over the next frames, because the weather has changed at
  /// `event_ns`.
  void begin_renewal(std::int64_t event_ns, std::int64_t now_ns, const Inputs& inputs,
                     SurfaceHistory& history) noexcept;
  /// Finishes node 1 and begins the next interval.
  void end_renewal(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Number of samples that are to be computed by `now_ns`.
  [[nodiscard]] std::uint32_t share_at(std::int64_t now_ns) const noexcept;
  /// Earliest time whose weather the host has changed since the last call; kNoChange if there is
  /// none.
  [[nodiscard]] std::int64_t take_weather_change(const Environment& environment) noexcept;
  static constexpr std::int64_t kNoChange = std::numeric_limits<std::int64_t>::max();
  /// Rays against everything that shades, as loaded.
  [[nodiscard]] const CasterRays& rays() const noexcept {
    return detail_ ? detail_->rays() : places_;
  }
  [[nodiscard]] SurfaceNode& node(std::size_t index) noexcept { return nodes_[storage(index)]; }
  [[nodiscard]] const SurfaceNode& node(std::size_t index) const noexcept {
    return nodes_[storage(index)];
  }
  [[nodiscard]] SurfaceStep step() const noexcept {
    return {model_->samples, heat_, rays(), offsets_, faces_};
  }
  [[nodiscard]] LocalSteps::Inputs local_inputs(const Inputs& inputs, SurfaceHistory& history,
                                                const SurfaceStep& step) noexcept {
    return {inputs.environment, inputs.entities, history, step, workers_, rays().origin_world_m()};
  }
  [[nodiscard]] LocalSteps::Window window() noexcept {
    return {node(0),   node(1),         node(2),  renewing_ ? 0U : done_,
            renewing_, *interval_rays_, interval_};
  }

  scene::SceneGeometry geometry_;
  std::vector<scene::Material> materials_;
  scene::ThermalOptions options_;
  std::vector<std::int32_t> entity_of_object_;
  CasterRays places_;
  std::optional<SurfaceDetail> detail_;
  bool extended_ = false;  ///< thermal.model foster
  SampleHeat heat_;
  std::optional<IntervalRays> interval_rays_;
  HeatInterval interval_;
  threads::WorkerPool workers_;
  RayOffsets offsets_;
  std::vector<EntityPlacement> entities_now_;
  std::optional<SurfaceModel> model_;
  EntityExitance exitance_;
  std::vector<EntityFaces> faces_;  ///< by entity, at the node with which the interval begins

  std::optional<LocalSteps> local_;
  EntityShadowMaps shadow_maps_;
  std::vector<Shadow> shadows_;
  glm::vec3 to_sun_{0.0F, 0.0F, 1.0F};  ///< unit vector to the sun of shadows()
  bool stale_shadow_ = false;
  std::optional<ExposureTiles> shade_;

  std::array<SurfaceNode, 3> nodes_;
  std::size_t ring_ = 0;
  std::uint32_t done_ = 0;           ///< computed samples of the node that is being computed
  std::int64_t share_begin_ns_ = 0;  ///< begin of the time in which the samples are computed
  std::int64_t share_end_ns_ = 0;    ///< end of that time
  std::int64_t last_now_ns_ = 0;
  bool renewing_ = false;  ///< node 1 is being computed, because the weather has changed
  bool lags_ = false;      ///< a change that matters is not known to all samples
  /// Earliest change of the weather that is not taken in.
  std::int64_t weather_change_ns_ = kNoChange;
  std::uint32_t turn_ = 0;
  std::int64_t interval_ns_ = 0;
  std::uint64_t revision_ = 0;  ///< revision of the weather that is taken in
  float fraction_ = 0.0F;
};

}  // namespace emit::renderer
