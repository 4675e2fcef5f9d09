// SPDX-License-Identifier: Apache-2.0
#include "gateway/cigi_heat.hpp"

#include <algorithm>
#include <bit>
#include <span>

#include "emit/protocol/convert.hpp"

namespace emit::server {

namespace cigi = protocol::cigi;
using protocol::PartCommandData;

CigiHeat::CigiHeat(const scene::ScenarioDesc* scenario,
                   const std::vector<config::CigiEntityConfig>& entities)
    : scenario_(scenario), parts_(kMaxParts) {
  for (const config::CigiEntityConfig& entity : entities) {
    entities_.emplace_back(static_cast<std::uint16_t>(entity.id), entity.entity);
  }
}

bool CigiHeat::take(const cigi::ComponentControl& packet) noexcept {
  return packet.component_class == cigi::ComponentClass::entity &&
         take(packet.instance_id, packet.component_id, packet.component_state, packet.data[0]);
}

bool CigiHeat::take(const cigi::ShortComponentControl& packet) noexcept {
  return packet.component_class == cigi::ComponentClass::entity &&
         take(packet.instance_id, packet.component_id, packet.component_state, packet.data[0]);
}

bool CigiHeat::take(std::uint16_t entity, std::uint16_t part, std::uint8_t state,
                    std::uint32_t word) noexcept {
  using Kind = PartCommandData::Kind;
  constexpr std::array kKinds{Kind::off, Kind::temperature, Kind::power, Kind::throttle};
  if (state >= kKinds.size()) return false;
  PartCommandData command{entity, part, kKinds[state], 0.0};
  if (command.kind != Kind::off) command.value = double{std::bit_cast<float>(word)};
  const auto mapped =
      std::ranges::find(entities_, entity, &std::pair<std::uint16_t, std::uint32_t>::first);
  if (mapped != entities_.end()) command.entity_id = mapped->second;
  if (protocol::check_part(command) != protocol::DecodeStatus::ok || !is_known(command)) {
    return false;
  }
  const std::span used = std::span(parts_).first(count_);
  const auto same = std::ranges::find_if(used, [&](const Part& other) {
    return other.command.entity_id == command.entity_id && other.command.part_id == part;
  });
  if (same != used.end()) {
    *same = {command, true};
    return true;
  }
  if (count_ == parts_.size()) return false;
  parts_[count_++] = {command, true};
  return true;
}

bool CigiHeat::is_known(const PartCommandData& command) const noexcept {
  if (scenario_ == nullptr) return true;
  for (const scene::ObjectDesc& object : scenario_->objects) {
    if (object.entity_id != command.entity_id || object.entity_id == 0) continue;
    for (const scene::PartDesc& part : object.parts) {
      if (part.id != command.part_id) continue;
      return command.kind != PartCommandData::Kind::throttle || part.curve.given;
    }
  }
  return false;
}

void CigiHeat::mark_all() noexcept {
  for (Part& part : std::span(parts_).first(count_)) part.marked = true;
}

void CigiHeat::fill(protocol::HostFrameData& frame) noexcept {
  frame.part_count = 0;
  for (Part& part : std::span(parts_).first(count_)) {
    if (!part.marked) continue;
    if (frame.part_count == frame.parts.size()) return;
    frame.parts[frame.part_count++] = part.command;
    part.marked = false;
  }
}

}  // namespace emit::server
