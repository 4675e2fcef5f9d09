// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/air_film.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/frames.hpp"
#include "emit/scene/scene_desc.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::renderer {

using scene::trajectory_at;
using scene::TrajectoryState;

/// Poses of one entity, and whether it was present, at any instant of the thermal history. The
/// poses are those of the scenario's trajectory, and from the first live pose on those that the
/// host sent. Owner: Renderer.
/// Thread: the renderer's.  Real time: everything but the constructor is RT-safe.
class PoseHistory {
 public:
  /// Largest number of live poses and of events.
  static constexpr std::size_t kMaxLivePoses = 16384;
  static constexpr std::size_t kMaxEvents = 256;
  /// Longest extrapolation of ahead(), ns.
  static constexpr std::int64_t kMaxAheadNs = 2'000'000'000;

  /// Starts with the scenario's trajectory of the object. An entity without trajectory stands at
  /// `placement`.
  /// `film_body` is the shape that sets its film.
  PoseHistory(const scene::ObjectDesc& object, const physics::Pose& placement,
              const physics::AirFilmBody& film_body = {});

  /// Adds a live pose. Poses that lie on the way between their neighbours are thinned out (to 1 cm
  /// and 1 mrad, at most one second apart while moving). Returns false, and ignores the pose, when
  /// its time is before the newest live pose.
  bool append(std::int64_t sim_time_ns, const physics::Pose& pose, bool on, bool teleport) noexcept;
  /// Says where the entity will be at an instant after its newest live pose, until forget() or the
  /// next pose. It is ignored before the first live pose, and for another instant.
  void foresee(std::int64_t sim_time_ns, const physics::Pose& pose) noexcept;
  /// Forgets what was foreseen.
  void forget() noexcept { foreseen_.reset(); }
  /// Forgets the live poses.
  void reset() noexcept;

  /// Returns the state of the entity at an instant. Between its newest live pose and what is
  /// foreseen it moves evenly.
  [[nodiscard]] TrajectoryState at(std::int64_t sim_time_ns) const noexcept;
  /// Returns the state at an instant like at(), but a moving entity continues straight for
  /// kMaxAheadNs after its newest live pose.
  [[nodiscard]] TrajectoryState ahead(std::int64_t sim_time_ns) const noexcept;

  /// Returns the scenario's trajectory, ascending in time.
  [[nodiscard]] std::span<const scene::Keyframe> script() const noexcept { return scripted_; }

  /// Knowledge about an entity at some time.
  struct Known {
    bool live = false;       ///< true when the host drives the entity
    scene::Keyframe newest;  ///< newest live pose of such an entity
  };
  /// Returns what is known now.
  [[nodiscard]] Known known() const noexcept;
  /// Returns the state at an instant by what was known earlier. After a reset() the earlier live
  /// poses are forgotten, so the result may differ.
  [[nodiscard]] TrajectoryState as_known(const Known& then,
                                         std::int64_t sim_time_ns) const noexcept;
  /// Returns true when the state at an instant, by what is known now, differs from the earlier one
  /// by more than 1 cm or 1 mrad, or in presence.
  [[nodiscard]] bool departs(const Known& then, std::int64_t sim_time_ns) const noexcept;

  /// Returns the length of the path between two instants while the entity is switched on, m. Jumps
  /// do not count.
  [[nodiscard]] double path_m(std::int64_t begin_ns, std::int64_t end_ns) const noexcept;

  /// Motion of an entity over an interval: its mean velocity in world axes, and the speed on ways
  /// that lead nowhere, which adds in squares.
  struct Motion {
    glm::dvec3 velocity_m_s{0.0};
    double undirected_m_s = 0.0;
  };
  /// Returns the motion between two instants. If they lie after the newest pose that the host sent,
  /// the motion of the last second before that pose goes on. Jumps do not count.
  [[nodiscard]] Motion motion(std::int64_t begin_ns, std::int64_t end_ns) const noexcept;
  /// Returns shape and length of the flow past the entity.
  [[nodiscard]] const physics::AirFilmBody& film_body() const noexcept { return film_body_; }

  /// Returns the instants at which the entity appears, vanishes, starts or stops, ascending: the
  /// latest kMaxEvents.
  [[nodiscard]] std::span<const std::int64_t> events_ns() const noexcept { return events_ns_; }

  /// Returns the instant since which the entity has been on at `sim_time_ns`: the latest at which
  /// it appeared. Empty if it was never off before. The latest kMaxAppearances are known.
  /// @pre at(sim_time_ns).on
  [[nodiscard]] std::optional<std::int64_t> on_since_ns(std::int64_t sim_time_ns) const noexcept;
  static constexpr std::size_t kMaxAppearances = 16;

  /// Returns the live poses that are kept, ascending in time.
  [[nodiscard]] std::span<const scene::Keyframe> live() const noexcept { return live_; }

  /// Returns the number of live poses dropped since the last reset because the store was full. The
  /// older half then keeps every other pose.
  [[nodiscard]] std::uint64_t dropped() const noexcept { return dropped_; }

 private:
  /// Returns the state at an instant, whatever is foreseen.
  [[nodiscard]] TrajectoryState recorded_at(std::int64_t sim_time_ns) const noexcept;
  void note_event(std::int64_t sim_time_ns) noexcept;
  void note_appearance(std::int64_t sim_time_ns) noexcept;
  [[nodiscard]] bool replaces_last(const scene::Keyframe& next) noexcept;
  void make_room() noexcept;
  void note_motion(const scene::Keyframe& last, const scene::Keyframe& next) noexcept;
  void note_scripted_events() noexcept;

  physics::AirFilmBody film_body_;
  scene::Trajectory scripted_;
  scene::Trajectory live_;
  std::optional<scene::Keyframe> foreseen_;
  std::vector<std::int64_t> events_ns_;
  // State of the detection of starts and stops. A live entity starts when it leaves the place where
  // it rested, and stops when it has stayed in one place for a while. Jitter of the host is
  // neither.
  bool moving_ = false;
  scene::Keyframe spot_;
  // Sample of the poses thinned out since the last kept one. The next pose must fit all of them.
  std::array<scene::Keyframe, 16> skipped_;
  std::size_t skipped_count_ = 0;
  std::size_t skipped_stride_ = 1;
  std::size_t skipped_phase_ = 0;
  std::uint64_t dropped_ = 0;
  std::array<std::int64_t, kMaxAppearances> appearances_ns_{};  ///< by the host, a ring
  std::size_t appearance_count_ = 0;
};

/// View of the entities' poses: by what is known now, by what was known earlier, or with
/// extrapolation. RT-safe.
class EntityPoses {
 public:
  /// Selects the poses that are known now.
  explicit EntityPoses(std::span<const PoseHistory> entities) : entities_(entities) {}
  /// Selects the poses by what was known earlier, one entry of `then` per entity.
  [[nodiscard]] static EntityPoses as_known(std::span<const PoseHistory> entities,
                                            std::span<const PoseHistory::Known> then) {
    EntityPoses poses(entities);
    poses.then_ = then;
    return poses;
  }
  /// Selects the poses that are known now, with extrapolation of moving entities.
  [[nodiscard]] static EntityPoses ahead(std::span<const PoseHistory> entities) {
    EntityPoses poses(entities);
    poses.ahead_ = true;
    return poses;
  }

  /// Returns the state of an entity at an instant.
  /// @pre entity is an index into the entities
  [[nodiscard]] TrajectoryState at(std::size_t entity, std::int64_t sim_time_ns) const noexcept {
    EMIT_DCHECK_OP(entity, <, entities_.size());
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
