// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <span>
#include <type_traits>
#include <utility>
#include <variant>

#include "big_endian_io.hpp"
#include "emit/protocol/dis/pdu.hpp"

/// Layouts of the PDUs: offsets from the PDU's first byte. `Io` is BigEndianReader or
/// BigEndianWriter. Bytes that are not named are reserved.
namespace emit::protocol::dis {

inline constexpr std::size_t kHeaderBytes = 12;

template <class Io>
void layout(Io& io, Header& h) {
  io.number(0, h.version);
  io.number(1, h.exercise_id);
  io.number(2, h.type);
  io.number(3, h.family);
  io.number(4, h.timestamp);
  io.number(8, h.length);
  if (h.version >= 7) io.number(10, h.status);
}

/// Layout of three numbers of one kind.
template <class Io, class Vector>
void layout_vector(Io& io, std::size_t offset, Vector& v) {
  constexpr std::size_t kBytes = sizeof(v.x);
  io.number(offset, v.x);
  io.number(offset + kBytes, v.y);
  io.number(offset + 2 * kBytes, v.z);
}
template <class Io>
void layout_angles(Io& io, std::size_t offset, EulerAngles& a) {
  io.number(offset, a.psi_rad);
  io.number(offset + 4, a.theta_rad);
  io.number(offset + 8, a.phi_rad);
}
template <class Io>
void layout_id(Io& io, std::size_t offset, EntityId& id) {
  io.number(offset, id.site);
  io.number(offset + 2, id.application);
  io.number(offset + 4, id.entity);
}
template <class Io>
void layout_event(Io& io, std::size_t offset, EventId& id) {
  io.number(offset, id.site);
  io.number(offset + 2, id.application);
  io.number(offset + 4, id.event);
}
template <class Io>
void layout_type(Io& io, std::size_t offset, EntityType& t) {
  io.number(offset, t.kind);
  io.number(offset + 1, t.domain);
  io.number(offset + 2, t.country);
  io.number(offset + 4, t.category);
  io.number(offset + 5, t.subcategory);
  io.number(offset + 6, t.specific);
  io.number(offset + 7, t.extra);
}
template <class Io>
void layout_descriptor(Io& io, std::size_t offset, MunitionDescriptor& d) {
  layout_type(io, offset, d.type);
  io.number(offset + 8, d.warhead);
  io.number(offset + 10, d.fuse);
  io.number(offset + 12, d.quantity);
  io.number(offset + 14, d.rate_per_minute);
}
template <class Io>
void layout_time(Io& io, std::size_t offset, ClockTime& t) {
  io.number(offset, t.hours);
  io.number(offset + 4, t.timestamp);
}

template <class Io>
void layout(Io& io, EntityState& p) {
  layout_id(io, 12, p.entity_id);
  io.number(18, p.force_id);
  io.number(19, p.parameter_count);
  layout_type(io, 20, p.type);
  layout_type(io, 28, p.alternative_type);
  layout_vector(io, 36, p.velocity_m_s);
  layout_vector(io, 48, p.location_ecef_m);
  layout_angles(io, 72, p.orientation);
  io.number(84, p.appearance);
  io.number(88, p.model);
  for (std::size_t i = 0; i < p.other_parameters.size(); ++i) {
    io.number(89 + i, p.other_parameters[i]);
  }
  layout_vector(io, 104, p.acceleration_m_s2);
  layout_vector(io, 116, p.angular_velocity_rad_s);
  io.number(128, p.marking_character_set);
  for (std::size_t i = 0; i < p.marking.size(); ++i) io.number(129 + i, p.marking[i]);
  io.number(140, p.capabilities);
}

template <class Io>
void layout(Io& io, EntityStateUpdate& p) {
  layout_id(io, 12, p.entity_id);
  io.number(19, p.parameter_count);
  layout_vector(io, 20, p.velocity_m_s);
  layout_vector(io, 32, p.location_ecef_m);
  layout_angles(io, 56, p.orientation);
  io.number(68, p.appearance);
}

template <class Io>
void layout(Io& io, Fire& p) {
  layout_id(io, 12, p.firing_id);
  layout_id(io, 18, p.target_id);
  layout_id(io, 24, p.munition_id);
  layout_event(io, 30, p.event_id);
  io.number(36, p.fire_mission_index);
  layout_vector(io, 40, p.location_ecef_m);
  layout_descriptor(io, 64, p.descriptor);
  layout_vector(io, 80, p.velocity_ecef_m_s);
  io.number(92, p.range_m);
}

template <class Io>
void layout(Io& io, Detonation& p) {
  layout_id(io, 12, p.firing_id);
  layout_id(io, 18, p.target_id);
  layout_id(io, 24, p.munition_id);
  layout_event(io, 30, p.event_id);
  layout_vector(io, 36, p.velocity_ecef_m_s);
  layout_vector(io, 48, p.location_ecef_m);
  layout_descriptor(io, 72, p.descriptor);
  layout_vector(io, 88, p.location_in_target_m);
  io.number(100, p.result);
  io.number(101, p.parameter_count);
}

template <class Io>
void layout(Io& io, StartResume& p) {
  layout_id(io, 12, p.originating_id);
  layout_id(io, 18, p.receiving_id);
  layout_time(io, 24, p.real_time);
  layout_time(io, 32, p.simulation_time);
  io.number(40, p.request_id);
}

template <class Io>
void layout(Io& io, StopFreeze& p) {
  layout_id(io, 12, p.originating_id);
  layout_id(io, 18, p.receiving_id);
  layout_time(io, 24, p.real_time);
  io.number(32, p.reason);
  io.number(33, p.frozen_behavior);
  io.number(36, p.request_id);
}

/// Layout of a variable parameter. Only an articulated part has a number at byte 8.
template <class Io>
void layout(Io& io, VariableParameter& p) {
  io.number(0, p.record_type);
  io.number(1, p.change_indicator);
  io.number(2, p.attached_to);
  io.number(4, p.type);
  if (p.record_type == VariableParameter::kArticulatedPart) io.number(8, p.value);
}

/// Returns whether PDUs of a type have variable parameters.
template <class P>
[[nodiscard]] constexpr bool has_parameters() noexcept {
  return requires(P p) {
    p.parameter_count;
  };
}

/// Returns the number of bytes that a PDU's fields and parameters take.
template <class P>
[[nodiscard]] std::size_t bytes_of(const P& pdu) noexcept {
  if constexpr (has_parameters<P>()) {
    return P::kBytes + pdu.parameter_count * kVariableParameterBytes;
  } else {
    return P::kBytes;
  }
}

/// Calls `call` with the PDU that the variant holds. Unlike std::visit it cannot throw.
template <class Call>
void with_pdu(const Pdu& pdu, Call&& call) {
  [&]<std::size_t... I>(std::index_sequence<I...>) {
    static_cast<void>(((pdu.index() == I && (call(*std::get_if<I>(&pdu)), true)) || ...));
  }
  (std::make_index_sequence<std::variant_size_v<Pdu>>());
}

/// Calls `call` with a null pointer of the PDU type that has this number, if the codec knows it.
/// Returns whether it does.
template <class Call>
bool with_pdu_type(std::uint8_t type, Call&& call) {
  return [&]<std::size_t... I>(std::index_sequence<I...>) {
    return ((static_cast<std::uint8_t>(std::variant_alternative_t<I, Pdu>::kType) == type &&
             (call(static_cast<const std::variant_alternative_t<I, Pdu>*>(nullptr)), true)) ||
            ...);
  }
  (std::make_index_sequence<std::variant_size_v<Pdu>>());
}

/// Checks the numbers of a PDU against the limits that its struct documents. Returns a fault of
/// kind `field` for the first one that is wrong, without its place in a datagram. RT-safe.
[[nodiscard]] Fault check_limits(const Pdu& pdu) noexcept;

}  // namespace emit::protocol::dis
