// SPDX-License-Identifier: Apache-2.0
#include "app/replay.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <vector>

#include "agents/messages.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/frame_header.hpp"
#include "emit/v1/control.pb.h"

namespace emit::server {

using physics::ErrorCode;
using physics::make_error;

namespace {

/// Returns the pose with the numbers as they were used. Inputs from a host are normalised on
/// reception; a second time could change the last bit.
physics::Pose exact_pose(const v1::Pose& pose) {
  physics::Pose out;
  out.position_world_m = {pose.position_m().x(), pose.position_m().y(), pose.position_m().z()};
  out.world_from_body = glm::dquat{pose.world_from_body().w(), pose.world_from_body().x(),
                                   pose.world_from_body().y(), pose.world_from_body().z()};
  return out;
}

/// Returns the entities of a decision. Errors: protocol (a pose that is none; the text names the
/// entity).
physics::Result<std::vector<renderer::EntityUpdate>> entity_updates(
    const google::protobuf::RepeatedPtrField<v1::EntityState>& states) {
  std::vector<renderer::EntityUpdate> out;
  for (const v1::EntityState& state : states) {
    out.push_back({state.entity_id(), exact_pose(state.pose()), !state.off(), state.teleport()});
    if (!physics::is_valid(out.back().pose)) {
      return make_error(ErrorCode::protocol, fmt::format("entity {}: bad pose", state.entity_id()));
    }
  }
  return out;
}

}  // namespace

struct JournalPlayer::PendingWeather {
  std::uint64_t host_frame_number = 0;
  scene::WeatherSample sample;
};
struct JournalPlayer::PendingPart {
  std::uint64_t host_frame_number = 0;
  TimedPart part;
};

JournalPlayer::JournalPlayer(FrameSource& source, ChannelTable channels)
    : source_(source), channels_(std::move(channels)) {}

JournalPlayer::~JournalPlayer() {
  release_shown();
}

void JournalPlayer::release_shown() noexcept {
  for (const renderer::SlotIndex slot : shown_) source_.release(slot);
  shown_.clear();
  shots_.clear();
  view_ = nullptr;
}

JournalPlayer::Shown JournalPlayer::shown_by(std::size_t channel) {
  const Channel& wanted = channels_.channels[channel];
  for (std::size_t i = 0; i < shots_.size(); ++i) {
    const ShownShot& shot = shots_[i];
    if (shot.camera != wanted.camera) continue;
    const TakenPicture taken =
        take_picture(channels_.pictures[wanted.picture], *shot.view, shown_[i], shot.moment);
    return {shot.view, taken.pixels};
  }
  return {};
}

physics::Result<std::optional<ReplayedFrame>> JournalPlayer::apply(const v1::JournalEntry& entry) {
  const auto fail = [&](const std::string& text) {
    return make_error(ErrorCode::protocol,
                      fmt::format("journal entry {}: {}", entry.sequence(), text));
  };
  if (last_sequence_ != 0 && entry.sequence() != last_sequence_ + 1) {
    return fail(fmt::format("follows {}: entries in between were lost", last_sequence_));
  }
  last_sequence_ = entry.sequence();

  if (entry.has_run_start()) {
    release_shown();
    source_.reset();
    weather_.clear();
    parts_.clear();
    render_number_ = 0;
    rendered_number_ = 0;
    run_id_ = entry.run_start().run_id();
    started_ = true;
    return std::optional<ReplayedFrame>();
  }
  if (entry.has_command()) {
    // The effect of a command shows in the frames and run starts that follow it.
    return std::optional<ReplayedFrame>();
  }
  if (entry.has_host_frame()) {
    const v1::HostFrame& frame = entry.host_frame();
    for (const v1::PartCommand& part : frame.parts()) {
      protocol::PartCommandData data;
      if (protocol::from_proto(part, data) != protocol::DecodeStatus::ok) {
        return fail("drive of a part out of range");
      }
      parts_.push_back({frame.frame_number(), timed_part(data, frame.sim_time_ns())});
    }
    if (frame.has_environment()) {
      protocol::EnvironmentData data;
      if (protocol::from_proto(frame.environment(), data) != protocol::DecodeStatus::ok) {
        return fail("environment out of range");
      }
      weather_.push_back({frame.frame_number(), weather_sample(data, frame.sim_time_ns())});
    }
    return std::optional<ReplayedFrame>();
  }
  if (!entry.has_frame()) {
    return fail("has no body");
  }
  if (!started_) {
    return fail("a frame before any run start: the journal begins in the middle of a run");
  }
  return play(entry.frame(), entry.sequence());
}

template <class Shot>
physics::Result<void> JournalPlayer::play_shot(const v1::FrameDecision& decision, const Shot& shot,
                                               bool ahead, std::uint64_t sequence) {
  const auto fail = [&](ErrorCode code, const std::string& text) {
    return make_error(code, fmt::format("journal entry {}: {}", sequence, text));
  };
  renderer::FrameRequest request;
  request.frame_number = ++render_number_;
  request.sim_time_ns = ahead ? decision.ahead_time_ns() : decision.sim_time_ns();
  request.thermal_time_ns = decision.thermal_time_ns();
  request.sensor_pose = exact_pose(shot.sensor_pose());
  if (!physics::is_valid(request.sensor_pose)) {
    return fail(ErrorCode::protocol, "bad sensor pose");
  }
  request.fov_h_rad = shot.fov_h_rad();
  if (!(request.fov_h_rad >= 0.0 && request.fov_h_rad < physics::kPi)) {
    return fail(ErrorCode::protocol, fmt::format("bad field of view: {} rad", request.fov_h_rad));
  }
  request.quality_level = static_cast<std::uint8_t>(
      std::min<std::uint32_t>(decision.quality_rung(), std::numeric_limits<std::uint8_t>::max()));
  const int slot = source_.submit(request);
  if (slot < 0) {
    return fail(ErrorCode::internal, "the source has no free slot");
  }
  shown_.push_back(static_cast<renderer::SlotIndex>(slot));
  const renderer::FrameView& view = source_.collect(shown_.back());
  if (shot.radiance_channel() >= channels_.channels.size()) {
    return fail(ErrorCode::protocol,
                fmt::format("the scenario has no channel {}", shot.radiance_channel()));
  }
  const Channel& channel = channels_.channels[shot.radiance_channel()];
  const glm::vec2 shift_px =
      ahead ? glm::vec2(decision.applied_ahead_shift_x_px(), decision.applied_ahead_shift_y_px())
            : glm::vec2(decision.applied_shift_x_px(), decision.applied_shift_y_px());
  const OutputChain::Moment moment{shift_px, rendered_number_};
  shots_.push_back({channel.camera, &view, moment});
  const std::uint32_t crc = protocol::crc32c(std::as_bytes(
      take_picture(channels_.pictures[channel.picture], view, shown_.back(), moment).pixels));
  crcs_match_ = crcs_match_ && crc == shot.radiance_crc32c();
  if (shown_.size() == 1) {
    view_ = &view;
    view_crc_ = crc;
  }
  return {};
}

physics::Result<std::optional<ReplayedFrame>> JournalPlayer::play(const v1::FrameDecision& decision,
                                                                  std::uint64_t sequence) {
  const auto fail = [&](ErrorCode code, const std::string& text) {
    return make_error(code, fmt::format("journal entry {}: {}", sequence, text));
  };
  if (decision.rendered()) {
    release_shown();
    // Weather acts from the frame that first used its host frame, as in the live run, where host
    // frames may have been accepted ahead of frames still in work.
    const auto later = std::find_if(weather_.begin(), weather_.end(), [&](const auto& pending) {
      return pending.host_frame_number > decision.host_frame_number();
    });
    // When more changes came than fit into one frame, the live run kept the first ones and the
    // newest.
    const auto count = static_cast<std::size_t>(later - weather_.begin());
    for (std::size_t i = 0; i < count; ++i) {
      if (i + 1 < kMaxWeatherPerFrame || i + 1 == count) {
        source_.apply_weather(weather_[i].sample);
      }
    }
    weather_.erase(weather_.begin(), later);

    // Commands to parts act by the same rule. The live run refused those it had no room for.
    const auto later_part = std::find_if(parts_.begin(), parts_.end(), [&](const auto& pending) {
      return pending.host_frame_number > decision.host_frame_number();
    });
    for (auto pending = parts_.begin(); pending != later_part; ++pending) {
      static_cast<void>(source_.apply_part(pending->part.sim_time_ns, pending->part.update));
    }
    parts_.erase(parts_.begin(), later_part);

    auto updates = entity_updates(decision.entities());
    auto ahead = entity_updates(decision.ahead_entities());
    for (const auto* read : {&updates, &ahead}) {
      if (!*read) return fail(ErrorCode::protocol, read->error().text);
    }
    source_.apply_entities(decision.sim_time_ns(), *updates);

    crcs_match_ = true;
    ++rendered_number_;
    if (auto played = play_shot(decision, decision, false, sequence); !played) {
      return tl::unexpected<physics::Error>(std::move(played.error()));
    }
    for (const v1::CameraDecision& camera : decision.more_cameras()) {
      if (camera.ahead()) source_.foresee_entities(decision.ahead_time_ns(), *ahead);
      if (auto played = play_shot(decision, camera, camera.ahead(), sequence); !played) {
        return tl::unexpected<physics::Error>(std::move(played.error()));
      }
    }
  } else if (view_ == nullptr) {
    return fail(ErrorCode::protocol, "repeats a frame, but none was rendered before");
  }

  ReplayedFrame frame;
  frame.run_id = run_id_;
  frame.frame_number = decision.frame_number();
  frame.host_frame_number = decision.host_frame_number();
  frame.sim_time_ns = decision.sim_time_ns();
  frame.pose_sim_time_ns = decision.pose_sim_time_ns();
  frame.flags = decision.flags();
  frame.repeated = !decision.rendered();
  frame.view = view_;
  frame.crc32c = view_crc_;
  frame.journal_crc32c = decision.radiance_crc32c();
  frame.matches = frame.crc32c == frame.journal_crc32c && crcs_match_;
  ++frames_;
  mismatches_ += frame.matches ? 0 : 1;
  return std::optional<ReplayedFrame>(frame);
}

}  // namespace emit::server
