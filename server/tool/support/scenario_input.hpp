// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// A scenario by shipped name or file, with `--set key=value` applied in this order.
struct ScenarioChoice {
  std::string scenario;
  std::vector<std::string> set;
};

/// Loads a scenario by shipped name or file, with the overrides applied. Setup only. Errors:
/// config.
[[nodiscard]] physics::Result<scene::ScenarioDesc> load_scenario_choice(
    const ScenarioChoice& choice);

/// Returns the shipped material library for commands that use geometry alone; empty when none is
/// found.
[[nodiscard]] std::vector<scene::Material> material_library();

/// Returns the index of a band by name; "" is the first. Errors: invalid_argument, naming the bands
/// there are.
[[nodiscard]] physics::Result<std::size_t> find_band(const scene::ScenarioDesc& scenario,
                                                     std::string_view name);

/// Returns the band that a channel kind shows. Without such a channel it is the first channel's,
/// then the first band.
[[nodiscard]] std::size_t band_of_channel(const scene::ScenarioDesc& scenario,
                                          scene::ChannelKind kind) noexcept;

/// Pose, on state and rates of a trajectory at an instant, by the rules of scene::Trajectory.
struct TrajectorySample {
  physics::Pose pose;
  protocol::PoseRates rates;
  bool on = true;
  bool teleport = false;  ///< a jump lies in (previous_ns, sim_time_ns]
};
/// Returns pose and rates of a trajectory at an instant.
/// @pre the trajectory is not empty
[[nodiscard]] TrajectorySample sample_trajectory(const scene::Trajectory& trajectory,
                                                 std::int64_t sim_time_ns,
                                                 std::int64_t previous_ns) noexcept;

/// Returns the first instant of the sensor's trajectory; the history start when it has none.
[[nodiscard]] std::int64_t trajectory_start_ns(const scene::ScenarioDesc& scenario) noexcept;

/// Returns the instant at which benchmarks render a scenario: the start of its camera's trajectory.
/// If that is (nearly) the start of the history, it is three and a half hours later.
[[nodiscard]] std::int64_t observation_ns(const scene::ScenarioDesc& scenario) noexcept;

/// Makes the host frame that a simulation host would send for the scenario's own trajectories, with
/// rates. `index` counts from 0, frame numbers from 1.
/// @pre check_entities_fit(scenario) succeeds
void make_host_frame(const scene::ScenarioDesc& scenario, std::int64_t start_ns, double rate_hz,
                     std::uint64_t index, protocol::HostFrameData& out);
/// Checks that a host frame has room for all entities. Errors: config when more entities move than
/// it holds.
[[nodiscard]] physics::Result<void> check_entities_fit(const scene::ScenarioDesc& scenario);

}  // namespace emit::tool
