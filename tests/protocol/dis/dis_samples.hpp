// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "emit/protocol/dis.hpp"

/// One sound PDU of each kind, in which every field differs from its default, as the bytes of the
/// golden vectors say.
namespace emit::test {

struct SamplePdu {
  protocol::dis::Pdu pdu;
  std::uint32_t timestamp;
  std::vector<protocol::dis::VariableParameter> parameters;
};

inline std::vector<SamplePdu> sample_pdus() {
  using namespace protocol::dis;
  const glm::vec3 velocity(101.5f, -202.25f, 303.125f);
  const glm::dvec3 location(4331297.0625, 567537.5, 4633133.25);
  const EulerAngles orientation{1.25f, -0.5f, 2.75f};
  const EntityType missile{.kind = 2,
                           .domain = 1,
                           .country = 225,
                           .category = 1,
                           .subcategory = 2,
                           .specific = 3,
                           .extra = 4};
  const MunitionDescriptor descriptor{
      .type = missile, .warhead = 1000, .fuse = 1100, .quantity = 1, .rate_per_minute = 60};
  const VariableParameter turret{.change_indicator = 3, .type = 4096 + 11, .value = 0.5f};
  const VariableParameter gun{
      .change_indicator = 4, .attached_to = 1, .type = 4416 + 13, .value = -0.25f};
  EntityState state{.entity_id = {0x0102, 0x0304, 0x0506},
                    .force_id = 2,
                    .parameter_count = 2,
                    .type = missile,
                    .alternative_type = {.kind = 1,
                                         .domain = 2,
                                         .country = 222,
                                         .category = 5,
                                         .subcategory = 6,
                                         .specific = 7,
                                         .extra = 8},
                    .velocity_m_s = velocity,
                    .location_ecef_m = location,
                    .orientation = orientation,
                    .appearance = 0xA1B2C3D4,
                    .model = DeadReckoningModel::rvb,
                    .acceleration_m_s2 = {9.5f, -8.25f, 7.125f},
                    .angular_velocity_rad_s = {0.25f, -0.5f, 0.75f},
                    .marking_character_set = 1,
                    .marking = {'S', 'E', 'E', 'K', 'E', 'R', '-', '1'},
                    .capabilities = 0x0102};
  for (std::uint8_t i = 0; i < 15; ++i) {
    state.other_parameters[i] = static_cast<std::uint8_t>(i + 1);
  }
  return {
      {state, 0x12345679, {turret, gun}},
      {Fire{.firing_id = {1, 2, 3},
            .target_id = {4, 5, 6},
            .munition_id = {7, 8, 9},
            .event_id = {10, 11, 12},
            .fire_mission_index = 77,
            .location_ecef_m = location,
            .descriptor = descriptor,
            .velocity_ecef_m_s = velocity,
            .range_m = 1500.5f},
       0x2222,
       {}},
      {Detonation{.firing_id = {1, 2, 3},
                  .target_id = {4, 5, 6},
                  .munition_id = {7, 8, 9},
                  .event_id = {10, 11, 12},
                  .velocity_ecef_m_s = velocity,
                  .location_ecef_m = location,
                  .descriptor = descriptor,
                  .location_in_target_m = {1.5f, -2.5f, 3.5f},
                  .result = 5,
                  .parameter_count = 1},
       0x3334,
       {turret}},
      {StartResume{.originating_id = {1, 2, 3},
                   .receiving_id = {0xFFFF, 0xFFFF, 0xFFFF},
                   .real_time = {480000, 0x10000001},
                   .simulation_time = {5, 0x20000000},
                   .request_id = 99},
       0x4444,
       {}},
      {StopFreeze{.originating_id = {1, 2, 3},
                  .receiving_id = {0xFFFF, 0xFFFF, 0xFFFF},
                  .real_time = {480001, 0x30000001},
                  .reason = 1,
                  .frozen_behavior = 6,
                  .request_id = 100},
       0x5555,
       {}},
      {EntityStateUpdate{.entity_id = {0x0102, 0x0304, 0x0506},
                         .parameter_count = 1,
                         .velocity_m_s = velocity,
                         .location_ecef_m = location,
                         .orientation = orientation,
                         .appearance = 0xA1B2C3D4},
       0x12345679,
       {turret}},
  };
}

/// Returns a datagram of these PDUs in exercise 9.
/// @pre each of them can be written
inline std::vector<std::byte> dis_datagram(std::span<const SamplePdu> pdus, std::uint8_t version) {
  std::vector<std::byte> memory(8192);
  protocol::dis::Writer writer(memory, version, 9);
  for (const SamplePdu& each : pdus) {
    EMIT_CHECK(!writer.add(each.pdu, each.timestamp, each.parameters));
  }
  return {writer.datagram().begin(), writer.datagram().end()};
}

}  // namespace emit::test
