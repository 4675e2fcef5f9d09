// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/scene/scene_desc.hpp"
#include "history/entity_stand.hpp"
#include "history/environment.hpp"
#include "history/step_plan.hpp"
#include "history/surface_history.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/run/body_surroundings.hpp"
#include "surface/run/local_steps.hpp"
#include "surface/run/node_grid.hpp"
#include "surface/run/sampled_scene.hpp"
#include "surface/run/surface_geometry.hpp"
#include "surface/run/surface_interval.hpp"
#include "surface/run/surface_nodes.hpp"
#include "surface/run/surface_warm_up.hpp"
#include "surface/run/world_inputs.hpp"
#include "surface/shade/entity_shadows.hpp"
#include "surface/shade/exposure_tiles.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// The thermal method `cached`: temperatures live on samples of the surface. Time advances in
/// intervals of thermal.first_step_s, which are cut where the script moves an entity or the weather
/// changes. Frames interpolate between the two nodes of the current interval. Meanwhile the next
/// interval is computed, in each frame as much as sim time has moved. No frame does more than its
/// share, and the result depends on the inputs alone. LocalSteps follows entities that the host
/// moves. After the host has changed the weather, the current interval is computed anew, over
/// several frames, before the next one.
///
/// This class owns the order of the work. Its parts are the geometry (SurfaceGeometry), the warm-up
/// (SurfaceWarmUp), the times of the nodes (NodeGrid), the nodes (SurfaceNodes), the interval that
/// is being computed (SurfaceInterval), blocks with shorter steps (LocalSteps), what entities that
/// move come to see (BodySurroundings), and the shade of entities (EntityShadows, ExposureTiles).
///
/// Owner: Renderer. Thread: the renderer's; computes on all cores. Real time: advance() allocates
/// nothing, on any thread; everything else is setup.
class CachedSurface {
 public:
  using Inputs = WorldInputs;

  /// Makes the surface without samples. `networks` are by material, and empty for emit2014. The
  /// other parameters and the errors are those of SurfaceGeometry::create().
  [[nodiscard]] static physics::Result<std::unique_ptr<CachedSurface>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<std::int32_t> entity_of_object, std::span<const FosterMaterial> networks,
      double reference_k, std::optional<SurfaceDetail> detail = std::nullopt);

  /// Samples the surface for `now_ns`, or takes it from `saved` and carries it on to `now_ns`. It
  /// also computes the interval that holds `now_ns`, and brings `plan` and `history` to the instant
  /// of the model. Setup: seconds. Errors: those of SurfaceWarmUp and of carry_on().
  /// @pre `inputs` has the entities of the geometry
  [[nodiscard]] physics::Result<void> prepare(std::int64_t now_ns, const RefineView& view,
                                              const Inputs& inputs, StepPlan& plan,
                                              SurfaceHistory& history,
                                              const std::optional<SavedSurface>& saved,
                                              const SurfaceProgress& progress);

  /// Brings the samples to `now_ns`, however far ahead it is, interval by interval. It does nothing
  /// for an instant before the latest one. Places of samples and meshes stay as they are. Setup:
  /// every interval takes as long as all its frames together. Errors: `internal` if `progress`
  /// stopped it.
  /// @pre prepare()
  [[nodiscard]] physics::Result<void> carry_on(std::int64_t now_ns, const Inputs& inputs,
                                               SurfaceHistory& history,
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
    return nodes_[node].vertices;
  }
  /// Index of the storage that node 0, 1 or 2 has. It rotates when an interval ends.
  [[nodiscard]] std::size_t storage(std::size_t node) const noexcept {
    return nodes_.storage(node);
  }
  /// Ranges of vertices in a storage that have changed since forget_changes().
  [[nodiscard]] std::span<const ChangedRanges::Range> changes(std::size_t storage) const noexcept {
    return nodes_.stored(storage).changes.ranges();
  }
  /// Radiance from other samples at a node, by vertex, then band. It is empty where
  /// faces do not exchange radiation, and without light in WorldInputs.
  [[nodiscard]] std::span<const float> seen_w_m2_sr(std::size_t node) const noexcept {
    return nodes_[node].seen_w_m2_sr;
  }
  /// Ranges of vertices in a storage whose values of seen_w_m2_sr() have changed since
  /// forget_changes().
  [[nodiscard]] std::span<const ChangedRanges::Range> seen_changes(
      std::size_t storage) const noexcept {
    return nodes_.stored(storage).seen_changes.ranges();
  }
  /// Forgets the changes of all nodes and of exposure_tiles().
  void forget_changes() noexcept;
  /// Temperature of the surroundings in K; empty if the thermal model does not compute it.
  [[nodiscard]] std::optional<double> surroundings_now_k() const noexcept {
    return nodes_.surroundings_k(fraction_);
  }
  /// Returns the open grounds at the end of the interval that holds the latest instant.
  /// @pre prepare()
  [[nodiscard]] const GroundState& ground_now() const noexcept { return nodes_[1].surroundings; }
  /// Returns true while some samples lack a change of the weather by the host that matters.
  [[nodiscard]] bool lags() const noexcept { return lags_; }
  /// Returns true while heat between columns is off by more than kMostColumnErrorK, because its
  /// solution was cut short.
  [[nodiscard]] bool columns_cut_short() const noexcept {
    return interval_.columns_left_k() > kMostColumnErrorK;
  }
  static constexpr double kMostColumnErrorK = 0.05;
  /// Number of blocks of samples that do not follow the intervals (LocalSteps). @pre prepare()
  [[nodiscard]] std::size_t local_blocks() const noexcept {
    EMIT_CHECK(local_.has_value());
    return local_->active();
  }

  /// Poses of the entities for which the views of their samples were found, by entity.
  /// @pre prepare()
  [[nodiscard]] const std::vector<EntityAnchor>& anchors() const noexcept { return anchors_; }

  /// Exposure tiles: recent shade of entities, finer than samples lie. @pre prepare()
  [[nodiscard]] const ExposureTiles& exposure_tiles() const noexcept {
    EMIT_CHECK(exposure_tiles_.has_value());
    return *exposure_tiles_;
  }
  /// Shadows that entities cast in the frame.
  [[nodiscard]] const EntityShadows& entity_shadows() const noexcept { return entity_shadows_; }
  /// Finds the shadows for the poses of the entities at `drawn_ns` and the sun of `sun_ns`.
  /// @pre prepare()
  void place_shadows(std::int64_t drawn_ns, std::int64_t sun_ns, const Inputs& inputs) noexcept;
  /// Brings the shadow depth map of an entity up to date, and places it. Call it for shadows that
  /// show in the frame.
  /// @pre place_shadows(); entity_shadows().shadows()[entity].on
  [[nodiscard]] PlacedShadowMap cast_shadow(std::size_t entity) noexcept {
    return entity_shadows_.cast(entity, geometry_.rays(), workers_);
  }
  /// Origin of rel in the world, m.
  [[nodiscard]] const glm::dvec3& origin_world_m() const noexcept {
    return geometry_.origin_world_m();
  }

  /// The samples. Their states have moved into the nodes. @pre prepare()
  [[nodiscard]] const SurfaceModel& model() const noexcept {
    EMIT_CHECK(model_.has_value());
    return *model_;
  }
  /// Output of a sample at the time of the latest advance(). @pre prepare(); sample < samples
  [[nodiscard]] SampleOutput output_now(std::uint32_t sample) const noexcept {
    return sample_between(nodes_[0], nodes_[1], sample, model().samples.samples[sample].vertex,
                          static_cast<double>(fraction_))
        .output;
  }
  /// Mean net flux into the solid at a sample, W/m2, over the interval of the latest advance(). NaN
  /// where no flux drives the heat: with emit2014 and prescribed temperatures.
  /// @pre prepare(); sample < samples
  [[nodiscard]] double flux_now_w_m2(std::uint32_t sample) const noexcept;
  /// Main memory of the samples in bytes, without the meshes between them.
  [[nodiscard]] std::uint64_t sample_bytes() const noexcept;
  /// Takes the refined meshes as a scene whose instances are grouped by mesh. Their levels of
  /// detail leave the model. @pre prepare(), and no call since.
  [[nodiscard]] SampledScene take_drawn_scene();

 private:
  CachedSurface(const scene::ScenarioDesc& scenario, SurfaceGeometry geometry,
                std::span<const FosterMaterial> networks, double reference_k);

  [[nodiscard]] SurfaceModelOptions model_options() const noexcept;
  /// Earliest instant of a saved surface that serves a run from `start_ns` on.
  [[nodiscard]] std::int64_t earliest_ns(std::int64_t start_ns) const noexcept;
  /// Takes the states of a model at `start_ns` as node 0, and computes node 1.
  void begin_first_interval(std::int64_t start_ns, const Inputs& inputs, const StepPlan& plan,
                            SurfaceHistory& history);
  /// Fills the vertices of node 0. Shares of the sun leave the shade of entities on static surfaces
  /// out, which exposure tiles and shadow maps add, and that of broken clouds, which the radiance
  /// pass adds.
  void fill_first_vertices(bool clouds);
  /// Writes the model with the states and outputs of node 0, which it lends to the model.
  [[nodiscard]] physics::Result<void> save(const SurfaceWarmUp& warm_up, const SavedSurface& saved);
  /// Makes the exposure tiles and the first shadow depth maps.
  void begin_shade(std::int64_t now_ns, const Inputs& inputs);

  /// Begins the interval from `node` to the next node, as long as their times say.
  void begin_interval(std::size_t node, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Chooses the time of the node after `node`, and begins the interval between them.
  void begin_anew(std::size_t node, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Begins the interval after node 1, whose samples are computed from `from_ns` to node 1.
  void begin_next(std::int64_t from_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Does the work that is due when `passed_frac` of its time has passed, from node 1 to node 2, or
  /// from node 0 to node 1 in a renewal.
  void compute(double passed_frac) noexcept;
  /// Does all of it.
  void finish() noexcept;
  /// Finishes node 2, and makes the interval that ends there the current one.
  void end_interval(const Inputs& inputs, SurfaceHistory& history) noexcept;

  /// Reacts to weather that the host has changed.
  void take_weather(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Returns true if a change of the weather that is not taken in matters at `now_ns`.
  [[nodiscard]] bool misses_weather(std::int64_t now_ns, const Inputs& inputs) const noexcept;
  /// Begins to compute node 1 anew over the next frames, because the weather has changed at
  /// `event_ns`.
  void begin_renewal(std::int64_t event_ns, std::int64_t now_ns, const Inputs& inputs,
                     SurfaceHistory& history) noexcept;
  /// Finishes node 1 and begins the next interval.
  void end_renewal(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Earliest time whose weather the host has changed since the last call; kNoChange if there is
  /// none.
  [[nodiscard]] std::int64_t take_weather_change(const Environment& environment) noexcept;
  static constexpr std::int64_t kNoChange = std::numeric_limits<std::int64_t>::max();

  /// Does the steps of LocalSteps that are due up to `until_ns`.
  void run_local(std::int64_t until_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  [[nodiscard]] LocalSteps::Window window() noexcept {
    return {nodes_[0],        nodes_[1],
            nodes_[2],        renewing_ ? 0U : interval_.done(),
            renewing_,        interval_.stepped_again(),
            interval_.rays(), interval_.heat_interval()};
  }

  SurfaceGeometry geometry_;
  scene::ThermalOptions options_;
  SampleHeat heat_;
  NodeGrid grid_;
  threads::WorkerPool workers_;
  std::optional<SurfaceModel> model_;

  SurfaceNodes nodes_;
  SurfaceInterval interval_;
  FrameShares shares_;  ///< time in which the samples of `interval_` are computed
  std::vector<EntityAnchor> anchors_;
  std::optional<LocalSteps> local_;
  std::optional<BodySurroundings> bodies_;  ///< none where faces do not exchange radiation
  EntityShadows entity_shadows_;
  std::optional<ExposureTiles> exposure_tiles_;

  std::int64_t last_now_ns_ = 0;
  float fraction_ = 0.0F;
  bool renewing_ = false;       ///< node 1 is being computed, because the weather has changed
  bool lags_ = false;           ///< a change that matters is not known to all samples
  std::uint64_t revision_ = 0;  ///< revision of the weather that is taken in
  /// Earliest change of the weather that is not taken in.
  std::int64_t weather_change_ns_ = kNoChange;
};

}  // namespace emit::renderer
