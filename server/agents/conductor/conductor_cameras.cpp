// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>

#include "agents/conductor/conductor.hpp"

namespace emit::server {

void Conductor::look_ahead(RenderJob& job, FrameLedger::Issued& issued) noexcept {
  job.ahead.sim_time_ns = 0;
  job.ahead.entity_count = 0;
  const auto camera =
      std::ranges::find_if(context_.cameras, [](const Camera& one) { return one.looks_ahead(); });
  // Mode host-step has no next frame to look at; the start of the daemon refuses such channels.
  if (camera == context_.cameras.end() || !slots_) return;
  const std::int64_t by_ns =
      std::llround(1e9 * camera->mount.look_ahead_frames / options_.pacing.rate_hz);
  // Nothing moves before the first pose of a host.
  AheadImage& image = issued.ahead.image;
  image.sim_time_ns = job.request.sim_time_ns;
  image.flags = issued.header.flags & kAheadFlags;
  ahead_pose_ = job.request.sensor_pose;
  if (input_.came) {
    // Beyond the horizon the seeker and the entities stand, as they will in the frames themselves.
    const PoseSample sample =
        seeker_.sample(job.request.sim_time_ns + by_ns, options_.pacing.horizon_ns);
    image.sim_time_ns = sample.shown_ns;
    image.flags = (sample.extrapolated ? protocol::kFlagExtrapolated : 0U) |
                  (sample.stale ? protocol::kFlagStale : 0U);
    ahead_pose_ = sample.pose;
  }
  job.ahead.sim_time_ns = image.sim_time_ns;
  if (!entities_.foresee(job, options_.pacing.horizon_ns)) issued.entities_behind = true;
  if (motion_) {
    motion_->place_ahead(job, issued, ahead_pose_,
                         issued.header.slot_begin_ns + options_.pacing.display_delay_ns + by_ns);
  }
}

physics::Pose Conductor::carrier_of(const Camera& camera, const Moment& moment) const noexcept {
  if (camera.mount.entity_id) {
    return entities_.pose_of(*camera.mount.entity_id, moment.sim_time_ns, moment.place);
  }
  // The table turns the seeker itself. Its gimbals turn in front of what the projector shows.
  const physics::Pose& seeker = moment.seeker;
  if (camera.along_projector) {
    return {seeker.position_world_m, glm::normalize(glm::quat_cast(moment.world_from_projector))};
  }
  if (body_from_detector_ == glm::dquat(1.0, 0.0, 0.0, 0.0)) return seeker;
  return {seeker.position_world_m, glm::normalize(seeker.world_from_body * body_from_detector_)};
}

void Conductor::place_cameras(RenderJob& job, const FrameLedger::Issued& issued) const noexcept {
  using Place = EntityBook::Place;
  const scene::ChannelCamera plain;
  const Moment now{job.request.sensor_pose, issued.motion.attitude.world_from_rendered,
                   job.request.sim_time_ns, slots_ ? Place::placed : Place::newest};
  const Moment ahead{ahead_pose_, issued.ahead.motion.attitude.world_from_rendered,
                     job.ahead.sim_time_ns, Place::foreseen};
  bool first = true;
  for (std::size_t i = 0; i < job.shots.size(); ++i) {
    CameraShot& shot = job.shots[i];
    shot.due = false;
    if (i >= context_.cameras.size()) continue;
    const Camera& camera = context_.cameras[i];
    const ChannelSet channels = camera.channels & job.channels;
    shot.due = channels != 0;
    if (!shot.due) continue;
    shot.ahead = camera.looks_ahead();
    shot.pose = carrier_of(camera, shot.ahead ? ahead : now);
    // A camera that is mounted as the seeker keeps the bits of its pose.
    if (camera.mount.offset_body_m != plain.offset_body_m) {
      shot.pose.position_world_m += shot.pose.world_from_body * camera.mount.offset_body_m;
    }
    if (camera.mount.yaw_pitch_roll_rad != plain.yaw_pitch_roll_rad) {
      shot.pose.world_from_body = glm::normalize(
          shot.pose.world_from_body * physics::body_from_turned(camera.mount.yaw_pitch_roll_rad));
    }
    shot.fov_h_rad = camera.mount.fov_h_rad > 0.0 ? camera.mount.fov_h_rad : fov_h_rad_;
    shot.window_px = window_around(context_.channels, channels);
    if (first) {
      job.request.sensor_pose = shot.pose;
      job.request.fov_h_rad = shot.fov_h_rad;
      first = false;
    }
  }
}

}  // namespace emit::server
