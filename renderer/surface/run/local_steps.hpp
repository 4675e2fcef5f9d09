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

/// Short time steps of the samples near entities that the host drives, of entities that turn, and
/// of parts whose heat changes.
///
/// The rays of an interval are sent before it begins, with the poses known then. If an entity
/// departs from these poses, three sets of samples leave the interval in blocks: its own, those
/// that it shades, and those that it was to shade. Each step of about a second first advances a
/// block over the time that has passed, with the poses that came. It then advances the block one
/// step ahead with foreseen poses, for the frames to show. If poses came as foreseen, the step
/// ahead counts and is not done again. A block returns to the interval, over the rest of it, when
/// no such entity is near any more. The samples of an entity are on their own too while it turns,
/// by the script as well: an interval knows one attitude. So are those of a part while a command
/// begins to act or the temperature behind their skin moves. Blocks take turns, so that no frame
/// advances all of them.
///
/// Node `before` holds the states of a block on its own at the end of its latest step, and `after`
/// holds the states foreseen at the end of the next step. The vertices of both nodes lie on
/// the line through these two.
///
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor is RT-safe.
class LocalSteps {
 public:
  /// Constants of a scene and its options.
  struct Setup {
    std::int64_t start_ns = 0;  ///< a node of the grid on which steps begin
    std::int64_t interval_ns = 1;
    std::size_t entities = 0;
    std::span<const PartHistory> parts{};
  };
  /// Data that the steps work with.
  struct Inputs {
    const Environment& environment;
    std::span<const PoseHistory> entities;
    std::span<const PartHistory> parts;
    SurfaceHistory& history;  ///< surroundings; left in the state that `next` ends with
    const SurfaceStep& step;
    threads::WorkerPool& workers;
    glm::dvec3 origin_world_m;
  };
  /// The two nodes of the current interval, and the node that is being computed with its rays and
  /// forcing.
  struct Window {
    SurfaceNode& before;
    SurfaceNode& after;
    SurfaceNode& next;
    std::uint32_t done = 0;  ///< number of samples of `next` that are computed
    /// The flag is true while `after` is being computed anew: then values between it and `before`
    /// do not hold.
    bool renewing = false;
    /// Flags by column of the node that is being computed, to be set for samples that are stepped
    /// otherwise.
    std::span<std::uint8_t> stepped_again;
    const IntervalRays& next_rays;
    const HeatInterval& next_interval;
  };

  /// Copies `rays` and `interval`, which have room for the scene's entities and materials.
  LocalSteps(const SurfaceSamples& all, const Setup& setup, const IntervalRays& rays,
             HeatInterval interval);

  /// Notes the poses that are known now: the rays of the current (0) or the next (1) interval are
  /// sent with them.
  void send_rays(std::size_t interval, std::span<const PoseHistory> entities) noexcept;
  /// Returns all blocks to the interval without a step; steps begin after `now_ns`.
  void restart(std::int64_t now_ns) noexcept;

  /// Does the steps that are due up to `until_ns`.
  /// @pre until_ns <= window.after.at_ns
  void run(std::int64_t until_ns, const Window& window, const Inputs& inputs) noexcept;
  /// Discards steps ahead that end after `event_ns`, because the weather changes at that time.
  void discard_foreseen(std::int64_t event_ns) noexcept;
  /// Prepares for moving node `before` to `event_ns`: blocks that were on their own in this
  /// interval are on their own from then on. @pre run(); event_ns lies in the current interval
  void take_weather_change(std::int64_t event_ns, const Window& window,
                           const SurfaceSamples& all) noexcept;
  /// Prepares for the end of the current interval. @pre run() to its end
  void rotate(const Window& window, const SurfaceSamples& all) noexcept;
  /// Follows the end of the interval: the node that was `next` is `after` now, and the one that was
  /// `before` is `next`.
  void rotated(const Window& window, const SurfaceSamples& all) noexcept;

  /// Length of a step.
  [[nodiscard]] std::int64_t step_ns() const noexcept { return step_ns_; }
  /// Number of blocks that do not follow the interval, blocks about to leave it included.
  [[nodiscard]] std::size_t active() const noexcept;
  /// Returns true for samples of blocks that are on their own, or were in this interval: node
  /// `before` does not hold them at its own instant.
  [[nodiscard]] bool has_own_clock(std::uint32_t sample) const noexcept {
    return own_clock_[sample] != 0;
  }

 private:
  static constexpr std::size_t kTurns = 16;  ///< number of groups of blocks that step in turn
  /// Number of samples that are advanced before any of them is written back.
  static constexpr std::size_t kBatch = 4096;
  /// A block follows its interval, is about to leave it, or is on its own.
  enum class State : std::uint8_t { of_interval, wanted, on_its_own };

  /// Finds the blocks that entities touch which have departed from the known poses, and those of
  /// entities that turn and of parts that change.
  void look_around(std::int64_t at_ns, const Window& window, const Inputs& inputs) noexcept;
  /// Advances a group of blocks to `at_ns`. It then does the step ahead, or returns blocks to the
  /// interval.
  void take_turn(std::size_t turn, std::int64_t at_ns, const Window& window,
                 const Inputs& inputs) noexcept;
  /// Takes a block out of the interval, with the states between its nodes at `at_ns`.
  void begin_alone(std::uint32_t block, std::int64_t at_ns, const Window& window,
                   const SurfaceSamples& all) noexcept;
  /// Marks the blocks that an entity touches in the time of `rays`, and its own blocks.
  void want(std::size_t entity, const IntervalRays& rays, std::int64_t at_ns) noexcept;
  /// Marks a block as touched.
  void want_block(std::uint32_t block, std::int64_t at_ns) noexcept;
  /// Advances blocks to `to_ns` with the poses that came.
  void bring(std::span<const std::uint32_t> blocks, std::int64_t to_ns, const Window& window,
             const Inputs& inputs) noexcept;
  /// Advances blocks one step ahead with foreseen poses, and draws their vertices on that line.
  void show(std::span<const std::uint32_t> blocks, std::size_t turn, std::int64_t at_ns,
            const Window& window, const Inputs& inputs) noexcept;
  /// Returns true if all entities stand at `at_ns` where they were foreseen to be, and no part has
  /// a new command.
  [[nodiscard]] bool came_true(std::size_t turn, std::int64_t at_ns,
                               const Inputs& inputs) const noexcept;
  /// Advances blocks to the end of the interval, and from there to `next` as far as it is computed.
  void hand_back(std::span<const std::uint32_t> blocks, std::int64_t at_ns, const Window& window,
                 const Inputs& inputs) noexcept;
  /// Fills forcing, gains and rays of a step.
  void prepare(std::int64_t begin_ns, std::int64_t end_ns, const Window& window,
               const Inputs& inputs) noexcept;
  /// Steps the samples of `blocks` with an index below `end`, from node `from`. It calls
  /// keep(sample, state, output) for each of them, in order, and for the other faces of sheets.
  template <class Keep>
  void step(std::span<const std::uint32_t> blocks, std::uint32_t end, const SurfaceNode& from,
            const IntervalRays& rays, const HeatInterval& interval, const Inputs& inputs,
            const Keep& keep) noexcept;
  /// Visits the samples of a block and the other faces of its sheets.
  template <class Visit>
  void each_sample(std::uint32_t block, const SurfaceSamples& all, const Visit& visit) noexcept;

  SampleBlocks blocks_;
  std::int64_t start_ns_ = 0;
  std::int64_t step_ns_ = 1;
  std::int64_t turn_ns_ = 1;
  std::int64_t next_turn_ = 0;  ///< the turn at start_ns_ + next_turn_ * turn_ns_
  std::array<std::vector<PoseHistory::Known>, 2> known_;  ///< by interval, then entity
  IntervalRays rays_;
  IntervalRays known_rays_;
  HeatInterval interval_;

  std::vector<State> state_;               ///< by block
  std::vector<std::int64_t> at_ns_;        ///< by block: end of its latest step on its own
  std::vector<std::int64_t> touched_ns_;   ///< by block: latest time at which an entity touched it
  std::vector<std::int64_t> foreseen_ns_;  ///< by block: end of its step ahead, which `after` holds
  /// Foreseen states of the entities at the end of the step ahead, by turn, then entity.
  std::array<std::vector<TrajectoryState>, kTurns> foreseen_;
  std::array<std::uint64_t, kTurns> foreseen_parts_{};   ///< by turn: commands that were known then
  std::vector<std::vector<std::uint32_t>> part_blocks_;  ///< by part: blocks with samples of it
  std::vector<std::vector<std::uint32_t>> entity_blocks_;  ///< by entity: its own blocks
  /// Flag of each entity: 1 once the blocks that it was to shade in this interval are found.
  std::vector<std::uint8_t> known_found_;
  std::vector<std::uint8_t> own_clock_;                   ///< by sample: has_own_clock()
  std::array<std::vector<std::uint32_t>, kTurns> turns_;  ///< by turn: blocks outside the interval
  std::vector<std::uint32_t> chosen_;
  std::vector<std::uint32_t> batch_;
  std::vector<SteppedSample> stepped_;
};

}  // namespace emit::renderer
