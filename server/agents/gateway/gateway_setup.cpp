// SPDX-License-Identifier: Apache-2.0
#include "agents/gateway/gateway_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "gateway/cigi_host.hpp"
#include "gateway/dis_exercise.hpp"
#include "gateway/net_fdm_model.hpp"

namespace emit::server {
namespace {

using physics::Error;
using physics::Result;

/// Gateway with what the log says of it.
struct Made {
  std::unique_ptr<HostGateway> gateway;
  std::string notes;
};

/// Returns a fault where the configuration names an entity that the scenario lacks.
std::optional<Error> check_entity(const scene::ScenarioDesc* scenario, std::uint32_t entity_id,
                                  std::string_view key) {
  const auto is_it = [&](const scene::ObjectDesc& object) { return object.entity_id == entity_id; };
  if (scenario == nullptr || std::ranges::any_of(scenario->objects, is_it)) return std::nullopt;
  return Error{physics::ErrorCode::config,
               fmt::format("{}: the scenario has no entity {}", key, entity_id)};
}

Result<Made> make_cigi(Context& context, const config::DaemonConfig& config,
                       const scene::ScenarioDesc* scenario) {
  Made out{nullptr, "protocol=cigi"};
  for (const config::CigiPartConfig& part : config.cigi.parts) {
    if (auto fault = check_entity(scenario, part.entity, "cigi.parts")) {
      return tl::unexpected<Error>(std::move(*fault));
    }
  }
  std::unique_ptr<SceneQuery> scene;
  if (scenario != nullptr) {
    auto query = SceneQuery::create(*scenario);
    if (!query) return tl::unexpected<Error>(std::move(query.error()));
    scene = std::make_unique<SceneQuery>(std::move(*query));
    // Answers have numbers where hosts want to know names.
    std::size_t number = 0;
    for (const std::string& material : scene->materials()) {
      out.notes +=
          fmt::format("{}{} {}", number == 0 ? " materials=\"" : ", ", number + 1, material);
      ++number;
    }
    out.notes += "\"";
  }
  CigiHost::Options options;
  options.cigi = config.cigi;
  options.synchronous = config.pacing.mode == config::PacingMode::host_step;
  options.rate_hz = options.synchronous ? config.cigi.rate_hz : config.pacing.rate_hz;
  options.first_time_ns = config.source.first_time_ns;
  options.scenario = scenario;
  options.is_view_fixed = is_view_fixed(context.cameras);
  options.picture = &context.picture;
  out.gateway = std::make_unique<CigiHost>(options, std::move(scene), context.counters,
                                           context.gateway_events);
  return out;
}

Result<Made> make_dis(Context& context, const config::DaemonConfig& config,
                      const scene::ScenarioDesc* scenario) {
  // The configuration names the entities, so that one that the scenario lacks is a mistake.
  for (const config::DisEntityConfig& entity : config.dis.entities) {
    if (auto fault = check_entity(scenario, entity.entity, "dis.entities")) {
      return tl::unexpected<Error>(std::move(*fault));
    }
  }
  Made out{nullptr, fmt::format("protocol=dis exercise={}", config.dis.exercise)};
  out.gateway = std::make_unique<DisExercise>(
      DisExercise::Options{config.dis, config.source.first_time_ns, scenario}, context.counters,
      context.gateway_events);
  return out;
}

Result<Made> make_gateway(Context& context, const config::DaemonConfig& config,
                          const scene::ScenarioDesc* scenario) {
  if (config.cigi.enabled()) return make_cigi(context, config, scenario);
  if (config.dis.enabled()) return make_dis(context, config, scenario);
  return Made{std::make_unique<NetFdmModel>(config.source.first_time_ns, scenario, context.counters,
                                            context.gateway_events),
              "protocol=net_fdm"};
}

GatewayPort::Options port_options(const config::DaemonConfig& config) {
  GatewayPort::Options out;
  if (config.cigi.enabled()) {
    out.section = "cigi";
    out.listen = config.cigi.listen;
    out.host = config.cigi.host;
    return out;
  }
  out.allow = config.access.allow;
  if (config.dis.enabled()) {
    out.section = "dis";
    out.listen = config.dis.listen;
    out.group = config.dis.group;
  } else {
    out.section = "net_fdm";
    out.listen = config.net_fdm.listen;
  }
  return out;
}

}  // namespace

Result<std::unique_ptr<GatewayAgent>> make_gateway_agent(
    Context& context, const config::DaemonConfig& config,
    const std::optional<scene::ScenarioDesc>& scenario) {
  if (!config.has_gateway()) return std::unique_ptr<GatewayAgent>();
  auto port = GatewayPort::open(port_options(config), context.clock, context.counters);
  if (!port) return tl::unexpected<Error>(std::move(port.error()));
  auto made = make_gateway(context, config, scenario ? &*scenario : nullptr);
  if (!made) return tl::unexpected<Error>(std::move(made.error()));
  return std::make_unique<GatewayAgent>(context, std::move(*port), std::move(made->gateway),
                                        std::move(made->notes));
}

}  // namespace emit::server
