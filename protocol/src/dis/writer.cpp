// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/dis/writer.hpp"

#include <algorithm>

#include "dis/layouts.hpp"

namespace emit::protocol::dis {
namespace {

/// Returns the protocol family of a PDU.
[[nodiscard]] constexpr std::uint8_t family_of(PduType type) noexcept {
  switch (type) {
    case PduType::fire:
    case PduType::detonation:
      return 2;
    case PduType::start_resume:
    case PduType::stop_freeze:
      return 5;
    default:
      return 1;
  }
}

}  // namespace

Writer::Writer(std::span<std::byte> memory, std::uint8_t version, std::uint8_t exercise_id) noexcept
    : memory_(memory), version_(version), exercise_id_(exercise_id) {
  EMIT_CHECK(version == 6 || version == 7);
}

Fault Writer::add(const Pdu& pdu, std::uint32_t timestamp,
                  std::span<const VariableParameter> parameters) noexcept {
  EMIT_CHECK_OP(parameters.size(), <=, 255U);
  const std::size_t begin = version_ == 7 ? (used_ + 7) / 8 * 8 : used_;
  Fault fault = check_limits(pdu);
  fault.pdu = pdus_;
  fault.offset = begin;
  with_pdu(pdu, [&]<class P>(P each) {
    fault.type = static_cast<std::uint8_t>(P::kType);
    if (fault) return;
    if constexpr (has_parameters<P>()) {
      each.parameter_count = static_cast<std::uint8_t>(parameters.size());
    } else {
      EMIT_CHECK(parameters.empty());
    }
    const std::size_t size = bytes_of(each);
    const std::size_t left = memory_.size() - std::min(begin, memory_.size());
    if (size > left) {
      fault.kind = Fault::Kind::no_space;
      fault.value = static_cast<double>(size);
      fault.highest = static_cast<double>(left);
      return;
    }
    std::ranges::fill(memory_.subspan(used_, begin - used_ + size), std::byte{0});
    const std::span<std::byte> bytes = memory_.subspan(begin, size);
    const BigEndianWriter io(bytes);
    Header header{.version = version_,
                  .exercise_id = exercise_id_,
                  .type = static_cast<std::uint8_t>(P::kType),
                  .family = family_of(P::kType),
                  .timestamp = timestamp,
                  .length = static_cast<std::uint16_t>(size)};
    layout(io, header);
    layout(io, each);
    for (std::size_t i = 0; i < parameters.size(); ++i) {
      VariableParameter parameter = parameters[i];
      const BigEndianWriter part(bytes.subspan(P::kBytes + i * kVariableParameterBytes));
      layout(part, parameter);
    }
    used_ = begin + size;
    ++pdus_;
  });
  return fault;
}

}  // namespace emit::protocol::dis
