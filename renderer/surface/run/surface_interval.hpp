// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "history/surface_history.hpp"
#include "surface/heat/heat_interval.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/heat/surface_node.hpp"
#include "surface/model/body_nodes.hpp"
#include "surface/model/entity_exitance.hpp"
#include "surface/model/surface_model.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/run/band_exchange.hpp"
#include "surface/run/column_solve.hpp"
#include "surface/run/local_steps.hpp"
#include "surface/run/surface_geometry.hpp"
#include "surface/run/surface_step.hpp"
#include "surface/run/world_inputs.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Time in which the work of an interval is done, a share of it in each frame.
struct FrameShares {
  std::int64_t begin_ns = 0;
  std::int64_t end_ns = 0;

  /// Returns how much of the time has passed by `now_ns`, 0 to 1. RT-safe.
  [[nodiscard]] double passed_frac(std::int64_t now_ns) const noexcept;
  /// Moves the time back by 1/`frames` of its length. The work then goes on while sim time stands
  /// still. RT-safe.
  void move_back(std::int64_t frames) noexcept;
};

/// The interval that is being computed: its forcing, gains, rays and the radiation of entities, and
/// how much of the work is done.
///
/// Owner: CachedSurface. Thread: the renderer's; compute() uses all cores. Real time: everything
/// but the constructor and reset() is RT-safe.
class SurfaceInterval {
 public:
  /// Keeps references to both, which must outlive it.
  SurfaceInterval(const SurfaceGeometry& geometry, const SampleHeat& heat);

  /// Starts with a new model. `anchors` has the poses of the entities for which the views of its
  /// samples were found. `exchange` says that faces exchange radiation. `turn` is the number
  /// of intervals before: each has another pattern of sun rays. With `lights` samples see each
  /// other in band too; null: they do not. It allocates.
  void reset(const SurfaceModel& model, std::vector<EntityAnchor> anchors, bool exchange,
             std::uint32_t turn, const BandLights* lights);
  /// Finds what samples send to each other in band at the node `from`, with all bounces. Setup.
  /// @pre begin() with these nodes
  void settle_bands(const SurfaceSamples& all, const WorldInputs& inputs, SurfaceNode& from,
                    const SurfaceNode& to, threads::WorkerPool& workers) {
    bands_->settle(all, rays_, inputs, from, workers);
    bands_->begin(to, inputs);
  }

  /// Fills forcing, gains and rays for the interval between two nodes, with the poses and the
  /// weather that are known now. Nothing of `to` is computed yet. It advances the surroundings in
  /// `history` to the end of the interval.
  void begin(const SurfaceNode& from, SurfaceNode& to, const SurfaceSamples& all,
             const WorldInputs& inputs, SurfaceHistory& history) noexcept;
  /// Does the work that is due when `passed_frac` of the time has passed, from `from` to `to`:
  /// first it advances the samples, then it finds the heat between their columns, and last what
  /// they send to each other in band. Samples that have
  /// a clock of their own in `skipped` are left out; null: none are.
  /// @pre begin() with these nodes
  void compute(const SurfaceNode& from, SurfaceNode& to, double passed_frac,
               const SurfaceSamples& all, const LocalSteps* skipped,
               threads::WorkerPool& workers) noexcept;
  /// Does all work that is left.
  void finish(const SurfaceNode& from, SurfaceNode& to, const SurfaceSamples& all,
              const LocalSteps* skipped, threads::WorkerPool& workers) noexcept;
  /// True once `to` is complete.
  [[nodiscard]] bool finished() const noexcept {
    return warm() && bands_->worked() == bands_->units();
  }
  /// Sets the views of entities that the next steps use; they stay in place.
  void see(std::span<const BodyView> views) noexcept { views_ = views; }
  /// Number of samples that are computed.
  [[nodiscard]] std::uint32_t done() const noexcept { return done_; }
  /// See LocalSteps::Window.
  [[nodiscard]] std::span<std::uint8_t> stepped_again() noexcept {
    return columns_->stepped_again();
  }
  /// See ColumnSolve::left_k().
  [[nodiscard]] double columns_left_k() const noexcept {
    return columns_ ? columns_->left_k() : 0.0;
  }
  /// Main memory for the columns, in bytes.
  [[nodiscard]] std::uint64_t bytes() const noexcept {
    return columns_ ? columns_->bytes() + bands_->bytes() : 0;
  }

  [[nodiscard]] const IntervalRays& rays() const noexcept { return rays_; }
  [[nodiscard]] const HeatInterval& heat_interval() const noexcept { return interval_; }
  /// Input that all steps share in this interval.
  [[nodiscard]] SurfaceStep step(const SurfaceSamples& all) const noexcept {
    return {all, heat_, geometry_.rays(), faces_, hot_, body_mean_k_, views_};
  }

 private:
  /// True once temperatures and cells of `to` are complete.
  [[nodiscard]] bool warm() const noexcept {
    return done_ == count_ && (columns_->columns() == 0 || columns_->finished());
  }
  /// Does the part of compute() that finds temperatures, and its part of the time.
  void compute_heat(const SurfaceNode& from, SurfaceNode& to, double passed_frac,
                    const SurfaceSamples& all, const LocalSteps* skipped,
                    threads::WorkerPool& workers) noexcept;
  /// Advances the samples up to `end` that are not advanced yet.
  void advance_samples(const SurfaceNode& from, SurfaceNode& to, std::uint32_t end,
                       const SurfaceSamples& all, const LocalSteps* skipped,
                       threads::WorkerPool& workers) noexcept;

  const SurfaceGeometry& geometry_;
  const SampleHeat& heat_;
  IntervalRays rays_;
  HeatInterval interval_;
  EntityExitance exitance_;
  HotParts hot_;
  std::vector<EntityFaces> faces_;  ///< by entity, at the node with which the interval begins
  BodyNodes bodies_;
  std::vector<double> inflow_w_;     ///< by body, at the node with which the interval begins
  std::vector<double> body_mean_k_;  ///< by body, mean over the interval
  std::span<const BodyView> views_;
  std::uint32_t turn_ = 0;
  std::uint32_t count_ = 0;             ///< samples of the model
  std::uint32_t done_ = 0;              ///< samples that are advanced
  std::optional<ColumnSolve> columns_;  ///< set by reset()
  std::optional<BandExchange> bands_;   ///< set by reset()
};

}  // namespace emit::renderer
