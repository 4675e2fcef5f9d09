// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "agents/agent.hpp"
#include "agents/context.hpp"
#include "agents/gateway/gateway_port.hpp"
#include "gateway/host_gateway.hpp"

namespace emit::server {

/// Carries the datagrams of a foreign host to its gateway, the gateway's host frames to the
/// conductor, and the gateway's messages back.
class GatewayAgent final : public Agent {
 public:
  /// @param notes  what the log says of the gateway at the start
  GatewayAgent(Context& context, GatewayPort port, std::unique_ptr<HostGateway> gateway,
               std::string notes)
      : Agent(context.bells.gateway),
        context_(context),
        port_(std::move(port)),
        gateway_(std::move(gateway)),
        notes_(std::move(notes)) {}

  [[nodiscard]] std::string_view name() const noexcept override { return "gateway"; }
  int do_work(std::int64_t now_ns) noexcept override;
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override {
    // A due frame without room waits for the conductor, and the agent looks now and then.
    constexpr std::int64_t kLookNs = 1'000'000;
    const std::int64_t due_ns = gateway_->wake_at_ns();
    return waits_for_room_ ? std::max(due_ns, turned_ns_ + kLookNs) : due_ns;
  }
  [[nodiscard]] int wait_fd() const noexcept override { return waits_for_room_ ? -1 : port_.fd(); }
  [[nodiscard]] SocketAddress address() const noexcept { return port_.address(); }
  [[nodiscard]] const std::string& notes() const noexcept { return notes_; }

 private:
  int take_reports() noexcept;
  int take_inputs(std::int64_t now_ns) noexcept;

  Context& context_;
  GatewayPort port_;
  std::unique_ptr<HostGateway> gateway_;
  std::string notes_;
  std::int64_t turned_ns_ = 0;   ///< instant of the latest turn, wall
  bool waits_for_room_ = false;  ///< on the ring to the conductor
};

}  // namespace emit::server
