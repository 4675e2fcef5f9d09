// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "emit/protocol/cigi/common.hpp"
#include "emit/protocol/cigi/host_requests.hpp"

/// Packets of the image generator. Units, axes and ranges are those of the host's packets.
namespace emit::protocol::cigi {

/// First packet of each message of an image generator (id 101).
struct StartOfFrame {
  static constexpr WireForms kWire{{101, 24}, {0xFFFF, 24}};
  static constexpr Sender kSender = Sender::ig;
  /// n: database n is loaded; -n: it is being loaded; 0: the image generator decides; -128: the
  /// database is not available.
  std::int8_t database = 0;
  std::uint8_t ig_status = 0;  ///< 3.3: 0 is no error; the image generator defines other values
  IgMode mode = IgMode::standby;
  bool timestamp_valid = false;
  bool custom_earth = false;  ///< the host's Earth Reference Model is in use, else WGS 84
  bool overframing = false;   ///< 4.0: frames take longer than they may
  bool paging = false;        ///< 4.0: the database cannot be loaded fast enough
  bool excessive_variable_data = false;  ///< 4.0: too many packets of variable length
  std::uint32_t ig_frame = 0;            ///< counts up by one with each message
  std::uint32_t timestamp_ticks = 0;     ///< ticks of 10 us since any epoch; it wraps
  std::uint32_t last_host_frame = 0;     ///< IgControl::host_frame that was received last
  bool operator==(const StartOfFrame&) const = default;
};

/// StartOfFrame::database of an image generator that does not have the database.
inline constexpr std::int8_t kDatabaseMissing = -128;

/// Answer to a HatHotRequest for one height (id 102).
struct HatHotResponse {
  static constexpr WireForms kWire{{102, 16}, {0x0FFF, 16}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t request_id = 0;
  bool valid = false;               ///< `height_m` holds
  bool height_of_terrain = false;   ///< otherwise height above terrain
  std::uint8_t host_frame_lsn = 0;  ///< low four bits of the host frame that counts, at most 15
  double height_m = 0.0;
  bool operator==(const HatHotResponse&) const = default;
};

/// Extended answer to a HatHotRequest (id 103).
struct HatHotExtendedResponse {
  static constexpr WireForms kWire{{103, 40}, {0x0FFE, 40}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t request_id = 0;
  bool valid = false;
  std::uint8_t host_frame_lsn = 0;
  double height_above_terrain_m = 0.0;
  double height_of_terrain_m = 0.0;
  std::uint32_t material_code = 0;
  float normal_azimuth_deg = 0.0f;    ///< -180 to 180
  float normal_elevation_deg = 0.0f;  ///< -90 to 90
  bool operator==(const HatHotExtendedResponse&) const = default;
};

/// Answer to a request for a line of sight (id 104).
struct LosResponse {
  static constexpr WireForms kWire{{104, 16}, {0x0FFD, 24}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t request_id = 0;
  bool valid = false;         ///< `range_m` holds
  bool entity_valid = false;  ///< an entity was hit, `entity_id` names it
  bool visible = false;       ///< nothing hides the destination of a segment
  std::uint8_t host_frame_lsn = 0;
  std::uint8_t response_count = 0;  ///< answers to this request
  std::uint16_t entity_id = 0;
  double range_m = 0.0;
  bool operator==(const LosResponse&) const = default;
};

/// Extended answer to a request for a line of sight (id 105).
struct LosExtendedResponse {
  static constexpr WireForms kWire{{105, 56}, {0x0FFC, 64}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t request_id = 0;
  bool valid = false;
  bool entity_valid = false;
  bool range_valid = false;
  bool visible = false;
  std::uint8_t host_frame_lsn = 0;
  std::uint8_t response_count = 0;
  std::uint16_t entity_id = 0;
  double range_m = 0.0;
  /// Point that was hit. The request says whether it is geodetic, and this packet does not repeat
  /// it. Therefore the three numbers need only be finite.
  Place place{};
  std::uint8_t red = 0;
  std::uint8_t green = 0;
  std::uint8_t blue = 0;
  std::uint8_t alpha = 0;
  std::uint32_t material_code = 0;
  float normal_azimuth_deg = 0.0f;    ///< -180 to 180
  float normal_elevation_deg = 0.0f;  ///< -90 to 90
  bool operator==(const LosExtendedResponse&) const = default;
};

enum class TrackState : std::uint8_t {
  searching = 0,
  tracking = 1,
  impending_breaklock = 2,
  breaklock = 3,
};

/// State of a sensor's tracker (id 106).
struct SensorResponse {
  static constexpr WireForms kWire{{106, 24}, {0x0FFB, 24}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t view_id = 0;
  std::uint8_t sensor_id = 0;
  TrackState state = TrackState::searching;
  std::uint16_t gate_x_px = 0;  ///< size of the gate along the view's X axis
  std::uint16_t gate_y_px = 0;
  float gate_azimuth_deg = 0.0f;    ///< position of the gate along the view's X axis
  float gate_elevation_deg = 0.0f;  ///< along the view's Y axis
  std::uint32_t ig_frame = 0;       ///< frame that the numbers were taken from
  bool operator==(const SensorResponse&) const = default;
};

/// State of a sensor's tracker with the point that it tracks (id 107).
struct SensorExtendedResponse {
  static constexpr WireForms kWire{{107, 48}, {0x0FFA, 56}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t view_id = 0;
  std::uint8_t sensor_id = 0;
  TrackState state = TrackState::searching;
  bool entity_valid = false;
  std::uint16_t entity_id = 0;
  std::uint16_t gate_x_px = 0;
  std::uint16_t gate_y_px = 0;
  float gate_azimuth_deg = 0.0f;
  float gate_elevation_deg = 0.0f;
  std::uint32_t ig_frame = 0;
  double latitude_deg = 0.0;   ///< -90 to 90
  double longitude_deg = 0.0;  ///< -180 to 180
  double altitude_m = 0.0;
  bool operator==(const SensorExtendedResponse&) const = default;
};

/// Answer to a PositionRequest (id 108).
struct PositionResponse {
  static constexpr WireForms kWire{{108, 48}, {0x0FF9, 48}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t object_id = 0;
  std::uint8_t part_id = 0;
  ObjectClass object_class = ObjectClass::entity;
  PositionFrame frame = PositionFrame::geodetic;
  Place place{};
  float roll_deg = 0.0f;
  float pitch_deg = 0.0f;
  float yaw_deg = 0.0f;
  bool operator==(const PositionResponse&) const = default;
};

/// Answer to an EnvironmentalConditionsRequest for weather (id 109).
struct WeatherConditionsResponse {
  static constexpr WireForms kWire{{109, 32}, {0x0FF8, 32}};
  static constexpr Sender kSender = Sender::ig;
  std::uint8_t request_id = 0;
  std::uint8_t humidity_percent = 0;  ///< 0 to 100
  float air_temperature_c = 0.0f;
  float visibility_m = 0.0f;         ///< not negative
  float horizontal_wind_m_s = 0.0f;  ///< not negative
  float vertical_wind_m_s = 0.0f;
  float wind_from_deg = 0.0f;  ///< -180 to 360
  float pressure_hpa = 0.0f;   ///< not negative
  bool operator==(const WeatherConditionsResponse&) const = default;
};

/// Notice that something happened (id 116).
struct EventNotification {
  static constexpr WireForms kWire{{116, 16}, {0x0FF1, 24}};
  static constexpr Sender kSender = Sender::ig;
  std::uint16_t event_id = 0;
  std::array<std::uint32_t, 3> data{};  ///< swapped as words of 32 bits
  bool operator==(const EventNotification&) const = default;
};

/// Text for the host's log (id 117). Its size follows the text: 8 to 104 bytes, in 4.0 16 to 112.
/// Version 4.0 allows longer texts; a reader refuses a text without a zero in its first 100 bytes.
struct ImageGeneratorMessage {
  static constexpr WireForms kWire{{117, 8}, {0x0FF0, 16}};
  static constexpr Sender kSender = Sender::ig;
  static constexpr std::size_t kTextBytes = 100;  ///< with the zero that ends the text
  std::uint16_t message_id = 0;
  std::array<char, kTextBytes> text{};  ///< ends with a zero; the rest is zero

  /// Returns a message. The text ends at its first zero and is cut off after 99 bytes. RT-safe.
  [[nodiscard]] static ImageGeneratorMessage make(std::uint16_t message_id,
                                                  std::string_view text) noexcept;
  /// Returns the text up to the zero. It is valid as long as this object. RT-safe.
  [[nodiscard]] std::string_view view() const noexcept;
  bool operator==(const ImageGeneratorMessage&) const = default;
};

}  // namespace emit::protocol::cigi
