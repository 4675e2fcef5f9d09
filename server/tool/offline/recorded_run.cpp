// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/recorded_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "agents/messages.hpp"
#include "app/scenario_identity.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/protocol/convert.hpp"
#include "emit/protocol/record/log.hpp"
#include "emit/scene/trajectory.hpp"
#include "emit/v1/control.pb.h"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Numbers of a pose as they were used; normalising them again could change the last bit.
physics::Pose exact_pose(const v1::Pose& pose) {
  physics::Pose out;
  out.position_world_m = {pose.position_m().x(), pose.position_m().y(), pose.position_m().z()};
  out.world_from_body = glm::dquat{pose.world_from_body().w(), pose.world_from_body().x(),
                                   pose.world_from_body().y(), pose.world_from_body().z()};
  return out;
}

bool same_place(const scene::Keyframe& a, const scene::Keyframe& b) {
  return a.on == b.on && a.pose.position_world_m == b.pose.position_world_m &&
         a.pose.world_from_body == b.pose.world_from_body;
}

/// Adds a pose. One of a body that stands replaces the one before it, and of a long course the
/// older half is thinned.
void add_key(scene::Trajectory& course, const scene::Keyframe& key) {
  constexpr std::size_t kMost = 8192;
  const std::size_t count = course.size();
  if (count > 1 && !key.teleport && same_place(course[count - 1], key) &&
      same_place(course[count - 2], key)) {
    course.back().sim_time_ns = key.sim_time_ns;
    return;
  }
  course.push_back(key);
  if (course.size() < kMost) return;
  scene::Trajectory kept;
  for (std::size_t i = 0; i < course.size(); ++i) {
    if (i % 2 == 0 || i >= kMost / 2 || course[i].teleport) kept.push_back(course[i]);
  }
  course = std::move(kept);
}

/// Deeds of a host in a run so far.
struct HostCourse {
  std::map<std::uint32_t, scene::Trajectory> entities;
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<scene::TimedPartCommand>> parts;
  std::vector<scene::WeatherSample> weather;
};

/// Frame that is looked for, as the journal has it.
struct FoundFrame {
  std::uint64_t frame_number = 0;
  std::int64_t sim_time_ns = 0;
  std::int64_t thermal_time_ns = 0;
  physics::Pose sensor;
  double fov_h_rad = 0.0;
};

class RunReader {
 public:
  explicit RunReader(std::optional<std::uint64_t> wanted) : wanted_(wanted) {}

  Result<void> take(const v1::JournalEntry& entry) {
    if (entry.has_run_start()) {
      begun_ = true;
      found_.reset();
      host_ = {};
      scenario_sha256_ = entry.run_start().scenario_sha256();
      scenario_name_ = entry.run_start().scenario_name();
    } else if (entry.has_host_frame() && !passed()) {
      return take_host(entry.host_frame());
    } else if (entry.has_frame() && entry.frame().rendered() && !passed()) {
      take_frame(entry.frame());
    }
    return {};
  }

  [[nodiscard]] bool begun() const noexcept { return begun_; }
  [[nodiscard]] const std::string& scenario_name() const noexcept { return scenario_name_; }
  [[nodiscard]] const std::string& scenario_sha256() const noexcept { return scenario_sha256_; }
  /// Returns the wanted frame; empty: the newest run has none.
  [[nodiscard]] std::optional<FoundFrame> found() const {
    return !wanted_ || (found_ && found_->frame_number == *wanted_) ? found_ : std::nullopt;
  }
  [[nodiscard]] const HostCourse& host() const noexcept { return host_; }

 private:
  /// Returns whether the wanted frame was there: what follows came after it.
  [[nodiscard]] bool passed() const noexcept {
    return wanted_ && found_ && found_->frame_number >= *wanted_;
  }

  Result<void> take_host(const v1::HostFrame& frame) {
    if (frame.has_environment()) {
      protocol::EnvironmentData data;
      if (protocol::from_proto(frame.environment(), data) != protocol::DecodeStatus::ok) {
        return make_error(ErrorCode::protocol, "the journal has an environment out of range");
      }
      host_.weather.push_back(server::weather_sample(data, frame.sim_time_ns()));
    }
    for (const v1::PartCommand& part : frame.parts()) {
      protocol::PartCommandData data;
      if (protocol::from_proto(part, data) != protocol::DecodeStatus::ok) {
        return make_error(ErrorCode::protocol, "the journal drives a part out of range");
      }
      const server::TimedPart timed = server::timed_part(data, frame.sim_time_ns());
      host_.parts[{timed.update.entity_id, timed.update.part_id}].push_back(
          {timed.sim_time_ns, timed.update.command});
    }
    return {};
  }

  void take_frame(const v1::FrameDecision& frame) {
    for (const v1::EntityState& state : frame.entities()) {
      add_key(host_.entities[state.entity_id()],
              {frame.sim_time_ns(), exact_pose(state.pose()), !state.off(), state.teleport()});
    }
    found_ = FoundFrame{frame.frame_number(), frame.sim_time_ns(), frame.thermal_time_ns(),
                        exact_pose(frame.sensor_pose()), frame.fov_h_rad()};
  }

  std::optional<std::uint64_t> wanted_;
  bool begun_ = false;
  std::string scenario_name_;
  std::string scenario_sha256_;
  HostCourse host_;
  std::optional<FoundFrame> found_;
};

/// Course of an entity: the scenario's until the host's first pose, then the host's.
scene::Trajectory joined_course(const scene::ObjectDesc& object, scene::Trajectory host) {
  const std::int64_t from_ns = host.front().sim_time_ns;
  scene::Trajectory out;
  for (const scene::Keyframe& key : object.trajectory) {
    if (key.sim_time_ns < from_ns - 1) out.push_back(key);
  }
  scene::Keyframe last{from_ns - 1, physics::Pose{}, object.on, false};
  if (!object.trajectory.empty()) {
    const auto state = scene::trajectory_at(object.trajectory, last.sim_time_ns);
    last.pose = state.pose;
    last.on = state.on;
  } else if (!object.instances.empty()) {
    last.pose = object.instances.front();
  }
  out.push_back(last);
  host.front().teleport = true;
  out.insert(out.end(), host.begin(), host.end());
  return out;
}

scene::WeatherSample clear_sky_row(const scene::ScenarioDesc& scenario, std::int64_t at_ns) {
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad),
                                physics::Metres(scenario.place.height_m)};
  const std::int64_t utc_ns = scenario.epoch_utc_ns + at_ns;
  const physics::Forcing forcing = physics::forcing_from_clear_sky(
      scenario.clear_sky, place, physics::sun_position(utc_ns, place), utc_ns);
  scene::WeatherSample row;
  row.sim_time_ns = at_ns;
  row.direct_normal_w_m2 = forcing.direct_normal_w_m2;
  row.diffuse_horizontal_w_m2 = forcing.diffuse_horizontal_w_m2;
  row.longwave_down_w_m2 = forcing.longwave_down_w_m2;
  row.air_k = forcing.air_k;
  row.wind_m_s = forcing.wind_m_s;
  row.cloud_frac = forcing.cloud_frac;
  row.wind_from_rad = scenario.clear_sky.wind_from_rad;
  return row;
}

/// Row of a table at an instant, linear between its neighbours. What only one of them states is
/// that one's.
scene::WeatherSample table_row(const std::vector<scene::WeatherSample>& rows, std::int64_t at_ns) {
  const auto after = std::ranges::upper_bound(rows, at_ns, {}, &scene::WeatherSample::sim_time_ns);
  scene::WeatherSample out = after == rows.begin() ? rows.front() : *(after - 1);
  if (after != rows.begin() && after != rows.end() && after->sim_time_ns > out.sim_time_ns) {
    const double frac = static_cast<double>(at_ns - out.sim_time_ns) /
                        static_cast<double>(after->sim_time_ns - out.sim_time_ns);
    for (double scene::WeatherSample::*value :
         {&scene::WeatherSample::direct_normal_w_m2, &scene::WeatherSample::diffuse_horizontal_w_m2,
          &scene::WeatherSample::longwave_down_w_m2, &scene::WeatherSample::air_k,
          &scene::WeatherSample::wind_m_s, &scene::WeatherSample::cloud_frac}) {
      out.*value = std::lerp(out.*value, (*after).*value, frac);
    }
  }
  out.sim_time_ns = at_ns;
  return out;
}

/// Weather of the scenario until the host's first word, then rows that hold until the next one.
std::vector<scene::WeatherSample> joined_weather(const scene::ScenarioDesc& scenario,
                                                 const std::vector<scene::WeatherSample>& host) {
  const std::int64_t from_ns = host.front().sim_time_ns;
  std::vector<scene::WeatherSample> out;
  if (scenario.weather.empty()) {
    constexpr std::int64_t kRowNs = 60'000'000'000;
    for (std::int64_t at_ns = scenario.thermal.history_start_ns - scenario.thermal.spin_up_ns;
         at_ns < from_ns; at_ns += kRowNs) {
      out.push_back(clear_sky_row(scenario, at_ns));
    }
    out.push_back(clear_sky_row(scenario, from_ns));
  } else {
    for (const scene::WeatherSample& row : scenario.weather) {
      if (row.sim_time_ns < from_ns) out.push_back(row);
    }
    out.push_back(table_row(scenario.weather, from_ns));
  }
  // Two rows of one instant make a jump.
  for (std::size_t i = 0; i < host.size(); ++i) {
    if (i > 0) {
      out.push_back(host[i - 1]);
      out.back().sim_time_ns = host[i].sim_time_ns;
    }
    out.push_back(host[i]);
  }
  return out;
}

void apply_host(const HostCourse& host, scene::ScenarioDesc& scenario) {
  for (scene::ObjectDesc& object : scenario.objects) {
    if (const auto course = host.entities.find(object.entity_id);
        object.entity_id != 0 && course != host.entities.end()) {
      object.trajectory = joined_course(object, course->second);
    }
    for (scene::PartDesc& part : object.parts) {
      const auto commands = host.parts.find({object.entity_id, part.id});
      if (commands == host.parts.end()) continue;
      const std::int64_t from_ns = commands->second.front().sim_time_ns;
      std::erase_if(part.commands, [&](const auto& one) { return one.sim_time_ns >= from_ns; });
      part.commands.insert(part.commands.end(), commands->second.begin(), commands->second.end());
    }
  }
  if (!host.weather.empty()) scenario.weather = joined_weather(scenario, host.weather);
}

}  // namespace

Result<RecordedFrame> follow_recording(const std::filesystem::path& log,
                                       std::optional<std::uint64_t> frame_number,
                                       scene::ScenarioDesc& scenario) {
  auto reader = protocol::LogReader::open(log);
  if (!reader) return tl::unexpected(reader.error());
  RunReader run(frame_number);
  for (;;) {
    const auto more = reader->next();
    if (!more) return tl::unexpected(more.error());
    if (!*more) break;
    if (reader->topic() != protocol::LogTopic::journal) continue;
    if (auto taken = run.take(reader->journal()); !taken) {
      return tl::unexpected(physics::Error(taken.error()).with_context(log.string()));
    }
  }
  if (!run.begun()) {
    return make_error(ErrorCode::unsupported,
                      fmt::format("{}: the journal lacks the begin of the run, so that what "
                                  "happened before is not known",
                                  log.string()));
  }
  const auto identity = server::identify_scenario(scenario);
  if (!identity) return tl::unexpected(identity.error());
  if (identity->sha256 != run.scenario_sha256()) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: the run is of scenario '{}' as it was then; the files or "
                                  "--set values of this one are others",
                                  log.string(), run.scenario_name()));
  }
  const auto found = run.found();
  if (!found) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{}: the newest run has no image with the number {}",
                                  log.string(), frame_number.value_or(0)));
  }
  RecordedFrame out{found->frame_number, found->sim_time_ns, {}};
  if (found->thermal_time_ns != found->sim_time_ns) {
    out.notes.push_back(
        fmt::format("the thermal clock was held for {:.3f} s: the history is that of a run that "
                    "was not held",
                    1e-9 * static_cast<double>(found->sim_time_ns - found->thermal_time_ns)));
  }
  apply_host(run.host(), scenario);
  scenario.sensor.trajectory = {{found->sim_time_ns, found->sensor, true, false}};
  if (found->fov_h_rad > 0.0) scenario.sensor.fov_h_rad = found->fov_h_rad;
  return out;
}

}  // namespace emit::tool
