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
/// Owner: Renderer. Thread: the renderer's. Real time: append, reset, at, path_m RT-safe (memory is
/// taken by the constructor).
class PoseHistory {
 public:
  static constexpr std::size_t kMaxLivePoses = 16384;
  static constexpr std::size_t kMaxEvents = 256;

  /// `placement` holds until the first keyframe of an entity without trajectory.
  PoseHistory(const scene::ObjectDesc& object, const physics::Pose& placement);

  /// Adds a live pose. Poses that lie on the way between their neighbours are thinned out (to 1 cm
  /// and 1 mrad, at most one second apart while moving). A time before the newest live pose is
  /// refused (false).
  bool append(std::int64_t sim_time_ns, const physics::Pose& pose, bool on, bool teleport) noexcept;
  /// Forgets the live poses.
  void reset() noexcept;

  [[nodiscard]] TrajectoryState at(std::int64_t sim_time_ns) const noexcept;

  /// Length of the way between two instants while switched on; jumps do not count.
  [[nodiscard]] double path_m(std::int64_t begin_ns, std::int64_t end_ns) const noexcept;

  /// Instants at which the entity appears, vanishes, starts or stops, ascending: the latest
  /// kMaxEvents.
  [[nodiscard]] std::span<const std::int64_t> events_ns() const noexcept { return events_ns_; }
  /// Goes up whenever events_ns() changes.
  [[nodiscard]] std::uint64_t events_revision() const noexcept { return events_revision_; }

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
  std::uint64_t events_revision_ = 0;
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

}  // namespace emit::renderer
