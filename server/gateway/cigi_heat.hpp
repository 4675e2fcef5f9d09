// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "emit/config/daemon_config.hpp"
#include "emit/protocol/cigi/host_packets.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::server {

/// Parts of entities that a CIGI host heats with Component Control of class entity: the instance is
/// the entity, the component is the part, the state is the kind of drive and the first word its
/// value as a float. What a host does not send again keeps its last value.
///
/// Thread: one owner. Real time: RT-safe after construction.
class CigiHeat {
 public:
  /// States of the component.
  enum State : std::uint8_t { kOff = 0, kTemperatureK = 1, kPowerWM2 = 2, kThrottle = 3 };
  /// Largest number of parts that a host heats in a run.
  static constexpr std::size_t kMaxParts = 1024;

  /// `scenario` may be null and outlives the object; every part is known then. `entities` are those
  /// of the host whose number in the scenario is another one.
  CigiHeat(const scene::ScenarioDesc* scenario,
           const std::vector<config::CigiEntityConfig>& entities);

  /// Forgets every part.
  void clear() noexcept { count_ = 0; }
  /// Returns false where it has no effect: another class, a part that the scenario does not have or
  /// that takes no throttle, a value out of range, or too many parts.
  bool take(const protocol::cigi::ComponentControl& packet) noexcept;
  bool take(const protocol::cigi::ShortComponentControl& packet) noexcept;
  /// Sends everything again with the next frames.
  void mark_all() noexcept;
  /// Writes the commands that no frame has carried yet, as many as have room.
  void fill(protocol::HostFrameData& frame) noexcept;

 private:
  bool take(std::uint16_t entity, std::uint16_t part, std::uint8_t state,
            std::uint32_t word) noexcept;
  [[nodiscard]] bool is_known(const protocol::PartCommandData& command) const noexcept;

  const scene::ScenarioDesc* scenario_;
  std::vector<std::pair<std::uint16_t, std::uint32_t>> entities_;
  struct Part {
    protocol::PartCommandData command;
    bool marked = false;
  };
  std::vector<Part> parts_;  ///< kMaxParts of them, the first `count_` in use
  std::size_t count_ = 0;
};

}  // namespace emit::server
