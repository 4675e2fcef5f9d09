// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <variant>

#include "emit/protocol/cigi/common.hpp"
#include "emit/protocol/cigi/host_packets.hpp"
#include "emit/protocol/cigi/host_packets4.hpp"
#include "emit/protocol/cigi/host_requests.hpp"
#include "emit/protocol/cigi/ig_packets.hpp"

/// Parts that reader and writer of messages share.
namespace emit::protocol::cigi {

/// Any packet that the codec knows. It holds no heap memory.
using Packet = std::variant<
    IgControl, EntityControl, ComponentControl, ShortComponentControl, ArticulatedPartControl,
    ShortArticulatedPartControl, RateControl, CelestialSphereControl, AtmosphereControl,
    EnvironmentalRegionControl, WeatherControl, ViewControl, SensorControl, EarthReferenceModel,
    ViewDefinition, HatHotRequest, LosSegmentRequest, LosVectorRequest, PositionRequest,
    EnvironmentalConditionsRequest, StartOfFrame, HatHotResponse, HatHotExtendedResponse,
    LosResponse, LosExtendedResponse, SensorResponse, SensorExtendedResponse, PositionResponse,
    WeatherConditionsResponse, EventNotification, ImageGeneratorMessage, EntityPosition,
    EntityControl40, AnimationControl, AccelerationControl>;

/// Returns the id of a packet in a version, 0 for a packet that the version does not have. RT-safe.
[[nodiscard]] std::uint16_t packet_id(const Packet& packet, Version version) noexcept;
/// Returns the name of an id in the document of a version, also for packets that the codec skips.
/// Ids that users define (201 to 255, in 4.0 from 0x8000 to 0xFFFE) are "user defined", those that
/// SISO registers (4.0, 0x1000 to 0x7FFF) are "registered", and the rest is "unknown". RT-safe.
[[nodiscard]] std::string_view packet_name(std::uint16_t id, Version version) noexcept;

/// A reason why bytes or a packet were refused, with its place. A plain struct: filling it
/// allocates nothing.
struct Fault {
  enum class Kind : std::uint8_t {
    none,
    too_short,        ///< fewer bytes are left than a packet of its kind has
    first_packet,     ///< the message does not begin with IG Control or Start Of Frame
    version,          ///< `value`.`lowest` is the version, neither 3.3 nor 4.0
    byte_order,       ///< the magic number is `value`, neither 0x8000 nor 0x0080
    size_zero,        ///< a packet states a size of less than its header
    size_alignment,   ///< a packet states a size that is not a multiple of 8
    size_beyond_end,  ///< a packet states a size of `value` bytes, `highest` are left
    size_of_packet,   ///< a packet states `value` bytes, a packet of its id has `lowest` or more
    field,            ///< `field` is `value`, outside `lowest` to `highest`, or not finite
    date,             ///< `field` is `value`, whose digits are no day of the calendar
    text,             ///< no zero ends the text of a message
    repeated,         ///< a second IG Control or Start Of Frame in one message
    sender,           ///< the other side sends packets of this id
    no_space,         ///< writer only: the packet does not fit the memory
    not_in_version,   ///< writer only: the version has no such packet, or no `field` in it
  };
  Kind kind = Kind::none;
  std::size_t packet = 0;  ///< number of the packet in the message; the first is 0
  std::uint16_t id = 0;    ///< id of the packet in its version
  Version version = Version::v3_3;
  std::size_t offset = 0;  ///< first byte of the packet in the message
  const char* field = "";  ///< name of the struct's member, static storage
  double value = 0.0;
  double lowest = 0.0;
  double highest = 0.0;
  [[nodiscard]] explicit operator bool() const noexcept { return kind != Kind::none; }
};

/// Length that is enough for every text of fault_text(), bytes.
inline constexpr std::size_t kFaultTextBytes = 256;
/// Writes for example "packet 3 (id 2, Entity Control) at byte 72: yaw_deg is nan, must be -180 to
/// 360". Returns the part of `buffer` that it used; a text that is too long is cut off. RT-safe.
[[nodiscard]] std::string_view fault_text(const Fault& fault, std::span<char> buffer) noexcept;

}  // namespace emit::protocol::cigi
