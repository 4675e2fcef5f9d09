// SPDX-License-Identifier: Apache-2.0
#include "tool/support/scenario_input.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>

#include "emit/config/load.hpp"
#include "emit/physics/check.hpp"
#include "emit/physics/nearest_name.hpp"
#include "emit/scene/trajectory.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;

/// Largest half width of the central difference that gives a trajectory's rates.
constexpr std::int64_t kRateStepNs = 500'000;

/// Returns rates inside a segment: constant velocity and constant rotation axis, so the chord is
/// exact.
protocol::PoseRates rates_at(const scene::Trajectory& trajectory,
                             std::int64_t sim_time_ns) noexcept {
  const auto after = std::upper_bound(
      trajectory.begin(), trajectory.end(), sim_time_ns,
      [](std::int64_t time, const scene::Keyframe& key) { return time < key.sim_time_ns; });
  if (after == trajectory.begin() || after == trajectory.end() || after->teleport) return {};
  // The chord stays inside the segment, because a neighbour moves otherwise.
  const std::int64_t from_ns = std::max(sim_time_ns - kRateStepNs, (after - 1)->sim_time_ns);
  const std::int64_t to_ns = std::min(sim_time_ns + kRateStepNs, after->sim_time_ns - 1);
  if (to_ns <= from_ns) return {};
  const physics::Pose a = scene::trajectory_at(trajectory, from_ns).pose;
  const physics::Pose b = scene::trajectory_at(trajectory, to_ns).pose;
  const double span_s = 1e-9 * static_cast<double>(to_ns - from_ns);
  protocol::PoseRates rates;
  rates.velocity_world_m_s = (b.position_world_m - a.position_world_m) / span_s;
  glm::dquat turn = glm::conjugate(a.world_from_body) * b.world_from_body;
  if (turn.w < 0.0) turn = -turn;
  const glm::dvec3 axis(turn.x, turn.y, turn.z);
  const double sine = glm::length(axis);
  if (sine > 0.0) {
    rates.angular_rate_body_rad_s = axis / sine * (2.0 * std::atan2(sine, turn.w) / span_s);
  }
  return rates;
}

}  // namespace

physics::Result<scene::ScenarioDesc> load_scenario_choice(const ScenarioChoice& choice) {
  const auto file = config::resolve_scenario(choice.scenario);
  auto scenario = file ? config::load_scenario(*file, choice.set)
                       : physics::Result<scene::ScenarioDesc>(tl::unexpect, file.error());
  if (!scenario) scenario.error().code = ErrorCode::config;
  return scenario;
}

std::vector<scene::Material> material_library() {
  config::LoadOptions options;
  options.require_scene_files = false;
  for (const std::string& name : config::shipped_scenarios()) {
    const auto file = config::resolve_scenario(name);
    if (!file) continue;
    if (auto scenario = config::load_scenario(*file, {}, options)) return scenario->materials;
  }
  return {};
}

physics::Result<std::size_t> find_band(const scene::ScenarioDesc& scenario, std::string_view name) {
  if (scenario.bands.empty()) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: the scenario has no band", scenario.file.string()));
  }
  if (name.empty()) return std::size_t{0};
  std::vector<std::string_view> known;
  for (std::size_t i = 0; i < scenario.bands.size(); ++i) {
    if (scenario.bands[i].name == name) return i;
    known.emplace_back(scenario.bands[i].name);
  }
  return make_error(ErrorCode::invalid_argument,
                    fmt::format("no band '{}'{}; the scenario has {}", name,
                                physics::did_you_mean(name, known), fmt::join(known, ", ")));
}

std::size_t band_of_channel(const scene::ScenarioDesc& scenario, scene::ChannelKind kind) noexcept {
  const scene::ChannelDesc* chosen = scenario.channels.empty() ? nullptr : &scenario.channels[0];
  for (const auto& channel : scenario.channels) {
    if (channel.kind == kind) {
      chosen = &channel;
      break;
    }
  }
  if (chosen == nullptr) return 0;
  for (std::size_t i = 0; i < scenario.bands.size(); ++i) {
    if (scenario.bands[i].name == chosen->band) return i;
  }
  return 0;
}

TrajectorySample sample_trajectory(const scene::Trajectory& trajectory, std::int64_t sim_time_ns,
                                   std::int64_t previous_ns) noexcept {
  EMIT_CHECK(!trajectory.empty());
  const scene::TrajectoryState state = scene::trajectory_at(trajectory, sim_time_ns);
  TrajectorySample sample;
  sample.pose = state.pose;
  sample.rates = rates_at(trajectory, sim_time_ns);
  sample.on = state.on;
  sample.teleport = std::any_of(trajectory.begin(), trajectory.end(), [&](const auto& key) {
    return key.teleport && key.sim_time_ns > previous_ns && key.sim_time_ns <= sim_time_ns;
  });
  return sample;
}

std::int64_t trajectory_start_ns(const scene::ScenarioDesc& scenario) noexcept {
  return scenario.sensor.trajectory.empty()
             ? std::max<std::int64_t>(scenario.thermal.history_start_ns, 0)
             : scenario.sensor.trajectory.front().sim_time_ns;
}

std::int64_t observation_ns(const scene::ScenarioDesc& scenario) noexcept {
  constexpr std::int64_t kHistoryNs = 12'600'000'000'000;
  const std::int64_t start_ns = trajectory_start_ns(scenario);
  const std::int64_t from_ns = scenario.thermal.history_start_ns;
  return start_ns < from_ns + kHistoryNs / 4 ? from_ns + kHistoryNs : start_ns;
}

physics::Result<void> check_entities_fit(const scene::ScenarioDesc& scenario) {
  const auto moving = std::count_if(
      scenario.objects.begin(), scenario.objects.end(),
      [](const auto& object) { return object.entity_id != 0 && !object.trajectory.empty(); });
  if (static_cast<std::size_t>(moving) > protocol::kMaxEntitiesPerFrame) {
    return make_error(ErrorCode::config,
                      fmt::format("{}: {} entities move, a host frame holds {}",
                                  scenario.file.string(), moving, protocol::kMaxEntitiesPerFrame));
  }
  return {};
}

void make_host_frame(const scene::ScenarioDesc& scenario, std::int64_t start_ns, double rate_hz,
                     std::uint64_t index, protocol::HostFrameData& out) {
  EMIT_CHECK(check_entities_fit(scenario).has_value());
  const auto time_of = [&](double count) {
    return start_ns + static_cast<std::int64_t>(std::llround(count * 1e9 / rate_hz));
  };
  const std::int64_t now_ns = time_of(static_cast<double>(index));
  const std::int64_t previous_ns = index == 0 ? now_ns : time_of(static_cast<double>(index) - 1.0);
  out.frame_number = index + 1;
  out.sim_time_ns = now_ns;
  out.run_id = 1;
  out.received_ns = 0;
  out.environment.reset();
  out.part_count = 0;
  out.seeker = physics::Pose{};
  out.seeker_rates.reset();
  if (!scenario.sensor.trajectory.empty()) {
    const auto sample = sample_trajectory(scenario.sensor.trajectory, now_ns, previous_ns);
    out.seeker = sample.pose;
    out.seeker_rates = sample.rates;
  }
  out.entity_count = 0;
  for (const auto& object : scenario.objects) {
    if (object.entity_id == 0 || object.trajectory.empty()) continue;
    const auto sample = sample_trajectory(object.trajectory, now_ns, previous_ns);
    auto& entity = out.entities[out.entity_count++];
    entity = protocol::EntityStateData{};
    entity.entity_id = object.entity_id;
    entity.pose = sample.pose;
    entity.has_pose = true;
    entity.rates = sample.rates;
    entity.on = sample.on;
    entity.teleport = sample.teleport;
  }
}

}  // namespace emit::tool
