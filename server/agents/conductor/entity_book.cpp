// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/entity_book.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace emit::server {
namespace {

/// An entity that stands is sent again after this time, so that its pose history sees it at rest.
constexpr std::int64_t kStandsForNs = 250'000'000;

/// Returns true for two poses that differ by no more than the rounding of an interpolation between
/// equal ends.
bool same_place(const physics::Pose& a, const physics::Pose& b) noexcept {
  constexpr double kSameM = 1e-6;
  constexpr double kSameRad = 1e-9;
  const glm::dvec3 moved_m = glm::abs(a.position_world_m - b.position_world_m);
  const glm::dquat turned = a.world_from_body - b.world_from_body;
  return std::max({moved_m.x, moved_m.y, moved_m.z}) <= kSameM &&
         std::max({std::abs(turned.w), std::abs(turned.x), std::abs(turned.y),
                   std::abs(turned.z)}) <= kSameRad;
}

}  // namespace

EntityBook::EntityBook(const ScenarioTracks& scenario) : scenario_(scenario) {
  entities_.reserve(kMaxTracked);
  marked_.reserve(kMaxTracked);
}

void EntityBook::clear() noexcept {
  entities_.clear();
  marked_.clear();
  next_moved_ = 0;
  next_standing_ = 0;
}

EntityBook::Entity* EntityBook::find(std::uint32_t id) noexcept {
  const auto found = std::lower_bound(entities_.begin(), entities_.end(), id,
                                      [](const Entity& a, std::uint32_t b) { return a.id < b; });
  return found != entities_.end() && found->id == id ? &*found : nullptr;
}

bool EntityBook::add(std::uint32_t id) noexcept {
  if (find(id) != nullptr) {
    return true;
  }
  if (entities_.size() == kMaxTracked) {
    return false;
  }
  Entity added;
  added.id = id;
  const auto place = std::lower_bound(entities_.begin(), entities_.end(), id,
                                      [](const Entity& a, std::uint32_t b) { return a.id < b; });
  entities_.insert(place, added);  // within the reserved memory
  return true;
}

void EntityBook::store(const protocol::EntityStateData& state, std::int64_t sim_time_ns,
                       bool mark) noexcept {
  Entity* const found = find(state.entity_id);
  if (found == nullptr) {
    return;
  }
  Entity& entity = *found;
  entity.on = state.on;
  if (state.has_pose) {
    entity.track.push({sim_time_ns, state.pose, state.rates, state.teleport});
    if (state.teleport) {
      if (!entity.teleport_pending) {
        entity.first_teleport_ns = sim_time_ns;
      }
      entity.last_teleport_ns = sim_time_ns;
      entity.teleport_pending = true;
    }
  } else {
    // An entity without a pose stays where it is: at its last pose from a host, or else at its pose
    // in the scenario at this instant. The track takes this as the end of any motion. It is no jump
    // of the entity.
    const physics::Pose pose = entity.track.empty()
                                   ? scenario_.entity_at(entity.id, sim_time_ns).pose
                                   : entity.track.newest().pose;
    constexpr bool kNoMotionBefore = true;
    entity.track.push({sim_time_ns, pose, std::nullopt, kNoMotionBefore});
  }
  if (mark && !entity.marked) {
    entity.marked = true;
    marked_.push_back(entity.id);
  }
}

void EntityBook::add_update(RenderJob& job, Entity& entity, const physics::Pose& pose,
                            std::int64_t base_ns) noexcept {
  renderer::EntityUpdate& update = job.entities[job.entity_count++];
  update.entity_id = entity.id;
  update.pose = pose;
  update.on = entity.on;
  // The pose is still the one before the jump while the instant shown is before it.
  update.teleport = entity.teleport_pending && base_ns >= entity.first_teleport_ns;
  if (update.teleport) {
    entity.teleport_pending = base_ns < entity.last_teleport_ns;
    entity.first_teleport_ns = entity.last_teleport_ns;
  }
}

physics::Pose EntityBook::pose_of(std::uint32_t id, std::int64_t sim_time_ns,
                                  Place place) const noexcept {
  const auto found = std::lower_bound(entities_.begin(), entities_.end(), id,
                                      [](const Entity& a, std::uint32_t b) { return a.id < b; });
  if (found == entities_.end() || found->id != id || found->track.empty()) {
    return scenario_.entity_at(id, sim_time_ns).pose;
  }
  switch (place) {
    case Place::newest:
      return found->track.newest().pose;
    case Place::placed:
      return found->placed.pose;
    case Place::foreseen:
      break;
  }
  return found->foreseen;
}

bool EntityBook::add_marked(RenderJob& job) noexcept {
  std::size_t applied = 0;
  for (; applied < marked_.size() && job.entity_count < job.entities.size(); ++applied) {
    Entity* found = find(marked_[applied]);
    if (found == nullptr) {
      continue;  // entities leave only with the whole book, in clear()
    }
    found->marked = false;
    const TimedPose& newest = found->track.newest();
    add_update(job, *found, newest.pose, newest.sim_time_ns);
  }
  marked_.erase(marked_.begin(), marked_.begin() + static_cast<std::ptrdiff_t>(applied));
  return marked_.empty();
}

template <class Wanted>
bool EntityBook::add_wanted(RenderJob& job, std::int64_t shown_ns, std::size_t& next,
                            std::size_t limit, const Wanted& wanted) noexcept {
  for (std::size_t i = 0, first = next; i < entities_.size(); ++i) {
    const std::size_t at = (first + i) % entities_.size();
    Entity& entity = entities_[at];
    if (entity.in_job || !wanted(entity)) {
      continue;
    }
    if (limit == 0 || job.entity_count == job.entities.size()) {
      next = at;
      return false;
    }
    --limit;
    entity.in_job = true;
    entity.sent = {entity.placed.pose, shown_ns, entity.on};
    add_update(job, entity, entity.placed.pose, entity.placed.base_ns);
  }
  return true;
}

bool EntityBook::add_all_at(RenderJob& job, std::int64_t shown_ns,
                            std::int64_t horizon_ns) noexcept {
  for (Entity& entity : entities_) {
    entity.placed = entity.track.sample(shown_ns, horizon_ns);
    entity.moved = !entity.sent || entity.teleport_pending || entity.sent->on != entity.on ||
                   !same_place(entity.sent->pose, entity.placed.pose);
    entity.in_job = false;
  }
  const auto moved = [](const Entity& entity) { return entity.moved; };
  const auto overdue = [&](const Entity& entity) {
    return !entity.moved && shown_ns - entity.sent->sim_time_ns >= kStandsForNs;
  };
  const auto any = [](const Entity&) { return true; };
  constexpr std::size_t kAll = std::numeric_limits<std::size_t>::max();
  // When a frame has too little room, entities that stand can wait, but not for ever.
  constexpr std::size_t kMaxOverdueFirst = 8;
  static_cast<void>(add_wanted(job, shown_ns, next_standing_, kMaxOverdueFirst, overdue));
  const bool up_to_date = add_wanted(job, shown_ns, next_moved_, kAll, moved);
  static_cast<void>(add_wanted(job, shown_ns, next_standing_, kAll, overdue) &&
                    add_wanted(job, shown_ns, next_standing_, kAll, any));
  return up_to_date;
}

bool EntityBook::foresee(RenderJob& job, std::int64_t horizon_ns) noexcept {
  RenderJob::Ahead& ahead = job.ahead;
  ahead.entity_count = 0;
  bool complete = true;
  for (Entity& entity : entities_) {
    entity.foreseen = entity.track.sample(ahead.sim_time_ns, horizon_ns).pose;
    if (same_place(entity.placed.pose, entity.foreseen)) continue;
    complete = ahead.entity_count < ahead.entities.size();
    if (!complete) continue;
    ahead.entities[ahead.entity_count++] = {entity.id, entity.foreseen, entity.on, false};
  }
  return complete;
}

}  // namespace emit::server
