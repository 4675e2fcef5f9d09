// SPDX-License-Identifier: Apache-2.0
#include <glm/gtc/quaternion.hpp>

#include "agents/conductor/conductor.hpp"

namespace emit::server {

physics::Pose Conductor::carrier_of(const Camera& camera, const RenderJob& job,
                                    const glm::dmat3& world_from_projector) const noexcept {
  const physics::Pose& seeker = job.request.sensor_pose;
  if (camera.mount.entity_id) {
    return entities_.pose_of(*camera.mount.entity_id, job.request.sim_time_ns, slots_ != nullptr);
  }
  // The table turns the seeker itself. Its gimbals turn in front of what the projector shows.
  if (camera.along_projector) {
    return {seeker.position_world_m, glm::normalize(glm::quat_cast(world_from_projector))};
  }
  if (body_from_detector_ == glm::dquat(1.0, 0.0, 0.0, 0.0)) return seeker;
  return {seeker.position_world_m, glm::normalize(seeker.world_from_body * body_from_detector_)};
}

void Conductor::place_cameras(RenderJob& job,
                              const glm::dmat3& world_from_projector) const noexcept {
  const scene::ChannelCamera plain;
  bool first = true;
  const physics::Pose* shown = nullptr;
  for (std::size_t i = 0; i < job.shots.size(); ++i) {
    CameraShot& shot = job.shots[i];
    shot.due = false;
    if (i >= context_.cameras.size()) continue;
    const Camera& camera = context_.cameras[i];
    const ChannelSet channels = camera.channels & job.channels;
    shot.due = channels != 0;
    if (!shot.due) continue;
    shot.pose = carrier_of(camera, job, world_from_projector);
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
      shown = &shot.pose;
      job.request.fov_h_rad = shot.fov_h_rad;
      first = false;
    }
  }
  if (shown != nullptr) job.request.sensor_pose = *shown;
}

}  // namespace emit::server
