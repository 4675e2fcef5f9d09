// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::renderer {

using scene::trajectory_at;
using scene::TrajectoryState;

/// Where an entity was and whether it was there, at any instant of the thermal history: the
/// scenario's trajectory, overridden from the first live pose on by what the host sent.
/// Owner: Renderer. Thread: the renderer's. Real time: everything but the constructor is RT-safe.
class PoseHistory {
 public:
  static constexpr std::size_t kMaxLivePoses = 16384;
  static constexpr std::size_t kMaxEvents = 256;
  static constexpr std::int64_t kMostAheadNs = 2'000'000'000;

  /// `placement` holds until the first keyframe of an entity without trajectory.
  PoseHistory(const scene::ObjectDesc& object, const physics::Pose& placement);

  /// Adds a live pose. Poses that lie on the way between their neighbours are thinned out (to 1 cm
  /// and 1 mrad, at most one second apart while moving). A time before the newest live pose is
  /// refused (false).
  bool append(std::int64_t sim_time_ns, const physics::Pose& pose, bool on, bool teleport) noexcept;
  /// Forgets the live poses.
  void reset() noexcept;

  [[nodiscard]] TrajectoryState at(std::int64_t sim_time_ns) const noexcept;
  /// Like at(), but an entity that moves goes on straight for kMostAheadNs after its newest live
  /// pose.
  [[nodiscard]] TrajectoryState ahead(std::int64_t sim_time_ns) const noexcept;

  /// The scenario's trajectory, ascending.
  [[nodiscard]] std::span<const scene::Keyframe> script() const noexcept { return scripted_; }

  /// What is known of an entity at some time.
  struct Known {
    bool live = false;       ///< the host drives it
    scene::Keyframe newest;  ///< its newest live pose, if so
  };
  [[nodiscard]] Known known() const noexcept;
  /// Where it was to be at `sim_time_ns` by what was known then. @pre no reset() since
  [[nodiscard]] TrajectoryState as_known(const Known& then,
                                         std::int64_t sim_time_ns) const noexcept;
  /// True when that is not where it is by what is known now (1 cm, 1 mrad).
  [[nodiscard]] bool departs(const Known& then, std::int64_t sim_time_ns) const noexcept;

  /// Length of the way between two instants while switched on; jumps do not count.
  [[nodiscard]] double path_m(std::int64_t begin_ns, std::int64_t end_ns) const noexcept;

  /// Instants at which the entity appears, vanishes, starts or stops, ascending: the latest
  /// kMaxEvents.
  [[nodiscard]] std::span<const std::int64_t> events_ns() const noexcept { return events_ns_; }

  /// What the host sent and is kept, ascending.
  [[nodiscard]] std::span<const scene::Keyframe> live() const noexcept { return live_; }

  /// Live poses dropped since the last reset because the store was full; the oldest are halved in
  /// density then.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  void note_event(std::int64_t sim_time_ns) noexcept;
  [[nodiscard]] bool replaces_last(const scene::Keyframe& next) noexcept;
  void make_room() noexcept;
  void note_motion(const scene::Keyframe& last, const scene::Keyframe& next) noexcept;
  void note_scripted_events() noexcept;

  scene::Trajectory scripted_;
  scene::Trajectory live_;
  std::vector<std::int64_t> events_ns_;
  // A live entity starts when it leaves the spot it rested on, and stops when it has stayed on one
  // for a while: jitter of the host is neither.
  bool moving_ = false;
  scene::Keyframe spot_;
  // Thinned-out poses since the last kept one, a sample of them: what the next pose must fit.
  std::array<scene::Keyframe, 16> skipped_;
  std::size_t skipped_count_ = 0;
  std::size_t skipped_stride_ = 1;
  std::size_t skipped_phase_ = 0;
  std::uint64_t dropped_ = 0;
};

/// Which poses of the entities count.
class EntityPoses {
 public:
  /// Those that are known now.
  explicit EntityPoses(std::span<const PoseHistory> entities) : entities_(entities) {}
  /// Those that were known then, by entity.
  [[nodiscard]] static EntityPoses as_known(std::span<const PoseHistory> entities,
                                            std::span<const PoseHistory::Known> then) {
    EntityPoses poses(entities);
    poses.then_ = then;
    return poses;
  }
  /// Those that are known now; entities that move go on.
  [[nodiscard]] static EntityPoses ahead(std::span<const PoseHistory> entities) {
    EntityPoses poses(entities);
    poses.ahead_ = true;
    return poses;
  }

  [[nodiscard]] TrajectoryState at(std::size_t entity, std::int64_t sim_time_ns) const noexcept {
    const PoseHistory& history = entities_[entity];
    if (!then_.empty()) return history.as_known(then_[entity], sim_time_ns);
    return ahead_ ? history.ahead(sim_time_ns) : history.at(sim_time_ns);
  }

 private:
  std::span<const PoseHistory> entities_;
  std::span<const PoseHistory::Known> then_;
  bool ahead_ = false;
};

}  // namespace emit::renderer
