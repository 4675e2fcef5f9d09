// SPDX-License-Identifier: Apache-2.0
#include "agents/gateway/gateway_setup.hpp"

#include <fmt/format.h>

#include <string>
#include <utility>

#include "gateway/cigi_host.hpp"

namespace emit::server {

physics::Result<std::unique_ptr<GatewayAgent>> make_cigi_agent(
    Context& context, const config::DaemonConfig& config,
    const std::optional<scene::ScenarioDesc>& scenario) {
  auto port = GatewayPort::open("cigi", config.cigi.listen, config.cigi.host, context.clock,
                                context.counters);
  if (!port) return tl::unexpected<physics::Error>(std::move(port.error()));
  std::unique_ptr<SceneQuery> scene;
  std::string notes = "protocol=cigi";
  if (scenario) {
    auto query = SceneQuery::create(*scenario);
    if (!query) return tl::unexpected<physics::Error>(std::move(query.error()));
    scene = std::make_unique<SceneQuery>(std::move(*query));
    // Answers have numbers where hosts want to know names.
    std::size_t number = 0;
    for (const std::string& material : scene->materials()) {
      notes += fmt::format("{}{} {}", number == 0 ? " materials=\"" : ", ", number + 1, material);
      ++number;
    }
    notes += "\"";
  }
  CigiHost::Options options;
  options.cigi = config.cigi;
  options.synchronous = config.pacing.mode == config::PacingMode::host_step;
  options.rate_hz = options.synchronous ? config.cigi.rate_hz : config.pacing.rate_hz;
  options.first_time_ns = config.source.first_time_ns;
  options.scenario = scenario ? &*scenario : nullptr;
  auto host = std::make_unique<CigiHost>(options, std::move(scene), context.counters,
                                         context.gateway_events);
  return std::make_unique<GatewayAgent>(context, std::move(*port), std::move(host),
                                        std::move(notes));
}

}  // namespace emit::server
