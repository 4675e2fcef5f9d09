// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/protocol/dis.hpp"
#include "emit/scene/scene_desc.hpp"
#include "gateway/georeference.hpp"
#include "gateway/host_gateway.hpp"
#include "motion/host_clock.hpp"
#include "rt/counters.hpp"
#include "telemetry/event_log.hpp"

namespace emit::server {

/// Entities of a DIS exercise as emitd's host (docs/dis.md). It listens and never answers.
///
/// Between two PDUs an entity goes on by its dead-reckoning model. The instants are those of the
/// sender's time stamps: the earliest of the latest arrivals ties them to this clock, so that
/// neither the delay of a PDU nor the loss of others shifts time. Host frames with all entities
/// come at a fixed rate.
class DisExercise final : public HostGateway {
 public:
  /// Senders (site and application) that are told apart.
  static constexpr std::size_t kMaxSenders = 64;

  struct Options {
    config::DisConfig dis;
    std::int64_t first_time_ns = 0;                 ///< simulation time of the first host frame
    const scene::ScenarioDesc* scenario = nullptr;  ///< null: there is none
  };
  /// The scenario, the counters and the events outlive the object.
  /// @pre the ids of `options.dis` are valid
  DisExercise(const Options& options, Counters& counters, EventLog& events);

  void take(std::span<const std::byte> datagram, std::int64_t received_ns) noexcept override;
  [[nodiscard]] bool next(protocol::HostFrameData& frame, std::int64_t now_ns) noexcept override;
  void report(const GatewayReport& report) noexcept override;
  [[nodiscard]] std::span<const std::byte> message(std::int64_t /*now_ns*/) noexcept override {
    return {};
  }
  [[nodiscard]] std::int64_t wake_at_ns() const noexcept override;

 private:
  struct Sender {
    std::uint16_t site = 0;
    std::uint16_t application = 0;
    protocol::dis::DisClock stamps;
    HostClock arrivals;
  };
  struct Entity {
    protocol::dis::EntityId id;
    std::uint32_t scenario_id = 0;  ///< 0: the seeker
    protocol::dis::Motion motion;
    bool came = false;    ///< it has had a PDU
    bool on = false;      ///< it is part of the exercise now
    bool frozen = false;  ///< it does not move
    std::optional<bool>
        shown;               ///< on or off in the latest host frame; none: it has not been in one
    std::size_t sender = 0;  ///< index into `senders_`
    std::int64_t stamp_ns = 0;  ///< instant of its motion, by the sender
    std::int64_t heard_ns = 0;  ///< arrival of its latest PDU, wall
  };

  /// Returns the sender of an entity; null: there are too many.
  [[nodiscard]] Sender* sender_of(const protocol::dis::EntityId& id) noexcept;
  [[nodiscard]] Entity* find(const protocol::dis::EntityId& id) noexcept;
  /// Notes the stamp of a PDU of an entity. Returns false when the entity has had a newer one.
  bool take_stamp(Entity& entity, std::uint32_t timestamp, std::int64_t received_ns) noexcept;
  void take_state(const protocol::dis::EntityState& state, std::uint32_t timestamp,
                  std::int64_t received_ns) noexcept;
  void take_update(const protocol::dis::EntityStateUpdate& update, std::uint32_t timestamp,
                   std::int64_t received_ns) noexcept;
  void refuse(const protocol::dis::Fault& fault) noexcept;
  /// Returns the instant by the sender of an entity.
  [[nodiscard]] std::int64_t sender_time_ns(const Entity& entity,
                                            std::int64_t now_ns) const noexcept;
  [[nodiscard]] bool is_silent(const Entity& entity, std::int64_t now_ns) const noexcept;
  /// Writes where an entity is now. Returns false when that is beyond what emitd takes.
  bool place(const Entity& entity, std::int64_t now_ns, physics::Pose& pose,
             std::optional<protocol::PoseRates>& rates) noexcept;

  Options options_;
  Counters& counters_;
  EventLog& events_;
  Georeference earth_;
  std::int64_t period_ns_;
  std::int64_t timeout_ns_;
  std::vector<Sender> senders_;   ///< reserved at the start
  std::vector<Entity> entities_;  ///< those of the configuration; the first is the seeker
  std::uint64_t run_id_ = 0;      ///< 0: the seeker has not come yet
  std::uint64_t number_ = 0;
  std::int64_t begin_ns_ = 0;  ///< instant of the first host frame, by the seeker's sender
  std::int64_t sim_time_ns_ = 0;
  std::int64_t due_ns_ = 0;
};

}  // namespace emit::server
