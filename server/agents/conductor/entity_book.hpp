// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "agents/messages.hpp"
#include "emit/protocol/host_frame.hpp"
#include "pacing/pose_track.hpp"
#include "pacing/scenario_track.hpp"

namespace emit::server {

/// The entities that hosts have moved in this run, with their poses and the updates that frames
/// must still carry. Thread: the conductor's. Real time: RT-safe after construction.
class EntityBook {
 public:
  /// Largest number of entities in a run.
  static constexpr std::size_t kMaxTracked = 1024;

  explicit EntityBook(const ScenarioTracks& scenario);

  /// Forgets every entity.
  void clear() noexcept;
  /// Makes an entry for an entity. Returns false when the book is full.
  [[nodiscard]] bool add(std::uint32_t id) noexcept;
  /// Stores the state of an entity that has an entry; others are ignored.
  /// @param mark  also lists the entity for add_marked(), where frames belong to poses
  void store(const protocol::EntityStateData& state, std::int64_t sim_time_ns, bool mark) noexcept;

  /// Which place of an entity counts: that of its newest pose, or where add_all_at() or foresee()
  /// has placed it.
  enum class Place : std::uint8_t { newest, placed, foreseen };
  /// Returns where an entity is in the frame that is made up at `sim_time_ns`. Without a pose of a
  /// host the scenario says it.
  [[nodiscard]] physics::Pose pose_of(std::uint32_t id, std::int64_t sim_time_ns,
                                      Place place) const noexcept;

  /// Adds the newest pose of every marked entity to the job, oldest mark first. Returns false when
  /// some had no room; they are still marked.
  [[nodiscard]] bool add_marked(RenderJob& job) noexcept;
  /// Adds the entities to the job where they are at `shown_ns`: those that moved first, then those
  /// that stand, round robin. Returns false when not all that moved had room.
  [[nodiscard]] bool add_all_at(RenderJob& job, std::int64_t shown_ns,
                                std::int64_t horizon_ns) noexcept;
  /// Adds to the job where the entities will be at job.ahead.sim_time_ns, those that will have
  /// moved since add_all_at(). Returns false when not all had room.
  [[nodiscard]] bool foresee(RenderJob& job, std::int64_t horizon_ns) noexcept;

 private:
  struct Entity {
    std::uint32_t id = 0;
    PoseTrack track;
    bool on = true;
    bool marked = false;            // listed in marked_
    bool teleport_pending = false;  // no update has shown these two jumps and any between them
    std::int64_t first_teleport_ns = 0;
    std::int64_t last_teleport_ns = 0;
    // The members below are used by add_all_at() alone.
    struct Sent {
      physics::Pose pose;
      std::int64_t sim_time_ns = 0;
      bool on = true;
    };
    std::optional<Sent> sent;  // the last update
    PoseSample placed;         // its place in the frame that is made up
    physics::Pose foreseen;    // its place in images of that frame that look ahead
    bool moved = false;        // `placed` differs from `sent`
    bool in_job = false;       // the frame that is made up has it already
  };

  [[nodiscard]] Entity* find(std::uint32_t id) noexcept;
  /// `base_ns`: time stamp of the received pose that `pose` starts from (PoseSample).
  static void add_update(RenderJob& job, Entity& entity, const physics::Pose& pose,
                         std::int64_t base_ns) noexcept;
  /// Adds up to `limit` wanted entities, from entity `next` on. Returns false, with `next` at the
  /// first one that was left out, when the limit or the job was too small.
  template <class Wanted>
  bool add_wanted(RenderJob& job, std::int64_t shown_ns, std::size_t& next, std::size_t limit,
                  const Wanted& wanted) noexcept;

  const ScenarioTracks& scenario_;
  std::vector<Entity> entities_;       // reserved at the start, sorted by id
  std::vector<std::uint32_t> marked_;  // ids, reserved at the start
  std::size_t next_moved_ = 0;         // where the next frame goes on among those that moved
  std::size_t next_standing_ = 0;      // where it goes on among those that stand
};

}  // namespace emit::server
