// SPDX-License-Identifier: Apache-2.0
#include "app/console_endpoint.hpp"

#include <unistd.h>

#include <array>
#include <utility>

#include "net/ip_address.hpp"
#include "telemetry/http_address.hpp"

namespace emit::server {
namespace {

/// Returns the names of this host that a browser may ask for.
std::vector<std::string> own_names(const std::string& listen) {
  std::vector<std::string> names;
  if (const auto where = parse_host_port(listen); where && !where->host.empty()) {
    names.push_back(where->host);
  }
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) == 0) {
    names.emplace_back(name.data());
  }
  return names;
}

}  // namespace

physics::Result<std::unique_ptr<ConsoleEndpoint>> ConsoleEndpoint::open(
    const config::DaemonConfig& config, const Parts& parts, ConsoleFacts facts) {
  const auto named = [&](physics::Error error) {
    return tl::unexpected<physics::Error>(
        std::move(error).with_context("console.listen").with_context(config.file.string()));
  };
  const auto address = http_address(config, config.console.listen, config::Port::console);
  if (!address) {
    return named(address.error());
  }
  std::unique_ptr<ConsoleEndpoint> endpoint(new ConsoleEndpoint(config, parts, std::move(facts)));
  if (endpoint->facts_.no_explanation.empty()) {
    endpoint->explainer_ =
        std::make_unique<Explainer>(parts.explain_command, parts.journal,
                                    [&context = parts.context] { context.bells.console.ring(); });
  }
  auto server = ConsoleServer::start(*address, parts.context, parts.tap, endpoint->answers(),
                                     {config.console.rate_hz, own_names(config.console.listen)});
  if (!server) {
    return named(std::move(server.error()));
  }
  endpoint->server_ = std::move(*server);
  return endpoint;
}

std::string ConsoleEndpoint::url() const {
  return "http://" + to_string(server_->address()) + "/";
}

ConsoleServer::Answers ConsoleEndpoint::answers() {
  ConsoleServer::Answers answers;
  answers.admits = [this](const SocketAddress& peer) { return admits(peer); };
  answers.hello = [this](bool local) {
    return console_hello(facts_, parts_.context, may_command(local));
  };
  answers.status = [this](std::size_t pages) { return status(pages); };
  answers.temperatures = [this](std::size_t channel) {
    return console_temperatures(parts_.context.channels[channel]);
  };
  answers.explain = [this](const ExplainRequest& request) { return explain(request); };
  answers.explained = [this]() -> std::optional<Explained> {
    return explainer_ ? explainer_->take() : std::nullopt;
  };
  answers.command = [this](CommandKind command, bool local, std::uint32_t page) {
    return take_command(command, local, page);
  };
  return answers;
}

bool ConsoleEndpoint::may_command(bool local) const noexcept {
  switch (config_.console.commands) {
    case config::ConsoleCommands::none:
      return false;
    case config::ConsoleCommands::loopback:
      return local;
    case config::ConsoleCommands::all:
      break;
  }
  return true;
}

bool ConsoleEndpoint::admits(const SocketAddress& peer) const {
  const protocol::IpAddress ip = ip_of(peer);
  if (parts_.receiver.may_connect(ip)) {
    return true;
  }
  parts_.context.counters.add(Counter::peers_refused);
  parts_.context.console_events.push(EventKind::peer_refused,
                                     static_cast<std::uint64_t>(PeerRefusal::not_allowed), 0,
                                     protocol::to_string(ip));
  return false;
}

std::string ConsoleEndpoint::status(std::size_t pages) const {
  const Context& context = parts_.context;
  return console_status(parts_.context, parts_.tap, parts_.board, parts_.duty_cycles,
                        {parts_.liveness.is_ready(context),
                         context.clock.monotonic_ns() - parts_.liveness.started_ns, pages});
}

std::string ConsoleEndpoint::take_command(CommandKind command, bool local, std::uint32_t page) {
  if (!may_command(local)) {
    return "console.commands does not allow it";
  }
  if (!parts_.liveness.serving.load(std::memory_order_acquire)) {
    return "emitd starts or stops";
  }
  HostInput* input = parts_.context.console_inputs.claim();
  if (input == nullptr) {
    return "commands before it still wait";
  }
  input->kind = HostInput::Kind::command;
  input->command = command;
  input->origin = {};
  input->origin.kind = Origin::Kind::console;
  input->origin.connection = page;
  parts_.context.console_inputs.commit();
  parts_.context.bells.conductor.ring();
  return {};
}

std::string ConsoleEndpoint::explain(ExplainRequest request) {
  if (!explainer_) return facts_.no_explanation;
  const Channel& channel = parts_.context.channels[request.channel];
  const Camera& camera = parts_.context.cameras[channel.camera];
  if (channel.quantity != protocol::PixelQuantity::radiance_w_m2_sr || channel.output_steps != 0) {
    return "the channel's pixels are no longer those of the sensor: choose one without output "
           "steps";
  }
  if (channel.camera != 0 || camera.along_projector || camera.mount != scene::ChannelCamera{}) {
    return "the channel has a camera of its own: only the sensor's own view can be explained";
  }
  if (request.x_px >= channel.width_px || request.y_px >= channel.height_px) {
    return "the pixel lies outside the image";
  }
  request.sensor_x_px = channel.window_px.x_px + request.x_px;
  request.sensor_y_px = channel.window_px.y_px + request.y_px;
  return explainer_->ask(request) ? std::string() : "explanations before it still wait";
}

}  // namespace emit::server
