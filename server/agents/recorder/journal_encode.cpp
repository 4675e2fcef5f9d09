// SPDX-License-Identifier: Apache-2.0
#include "agents/recorder/journal_encode.hpp"

#include <cstring>
#include <vector>

#include "agents/journal_ring.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/version.hpp"
#include "emit/v1/control.pb.h"

namespace emit::server {
namespace {

template <class Line>
bool read(std::span<const std::byte> bytes, Line& line) {
  if (bytes.size() < sizeof(Line)) {
    return false;
  }
  std::memcpy(&line, bytes.data(), sizeof(Line));
  return true;
}

/// Reads `count` elements into the begin of `out`, and moves `bytes` behind them. It returns false
/// when the bytes or the room do not suffice.
template <class Elements>
bool read_elements(std::span<const std::byte>& bytes, std::uint32_t count, Elements& out) {
  const std::size_t size = count * sizeof(typename Elements::value_type);
  if (count > out.size() || bytes.size() < size) {
    return false;
  }
  if (count > 0) {
    std::memcpy(out.data(), bytes.data(), size);
  }
  bytes = bytes.subspan(size);
  return true;
}

bool host_frame(std::span<const std::byte> bytes, v1::HostFrame& out) {
  JournalHostFrame line;
  protocol::HostFrameData frame;
  if (!read(bytes, line)) {
    return false;
  }
  bytes = bytes.subspan(sizeof(line));
  if (!read_elements(bytes, line.entity_count, frame.entities) ||
      !read_elements(bytes, line.part_count, frame.parts) || !bytes.empty()) {
    return false;
  }
  frame.frame_number = line.frame_number;
  frame.sim_time_ns = line.sim_time_ns;
  frame.run_id = line.run_id;
  frame.received_ns = line.received_ns;
  frame.seeker = line.seeker;
  frame.seeker_rates = line.seeker_rates;
  frame.environment = line.environment;
  frame.fov_h_rad = line.fov_h_rad;
  frame.gimbal_rad = line.gimbal_rad;
  frame.entity_count = line.entity_count;
  frame.part_count = line.part_count;
  protocol::to_proto(frame, out);
  return true;
}

void add_entities(std::span<const renderer::EntityUpdate> updates,
                  google::protobuf::RepeatedPtrField<v1::EntityState>& out) {
  for (const renderer::EntityUpdate& update : updates) {
    protocol::EntityStateData state;
    state.entity_id = update.entity_id;
    state.pose = update.pose;
    state.has_pose = true;
    state.on = update.on;
    state.teleport = update.teleport;
    protocol::to_proto(state, *out.Add());
  }
}

bool decision(std::span<const std::byte> bytes, v1::FrameDecision& out) {
  JournalFrame line;
  std::vector<renderer::EntityUpdate> entities(protocol::kMaxEntitiesPerFrame);
  std::vector<renderer::EntityUpdate> ahead(protocol::kMaxEntitiesPerFrame);
  if (!read(bytes, line)) {
    return false;
  }
  bytes = bytes.subspan(sizeof(line));
  if (!read_elements(bytes, line.entity_count, entities) ||
      !read_elements(bytes, line.ahead_entity_count, ahead) || !bytes.empty()) {
    return false;
  }
  out.set_frame_number(line.frame_number);
  out.set_host_frame_number(line.host_frame_number);
  out.set_sim_time_ns(line.sim_time_ns);
  out.set_pose_sim_time_ns(line.pose_sim_time_ns);
  out.set_thermal_time_ns(line.thermal_time_ns);
  protocol::to_proto(line.sensor_pose, std::nullopt, *out.mutable_sensor_pose());
  out.set_fov_h_rad(line.fov_h_rad);
  out.set_flags(line.flags);
  out.set_quality_rung(line.quality_rung);
  out.set_radiance_crc32c(line.radiance_crc32c);
  out.set_radiance_channel(line.radiance_channel);
  out.set_rendered(line.rendered);
  out.set_trigger_number(line.trigger_number);
  out.set_slot_begin_ns(line.slot_begin_ns);
  out.set_applied_shift_x_px(line.shift_px.x);
  out.set_applied_shift_y_px(line.shift_px.y);
  if (line.more_shot_count > line.more_shots.size()) {
    return false;
  }
  for (std::uint32_t i = 0; i < line.more_shot_count; ++i) {
    const JournalShot& shot = line.more_shots[i];
    v1::CameraDecision& camera = *out.add_more_cameras();
    protocol::to_proto(shot.pose, std::nullopt, *camera.mutable_sensor_pose());
    camera.set_fov_h_rad(shot.fov_h_rad);
    camera.set_radiance_crc32c(shot.crc32c);
    camera.set_radiance_channel(shot.channel);
    camera.set_ahead(shot.ahead);
  }
  add_entities(std::span(entities).first(line.entity_count), *out.mutable_entities());
  if (line.ahead_time_ns != 0) {
    out.set_ahead_time_ns(line.ahead_time_ns);
    out.set_applied_ahead_shift_x_px(line.ahead_shift_px.x);
    out.set_applied_ahead_shift_y_px(line.ahead_shift_px.y);
    add_entities(std::span(ahead).first(line.ahead_entity_count), *out.mutable_ahead_entities());
  }
  return true;
}

}  // namespace

bool to_journal_entry(std::span<const std::byte> line, const Recorder::Identity& identity,
                      v1::JournalEntry& out) {
  JournalHead head;
  if (!read(line, head)) {
    return false;
  }
  out.Clear();
  out.set_sequence(head.sequence);
  out.set_wall_time_ns(head.wall_time_ns);
  switch (head.kind) {
    case JournalKind::run_start: {
      JournalRunStart start;
      if (!read(line, start)) {
        return false;
      }
      auto& message = *out.mutable_run_start();
      message.set_run_id(start.run_id);
      message.set_scenario_name(identity.scenario_name);
      message.set_scenario_sha256(identity.scenario_sha256);
      message.set_software(identity.software);
      message.set_device(identity.device);
      message.set_pacing(identity.pacing);
      message.set_first_time_ns(identity.first_time_ns);
      return identity.recording.empty() ||
             message.mutable_recording()->ParseFromString(identity.recording);
    }
    case JournalKind::host_frame:
      return host_frame(line, *out.mutable_host_frame());
    case JournalKind::command: {
      JournalCommand command;
      if (!read(line, command)) {
        return false;
      }
      out.mutable_command()->set_kind(static_cast<v1::Command::Kind>(command.command));
      return true;
    }
    case JournalKind::frame:
      return decision(line, *out.mutable_frame());
  }
  return false;
}

}  // namespace emit::server
