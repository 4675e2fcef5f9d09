// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <string_view>
#include <variant>

/// Protocol data units (PDU) of Distributed Interactive Simulation, IEEE 1278.1, versions 6
/// (1278.1A-1998) and 7 (1278.1-2012). Locations and world velocities are in the earth-centred,
/// earth-fixed frame (ECEF) of WGS-84. A body has x to the front, y to the right and z down.
/// Numbers that are not finite and locations beyond 1e8 m are refused.
namespace emit::protocol::dis {

/// Types of PDU that the codec knows.
enum class PduType : std::uint8_t {
  entity_state = 1,
  fire = 2,
  detonation = 3,
  start_resume = 13,
  stop_freeze = 14,
  entity_state_update = 67,
};

/// First 12 bytes of every PDU.
struct Header {
  std::uint8_t version = 7;  ///< 6 or 7
  std::uint8_t exercise_id = 0;
  std::uint8_t type = 0;        ///< PduType, or one that the codec does not know
  std::uint8_t family = 0;      ///< protocol family: 1 entity information, 2 warfare, 5 management
  std::uint32_t timestamp = 0;  ///< see DisClock
  std::uint16_t length = 0;     ///< of the PDU with this header, bytes
  std::uint8_t status = 0;      ///< version 7 only
  bool operator==(const Header&) const = default;
};

/// Number of an entity, which is unique in an exercise. All zero: no entity.
struct EntityId {
  std::uint16_t site = 0;
  std::uint16_t application = 0;
  std::uint16_t entity = 0;
  bool operator==(const EntityId&) const = default;
};

/// Number of an event: the fire and the detonation of one shot have the same.
struct EventId {
  std::uint16_t site = 0;
  std::uint16_t application = 0;
  std::uint16_t event = 0;
  bool operator==(const EventId&) const = default;
};

/// Type of an entity in the enumerations of SISO-REF-010.
struct EntityType {
  std::uint8_t kind = 0;  ///< 1 platform, 2 munition, 3 life form, 8 expendable
  std::uint8_t domain = 0;
  std::uint16_t country = 0;
  std::uint8_t category = 0;
  std::uint8_t subcategory = 0;
  std::uint8_t specific = 0;
  std::uint8_t extra = 0;
  bool operator==(const EntityType&) const = default;
};

/// Attitude as rotations that turn the ECEF axes into the body's: psi about z, then theta about the
/// new y, then phi about the new x. Any finite angle, rad.
struct EulerAngles {
  float psi_rad = 0.0f;
  float theta_rad = 0.0f;
  float phi_rad = 0.0f;
  bool operator==(const EulerAngles&) const = default;
};

/// Rule by which a receiver goes on between two PDUs. First letter: F fixed, R rotating. Second: P
/// constant velocity, V constant acceleration. Third: W world axes, B body axes.
enum class DeadReckoningModel : std::uint8_t {
  other = 0,
  stationary = 1,
  fpw = 2,
  rpw = 3,
  rvw = 4,
  fvw = 5,
  fpb = 6,
  rpb = 7,
  rvb = 8,
  fvb = 9,
};

/// State of an entity (type 1). Entities send it at least every few seconds.
struct EntityState {
  static constexpr PduType kType = PduType::entity_state;
  static constexpr std::size_t kBytes = 144;
  EntityId entity_id{};
  std::uint8_t force_id = 0;         ///< 0 other, 1 friendly, 2 opposing, 3 neutral
  std::uint8_t parameter_count = 0;  ///< variable parameters behind the PDU's fixed part
  EntityType type{};
  EntityType alternative_type{};
  glm::vec3 velocity_m_s{0.0f};  ///< along ECEF axes; along the body's with models 6 to 9
  glm::dvec3 location_ecef_m{0.0};
  EulerAngles orientation{};
  std::uint32_t appearance = 0;  ///< bits whose meaning depends on the type
  DeadReckoningModel model = DeadReckoningModel::other;
  std::array<std::uint8_t, 15> other_parameters{};
  glm::vec3 acceleration_m_s2{0.0f};       ///< along the axes of the velocity
  glm::vec3 angular_velocity_rad_s{0.0f};  ///< along the body's axes
  std::uint8_t marking_character_set = 0;  ///< 1: ASCII
  std::array<char, 11> marking{};          ///< not ended by a zero if it fills the array
  std::uint32_t capabilities = 0;
  /// Returns the marking up to its first zero. It is valid as long as this object. RT-safe.
  [[nodiscard]] std::string_view marking_text() const noexcept;
  bool operator==(const EntityState&) const = default;
};

/// Update of an entity that was described before (type 67). It has no type, model, acceleration or
/// rate: those of the latest EntityState hold.
struct EntityStateUpdate {
  static constexpr PduType kType = PduType::entity_state_update;
  static constexpr std::size_t kBytes = 72;
  EntityId entity_id{};
  std::uint8_t parameter_count = 0;
  glm::vec3 velocity_m_s{0.0f};  ///< along the axes that the entity's model says
  glm::dvec3 location_ecef_m{0.0};
  EulerAngles orientation{};
  std::uint32_t appearance = 0;
  bool operator==(const EntityStateUpdate&) const = default;
};

/// Munition of a shot.
struct MunitionDescriptor {
  EntityType type{};
  std::uint16_t warhead = 0;
  std::uint16_t fuse = 0;
  std::uint16_t quantity = 0;
  std::uint16_t rate_per_minute = 0;
  bool operator==(const MunitionDescriptor&) const = default;
};

/// A shot was fired (type 2).
struct Fire {
  static constexpr PduType kType = PduType::fire;
  static constexpr std::size_t kBytes = 96;
  EntityId firing_id{};
  EntityId target_id{};
  EntityId munition_id{};  ///< all zero if the munition is no entity of its own
  EventId event_id{};
  std::uint32_t fire_mission_index = 0;
  glm::dvec3 location_ecef_m{0.0};
  MunitionDescriptor descriptor{};
  glm::vec3 velocity_ecef_m_s{0.0f};
  float range_m = 0.0f;  ///< 0: unknown. Not negative.
  bool operator==(const Fire&) const = default;
};

/// A munition hit, exploded or ended (type 3).
struct Detonation {
  static constexpr PduType kType = PduType::detonation;
  static constexpr std::size_t kBytes = 104;
  EntityId firing_id{};
  EntityId target_id{};
  EntityId munition_id{};
  EventId event_id{};
  glm::vec3 velocity_ecef_m_s{0.0f};
  glm::dvec3 location_ecef_m{0.0};
  MunitionDescriptor descriptor{};
  glm::vec3 location_in_target_m{0.0f};  ///< in the body frame of the target
  std::uint8_t result = 0;  ///< 1 entity impact, 3 ground impact, 5 detonation and so on
  std::uint8_t parameter_count = 0;
  bool operator==(const Detonation&) const = default;
};

/// Time of a clock: hours since 1970-01-01 UTC, and the time past the hour in the units of
/// DisClock.
struct ClockTime {
  std::int32_t hours = 0;
  std::uint32_t timestamp = 0;
  bool operator==(const ClockTime&) const = default;
};

/// A manager starts entities or goes on (type 13).
struct StartResume {
  static constexpr PduType kType = PduType::start_resume;
  static constexpr std::size_t kBytes = 44;
  EntityId originating_id{};
  EntityId receiving_id{};  ///< 0xFFFF stands for all sites, applications or entities
  ClockTime real_time{};    ///< when it shall happen
  ClockTime simulation_time{};
  std::uint32_t request_id = 0;
  bool operator==(const StartResume&) const = default;
};

/// A manager stops entities (type 14).
struct StopFreeze {
  static constexpr PduType kType = PduType::stop_freeze;
  static constexpr std::size_t kBytes = 40;
  EntityId originating_id{};
  EntityId receiving_id{};
  ClockTime real_time{};
  std::uint8_t reason = 0;           ///< 1 recess, 2 termination, and others of SISO-REF-010
  std::uint8_t frozen_behavior = 0;  ///< bits: 0 clock runs, 1 transmits, 2 receives
  std::uint32_t request_id = 0;
  bool operator==(const StopFreeze&) const = default;
};

/// Any PDU that the codec knows. It holds no heap memory.
using Pdu = std::variant<EntityState, Fire, Detonation, StartResume, StopFreeze, EntityStateUpdate>;

/// Bytes of one variable parameter.
inline constexpr std::size_t kVariableParameterBytes = 16;

/// A variable parameter, of which articulated parts are read. Their type is a class of parts times
/// 32 plus a metric, see part_class() and metric().
struct VariableParameter {
  static constexpr std::uint8_t kArticulatedPart = 0;
  static constexpr std::uint8_t kAttachedPart = 1;
  std::uint8_t record_type = kArticulatedPart;
  std::uint8_t change_indicator = 0;  ///< counts up with each change; attached parts: 1 is detached
  std::uint16_t attached_to = 0;  ///< number of the parameter that carries the part; 0: the body
  std::uint32_t type = 0;         ///< articulated parts: see above; attached parts: the station
  /// Articulated parts only: the metric's value in m, m/s, rad or rad/s. It may be any number, also
  /// none, so that a caller must check it.
  float value = 0.0f;
  /// Returns what of the part the value means: 1 position, 3 extension, 5 x, 7 y, 9 z, 11 azimuth,
  /// 13 elevation, 15 rotation, and the even numbers their rates. RT-safe.
  [[nodiscard]] constexpr std::uint32_t metric() const noexcept { return type % 32; }
  /// Returns the number of the part's class in SISO-REF-010, for example 4096 a turret. RT-safe.
  [[nodiscard]] constexpr std::uint32_t part_class() const noexcept { return type - type % 32; }
  bool operator==(const VariableParameter&) const = default;
};

/// Variable parameters of a PDU, as a view of its bytes.
class VariableParameters {
 public:
  VariableParameters() = default;
  /// @pre the bytes are a multiple of kVariableParameterBytes
  explicit VariableParameters(std::span<const std::byte> bytes) noexcept;
  [[nodiscard]] std::size_t size() const noexcept {
    return bytes_.size() / kVariableParameterBytes;
  }
  /// Returns a parameter. RT-safe.
  /// @pre index < size()
  [[nodiscard]] VariableParameter operator[](std::size_t index) const noexcept;

 private:
  std::span<const std::byte> bytes_;
};

/// A reason why bytes or a PDU were refused, with its place. A plain struct: filling it allocates
/// nothing.
struct Fault {
  enum class Kind : std::uint8_t {
    none,
    too_short,    ///< `value` bytes are left, a PDU has `lowest` or more
    length,       ///< a PDU states `value` bytes, at least `lowest` and at most `highest` can be
    version,      ///< `value` is the version, neither 6 nor 7
    size_of_pdu,  ///< a PDU states `value` bytes, one of its type and parameters has `lowest`
    field,        ///< `field` is `value`, outside `lowest` to `highest`, or not finite
    no_space,     ///< writer only: the PDU has `value` bytes, `highest` are free
  };
  Kind kind = Kind::none;
  std::size_t pdu = 0;     ///< number of the PDU in the datagram; the first is 0
  std::uint8_t type = 0;   ///< of the PDU
  std::size_t offset = 0;  ///< first byte of the PDU in the datagram
  const char* field = "";  ///< name of the struct's member, static storage
  double value = 0.0;
  double lowest = 0.0;
  double highest = 0.0;
  [[nodiscard]] explicit operator bool() const noexcept { return kind != Kind::none; }
};

/// Length that is enough for every text of fault_text(), bytes.
inline constexpr std::size_t kFaultTextBytes = 192;
/// Writes for example "PDU 2 (type 1, Entity State) at byte 288: psi_rad is nan, must be finite".
/// Returns the part of `buffer` that it used; a text that is too long is cut off. RT-safe.
[[nodiscard]] std::string_view fault_text(const Fault& fault, std::span<char> buffer) noexcept;

/// Returns the name of a type of PDU, also for the common ones that the codec skips; others are
/// "unknown". RT-safe.
[[nodiscard]] std::string_view pdu_name(std::uint8_t type) noexcept;

}  // namespace emit::protocol::dis
