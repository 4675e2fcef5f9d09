// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/cigi/message.hpp"

#include <algorithm>
#include <limits>

#include "cigi/packet_types.hpp"
#include "fixed_text.hpp"

namespace emit::protocol::cigi {
namespace {

// Names of the ids from 1 to 35 and from 101 to 117.
constexpr std::string_view kHostNames[] = {
    "IG Control",
    "Entity Control",
    "Conformal Clamped Entity Control",
    "Component Control",
    "Short Component Control",
    "Articulated Part Control",
    "Short Articulated Part Control",
    "Rate Control",
    "Celestial Sphere Control",
    "Atmosphere Control",
    "Environmental Region Control",
    "Weather Control",
    "Maritime Surface Conditions Control",
    "Wave Control",
    "Terrestrial Surface Conditions Control",
    "View Control",
    "Sensor Control",
    "Motion Tracker Control",
    "Earth Reference Model Definition",
    "Trajectory Definition",
    "View Definition",
    "Collision Detection Segment Definition",
    "Collision Detection Volume Definition",
    "HAT/HOT Request",
    "Line of Sight Segment Request",
    "Line of Sight Vector Request",
    "Position Request",
    "Environmental Conditions Request",
    "Symbol Surface Definition",
    "Symbol Text Definition",
    "Symbol Circle Definition",
    "Symbol Line Definition",
    "Symbol Clone",
    "Symbol Control",
    "Short Symbol Control",
};
constexpr std::string_view kIgNames[] = {
    "Start Of Frame",
    "HAT/HOT Response",
    "HAT/HOT Extended Response",
    "Line of Sight Response",
    "Line of Sight Extended Response",
    "Sensor Response",
    "Sensor Extended Response",
    "Position Response",
    "Weather Conditions Response",
    "Aerosol Concentration Response",
    "Maritime Surface Conditions Response",
    "Terrestrial Surface Conditions Response",
    "Collision Detection Segment Notification",
    "Collision Detection Volume Notification",
    "Animation Stop Notification",
    "Event Notification",
    "Image Generator Message",
};

// Names of the ids of version 4.0 from 0x00 to 0x26, and from 0x0FFF downwards.
constexpr std::string_view kHostNamesV4[] = {
    "IG Control",
    "Entity Position",
    "Conformal Clamped Entity Position",
    "Component Control",
    "Short Component Control",
    "Articulated Part Control",
    "Short Articulated Part Control",
    "Velocity Control",
    "Celestial Sphere Control",
    "Atmosphere Control",
    "Environmental Region Control",
    "Weather Control",
    "Maritime Surface Conditions Control",
    "Wave Control",
    "Terrestrial Surface Conditions Control",
    "View Control",
    "Sensor Control",
    "Motion Tracker Control",
    "Earth Reference Model Definition",
    "Acceleration Control",
    "View Definition",
    "Collision Detection Segment Definition",
    "Collision Detection Volume Definition",
    "HAT/HOT Request",
    "Line of Sight Segment Request",
    "Line of Sight Vector Request",
    "Position Request",
    "Environmental Conditions Request",
    "Symbol Surface Definition",
    "Symbol Text Definition",
    "Symbol Circle Definition",
    "Symbol Polygon Definition",
    "Symbol Clone",
    "Symbol Control",
    "Short Symbol Control",
    "Symbol Textured Circle Definition",
    "Symbol Textured Polygon Definition",
    "Entity Control",
    "Animation Control",
};

[[nodiscard]] std::string_view name_v4(std::uint16_t id) noexcept {
  if (id < std::size(kHostNamesV4)) return kHostNamesV4[id];
  if (id == StartOfFrame::kWire.v4_0.id) return kIgNames[0];
  if (id <= 0x0FFF && id >= 0x0FF0) return kIgNames[0x0FFF - id + 1];
  if (id >= 0x1000 && id < kFirstUserDefinedIdV4) return "registered";
  return user_defined(id, Version::v4_0) ? "user defined" : "unknown";
}

/// Returns whether a fault knows the id of its packet.
[[nodiscard]] bool has_id(const Fault& fault) noexcept {
  if (fault.kind == Fault::Kind::too_short) return fault.version == Version::v3_3;
  return fault.kind != Fault::Kind::not_in_version || *fault.field != '\0';
}

void add_field_fault(const Fault& fault, FixedText& out) noexcept {
  constexpr double kLargest = std::numeric_limits<double>::max();
  out.add(": {} is {}", fault.field, fault.value);
  if (fault.highest < kLargest) {
    out.add(", must be {} to {}", fault.lowest, fault.highest);
  } else if (fault.lowest > -kLargest) {
    out.add(", must be finite and at least {}", fault.lowest);
  } else {
    out.add(", must be finite");
  }
}

}  // namespace

ImageGeneratorMessage ImageGeneratorMessage::make(std::uint16_t message_id,
                                                  std::string_view text) noexcept {
  ImageGeneratorMessage message{.message_id = message_id};
  const std::string_view part = text.substr(0, std::min(text.find('\0'), kTextBytes - 1));
  std::ranges::copy(part, message.text.begin());
  return message;
}

std::string_view ImageGeneratorMessage::view() const noexcept {
  const auto end = std::ranges::find(text, '\0');
  return {text.data(), static_cast<std::size_t>(end - text.begin())};
}

std::uint16_t packet_id(const Packet& packet, Version version) noexcept {
  std::uint16_t id = 0;
  with_packet(packet, [&]<class P>(const P&) { id = P::kWire.of(version).id; });
  return id;
}

std::string_view packet_name(std::uint16_t id, Version version) noexcept {
  if (version == Version::v4_0) return name_v4(id);
  if (id >= 1 && id <= std::size(kHostNames)) return kHostNames[id - 1];
  if (id >= 101 && id <= 100 + std::size(kIgNames)) return kIgNames[id - 101];
  return user_defined(id, version) ? "user defined" : "unknown";
}

std::string_view fault_text(const Fault& fault, std::span<char> buffer) noexcept {
  FixedText out(buffer);
  if (fault.kind == Fault::Kind::none) {
    out.add("no fault");
    return out.text();
  }
  out.add("packet {}", fault.packet);
  const std::string_view name = packet_name(fault.id, fault.version);
  if (has_id(fault) && fault.version == Version::v3_3) out.add(" (id {}, {})", fault.id, name);
  if (has_id(fault) && fault.version == Version::v4_0) out.add(" (id {:#06x}, {})", fault.id, name);
  out.add(" at byte {}", fault.offset);
  switch (fault.kind) {
    case Fault::Kind::none:
      break;
    case Fault::Kind::too_short:
      out.add(": {} bytes are left, it needs {}", fault.value, fault.lowest);
      break;
    case Fault::Kind::first_packet:
      out.add(": the message must begin with IG Control or Start Of Frame");
      break;
    case Fault::Kind::version:
      out.add(": CIGI version {}.{}, must be 3.3 or 4.0", fault.value, fault.lowest);
      break;
    case Fault::Kind::byte_order:
      out.add(": byte swap magic number {:#06x}, must be 0x8000 or 0x0080",
              static_cast<unsigned>(fault.value));
      break;
    case Fault::Kind::size_zero:
      out.add(": states {} bytes", fault.value);
      break;
    case Fault::Kind::size_alignment:
      out.add(": states {} bytes, must be a multiple of 8", fault.value);
      break;
    case Fault::Kind::size_beyond_end:
      out.add(": states {} bytes, {} are left", fault.value, fault.highest);
      break;
    case Fault::Kind::size_of_packet:
      out.add(": states {} bytes, must be {}", fault.value, fault.lowest);
      break;
    case Fault::Kind::field:
      add_field_fault(fault, out);
      break;
    case Fault::Kind::date:
      out.add(": {} is {}, no day of the calendar", fault.field, fault.value);
      break;
    case Fault::Kind::text:
      out.add(": the text has no end");
      break;
    case Fault::Kind::repeated:
      out.add(": a message has one such packet, the first");
      break;
    case Fault::Kind::sender:
      out.add(": the other side sends such packets");
      break;
    case Fault::Kind::no_space:
      out.add(": it has {} bytes, {} are free", fault.value, fault.highest);
      break;
    case Fault::Kind::not_in_version:
      if (*fault.field == '\0') {
        out.add(": the version has no such packet");
      } else {
        out.add(": the version has no {}", fault.field);
      }
      break;
  }
  return out.text();
}

}  // namespace emit::protocol::cigi
