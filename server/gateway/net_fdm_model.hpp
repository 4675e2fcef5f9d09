// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <limits>

#include "emit/protocol/net_fdm.hpp"
#include "emit/scene/scene_desc.hpp"
#include "gateway/georeference.hpp"
#include "gateway/host_gateway.hpp"
#include "rt/counters.hpp"
#include "telemetry/event_log.hpp"

namespace emit::server {

/// A flight dynamics model that moves the seeker by FlightGear's native FDM datagrams
/// (protocol/docs/net_fdm.md). The datagrams have no simulation time, so that it passes as their
/// arrivals do. Lost datagrams shift nothing.
class NetFdmModel final : public HostGateway {
 public:
  /// The arguments outlive the object. `scenario` may be null.
  NetFdmModel(std::int64_t first_time_ns, const scene::ScenarioDesc* scenario, Counters& counters,
              EventLog& events);

  void take(std::span<const std::byte> datagram, std::int64_t received_ns) noexcept override;
  [[nodiscard]] bool next(protocol::HostFrameData& frame, std::int64_t now_ns) noexcept override;
  void report(const GatewayReport& /*report*/) noexcept override {}
  [[nodiscard]] std::span<const std::byte> message(std::int64_t /*now_ns*/) noexcept override {
    return {};
  }
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override {
    return std::numeric_limits<std::int64_t>::max();
  }

 private:
  Counters& counters_;
  EventLog& events_;
  Georeference earth_;
  std::int64_t first_time_ns_;
  protocol::net_fdm::State state_;
  bool pending_ = false;
  std::uint64_t number_ = 0;
  std::uint64_t run_id_ = 0;
  std::int64_t begin_ns_ = 0;     ///< wall instant of `first_time_ns_`
  std::int64_t received_ns_ = 0;  ///< arrival of the latest one, wall
};

}  // namespace emit::server
