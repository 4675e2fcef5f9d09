// SPDX-License-Identifier: Apache-2.0
#include "agents/gateway/gateway_agent.hpp"

namespace emit::server {
namespace {

/// Datagrams taken in a turn, so that a flood does not delay what goes to the host.
constexpr int kMostPerTurn = 16;

}  // namespace

int GatewayAgent::do_work(std::int64_t now_ns) noexcept {
  turned_ns_ = now_ns;
  int work = take_reports() + take_inputs(now_ns);
  if (const auto message = gateway_->message(now_ns); !message.empty()) {
    port_.send(message);
    ++work;
  }
  return work;
}

int GatewayAgent::take_reports() noexcept {
  int work = 0;
  for (const GatewayReport* report = context_.gateway_reports.front(); report != nullptr;
       report = context_.gateway_reports.front()) {
    gateway_->report(*report);
    context_.gateway_reports.pop();
    ++work;
  }
  return work;
}

int GatewayAgent::take_inputs(std::int64_t now_ns) noexcept {
  int work = 0;
  for (int datagrams = 0; datagrams <= kMostPerTurn;) {
    // A datagram is read only when there is room for what comes of it; until then it waits in the
    // kernel. The conductor rings when it has made room.
    HostInput* input =
        context_.of_gateway_room.look([this] { return context_.gateway_inputs.claim(); });
    waits_for_room_ = input == nullptr;
    if (waits_for_room_) break;
    if (gateway_->next(input->frame, now_ns)) {
      input->kind = HostInput::Kind::frame;
      input->origin = Origin{.kind = Origin::Kind::gateway};
      context_.gateway_inputs.commit();
      context_.bells.conductor.ring();
      ++work;
      continue;
    }
    const auto datagram = datagrams < kMostPerTurn ? port_.receive() : std::nullopt;
    if (!datagram) break;
    gateway_->take(datagram->bytes, datagram->received_ns);
    ++datagrams;
    ++work;
  }
  return work;
}

}  // namespace emit::server
