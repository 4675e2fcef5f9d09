// SPDX-License-Identifier: Apache-2.0
#include "cigi/limits.hpp"

#include <chrono>
#include <concepts>
#include <cstdint>
#include <limits>
#include <variant>

#include "cigi/packet_types.hpp"

namespace emit::protocol::cigi {
namespace {

/// Keeps the first number that is out of its range. Comparisons are false for NaN.
class Limits {
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
  void not_negative(const char* field, double value) noexcept {
    within(field, value, 0.0, kLargest);
  }
  template <class E>
  void one_of(const char* field, E value, E last) noexcept {
    within(field, static_cast<double>(value), 0.0, static_cast<double>(last));
  }
  void latitude(double value_deg) noexcept { within("latitude_deg", value_deg, -90.0, 90.0); }
  void longitude(double value_deg) noexcept { within("longitude_deg", value_deg, -180.0, 180.0); }
  void roll(double value_deg) noexcept { within("roll_deg", value_deg, -180.0, 180.0); }
  void pitch(double value_deg) noexcept { within("pitch_deg", value_deg, -90.0, 90.0); }
  void yaw(double value_deg) noexcept { within("yaw_deg", value_deg, -180.0, 360.0); }
  void place(const Place& place, bool geodetic) noexcept {
    if (geodetic) {
      latitude(place.latitude_deg_or_x_m);
      longitude(place.longitude_deg_or_y_m);
      finite("altitude_m", place.altitude_m_or_z_m);
    } else {
      finite("x_m", place.latitude_deg_or_x_m);
      finite("y_m", place.longitude_deg_or_y_m);
      finite("z_m", place.altitude_m_or_z_m);
    }
  }
  void date(const char* field, std::uint32_t mmddyyyy) noexcept {
    const std::uint32_t month = mmddyyyy / 1'000'000;
    const std::chrono::year_month_day day{std::chrono::year(static_cast<int>(mmddyyyy % 10'000)),
                                          std::chrono::month(month),
                                          std::chrono::day(mmddyyyy / 10'000 % 100)};
    if (fault_ || (month <= 12 && day.ok())) return;
    fault_ = {.kind = Fault::Kind::date, .field = field, .value = static_cast<double>(mmddyyyy)};
  }
  void wind(double value_deg) noexcept { within("wind_from_deg", value_deg, -180.0, 360.0); }
  void text_without_end() noexcept {
    if (!fault_) fault_ = {.kind = Fault::Kind::text, .field = "text"};
  }
  [[nodiscard]] const Fault& fault() const noexcept { return fault_; }

 private:
  static constexpr double kLargest = std::numeric_limits<double>::max();
  Fault fault_;
};

template <class P>
void check_pose(Limits& limits, const P& p) {
  limits.finite("x_m", p.x_m);
  limits.finite("y_m", p.y_m);
  limits.finite("z_m", p.z_m);
  limits.roll(p.roll_deg);
  limits.pitch(p.pitch_deg);
  limits.yaw(p.yaw_deg);
}

template <class P>
void check_air(Limits& limits, const P& p) {
  limits.within("humidity_percent", p.humidity_percent, 0.0, 100.0);
  limits.finite("air_temperature_c", p.air_temperature_c);
  limits.not_negative("visibility_m", p.visibility_m);
  limits.not_negative("horizontal_wind_m_s", p.horizontal_wind_m_s);
  limits.finite("vertical_wind_m_s", p.vertical_wind_m_s);
  limits.wind(p.wind_from_deg);
  limits.not_negative("pressure_hpa", p.pressure_hpa);
}

template <class P>
void check_normal(Limits& limits, const P& p) {
  limits.within("host_frame_lsn", p.host_frame_lsn, 0.0, 15.0);
  limits.within("normal_azimuth_deg", p.normal_azimuth_deg, -180.0, 180.0);
  limits.within("normal_elevation_deg", p.normal_elevation_deg, -90.0, 90.0);
}

template <class P>
void check_gate(Limits& limits, const P& p) {
  limits.one_of("state", p.state, TrackState::breaklock);
  limits.finite("gate_azimuth_deg", p.gate_azimuth_deg);
  limits.finite("gate_elevation_deg", p.gate_elevation_deg);
}

/// One function per packet with numbers that can be wrong.
struct CheckPacket {
  Limits& limits;

  void operator()(const IgControl& p) const {
    limits.one_of("mode", p.mode, IgMode::debug);
    limits.within("database", p.database, 0.0, 127.0);
  }
  void operator()(const EntityControl& p) const {
    limits.one_of("state", p.state, EntityState::destroyed);
    limits.one_of("clamp", p.clamp, Clamp::conformal);
    limits.one_of("animation", p.animation, Animation::proceed);
    limits.roll(p.roll_deg);
    limits.pitch(p.pitch_deg);
    limits.yaw(p.yaw_deg);
    limits.place(p.place, !p.attached);
  }
  void operator()(const EntityPosition& p) const {
    limits.one_of("clamp", p.clamp, Clamp::conformal);
    limits.roll(p.roll_deg);
    limits.pitch(p.pitch_deg);
    limits.yaw(p.yaw_deg);
    limits.place(p.place, !p.attached);
  }
  void operator()(const EntityControl40& p) const {
    limits.one_of("state", p.state, EntityState::destroyed);
  }
  void operator()(const AnimationControl& p) const { limits.finite("speed", p.speed); }
  void operator()(const AccelerationControl& p) const {
    limits.finite("x_m_s2", p.x_m_s2);
    limits.finite("y_m_s2", p.y_m_s2);
    limits.finite("z_m_s2", p.z_m_s2);
    limits.finite("roll_deg_s2", p.roll_deg_s2);
    limits.finite("pitch_deg_s2", p.pitch_deg_s2);
    limits.finite("yaw_deg_s2", p.yaw_deg_s2);
  }
  template <class P>
  requires std::same_as<P, ComponentControl> || std::same_as<P, ShortComponentControl>
  void operator()(const P& p) const {
    limits.within("component_class", static_cast<double>(p.component_class), 0.0, 63.0);
  }
  void operator()(const ArticulatedPartControl& p) const { check_pose(limits, p); }
  void operator()(const ShortArticulatedPartControl& p) const {
    for (const PartMotion& motion : p.motions) {
      limits.one_of("axis", motion.axis, PartAxis::roll);
      switch (motion.axis) {
        case PartAxis::yaw:
          limits.yaw(motion.value_m_or_deg);
          break;
        case PartAxis::pitch:
          limits.pitch(motion.value_m_or_deg);
          break;
        case PartAxis::roll:
          limits.roll(motion.value_m_or_deg);
          break;
        default:
          limits.finite("value_m_or_deg", motion.value_m_or_deg);
      }
    }
  }
  void operator()(const RateControl& p) const {
    limits.finite("x_m_s", p.x_m_s);
    limits.finite("y_m_s", p.y_m_s);
    limits.finite("z_m_s", p.z_m_s);
    limits.finite("roll_deg_s", p.roll_deg_s);
    limits.finite("pitch_deg_s", p.pitch_deg_s);
    limits.finite("yaw_deg_s", p.yaw_deg_s);
  }
  void operator()(const CelestialSphereControl& p) const {
    limits.within("star_intensity_percent", p.star_intensity_percent, 0.0, 100.0);
    limits.finite("second_utc", p.second_utc);
    if (!p.date_valid) return;
    limits.within("hour_utc", p.hour_utc, 0.0, 23.0);
    limits.within("minute_utc", p.minute_utc, 0.0, 59.0);
    limits.within("second_utc", p.second_utc, 0.0, 60.0);
    limits.date("date_mmddyyyy", p.date_mmddyyyy);
  }
  void operator()(const AtmosphereControl& p) const { check_air(limits, p); }
  void operator()(const EnvironmentalRegionControl& p) const {
    limits.one_of("state", p.state, RegionState::destroyed);
    limits.latitude(p.latitude_deg);
    limits.longitude(p.longitude_deg);
    limits.not_negative("size_x_m", p.size_x_m);
    limits.not_negative("size_y_m", p.size_y_m);
    limits.not_negative("corner_radius_m", p.corner_radius_m);
    limits.within("rotation_deg", p.rotation_deg, -180.0, 180.0);
    limits.not_negative("transition_m", p.transition_m);
  }
  void operator()(const WeatherControl& p) const {
    limits.within("cloud_type", p.cloud_type, 0.0, 15.0);
    limits.one_of("scope", p.scope, WeatherScope::entity);
    limits.within("severity", p.severity, 0.0, 7.0);
    check_air(limits, p);
    limits.within("scud_percent", p.scud_percent, 0.0, 100.0);
    limits.within("coverage_percent", p.coverage_percent, 0.0, 100.0);
    limits.finite("base_m", p.base_m);
    limits.not_negative("thickness_m", p.thickness_m);
    limits.not_negative("transition_m", p.transition_m);
    limits.not_negative("aerosol_g_m3", p.aerosol_g_m3);
    limits.within("top_scud_percent", p.top_scud_percent, 0.0, 100.0);
    limits.not_negative("top_transition_m", p.top_transition_m);
  }
  void operator()(const ViewControl& p) const { check_pose(limits, p); }
  void operator()(const SensorControl& p) const {
    limits.within("track_mode", static_cast<double>(p.track_mode), 0.0, 7.0);
    limits.within("gain", p.gain, 0.0, 1.0);
    limits.within("level", p.level, 0.0, 1.0);
    limits.not_negative("ac_coupling_us", p.ac_coupling_us);
    limits.within("noise", p.noise, 0.0, 1.0);
  }
  void operator()(const EarthReferenceModel& p) const {
    limits.not_negative("equatorial_radius_m", p.equatorial_radius_m);
    limits.within("flattening", p.flattening, 0.0, 1.0);
  }
  void operator()(const ViewDefinition& p) const {
    limits.one_of("mirror", p.mirror, Mirror::both);
    limits.within("pixel_replication", p.pixel_replication, 0.0, 7.0);
    limits.within("view_type", p.view_type, 0.0, 7.0);
    limits.not_negative("near_m", p.near_m);
    limits.not_negative("far_m", p.far_m);
    half_angle("left_deg", p.left_deg, p.orthographic);
    half_angle("right_deg", p.right_deg, p.orthographic);
    half_angle("top_deg", p.top_deg, p.orthographic);
    half_angle("bottom_deg", p.bottom_deg, p.orthographic);
  }
  void operator()(const HatHotRequest& p) const {
    limits.one_of("type", p.type, HatHotType::extended);
    limits.place(p.place, !p.relative_to_entity);
  }
  void operator()(const LosSegmentRequest& p) const {
    limits.place(p.source, !p.source_relative);
    limits.place(p.destination, !p.destination_relative);
  }
  void operator()(const LosVectorRequest& p) const {
    limits.within("azimuth_deg", p.azimuth_deg, -180.0, 180.0);
    limits.within("elevation_deg", p.elevation_deg, -90.0, 90.0);
    limits.not_negative("min_range_m", p.min_range_m);
    limits.not_negative("max_range_m", p.max_range_m);
    limits.place(p.source, !p.source_relative);
  }
  void operator()(const PositionRequest& p) const {
    limits.one_of("object_class", p.object_class, ObjectClass::motion_tracker);
    limits.one_of("frame", p.frame, PositionFrame::submodel);
  }
  void operator()(const EnvironmentalConditionsRequest& p) const {
    limits.latitude(p.latitude_deg);
    limits.longitude(p.longitude_deg);
    limits.finite("altitude_m", p.altitude_m);
  }
  void operator()(const StartOfFrame& p) const {
    limits.one_of("mode", p.mode, IgMode::maintenance);
  }
  void operator()(const HatHotResponse& p) const {
    limits.within("host_frame_lsn", p.host_frame_lsn, 0.0, 15.0);
    limits.finite("height_m", p.height_m);
  }
  void operator()(const HatHotExtendedResponse& p) const {
    limits.finite("height_above_terrain_m", p.height_above_terrain_m);
    limits.finite("height_of_terrain_m", p.height_of_terrain_m);
    check_normal(limits, p);
  }
  void operator()(const LosResponse& p) const {
    limits.within("host_frame_lsn", p.host_frame_lsn, 0.0, 15.0);
    limits.finite("range_m", p.range_m);
  }
  void operator()(const LosExtendedResponse& p) const {
    limits.finite("range_m", p.range_m);
    limits.place(p.place, false);
    check_normal(limits, p);
  }
  void operator()(const SensorResponse& p) const { check_gate(limits, p); }
  void operator()(const SensorExtendedResponse& p) const {
    check_gate(limits, p);
    limits.latitude(p.latitude_deg);
    limits.longitude(p.longitude_deg);
    limits.finite("altitude_m", p.altitude_m);
  }
  void operator()(const PositionResponse& p) const {
    limits.one_of("object_class", p.object_class, ObjectClass::motion_tracker);
    limits.one_of("frame", p.frame, PositionFrame::submodel);
    limits.place(p.place, p.frame == PositionFrame::geodetic);
    limits.roll(p.roll_deg);
    limits.pitch(p.pitch_deg);
    limits.yaw(p.yaw_deg);
  }
  void operator()(const WeatherConditionsResponse& p) const { check_air(limits, p); }
  void operator()(const EventNotification&) const {}
  void operator()(const ImageGeneratorMessage& p) const {
    if (p.text.back() != '\0') limits.text_without_end();
  }

 private:
  void half_angle(const char* field, float value_deg, bool orthographic) const {
    if (orthographic) {
      limits.finite(field, value_deg);
    } else {
      limits.within(field, value_deg, -90.0, 90.0);
    }
  }
};

/// Returns the name of the first value that the version cannot carry, or nullptr.
[[nodiscard]] const char* foreign_field(const Packet& packet, Version version) noexcept {
  if (version == Version::v4_0) {
    const auto* frame = std::get_if<StartOfFrame>(&packet);
    return frame != nullptr && frame->ig_status != 0 ? "ig_status" : nullptr;
  }
  if (const auto* p = std::get_if<IgControl>(&packet)) {
    return p->type_substitution_enabled ? "type_substitution_enabled" : nullptr;
  }
  if (const auto* p = std::get_if<StartOfFrame>(&packet)) {
    if (p->overframing) return "overframing";
    if (p->paging) return "paging";
    return p->excessive_variable_data ? "excessive_variable_data" : nullptr;
  }
  if (const auto* p = std::get_if<CelestialSphereControl>(&packet)) {
    return p->second_utc != 0.0f ? "second_utc" : nullptr;
  }
  if (const auto* p = std::get_if<WeatherControl>(&packet)) {
    if (p->top_scud_enabled) return "top_scud_enabled";
    if (p->top_scud_percent != 0.0f) return "top_scud_percent";
    return p->top_transition_m != 0.0f ? "top_transition_m" : nullptr;
  }
  return nullptr;
}

}  // namespace

Fault check_version(const Packet& packet, Version version) noexcept {
  bool exists = false;
  with_packet(packet, [&]<class P>(const P&) { exists = P::kWire.exists(version); });
  if (!exists) return {.kind = Fault::Kind::not_in_version};
  const char* field = foreign_field(packet, version);
  if (field != nullptr) return {.kind = Fault::Kind::not_in_version, .field = field};
  return {};
}

Fault check_limits(const Packet& packet) noexcept {
  Limits limits;
  with_packet(packet, CheckPacket{limits});
  return limits.fault();
}

}  // namespace emit::protocol::cigi
