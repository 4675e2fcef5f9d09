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

#include "emit/scene/scene_desc.hpp"
#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "history/step_plan.hpp"
#include "history/surface_history.hpp"
#include "surface/heat/surface_node.hpp"
#include "surface/model/mover_glow.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/ray_offsets.hpp"
#include "surface/run/local_steps.hpp"
#include "surface/run/surface_step.hpp"
#include "surface/shade/shade_pages.hpp"
#include "surface/shade/silhouettes.hpp"
#include "surface/state/state_file.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// A scene whose vertices are samples: every instance has its own.
struct SampledScene {
  scene::SceneGeometry geometry;            ///< instances grouped by mesh
  std::vector<std::uint32_t> first_sample;  ///< by instance: sample of its mesh's first vertex
  std::vector<float> sky_frac;              ///< by sample: share of the hemisphere that shows sky
  /// By sample, K: what it shows, reflected sunlight counted in; tells what a coarser surface may
  /// leave out.
  std::vector<float> value_k;
};

/// The thermal method `cached`: temperatures live on samples of the surface. Time goes in intervals
/// of thermal.first_step_s, cut where the script moves an entity or the weather changes. While
/// frames interpolate between the two ends of the current one, the next is computed, as much per
/// frame as sim time has moved: no frame does more than its share, and the result depends on the
/// inputs alone. What the host does with an entity meanwhile is carried by LocalSteps; after it has
/// changed the weather, the current interval is computed anew, over frames, before the next one.
///
/// Owner: Renderer. Thread: the renderer's; computes on all cores. Real time: advance() allocates
/// nothing, on any thread; everything else is setup.
class CachedSurface {
 public:
  struct Inputs {
    const Environment& environment;
    std::span<const PoseHistory> entities;
  };

  /// `mover_of_object`: index of an object's PoseHistory, -1: static. `networks` by material, none
  /// for emit2014. `detail`: where meshes were simplified. Errors: config (an entity without
  /// triangles), those of CasterRays.
  [[nodiscard]] static physics::Result<std::unique_ptr<CachedSurface>> create(
      const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
      std::vector<std::int32_t> mover_of_object, std::span<const FosterMaterial> networks,
      double reference_k, std::optional<SurfaceDetail> detail = std::nullopt);

  /// thermal.state_file, and what the state in it must be made for.
  struct Saved {
    std::filesystem::path file;
    StateKey key{};  ///< of the scenario: scenario_key()
    /// The start of a run: what does not fit is an error, what is not there is written, and what is
    /// earlier is carried on. False: the file is used where it holds the very instant, and left as
    /// it is.
    bool start = true;
    /// Whether a surface that was refined for `eyes` will do for the first frame.
    std::function<bool(std::span<const RefineView::Eye> eyes)> fits_camera;
  };

  /// Samples the surface as it is to be seen at `now_ns`, or takes it from `saved` and carries it
  /// on to there, and computes the interval that holds it. `plan` and `history` are brought there.
  /// Setup: seconds. Errors: those of build_surface_model(), read_state(), carry_on() and
  /// write_state(); config (the saved surface was refined for another camera).
  [[nodiscard]] physics::Result<void> prepare(std::int64_t now_ns, const RefineView& view,
                                              const Inputs& inputs, StepPlan& plan,
                                              SurfaceHistory& history,
                                              const std::optional<Saved>& saved,
                                              const SurfaceProgress& progress);

  /// True when frames at `now_ns` need prepare() first: sim time went back behind the current
  /// interval or jumped far ahead of it.
  [[nodiscard]] bool stale(std::int64_t now_ns) const noexcept;

  /// Brings the samples to `now_ns`. @pre !stale(now_ns)
  void advance(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;

  /// Way of `now_ns` of the last advance() between the two nodes.
  [[nodiscard]] float fraction() const noexcept { return fraction_; }
  /// Values at the nodes before (0) and after (1) now, and at the one that is being computed (2).
  [[nodiscard]] std::span<const SampleVertex> vertices(std::size_t node) const noexcept {
    return nodes_[storage(node)].vertices;
  }
  /// Index of the storage that node (0..2) has: rotates when an interval ends.
  [[nodiscard]] std::size_t storage(std::size_t node) const noexcept { return (ring_ + node) % 3; }
  /// What has changed in that storage since forget_changes().
  [[nodiscard]] std::span<const ChangedRanges::Range> changes(std::size_t storage) const noexcept {
    return nodes_[storage].changes.ranges();
  }
  void forget_changes() noexcept;
  /// Temperature of the surroundings where the thermal model carries it.
  [[nodiscard]] std::optional<double> surroundings_now_k() const noexcept;
  /// True while some samples do not know yet of weather that the host has changed by more than
  /// matters.
  [[nodiscard]] bool lags() const noexcept { return lags_; }
  /// Blocks of samples that do not follow the intervals, because the host moves an entity.
  [[nodiscard]] std::size_t local_blocks() const noexcept { return local_->active(); }

  /// What entities have shaded lately, finer than samples lie.
  [[nodiscard]] const ShadePages& shade() const noexcept { return *shade_; }
  /// Entities as the sun sees them, where they stand.
  [[nodiscard]] const Silhouettes& silhouettes() const noexcept { return silhouettes_; }
  /// The shadow of an entity, on static surfaces.
  struct Shadow {
    bool on = false;
    /// The convex hull of these, rel, holds what is shaded.
    std::array<glm::vec3, 12> hull_m;
  };
  [[nodiscard]] std::span<const Shadow> shadows() const noexcept { return shadows_; }
  /// Finds shadows() of the entities as they are drawn, under the sun of `sun_ns`.
  void place_shadows(std::int64_t drawn_ns, std::int64_t sun_ns, const Inputs& inputs) noexcept;
  /// That of an entity, for those that show.
  /// @pre place_shadows(); shadows()[mover].on
  [[nodiscard]] PlacedSilhouette cast_shadow(std::size_t mover) noexcept;
  /// Since place_shadows() too many bodies had turned to be looked at in one frame: a shadow has
  /// the outline of a while ago.
  [[nodiscard]] bool stale_shadow() const noexcept { return stale_shadow_; }
  /// Of rel axes.
  [[nodiscard]] const glm::dvec3& origin_world_m() const noexcept {
    return rays().origin_world_m();
  }

  [[nodiscard]] const SurfaceModel& model() const noexcept { return *model_; }
  /// Main memory that the samples take, without the meshes between them.
  [[nodiscard]] std::uint64_t sample_bytes() const noexcept;
  /// The refined meshes as a scene whose instances are grouped by mesh.
  [[nodiscard]] SampledScene drawn_scene() const;

 private:
  CachedSurface(const scene::ScenarioDesc& scenario, scene::SceneGeometry geometry,
                std::vector<std::int32_t> mover_of_object, std::span<const FosterMaterial> networks,
                CasterRays places, std::optional<SurfaceDetail> detail, double reference_k);

  /// What is known of the scene when a model is made: at the start of the first interval shown.
  struct ModelWork {
    std::int64_t start_ns = 0;
    const RefineView& view;
    const Inputs& inputs;
    StepPlan& plan;
    SurfaceHistory& history;
    SurfaceModelOptions options;
    const SurfaceProgress& progress;
  };
  [[nodiscard]] physics::Result<SurfaceModel> make_model(const ModelWork& work,
                                                         const std::optional<Saved>& saved) const;
  [[nodiscard]] physics::Result<SurfaceModel> warm_up(const ModelWork& work) const;
  /// The saved model, carried on to the start; none: it does not fit, and need not.
  [[nodiscard]] physics::Result<std::optional<SurfaceModel>> take_saved(const ModelWork& work,
                                                                        const Saved& saved) const;
  [[nodiscard]] SurfaceInputs surface_inputs(const HistoryRecord& record,
                                             const SurfaceHistory& history,
                                             std::span<const std::vector<glm::vec3>> ways_m) const;
  [[nodiscard]] RecordInputs record_inputs(const Inputs& inputs) const {
    return {heat_, inputs.environment, inputs.entities, *interval_rays_, rays().origin_world_m()};
  }
  void place_movers(std::int64_t now_ns, std::span<const PoseHistory> entities);
  [[nodiscard]] std::vector<std::vector<glm::vec3>> ways_m(
      std::int64_t from_ns, std::span<const PoseHistory> entities) const;
  void begin_shade(std::int64_t now_ns, const Inputs& inputs);
  /// Forcing, gains and rays from `node` to the next one, which nothing has been computed of yet.
  void begin_interval(std::size_t node, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// Advances the samples up to `last` from `node` to the next one.
  void compute(std::size_t node, std::uint32_t last) noexcept;
  void rotate() noexcept { ring_ = (ring_ + 1) % 3; }
  /// begin_interval(), to the next node.
  void begin_anew(std::size_t node, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// The next instant of the grid, or an earlier one after `now_ns` at which an entity or the
  /// weather changes.
  [[nodiscard]] std::int64_t next_node_ns(std::int64_t from_ns, std::int64_t now_ns,
                                          const Inputs& inputs) const noexcept;
  /// Makes node 0 what lies between it and node 1 at `event_ns`, and node 1 the same line's point
  /// at `end_ns`, but for what samples go on from.
  void cut_at(std::int64_t event_ns, std::int64_t end_ns) noexcept;
  /// Takes in what the host has changed of the weather.
  void take_weather(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// The weather has changed at `event_ns`: node 1 was computed without that, and is computed anew
  /// over the next frames.
  void begin_renewal(std::int64_t event_ns, std::int64_t now_ns, const Inputs& inputs,
                     SurfaceHistory& history) noexcept;
  void end_renewal(std::int64_t now_ns, const Inputs& inputs, SurfaceHistory& history) noexcept;
  /// True where the weather of `now_ns` is not what node 1 was computed with, by more than changes
  /// nothing.
  [[nodiscard]] bool matters(std::int64_t now_ns, const Environment& environment) const noexcept;
  /// Samples that are to be computed by then.
  [[nodiscard]] std::uint32_t share_at(std::int64_t now_ns) const noexcept;
  /// The earliest change of the weather by the host that was not known before; kNoNews: none.
  [[nodiscard]] std::int64_t take_news(const Environment& environment) noexcept;
  static constexpr std::int64_t kNoNews = std::numeric_limits<std::int64_t>::max();
  /// What shades.
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
  std::vector<std::int32_t> mover_of_object_;
  CasterRays places_;
  std::optional<SurfaceDetail> detail_;
  bool extended_ = false;  ///< thermal.model foster
  SampleHeat heat_;
  std::optional<IntervalRays> interval_rays_;
  HeatInterval interval_;
  threads::WorkerPool workers_;
  RayOffsets offsets_;
  std::vector<MoverPlacement> movers_now_;
  std::optional<SurfaceModel> model_;
  MoverGlow glow_;
  std::vector<MoverFaces> faces_;  ///< by entity, at the node that an interval begins with

  std::optional<LocalSteps> local_;
  Silhouettes silhouettes_;
  std::vector<Shadow> shadows_;
  glm::vec3 to_sun_{0.0F, 0.0F, 1.0F};  ///< of shadows()
  bool stale_shadow_ = false;
  std::optional<ShadePages> shade_;

  std::array<SurfaceNode, 3> nodes_;
  std::size_t ring_ = 0;
  std::uint32_t done_ = 0;           ///< samples of the node that is being computed which are
  std::int64_t share_begin_ns_ = 0;  ///< time in which they are
  std::int64_t share_end_ns_ = 0;
  std::int64_t last_now_ns_ = 0;
  bool renewing_ = false;           ///< that node is node 1, because the weather has changed
  bool lags_ = false;               ///< ... by more than the tolerance
  std::int64_t news_ns_ = kNoNews;  ///< the earliest change of the weather that is not taken in
  std::uint32_t turn_ = 0;
  std::int64_t interval_ns_ = 0;
  std::uint64_t revision_ = 0;  ///< of the weather
  float fraction_ = 0.0F;
};

}  // namespace emit::renderer
