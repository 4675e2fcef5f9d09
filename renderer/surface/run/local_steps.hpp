// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "history/environment.hpp"
#include "history/pose_history.hpp"
#include "history/surface_history.hpp"
#include "surface/heat/heat_interval.hpp"
#include "surface/heat/sample_blocks.hpp"
#include "surface/heat/surface_node.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/run/surface_step.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// Carries samples on in short steps of their own where the host drives an entity.
///
/// The rays of an interval are sent before it begins, with poses as they were known then. Where an
/// entity departs from those, its own samples and those that it shades, or was to shade, leave the
/// interval in blocks: every step of about a second they go on over what has passed, with the poses
/// that came, and from there ahead over the next step for what frames show. Where poses came as was
/// foreseen, that was the step. Blocks come back, over what is left of the interval, when no such
/// entity is near any more. They take turns, so that no frame carries all of them on.
///
/// While a block is on its own, node `before` holds its states at the end of its latest step,
/// `after` those foreseen at the end of the next, and the vertices of both nodes lie on the line
/// that leads through the two.
///
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor is RT-safe.
class LocalSteps {
 public:
  /// Of a scene and its options.
  struct Setup {
    std::int64_t start_ns = 0;  ///< a node of the grid that steps begin at
    std::int64_t interval_ns = 1;
    std::size_t entities = 0;
  };
  /// What the steps work with.
  struct Inputs {
    const Environment& environment;
    std::span<const PoseHistory> entities;
    SurfaceHistory& history;  ///< of the surroundings: left where it was to be for `next`
    const SurfaceStep& step;
    threads::WorkerPool& workers;
    glm::dvec3 origin_world_m;
  };
  /// The current interval, the node that is being computed, and how.
  struct Window {
    SurfaceNode& before;
    SurfaceNode& after;
    SurfaceNode& next;
    std::uint32_t done = 0;  ///< samples of `next` that are computed
    /// `after` is being computed anew: what lies between it and `before` does not hold.
    bool renewing = false;
    const IntervalRays& next_rays;
    const HeatInterval& next_interval;
  };

  /// `rays`, `interval`: to be copied, with room for the scene's entities and materials.
  LocalSteps(const SurfaceSamples& all, const Setup& setup, const IntervalRays& rays,
             HeatInterval interval);

  /// The rays of the current (0) or the next (1) interval are sent with what is known now.
  void send_rays(std::size_t interval, std::span<const PoseHistory> entities) noexcept;
  /// No block is on its own; steps begin after `now_ns`.
  void restart(std::int64_t now_ns) noexcept;

  /// Does what is due up to `until_ns`, which lies in the current interval.
  void run(std::int64_t until_ns, const Window& window, const Inputs& inputs) noexcept;
  /// The weather changes from `event_ns` on: what is foreseen beyond does not come true.
  void doubt(std::int64_t event_ns) noexcept;
  /// `before` is about to be moved to `event_ns`: blocks that were on their own in this interval
  /// are so from then on. @pre run(); event_ns lies in the current interval
  void take_news(std::int64_t event_ns, const Window& window, const SurfaceSamples& all) noexcept;
  /// The current interval is about to end. @pre run() to its end
  void rotate(const Window& window, const SurfaceSamples& all) noexcept;
  /// It has: what was `next` is `after` now, and what was `before` is `next`.
  void rotated(const Window& window, const SurfaceSamples& all) noexcept;

  /// Blocks on their own.
  [[nodiscard]] std::size_t active() const noexcept;
  /// True for the samples of those, and of blocks that were in this interval: `before` does not
  /// hold them at its own instant.
  [[nodiscard]] bool has_own_clock(std::uint32_t sample) const noexcept {
    return own_clock_[sample] != 0;
  }

 private:
  static constexpr std::size_t kTurns = 16;  ///< groups of blocks that step one after the other
  /// Samples that are carried on before any of them is written back.
  static constexpr std::size_t kBatch = 4096;
  enum class State : std::uint8_t { of_interval, wanted, on_its_own };

  /// Finds the blocks that the departure of an entity touches.
  void look_around(std::int64_t at_ns, const Window& window, const Inputs& inputs) noexcept;
  /// Carries a group on to `at_ns`, and shows where it goes or hands it back to its interval.
  void take_turn(std::size_t turn, std::int64_t at_ns, const Window& window,
                 const Inputs& inputs) noexcept;
  void begin_alone(std::uint32_t block, std::int64_t at_ns, const Window& window,
                   const SurfaceSamples& all) noexcept;
  /// Wants the blocks that an entity touches in the time of `rays`, and those of its own.
  void want(std::size_t entity, const IntervalRays& rays, std::int64_t at_ns) noexcept;
  void bring(std::span<const std::uint32_t> blocks, std::int64_t to_ns, const Window& window,
             const Inputs& inputs) noexcept;
  void show(std::span<const std::uint32_t> blocks, std::size_t turn, std::int64_t at_ns,
            const Window& window, const Inputs& inputs) noexcept;
  /// True where all entities are at `at_ns` where they were foreseen to be.
  [[nodiscard]] bool came_true(std::size_t turn, std::int64_t at_ns,
                               const Inputs& inputs) const noexcept;
  void hand_back(std::span<const std::uint32_t> blocks, std::int64_t at_ns, const Window& window,
                 const Inputs& inputs) noexcept;
  /// Forcing and rays of a step.
  void prepare(std::int64_t begin_ns, std::int64_t end_ns, const Window& window,
               const Inputs& inputs) noexcept;
  /// Steps the samples of `blocks` below `end` from `from`; keep(sample, state, output) is called
  /// for each, in order.
  template <class Keep>
  void step(std::span<const std::uint32_t> blocks, std::uint32_t end, const SurfaceNode& from,
            const IntervalRays& rays, const HeatInterval& interval, const Inputs& inputs,
            const Keep& keep) noexcept;
  template <class Visit>
  void each_sample(std::uint32_t block, const SurfaceSamples& all, const Visit& visit) noexcept;

  SampleBlocks blocks_;
  std::int64_t start_ns_ = 0;
  std::int64_t step_ns_ = 1;
  std::int64_t turn_ns_ = 1;
  std::int64_t next_turn_ = 0;                            ///< at start_ns_ + next_turn_ * turn_ns_
  std::array<std::vector<PoseHistory::Known>, 2> known_;  ///< by interval, then entity
  IntervalRays rays_;
  IntervalRays known_rays_;
  HeatInterval interval_;

  std::vector<State> state_;               ///< by block
  std::vector<std::int64_t> at_ns_;        ///< by block: end of its latest step, while alone
  std::vector<std::int64_t> touched_ns_;   ///< by block: latest instant at which it was
  std::vector<std::int64_t> foreseen_ns_;  ///< by block: what `after` holds of it
  /// By turn, then entity: where they were foreseen to be at the end of the turn's step.
  std::array<std::vector<TrajectoryState>, kTurns> foreseen_;
  std::vector<std::uint8_t> known_found_;                 ///< by entity: in this interval
  std::vector<std::uint8_t> own_clock_;                   ///< by sample
  std::array<std::vector<std::uint32_t>, kTurns> turns_;  ///< blocks that are not of_interval
  std::vector<std::uint32_t> chosen_;
  std::vector<std::uint32_t> batch_;
  std::vector<SteppedSample> stepped_;
};

}  // namespace emit::renderer
