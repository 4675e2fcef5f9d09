// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/dis/pdu.hpp"

#include <algorithm>
#include <limits>

#include "dis/layouts.hpp"
#include "emit/physics/limits.hpp"
#include "fixed_text.hpp"

namespace emit::protocol::dis {
namespace {

constexpr double kLargest = std::numeric_limits<double>::max();

/// Keeps the first number that is out of its range. Comparisons are false for NaN.
class PduLimits {
 public:
  void within(const char* field, double value, double lowest, double highest) noexcept {
    if (fault_ || (value >= lowest && value <= highest)) return;
    fault_ = {.kind = Fault::Kind::field,
              .field = field,
              .value = value,
              .lowest = lowest,
              .highest = highest};
  }
  void finite(const char* field, double value) noexcept {
    within(field, value, -kLargest, kLargest);
  }
  template <class Vector>
  void finite_vector(const char* field, const Vector& v) noexcept {
    finite(field, v.x);
    finite(field, v.y);
    finite(field, v.z);
  }
  void location(const glm::dvec3& v) noexcept {
    constexpr double kMax = physics::limits::kMaxPositionM;
    within("location_ecef_m", v.x, -kMax, kMax);
    within("location_ecef_m", v.y, -kMax, kMax);
    within("location_ecef_m", v.z, -kMax, kMax);
  }
  void orientation(const EulerAngles& angles) noexcept {
    finite("psi_rad", angles.psi_rad);
    finite("theta_rad", angles.theta_rad);
    finite("phi_rad", angles.phi_rad);
  }
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }

 private:
  Fault fault_;
};

/// One function per PDU.
struct CheckPdu {
  PduLimits& limits;

  void operator()(const EntityState& p) const {
    limits.finite_vector("velocity_m_s", p.velocity_m_s);
    limits.location(p.location_ecef_m);
    limits.orientation(p.orientation);
    limits.within("model", static_cast<double>(p.model), 0.0,
                  static_cast<double>(DeadReckoningModel::fvb));
    limits.finite_vector("acceleration_m_s2", p.acceleration_m_s2);
    limits.finite_vector("angular_velocity_rad_s", p.angular_velocity_rad_s);
  }
  void operator()(const EntityStateUpdate& p) const {
    limits.finite_vector("velocity_m_s", p.velocity_m_s);
    limits.location(p.location_ecef_m);
    limits.orientation(p.orientation);
  }
  void operator()(const Fire& p) const {
    limits.location(p.location_ecef_m);
    limits.finite_vector("velocity_ecef_m_s", p.velocity_ecef_m_s);
    limits.within("range_m", p.range_m, 0.0, kLargest);
  }
  void operator()(const Detonation& p) const {
    limits.finite_vector("velocity_ecef_m_s", p.velocity_ecef_m_s);
    limits.location(p.location_ecef_m);
    limits.finite_vector("location_in_target_m", p.location_in_target_m);
  }
  void operator()(const StartResume&) const {}
  void operator()(const StopFreeze&) const {}
};

}  // namespace

std::string_view EntityState::marking_text() const noexcept {
  const auto end = std::ranges::find(marking, '\0');
  return {marking.data(), static_cast<std::size_t>(end - marking.begin())};
}

VariableParameters::VariableParameters(std::span<const std::byte> bytes) noexcept : bytes_(bytes) {
  EMIT_CHECK_OP(bytes.size() % kVariableParameterBytes, ==, 0U);
}

VariableParameter VariableParameters::operator[](std::size_t index) const noexcept {
  EMIT_CHECK_OP(index, <, size());
  const BigEndianReader io(bytes_.subspan(index * kVariableParameterBytes));
  VariableParameter parameter;
  layout(io, parameter);
  return parameter;
}

Fault check_limits(const Pdu& pdu) noexcept {
  PduLimits limits;
  with_pdu(pdu, CheckPdu{limits});
  return limits.fault();
}

std::string_view pdu_name(std::uint8_t type) noexcept {
  switch (type) {
    case 1:
      return "Entity State";
    case 2:
      return "Fire";
    case 3:
      return "Detonation";
    case 4:
      return "Collision";
    case 11:
      return "Create Entity";
    case 12:
      return "Remove Entity";
    case 13:
      return "Start/Resume";
    case 14:
      return "Stop/Freeze";
    case 15:
      return "Acknowledge";
    case 20:
      return "Data";
    case 21:
      return "Event Report";
    case 22:
      return "Comment";
    case 23:
      return "Electromagnetic Emission";
    case 24:
      return "Designator";
    case 25:
      return "Transmitter";
    case 26:
      return "Signal";
    case 67:
      return "Entity State Update";
    case 72:
      return "Entity Damage Status";
    default:
      return "unknown";
  }
}

std::string_view fault_text(const Fault& fault, std::span<char> buffer) noexcept {
  FixedText out(buffer);
  if (fault.kind == Fault::Kind::none) {
    out.add("no fault");
    return out.text();
  }
  out.add("PDU {}", fault.pdu);
  if (fault.kind != Fault::Kind::too_short) {
    out.add(" (type {}, {})", fault.type, pdu_name(fault.type));
  }
  out.add(" at byte {}", fault.offset);
  switch (fault.kind) {
    case Fault::Kind::none:
      break;
    case Fault::Kind::too_short:
      out.add(": {} bytes are left, it needs {}", fault.value, fault.lowest);
      break;
    case Fault::Kind::length:
      out.add(": states {} bytes, must be {} to {}", fault.value, fault.lowest, fault.highest);
      break;
    case Fault::Kind::version:
      out.add(": version {}, must be 6 or 7", fault.value);
      break;
    case Fault::Kind::size_of_pdu:
      out.add(": states {} bytes, needs {}", fault.value, fault.lowest);
      break;
    case Fault::Kind::field:
      out.add(": {} is {}", fault.field, fault.value);
      if (fault.highest < kLargest) {
        out.add(", must be {} to {}", fault.lowest, fault.highest);
      } else {
        out.add("{}",
                fault.lowest < 0.0 ? ", must be finite" : ", must be finite and not negative");
      }
      break;
    case Fault::Kind::no_space:
      out.add(": it has {} bytes, {} are free", fault.value, fault.highest);
      break;
  }
  return out.text();
}

}  // namespace emit::protocol::dis
