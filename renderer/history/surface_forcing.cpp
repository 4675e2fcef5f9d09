// SPDX-License-Identifier: Apache-2.0
#include "emit/renderer/surface_forcing.hpp"

#include <algorithm>

#include "emit/physics/constants.hpp"
#include "history/environment.hpp"
#include "history/foster_history.hpp"
#include "history/foster_setup.hpp"
#include "history/surface_history.hpp"

namespace emit::renderer {

physics::Result<std::vector<IntervalForcing>> surface_forcing(
    const scene::ScenarioDesc& scenario, std::span<const std::int64_t> nodes_ns,
    std::span<const scene::Material> materials) {
  if (nodes_ns.size() < 2 || !std::is_sorted(nodes_ns.begin(), nodes_ns.end())) {
    return physics::make_error(physics::ErrorCode::invalid_argument,
                               "forcing needs at least two instants, in order of time");
  }
  const Environment environment(scenario);
  std::vector<IntervalForcing> out(nodes_ns.size() - 1);
  if (scenario.thermal.model == scene::ThermalModel::foster) {
    scene::ScenarioDesc start = scenario;
    start.thermal.history_start_ns = nodes_ns.front();
    start.thermal.spin_up_ns = 0;
    auto built = build_foster_materials(start, materials);
    if (!built) return tl::unexpected(std::move(built.error()));
    const FosterMaterial surroundings = built->back();
    built->pop_back();
    // No host can send rain here.
    FosterHistory history(start, std::move(*built), surroundings, environment, physics::kReferenceK,
                          DryGrounds::skipped, StartNodes::asked);
    history.forcing_over(nodes_ns, environment, out);
    return out;
  }
  for (std::size_t i = 0; i < out.size(); ++i) {
    out[i] = weather_forcing(interval_between(nodes_ns[i], nodes_ns[i + 1], environment));
  }
  return out;
}

}  // namespace emit::renderer
