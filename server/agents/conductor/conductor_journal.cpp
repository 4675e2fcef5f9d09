// SPDX-License-Identifier: Apache-2.0
#include "agents/conductor/conductor_journal.hpp"

namespace emit::server {

void ConductorJournal::run_start(std::uint64_t run_id, std::int64_t now_ns) noexcept {
  JournalRunStart line;
  line.head = {0, now_ns, JournalKind::run_start};
  line.run_id = run_id;
  written(writer_.write(line));
}

void ConductorJournal::command(CommandKind command, std::int64_t now_ns) noexcept {
  JournalCommand line;
  line.head = {0, now_ns, JournalKind::command};
  line.command = command;
  written(writer_.write(line));
}

void ConductorJournal::host_frame(const protocol::HostFrameData& frame,
                                  std::int64_t now_ns) noexcept {
  JournalHostFrame line;
  line.head = {0, now_ns, JournalKind::host_frame};
  line.frame_number = frame.frame_number;
  line.sim_time_ns = frame.sim_time_ns;
  line.run_id = frame.run_id;
  line.received_ns = frame.received_ns;
  line.seeker = frame.seeker;
  line.seeker_rates = frame.seeker_rates;
  line.environment = frame.environment;
  line.fov_h_rad = frame.fov_h_rad;
  line.gimbal_rad = frame.gimbal_rad;
  line.entity_count = frame.entity_count;
  line.part_count = frame.part_count;
  written(writer_.write(line, frame.entity_span(), frame.part_span()));
}

void ConductorJournal::frame(const protocol::FrameHeader& header, const Shown& shown, bool rendered,
                             std::span<const renderer::EntityUpdate> entities,
                             std::span<const renderer::EntityUpdate> ahead_entities,
                             std::int64_t now_ns) noexcept {
  JournalFrame line;
  line.head = {0, now_ns, JournalKind::frame};
  line.frame_number = header.frame_number;
  line.host_frame_number = header.host_frame_number;
  line.sim_time_ns = header.sim_time_ns;
  line.pose_sim_time_ns = header.pose_sim_time_ns;
  line.thermal_time_ns = shown.thermal_time_ns;
  line.sensor_pose = header.pose;
  line.fov_h_rad = shown.fov_h_rad;
  line.flags = header.flags;
  line.quality_rung = header.quality_rung;
  line.radiance_crc32c = shown.crc32c;
  line.radiance_channel = shown.channel;
  line.rendered = rendered;
  line.trigger_number = header.trigger_number;
  line.slot_begin_ns = header.slot_begin_ns;
  line.shift_px = shown.shift_px;
  line.ahead_shift_px = shown.ahead_shift_px;
  line.ahead_time_ns = shown.ahead_time_ns;
  line.more_shot_count = rendered ? shown.more_shot_count : 0;
  line.more_shots = shown.more_shots;
  line.entity_count = static_cast<std::uint32_t>(entities.size());
  line.ahead_entity_count = static_cast<std::uint32_t>(ahead_entities.size());
  written(writer_.write(line, entities, ahead_entities));
}

void ConductorJournal::written(bool found_room) noexcept {
  context_.bells.recorder.ring();
  if (found_room) {
    return;
  }
  context_.counters.add(Counter::journal_dropped);
  if (!lossy_) {
    // The loss is logged once: from here on the journal of this run does not replay.
    lossy_ = true;
    context_.conductor_events.push(EventKind::journal_overrun, writer_.sequence());
  }
}

}  // namespace emit::server
