// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_queries.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <type_traits>

#include "emit/physics/constants.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;
using physics::kDegree;

namespace {

/// Returns the messages between two answers; 0: there is one answer.
std::uint8_t period_of(const cigi::HatHotRequest& request) noexcept {
  return request.update_period_frames;
}
std::uint8_t period_of(const cigi::LosSegmentRequest& request) noexcept {
  return request.update_period_frames;
}
std::uint8_t period_of(const cigi::LosVectorRequest& request) noexcept {
  return request.update_period_frames;
}
std::uint8_t period_of(const cigi::PositionRequest& request) noexcept {
  return request.continuous ? 1 : 0;
}

/// Returns true where a question takes the place of another one.
template <class Request>
bool replaces(const Request& request, const Request& other) noexcept {
  if constexpr (std::is_same_v<Request, cigi::PositionRequest>) {
    return request.object_id == other.object_id && request.object_class == other.object_class &&
           request.part_id == other.part_id;
  } else {
    return request.request_id == other.request_id;
  }
}

cigi::Place geodetic(const physics::GeoPlace& place) noexcept {
  return {physics::to_degrees(place.latitude), physics::to_degrees(place.longitude),
          place.height.value()};
}

}  // namespace

bool CigiQueries::add(const Question& question) noexcept {
  const auto end = questions_.begin() + static_cast<std::ptrdiff_t>(count_);
  const auto same = std::find_if(questions_.begin(), end, [&](const Question& other) {
    return std::visit(
        [&](const auto& request) {
          const auto* known = std::get_if<std::decay_t<decltype(request)>>(&other.request);
          return known != nullptr && period_of(*known) != 0 && replaces(request, *known);
        },
        question.request);
  });
  if (same != end) {
    *same = question;
    return true;
  }
  if (count_ == kMaxQuestions) return false;
  questions_[count_++] = question;
  return true;
}

CigiQueries::Answered CigiQueries::answer(cigi::Writer& writer) noexcept {
  Answered out;
  std::size_t kept = 0;
  bool has_room = true;
  const auto add = [&](const Question& question, bool blind) {
    return writer.add(
        std::visit([&](const auto& request) { return answer_to(request, question.lsn, blind); },
                   question.request));
  };
  for (std::size_t i = 0; i < count_; ++i) {
    Question question = questions_[i];
    bool stays = true;
    if (question.wait_frames > 0) {
      --question.wait_frames;
    } else if (has_room) {
      cigi::Fault fault = add(question, false);
      // Numbers that no packet can hold are no answer.
      if (fault && fault.kind != cigi::Fault::Kind::no_space) fault = add(question, true);
      has_room = fault.kind != cigi::Fault::Kind::no_space;
      if (has_room) {
        ++(fault ? out.dropped : out.answers);
        const std::uint8_t period =
            std::visit([](const auto& request) { return period_of(request); }, question.request);
        stays = period != 0;
        question.wait_frames = period != 0 ? static_cast<std::uint8_t>(period - 1) : 0;
      }
    }
    if (stays) questions_[kept++] = question;
  }
  count_ = kept;
  return out;
}

std::optional<glm::dvec3> CigiQueries::point_of(const cigi::Place& place, bool relative,
                                                std::uint16_t entity_id) const noexcept {
  if (!relative) {
    return earth_.position_world_m({physics::degrees(place.latitude_deg_or_x_m),
                                    physics::degrees(place.longitude_deg_or_y_m),
                                    physics::Metres(place.altitude_m_or_z_m)});
  }
  const auto pose = entities_.pose_of(entity_id);
  if (!pose) return std::nullopt;
  return pose->position_world_m + pose->world_from_body * glm::dvec3{place.latitude_deg_or_x_m,
                                                                     place.longitude_deg_or_y_m,
                                                                     place.altitude_m_or_z_m};
}

void CigiQueries::write_normal(const SceneQuery::Hit& hit, float& azimuth_deg,
                               float& elevation_deg) const noexcept {
  const glm::dvec3 enu =
      hit.normal_world * earth_.world_from_enu(earth_.place_of(hit.position_world_m));
  azimuth_deg = static_cast<float>(std::atan2(enu.x, enu.y) / kDegree);
  elevation_deg = static_cast<float>(std::asin(std::clamp(enu.z, -1.0, 1.0)) / kDegree);
}

cigi::Packet CigiQueries::answer_to(const cigi::HatHotRequest& request, std::uint8_t lsn,
                                    bool blind) const noexcept {
  std::optional<SceneQuery::Hit> hit;
  double of_m = 0.0;
  double above_m = 0.0;
  if (const auto point = point_of(request.place, request.relative_to_entity, request.entity_id);
      point && scene_ != nullptr && !blind) {
    const physics::GeoPlace place = earth_.place_of(*point);
    hit = scene_->ground(*point, earth_.world_from_enu(place)[2]);
    if (hit) {
      // Both heights are along the same vertical of the ellipsoid.
      of_m = earth_.place_of(hit->position_world_m).height.value();
      above_m = place.height.value() - of_m;
    }
  }
  if (request.type == cigi::HatHotType::extended) {
    cigi::HatHotExtendedResponse out;
    out.request_id = request.request_id;
    out.valid = hit.has_value();
    out.host_frame_lsn = lsn;
    if (hit) {
      out.height_above_terrain_m = above_m;
      out.height_of_terrain_m = of_m;
      out.material_code = hit->material + 1;
      write_normal(*hit, out.normal_azimuth_deg, out.normal_elevation_deg);
    }
    return out;
  }
  cigi::HatHotResponse out;
  out.request_id = request.request_id;
  out.valid = hit.has_value();
  out.height_of_terrain = request.type == cigi::HatHotType::height_of;
  out.host_frame_lsn = lsn;
  out.height_m = out.height_of_terrain ? of_m : above_m;
  return out;
}

cigi::Packet CigiQueries::answer_to(const cigi::LosSegmentRequest& request, std::uint8_t lsn,
                                    bool blind) const noexcept {
  Sight sight{request.request_id, request.extended, request.response_relative, false, {}};
  const auto source = point_of(request.source, request.source_relative, request.entity_id);
  const auto destination = point_of(
      request.destination, request.destination_relative,
      request.destination_entity_valid ? request.destination_entity_id : request.entity_id);
  if (!source || !destination || scene_ == nullptr || blind) return packet_of(sight, lsn);
  const double length_m = glm::distance(*source, *destination);
  sight.visible = true;
  if (length_m > 0.0) {
    sight.hit = scene_->first_hit(*source, (*destination - *source) / length_m);
    // The surface on which the destination lies does not hide it.
    constexpr double kAtDestinationM = 1e-6;
    if (sight.hit && sight.hit->range_m > length_m + kAtDestinationM) sight.hit.reset();
    // A destination inside of an entity counts as hidden, and the answer names the entity.
    if (sight.hit) sight.visible = sight.hit->range_m > length_m - kAtDestinationM;
  }
  return packet_of(sight, lsn);
}

cigi::Packet CigiQueries::answer_to(const cigi::LosVectorRequest& request, std::uint8_t lsn,
                                    bool blind) const noexcept {
  Sight sight{request.request_id, request.extended, request.response_relative, false, {}};
  const auto source = point_of(request.source, request.source_relative, request.entity_id);
  if (!source || scene_ == nullptr || blind) return packet_of(sight, lsn);
  const double azimuth_rad = request.azimuth_deg * kDegree;
  const double elevation_rad = request.elevation_deg * kDegree;
  const double level = std::cos(elevation_rad);
  glm::dvec3 direction;
  if (request.source_relative) {
    // Azimuth turns to the right of the body and elevation up; its z axis is down.
    const glm::dvec3 body{level * std::cos(azimuth_rad), level * std::sin(azimuth_rad),
                          -std::sin(elevation_rad)};
    direction = entities_.pose_of(request.entity_id)->world_from_body * body;
  } else {
    const glm::dvec3 enu{level * std::sin(azimuth_rad), level * std::cos(azimuth_rad),
                         std::sin(elevation_rad)};
    direction = earth_.world_from_enu(earth_.place_of(*source)) * enu;
  }
  sight.hit = scene_->first_hit(*source, glm::normalize(direction));
  if (sight.hit && (sight.hit->range_m < request.min_range_m ||
                    (request.max_range_m > 0.0f && sight.hit->range_m > request.max_range_m))) {
    sight.hit.reset();
  }
  return packet_of(sight, lsn);
}

cigi::Packet CigiQueries::packet_of(const Sight& sight, std::uint8_t lsn) const noexcept {
  const bool on_entity = sight.hit && sight.hit->entity_id != 0;
  const std::uint16_t entity_id =
      on_entity ? entities_.host_id_of(sight.hit->entity_id) : std::uint16_t{0};
  if (!sight.extended) {
    cigi::LosResponse out;
    out.request_id = sight.request_id;
    out.valid = sight.hit.has_value();
    out.entity_valid = on_entity;
    out.visible = sight.visible;
    out.host_frame_lsn = lsn;
    out.response_count = 1;
    out.entity_id = entity_id;
    out.range_m = sight.hit ? sight.hit->range_m : 0.0;
    return out;
  }
  cigi::LosExtendedResponse out;
  out.request_id = sight.request_id;
  out.valid = sight.hit.has_value();
  out.entity_valid = on_entity;
  out.range_valid = sight.hit.has_value();
  out.visible = sight.visible;
  out.host_frame_lsn = lsn;
  out.response_count = 1;
  out.entity_id = entity_id;
  if (!sight.hit) return out;
  out.range_m = sight.hit->range_m;
  out.material_code = sight.hit->material + 1;
  out.alpha = 255;  // surfaces are opaque; radiance has no colour
  write_normal(*sight.hit, out.normal_azimuth_deg, out.normal_elevation_deg);
  const auto pose = sight.relative && on_entity ? entities_.pose_of(entity_id) : std::nullopt;
  if (pose) {
    const glm::dvec3 offset = glm::conjugate(pose->world_from_body) *
                              (sight.hit->position_world_m - pose->position_world_m);
    out.place = {offset.x, offset.y, offset.z};
  } else {
    out.place = geodetic(earth_.place_of(sight.hit->position_world_m));
  }
  return out;
}

cigi::Packet CigiQueries::answer_to(const cigi::PositionRequest& request, std::uint8_t /*lsn*/,
                                    bool blind) const noexcept {
  cigi::PositionResponse out;
  out.object_id = request.object_id;
  out.part_id = request.part_id;
  out.object_class = request.object_class;
  std::optional<physics::Pose> pose;
  std::optional<physics::Pose> parent;
  if (request.object_class == cigi::ObjectClass::entity) {
    pose = entities_.pose_of(request.object_id);
    if (const auto id = entities_.parent_of(request.object_id)) parent = entities_.pose_of(*id);
  } else if (request.object_class == cigi::ObjectClass::articulated_part) {
    pose = entities_.pose_of_part(request.object_id, request.part_id);
    parent = entities_.pose_of(request.object_id);
  } else if (request.object_class == cigi::ObjectClass::view) {
    pose = entities_.seeker_pose();
  }
  // The packet cannot say that there is no answer: an object without a pose is at zero.
  if (!pose || blind) return out;
  if (request.frame == cigi::PositionFrame::parent && parent) {
    out.frame = cigi::PositionFrame::parent;
    const glm::dquat body_from_world = glm::conjugate(parent->world_from_body);
    const glm::dvec3 offset = body_from_world * (pose->position_world_m - parent->position_world_m);
    out.place = {offset.x, offset.y, offset.z};
    // The turn from the parent's axes is read as if these were north, east and down.
    const glm::dquat enu_from_ned = physics::world_from_body_heading_pitch_roll(0.0, 0.0, 0.0);
    const physics::HeadingPitchRoll turn =
        physics::heading_pitch_roll(enu_from_ned * (body_from_world * pose->world_from_body));
    out.yaw_deg = static_cast<float>(turn.heading_rad / kDegree);
    out.pitch_deg = static_cast<float>(turn.pitch_rad / kDegree);
    out.roll_deg = static_cast<float>(turn.roll_rad / kDegree);
    return out;
  }
  out.place = geodetic(earth_.place_of(pose->position_world_m));
  const physics::HeadingPitchRoll attitude = earth_.attitude_of(*pose);
  out.yaw_deg = static_cast<float>(attitude.heading_rad / kDegree);
  out.pitch_deg = static_cast<float>(attitude.pitch_rad / kDegree);
  out.roll_deg = static_cast<float>(attitude.roll_rad / kDegree);
  return out;
}

}  // namespace emit::server
