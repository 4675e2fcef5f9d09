// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_entities.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/physics/constants.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;
using physics::kDegree;
using physics::Pose;

namespace {

/// Returns the attitude that is tilted so that the body stands on a slope.
glm::dquat tilted(const glm::dquat& world_from_body, const glm::dvec3& up,
                  const glm::dvec3& normal) noexcept {
  const glm::dvec3 axis = glm::cross(up, normal);
  const double sine = glm::length(axis);
  if (sine < 1e-12) return world_from_body;
  const double angle_rad = std::atan2(sine, glm::dot(up, normal));
  return glm::normalize(glm::angleAxis(angle_rad, axis / sine) * world_from_body);
}

physics::GeoPlace place_of(const cigi::Place& place) noexcept {
  return {physics::degrees(place.latitude_deg_or_x_m), physics::degrees(place.longitude_deg_or_y_m),
          physics::Metres(place.altitude_m_or_z_m)};
}

}  // namespace

CigiEntities::CigiEntities(const Georeference& earth, SceneQuery* scene, Options options)
    : earth_(earth),
      scene_(scene),
      options_(std::move(options)),
      places_(std::make_unique<std::array<std::uint16_t, 65536>>()) {
  for (const CigiPart::Joint& joint : options_.parts) parts_.emplace_back(joint);
  entities_.reserve(parts_.size() + kMaxEntities);
  clear();
}

void CigiEntities::clear() noexcept {
  entities_.clear();
  places_->fill(kNone);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    parts_[i] = CigiPart(options_.parts[i]);
    Entity& entity = entities_.emplace_back();
    entity.part = i;
    entity.scenario_id = parts_[i].joint().scenario_id;
    entity.control.state = cigi::EntityState::active;
    entity.has_place = entity.changed = entity.told = true;
    entity.known = options_.known(entity.scenario_id);
  }
  next_ = 0;
  time_ns_ = 0;
  carrier_ = options_.seeker;
  view_offset_body_m_ = glm::dvec3(0.0);
  view_yaw_pitch_roll_rad_ = glm::dvec3(0.0);
  if (scene_ != nullptr) scene_->reset();
}

void CigiEntities::mark_all(bool jump) noexcept {
  for (Entity& entity : entities_) {
    entity.marked = true;
    entity.jumps |= jump;
  }
}

CigiEntities::Entity* CigiEntities::find(std::uint16_t id) noexcept {
  const std::uint16_t place = (*places_)[id];
  return place == kNone ? nullptr : &entities_[place];
}
const CigiEntities::Entity* CigiEntities::find(std::uint16_t id) const noexcept {
  const std::uint16_t place = (*places_)[id];
  return place == kNone ? nullptr : &entities_[place];
}

CigiEntities::Entity* CigiEntities::find_or_make(std::uint16_t id) noexcept {
  if (Entity* entity = find(id)) return entity;
  if (entities_.size() == parts_.size() + kMaxEntities) return nullptr;
  (*places_)[id] = static_cast<std::uint16_t>(entities_.size());
  Entity& entity = entities_.emplace_back();
  entity.id = entity.control.entity_id = id;
  entity.scenario_id = id;
  bool mapped = false;
  bool taken = false;  // another number of the host stands for this entity
  for (const auto& [host_id, scenario_id] : options_.entities) {
    if (host_id == id) entity.scenario_id = scenario_id;
    mapped |= host_id == id;
    taken |= scenario_id == id;
  }
  for (const CigiPart& part : parts_) taken |= part.joint().scenario_id == id;
  // The carrier of the sensor need not be seen, and 0 means scenery in a scenario.
  entity.known =
      entity.scenario_id != 0 && (mapped || !taken) && options_.known(entity.scenario_id);
  entity.told = entity.known || id == carrier_;
  return &entity;
}

void CigiEntities::shift(std::int64_t by_ns) noexcept {
  time_ns_ += by_ns;
  for (Entity& entity : entities_) entity.time_ns += by_ns;
  for (CigiPart& part : parts_) part.shift(by_ns);
}

CigiEntities::Entity* CigiEntities::find_part(std::uint16_t entity_id,
                                              std::uint8_t part_id) noexcept {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const CigiPart::Joint& joint = parts_[i].joint();
    if (joint.entity_id == entity_id && joint.part_id == part_id) return &entities_[i];
  }
  return nullptr;
}

const CigiEntities::Entity* CigiEntities::carrier_of(const Entity& entity) const noexcept {
  if (!entity.part) return find(entity.control.parent_id);
  const CigiPart::Joint& joint = parts_[*entity.part].joint();
  if (!joint.on_part) return find(joint.entity_id);
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const CigiPart::Joint& other = parts_[i].joint();
    if (other.entity_id == joint.entity_id && other.part_id == *joint.on_part) return &entities_[i];
  }
  return nullptr;
}

void CigiEntities::after_part_packet(Entity& entity) noexcept {
  const auto state =
      parts_[*entity.part].is_shown() ? cigi::EntityState::active : cigi::EntityState::standby;
  if (std::exchange(entity.control.state, state) != state) entity.jumps = true;
  entity.changed = true;
}

bool CigiEntities::take(const cigi::ArticulatedPartControl& packet) noexcept {
  Entity* entity = find_part(packet.entity_id, packet.part_id);
  if (entity == nullptr) return false;
  parts_[*entity->part].set(packet, time_ns_);
  after_part_packet(*entity);
  return true;
}

bool CigiEntities::take(const cigi::ShortArticulatedPartControl& packet) noexcept {
  bool all = true;
  for (const cigi::PartMotion& motion : packet.motions) {
    // A freedom that is not used says nothing about its part.
    if (motion.axis == cigi::PartAxis::none) continue;
    Entity* entity = find_part(packet.entity_id, motion.part_id);
    all &= entity != nullptr;
    if (entity == nullptr) continue;
    parts_[*entity->part].set(motion, time_ns_);
    after_part_packet(*entity);
  }
  return all;
}

bool CigiEntities::take(const cigi::EntityControl& packet) noexcept {
  Entity* entity = find_or_make(packet.entity_id);
  if (entity == nullptr) return false;
  // An entity that comes back, or hangs on another one, is somewhere else at once.
  if (entity->control.state != packet.state || entity->control.attached != packet.attached ||
      entity->control.parent_id != packet.parent_id) {
    entity->jumps = true;
  }
  if (packet.state == cigi::EntityState::destroyed) entity->rates.reset();
  entity->control = packet;
  entity->time_ns = time_ns_;
  entity->way_world_m = glm::dvec3(0.0);
  entity->turn_body = glm::dquat(1.0, 0.0, 0.0, 0.0);
  entity->has_place = entity->changed = true;
  return true;
}

bool CigiEntities::take(const cigi::EntityPosition& packet) noexcept {
  Entity* entity = find_or_make(packet.entity_id);
  if (entity == nullptr) return false;
  cigi::EntityControl whole = entity->control;
  whole.attached = packet.attached;
  whole.clamp = packet.clamp;
  whole.parent_id = packet.parent_id;
  whole.roll_deg = packet.roll_deg;
  whole.pitch_deg = packet.pitch_deg;
  whole.yaw_deg = packet.yaw_deg;
  whole.place = packet.place;
  return take(whole);
}

bool CigiEntities::take(const cigi::EntityControl40& packet) noexcept {
  Entity* entity = find_or_make(packet.entity_id);
  if (entity == nullptr) return false;
  if (entity->control.state != packet.state) entity->jumps = true;
  if (packet.state == cigi::EntityState::destroyed) entity->rates.reset();
  entity->control.state = packet.state;
  entity->changed = true;
  return true;
}

bool CigiEntities::take(const cigi::RateControl& packet) noexcept {
  if (packet.applies_to_part) {
    Entity* part = find_part(packet.entity_id, packet.part_id);
    if (part == nullptr) return false;
    parts_[*part->part].set(packet, time_ns_);
    part->changed = true;
    return true;
  }
  Entity* entity = find(packet.entity_id);
  if (entity == nullptr || entity->control.attached) return false;
  move_on(*entity);
  entity->rates = packet;
  entity->changed = true;
  return true;
}

bool CigiEntities::take(const cigi::ViewControl& packet) noexcept {
  if (packet.group_id != 0 || packet.view_id != options_.view) return false;
  carrier_ = packet.entity_id;
  const auto set = [](bool enabled, double& value, double to) {
    if (enabled) value = to;
  };
  set(packet.x_enabled, view_offset_body_m_.x, packet.x_m);
  set(packet.y_enabled, view_offset_body_m_.y, packet.y_m);
  set(packet.z_enabled, view_offset_body_m_.z, packet.z_m);
  set(packet.yaw_enabled, view_yaw_pitch_roll_rad_.x, packet.yaw_deg * kDegree);
  set(packet.pitch_enabled, view_yaw_pitch_roll_rad_.y, packet.pitch_deg * kDegree);
  set(packet.roll_enabled, view_yaw_pitch_roll_rad_.z, packet.roll_deg * kDegree);
  return true;
}

void CigiEntities::move_on(Entity& entity) noexcept {
  const Pose from = said_pose(entity);
  const Pose to = pose_on_earth(entity);
  entity.way_world_m = to.position_world_m - from.position_world_m;
  entity.turn_body = glm::normalize(glm::conjugate(from.world_from_body) * to.world_from_body);
  entity.time_ns = time_ns_;
}

Pose CigiEntities::pose_on_earth(const Entity& entity) const noexcept {
  Pose pose = said_pose(entity);
  pose.position_world_m += entity.way_world_m;
  pose.world_from_body = glm::normalize(pose.world_from_body * entity.turn_body);
  if (!is_moving(entity)) return pose;
  const auto rates = rates_of(entity, pose);
  if (!rates) return pose;
  const double for_s = 1e-9 * static_cast<double>(time_ns_ - entity.time_ns);
  pose.position_world_m += rates->velocity_world_m_s * for_s;
  const glm::dvec3 turn_rad = rates->angular_rate_body_rad_s * for_s;
  if (const double angle_rad = glm::length(turn_rad); angle_rad > 0.0) {
    pose.world_from_body =
        glm::normalize(pose.world_from_body * glm::angleAxis(angle_rad, turn_rad / angle_rad));
  }
  return pose;
}

Pose CigiEntities::said_pose(const Entity& entity) const noexcept {
  const cigi::EntityControl& control = entity.control;
  const physics::HeadingPitchRoll attitude = {
      control.yaw_deg * kDegree, control.pitch_deg * kDegree, control.roll_deg * kDegree};
  const physics::GeoPlace place = place_of(control.place);
  if (control.clamp == cigi::Clamp::none || scene_ == nullptr) {
    return earth_.world_pose(place, attitude);
  }
  // The altitude of a clamped entity is its height above the ground, and its pitch and roll refer
  // to the ground if the clamp is conformal. Where there is no ground, they stay as they are.
  const physics::GeoPlace foot = {place.latitude, place.longitude, physics::Metres(0.0)};
  const glm::dvec3 up = earth_.world_from_enu(foot)[2];
  const auto ground = scene_->ground(earth_.position_world_m(foot), up);
  Pose pose = earth_.world_pose(ground ? foot : place, attitude);
  if (!ground) return pose;
  pose.position_world_m = ground->position_world_m + up * control.place.altitude_m_or_z_m;
  if (control.clamp == cigi::Clamp::conformal) {
    pose.world_from_body = tilted(pose.world_from_body, up, ground->normal_world);
  }
  return pose;
}

std::optional<Pose> CigiEntities::pose_of(const Entity& entity, int parents) const noexcept {
  const cigi::EntityControl& control = entity.control;
  if (!entity.has_place || control.state == cigi::EntityState::destroyed) return std::nullopt;
  if (!hangs(entity)) return pose_on_earth(entity);
  const Entity* carrier = carrier_of(entity);
  if (carrier == nullptr || parents == kMaxParents) return std::nullopt;
  const auto pose = pose_of(*carrier, parents + 1);
  if (!pose) return std::nullopt;
  if (entity.part) return parts_[*entity.part].pose(*pose, time_ns_);
  return attached(*pose,
                  {control.place.latitude_deg_or_x_m, control.place.longitude_deg_or_y_m,
                   control.place.altitude_m_or_z_m},
                  physics::body_from_turned(
                      glm::dvec3{control.yaw_deg, control.pitch_deg, control.roll_deg} * kDegree));
}

std::optional<Pose> CigiEntities::pose_of(std::uint16_t id) const noexcept {
  const Entity* entity = find(id);
  return entity != nullptr ? pose_of(*entity, 0) : std::nullopt;
}

std::optional<Pose> CigiEntities::seeker_pose() const noexcept {
  const auto carrier = pose_of(carrier_);
  if (!carrier) return std::nullopt;
  return attached(*carrier, view_offset_body_m_,
                  physics::body_from_turned(view_yaw_pitch_roll_rad_));
}

std::optional<Pose> CigiEntities::pose_of_part(std::uint16_t entity_id,
                                               std::uint8_t part_id) const noexcept {
  for (std::size_t i = 0; i < parts_.size(); ++i) {
    const CigiPart::Joint& joint = parts_[i].joint();
    if (joint.entity_id == entity_id && joint.part_id == part_id) return pose_of(entities_[i], 0);
  }
  return std::nullopt;
}

std::optional<std::uint16_t> CigiEntities::parent_of(std::uint16_t id) const noexcept {
  const Entity* entity = find(id);
  if (entity == nullptr || !entity->control.attached) return std::nullopt;
  return entity->control.parent_id;
}

std::uint16_t CigiEntities::host_id_of(std::uint32_t entity_id) const noexcept {
  for (const auto& [host_id, scenario_id] : options_.entities) {
    if (scenario_id == entity_id) return host_id;
  }
  for (const CigiPart& part : parts_) {
    if (part.joint().scenario_id == entity_id) return part.joint().entity_id;
  }
  return static_cast<std::uint16_t>(entity_id);
}

std::optional<std::uint16_t> CigiEntities::take_unknown() noexcept {
  for (Entity& entity : entities_) {
    if (!std::exchange(entity.told, true)) return entity.id;
  }
  return std::nullopt;
}

std::optional<protocol::PoseRates> CigiEntities::rates_of(const Entity& entity,
                                                          const Pose& pose) const noexcept {
  if (!entity.rates || hangs(entity)) return std::nullopt;
  const cigi::RateControl& rates = *entity.rates;
  const glm::dvec3 linear_m_s{rates.x_m_s, rates.y_m_s, rates.z_m_s};
  const glm::dvec3 angular_rad_s =
      glm::dvec3{rates.roll_deg_s, rates.pitch_deg_s, rates.yaw_deg_s} * kDegree;
  if (rates.local) return protocol::PoseRates{pose.world_from_body * linear_m_s, angular_rad_s};
  // Rates in the frame of the world are along north, east and down where the entity is.
  const glm::dmat3 world_from_enu = earth_.world_from_enu(earth_.place_of(pose.position_world_m));
  const auto world_of = [&](const glm::dvec3& ned) {
    return world_from_enu * glm::dvec3{ned.y, ned.x, -ned.z};
  };
  return protocol::PoseRates{world_of(linear_m_s),
                             glm::conjugate(pose.world_from_body) * world_of(angular_rad_s)};
}

bool CigiEntities::has_moved(const Entity& entity) const noexcept {
  const Entity* link = &entity;
  for (int parents = 0; parents <= kMaxParents; ++parents) {
    if (link->changed || is_moving(*link)) return true;
    if (!hangs(*link)) return false;
    link = carrier_of(*link);
    if (link == nullptr) return false;
  }
  return false;
}

bool CigiEntities::jumps_with(const Entity& entity) const noexcept {
  const Entity* link = &entity;
  for (int parents = 0; parents <= kMaxParents && link != nullptr; ++parents) {
    if (link->jumps) return true;
    link = hangs(*link) ? carrier_of(*link) : nullptr;
  }
  return false;
}

bool CigiEntities::is_on(const Entity& entity) const noexcept {
  const Entity* link = &entity;
  for (int parents = 0; parents <= kMaxParents; ++parents) {
    if (link->control.state != cigi::EntityState::active) return false;
    if (!hangs(*link)) return true;
    link = carrier_of(*link);
    if (link == nullptr) return false;
  }
  return false;
}

void CigiEntities::fill(protocol::HostFrameData& frame) noexcept {
  frame.seeker = *seeker_pose();
  frame.seeker_rates.reset();
  const glm::dvec3 zero(0.0);
  // Rates of the carrier are those of the sensor only where it sits in the carrier's origin.
  if (const Entity* carrier = find(carrier_);
      carrier != nullptr && view_offset_body_m_ == zero && view_yaw_pitch_roll_rad_ == zero) {
    frame.seeker_rates = rates_of(*carrier, frame.seeker);
  }
  // Three poses in a row at one place tell the prediction that an entity stands.
  constexpr int kRepeats = 3;
  for (Entity& entity : entities_) {
    if (has_moved(entity)) {
      entity.marked = true;
      entity.repeats = options_.predicted ? kRepeats : 0;
      entity.jumps = jumps_with(entity);
    } else if (entity.repeats > 0) {
      entity.marked = true;
      --entity.repeats;
    }
  }
  for (Entity& entity : entities_) {
    entity.changed = false;
    // No frame says so of an entity that the scenario does not have.
    if (!entity.known) entity.jumps = false;
  }
  frame.entity_count = 0;
  const std::size_t count = entities_.size();
  for (std::size_t i = 0; i < count && frame.entity_count < protocol::kMaxEntitiesPerFrame; ++i) {
    const std::size_t place = (next_ + i) % count;
    Entity& entity = entities_[place];
    if (!entity.marked || !entity.known) continue;
    protocol::EntityStateData& out = frame.entities[frame.entity_count++];
    out = {};
    out.entity_id = entity.scenario_id;
    const auto pose = pose_of(entity, 0);
    out.has_pose = pose.has_value();
    out.on = pose && is_on(entity);
    if (pose) {
      out.pose = *pose;
      out.rates = rates_of(entity, *pose);
      out.teleport = std::exchange(entity.jumps, false);
    }
    entity.marked = false;
    if (frame.entity_count == protocol::kMaxEntitiesPerFrame) next_ = (place + 1) % count;
  }
}

void CigiEntities::place_in_scene() noexcept {
  if (scene_ == nullptr) return;
  for (const Entity& entity : entities_) {
    if (!entity.known) continue;
    const auto pose = pose_of(entity, 0);
    scene_->place(entity.scenario_id, pose.value_or(Pose{}), pose && is_on(entity));
  }
}

}  // namespace emit::server
