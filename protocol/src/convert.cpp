// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/convert.hpp"

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "emit/physics/constants.hpp"
#include "emit/physics/limits.hpp"
#include "emit/v1/control.pb.h"
#include "emit/v1/host.pb.h"
#include "emit/v1/status.pb.h"
#include "quiet_protobuf.hpp"

namespace emit::protocol {
namespace {

static_assert(static_cast<int>(DecodeStatus::ok) == v1::Status::CODE_OK);
static_assert(static_cast<int>(DecodeStatus::wrong_version) == v1::Status::CODE_WRONG_VERSION);
static_assert(static_cast<int>(DecodeStatus::oversize) == v1::Status::CODE_OVERSIZE);
static_assert(static_cast<int>(DecodeStatus::malformed) == v1::Status::CODE_MALFORMED);
static_assert(static_cast<int>(DecodeStatus::invalid_pose) == v1::Status::CODE_INVALID_POSE);
static_assert(static_cast<int>(DecodeStatus::invalid_environment) ==
              v1::Status::CODE_INVALID_ENVIRONMENT);
static_assert(static_cast<int>(DecodeStatus::invalid_view) == v1::Status::CODE_INVALID_VIEW);
static_assert(static_cast<int>(DecodeStatus::invalid_part) == v1::Status::CODE_INVALID_PART);

namespace limits = physics::limits;

constexpr double kMaxSpeedMS = 1e6;
constexpr double kMaxAngularRateRadS = 1e4;
/// Largest difference of a squared norm from 1 that is not normalised away, so that decoding a
/// decoded value changes no bit.
constexpr double kNormTolerance = 1e-12;

glm::dvec3 from(const v1::Vector3& in) noexcept {
  return {in.x(), in.y(), in.z()};
}

void set(const glm::dvec3& in, v1::Vector3& out) {
  out.set_x(in.x);
  out.set_y(in.y);
  out.set_z(in.z);
}

/// Checks values one after the other and notes the first one that is out of range.
class RangeCheck {
 public:
  explicit RangeCheck(DecodeFault* fault) : fault_(fault) {}
  bool in_range(const char* field, double value, const limits::Interval& range) noexcept {
    if (range.contains(value)) return true;
    note({DecodeFault::Kind::out_of_range, DecodeFault::Part::message, 0, field, value, range.lo,
          range.hi, 0});
    return false;
  }
  /// `fields`: the names of the three components.
  bool in_range(const std::array<const char*, 3>& fields, const glm::dvec3& vector,
                double limit) noexcept {
    const limits::Interval range{-limit, limit};
    return in_range(fields[0], vector.x, range) && in_range(fields[1], vector.y, range) &&
           in_range(fields[2], vector.z, range);
  }
  bool present(const char* field, bool is_there) noexcept {
    if (!is_there) {
      note({DecodeFault::Kind::missing, DecodeFault::Part::message, 0, field, 0.0, 0.0, 0.0, 0});
    }
    return is_there;
  }

 private:
  void note(const DecodeFault& fault) noexcept {
    if (fault_ != nullptr) *fault_ = fault;
  }
  DecodeFault* fault_;
};

/// Says whose pose or weather the noted field belongs to.
void set_part(DecodeFault* fault, DecodeFault::Part part, std::uint32_t entity_id = 0,
              std::uint32_t part_id = 0) noexcept {
  if (fault != nullptr) {
    fault->part = part;
    fault->entity_id = entity_id;
    fault->part_id = part_id;
  }
}

/// Reads a quaternion and normalises it. Returns false when its norm is out of range.
bool read_attitude(const v1::Quaternion& in, glm::dquat& out, RangeCheck& check) noexcept {
  out = glm::dquat(in.w(), in.x(), in.y(), in.z());
  const double squared = out.w * out.w + out.x * out.x + out.y * out.y + out.z * out.z;
  const double norm = std::sqrt(squared);
  if (!check.in_range("norm of world_from_body", norm, limits::kQuaternionNorm)) return false;
  if (std::abs(squared - 1.0) > kNormTolerance) {
    out = glm::dquat(out.w / norm, out.x / norm, out.y / norm, out.z / norm);
  }
  return true;
}

/// Returns true when an entity before entity `checked` has the same id.
bool repeats_an_id(const HostFrameData& frame, std::uint32_t checked) noexcept {
  for (std::uint32_t i = 0; i < checked; ++i) {
    if (frame.entities[i].entity_id == frame.entities[checked].entity_id) return true;
  }
  return false;
}

/// Returns true when a command before command `checked` is for the same part.
bool repeats_a_part(const HostFrameData& frame, std::uint32_t checked) noexcept {
  const PartCommandData& part = frame.parts[checked];
  for (std::uint32_t i = 0; i < checked; ++i) {
    if (frame.parts[i].entity_id == part.entity_id && frame.parts[i].part_id == part.part_id) {
      return true;
    }
  }
  return false;
}

/// Reads the commands to parts of a host frame.
DecodeStatus read_parts(const v1::HostFrame& in, HostFrameData& out, DecodeFault* fault) noexcept {
  for (const v1::PartCommand& part : in.parts()) {
    const std::uint32_t index = out.part_count;
    if (auto status = from_proto(part, out.parts[index], fault); status != DecodeStatus::ok) {
      return status;
    }
    if (repeats_a_part(out, index)) {
      if (fault != nullptr) fault->kind = DecodeFault::Kind::repeated;
      set_part(fault, DecodeFault::Part::part, part.entity_id(), part.part_id());
      return DecodeStatus::invalid_part;
    }
    ++out.part_count;
  }
  return DecodeStatus::ok;
}

}  // namespace

void to_proto(const physics::Pose& pose, const std::optional<PoseRates>& rates, v1::Pose& out) {
  set(pose.position_world_m, *out.mutable_position_m());
  auto& attitude = *out.mutable_world_from_body();
  attitude.set_w(pose.world_from_body.w);
  attitude.set_x(pose.world_from_body.x);
  attitude.set_y(pose.world_from_body.y);
  attitude.set_z(pose.world_from_body.z);
  if (rates) {
    set(rates->velocity_world_m_s, *out.mutable_velocity_m_s());
    set(rates->angular_rate_body_rad_s, *out.mutable_angular_rate_rad_s());
  } else {
    out.clear_velocity_m_s();
    out.clear_angular_rate_rad_s();
  }
}

void to_proto(const EntityStateData& entity, v1::EntityState& out) {
  out.set_entity_id(entity.entity_id);
  out.set_off(!entity.on);
  out.set_teleport(entity.teleport);
  if (entity.has_pose) {
    to_proto(entity.pose, entity.rates, *out.mutable_pose());
  } else {
    out.clear_pose();
  }
}

void to_proto(const EnvironmentData& environment, v1::Environment& out) {
  out.set_direct_normal_w_m2(environment.direct_normal_w_m2);
  out.set_diffuse_horizontal_w_m2(environment.diffuse_horizontal_w_m2);
  out.set_longwave_down_w_m2(environment.longwave_down_w_m2);
  out.set_air_k(environment.air_k);
  out.set_wind_m_s(environment.wind_m_s);
  out.set_cloud_frac(environment.cloud_frac);
  out.clear_environment_k();
  out.clear_film_w_m2_k();
  out.clear_wind_from_deg();
  out.clear_relative_humidity_frac();
  out.set_rain_mm_h(environment.rain_mm_h);
  if (environment.environment_k) out.set_environment_k(*environment.environment_k);
  if (environment.film_w_m2_k) out.set_film_w_m2_k(*environment.film_w_m2_k);
  if (environment.wind_from_deg) out.set_wind_from_deg(*environment.wind_from_deg);
  if (environment.relative_humidity_frac) {
    out.set_relative_humidity_frac(*environment.relative_humidity_frac);
  }
}

void to_proto(const PartCommandData& part, v1::PartCommand& out) {
  out.set_entity_id(part.entity_id);
  out.set_part_id(part.part_id);
  switch (part.kind) {
    case PartCommandData::Kind::off:
      out.clear_drive();
      break;
    case PartCommandData::Kind::temperature:
      out.set_temperature_k(part.value);
      break;
    case PartCommandData::Kind::power:
      out.set_power_w_m2(part.value);
      break;
    case PartCommandData::Kind::throttle:
      out.set_throttle(part.value);
      break;
  }
}

void to_proto(const HostFrameData& frame, v1::HostFrame& out) {
  out.Clear();
  out.set_protocol_version(kProtocolVersion);
  out.set_frame_number(frame.frame_number);
  out.set_sim_time_ns(frame.sim_time_ns);
  out.set_run_id(frame.run_id);
  to_proto(frame.seeker, frame.seeker_rates, *out.mutable_seeker());
  for (const EntityStateData& entity : frame.entity_span()) to_proto(entity, *out.add_entities());
  if (frame.environment) to_proto(*frame.environment, *out.mutable_environment());
  if (frame.fov_h_rad) out.set_fov_h_rad(*frame.fov_h_rad);
  if (frame.gimbal_rad) {
    out.mutable_gimbal()->set_yaw_rad(frame.gimbal_rad->x);
    out.mutable_gimbal()->set_pitch_rad(frame.gimbal_rad->y);
    out.mutable_gimbal()->set_roll_rad(frame.gimbal_rad->z);
  }
  for (const PartCommandData& part : frame.part_span()) to_proto(part, *out.add_parts());
}

DecodeStatus check_pose(const physics::Pose& pose, const std::optional<PoseRates>& rates,
                        DecodeFault* fault) noexcept {
  RangeCheck check(fault);
  const bool valid =
      check.in_range({"position_m.x", "position_m.y", "position_m.z"}, pose.position_world_m,
                     kMaxPositionM) &&
      (!rates ||
       (check.in_range({"velocity_m_s.x", "velocity_m_s.y", "velocity_m_s.z"},
                       rates->velocity_world_m_s, kMaxSpeedMS) &&
        check.in_range({"angular_rate_rad_s.x", "angular_rate_rad_s.y", "angular_rate_rad_s.z"},
                       rates->angular_rate_body_rad_s, kMaxAngularRateRadS)));
  return valid ? DecodeStatus::ok : DecodeStatus::invalid_pose;
}

DecodeStatus check_environment(const EnvironmentData& out, DecodeFault* fault) noexcept {
  // The ranges are those of a scenario's weather, so that live weather can do nothing that a
  // scenario cannot.
  RangeCheck check(fault);
  const bool valid =
      check.in_range("direct_normal_w_m2", out.direct_normal_w_m2, limits::kDirectNormalWM2) &&
      check.in_range("diffuse_horizontal_w_m2", out.diffuse_horizontal_w_m2,
                     limits::kDiffuseHorizontalWM2) &&
      check.in_range("longwave_down_w_m2", out.longwave_down_w_m2, limits::kLongwaveDownWM2) &&
      check.in_range("air_k", out.air_k, limits::kAirK) &&
      check.in_range("wind_m_s", out.wind_m_s, limits::kWindMS) &&
      check.in_range("cloud_frac", out.cloud_frac, limits::kCloudFrac) &&
      (!out.environment_k ||
       check.in_range("environment_k", *out.environment_k, limits::kEnvironmentK)) &&
      (!out.film_w_m2_k || check.in_range("film_w_m2_k", *out.film_w_m2_k, limits::kFilmWM2K)) &&
      (!out.wind_from_deg ||
       check.in_range("wind_from_deg", *out.wind_from_deg, limits::kWindFromDeg)) &&
      (!out.relative_humidity_frac ||
       check.in_range("relative_humidity_frac", *out.relative_humidity_frac,
                      limits::kHumidityFrac)) &&
      check.in_range("rain_mm_h", out.rain_mm_h, limits::kRainMmH);
  if (valid) return DecodeStatus::ok;
  set_part(fault, DecodeFault::Part::environment);
  return DecodeStatus::invalid_environment;
}

DecodeStatus from_proto(const v1::Pose& in, physics::Pose& pose, std::optional<PoseRates>& rates,
                        DecodeFault* fault) noexcept {
  RangeCheck check(fault);
  if (!check.present("position_m", in.has_position_m()) ||
      !check.present("world_from_body", in.has_world_from_body())) {
    return DecodeStatus::invalid_pose;
  }
  pose.position_world_m = from(in.position_m());
  pose.world_from_body = glm::dquat(1.0, 0.0, 0.0, 0.0);
  rates.reset();
  if (check_pose(pose, rates, fault) != DecodeStatus::ok ||
      !read_attitude(in.world_from_body(), pose.world_from_body, check)) {
    return DecodeStatus::invalid_pose;
  }
  const bool has_rates = in.has_velocity_m_s() || in.has_angular_rate_rad_s();
  if (has_rates) {
    if (!check.present("velocity_m_s beside angular_rate_rad_s", in.has_velocity_m_s()) ||
        !check.present("angular_rate_rad_s beside velocity_m_s", in.has_angular_rate_rad_s())) {
      return DecodeStatus::invalid_pose;
    }
    rates = PoseRates{from(in.velocity_m_s()), from(in.angular_rate_rad_s())};
    return check_pose(pose, rates, fault);
  }
  return DecodeStatus::ok;
}

DecodeStatus from_proto(const v1::EntityState& in, EntityStateData& out,
                        DecodeFault* fault) noexcept {
  out = EntityStateData{};
  out.entity_id = in.entity_id();
  out.on = !in.off();
  out.teleport = in.teleport();
  out.has_pose = in.has_pose();
  if (!out.has_pose) return DecodeStatus::ok;
  const DecodeStatus status = from_proto(in.pose(), out.pose, out.rates, fault);
  if (status != DecodeStatus::ok) set_part(fault, DecodeFault::Part::entity, out.entity_id);
  return status;
}

DecodeStatus from_proto(const v1::Environment& in, EnvironmentData& out,
                        DecodeFault* fault) noexcept {
  out = EnvironmentData{};
  out.direct_normal_w_m2 = in.direct_normal_w_m2();
  out.diffuse_horizontal_w_m2 = in.diffuse_horizontal_w_m2();
  out.longwave_down_w_m2 = in.longwave_down_w_m2();
  out.air_k = in.air_k();
  out.wind_m_s = in.wind_m_s();
  out.cloud_frac = in.cloud_frac();
  if (in.has_environment_k()) out.environment_k = in.environment_k();
  if (in.has_film_w_m2_k()) out.film_w_m2_k = in.film_w_m2_k();
  if (in.has_wind_from_deg()) out.wind_from_deg = in.wind_from_deg();
  if (in.has_relative_humidity_frac()) out.relative_humidity_frac = in.relative_humidity_frac();
  out.rain_mm_h = in.rain_mm_h();
  return check_environment(out, fault);
}

DecodeStatus check_part(const PartCommandData& part, DecodeFault* fault) noexcept {
  using Kind = PartCommandData::Kind;
  RangeCheck check(fault);
  const bool valid = check.in_range("part_id", static_cast<double>(part.part_id),
                                    {limits::kPartId.lo, limits::kPartId.hi}) &&
                     (part.kind != Kind::temperature ||
                      check.in_range("temperature_k", part.value, limits::kPartK)) &&
                     (part.kind != Kind::power ||
                      check.in_range("power_w_m2", part.value, limits::kPartPowerWM2)) &&
                     (part.kind != Kind::throttle ||
                      check.in_range("throttle", part.value, limits::kPartThrottle));
  if (valid) return DecodeStatus::ok;
  set_part(fault, DecodeFault::Part::part, part.entity_id, part.part_id);
  return DecodeStatus::invalid_part;
}

DecodeStatus from_proto(const v1::PartCommand& in, PartCommandData& out,
                        DecodeFault* fault) noexcept {
  out = PartCommandData{in.entity_id(), in.part_id()};
  switch (in.drive_case()) {
    case v1::PartCommand::kTemperatureK:
      out.kind = PartCommandData::Kind::temperature;
      out.value = in.temperature_k();
      break;
    case v1::PartCommand::kPowerWM2:
      out.kind = PartCommandData::Kind::power;
      out.value = in.power_w_m2();
      break;
    case v1::PartCommand::kThrottle:
      out.kind = PartCommandData::Kind::throttle;
      out.value = in.throttle();
      break;
    case v1::PartCommand::DRIVE_NOT_SET:
      break;
  }
  return check_part(out, fault);
}

DecodeStatus check_gimbal(const glm::dvec3& gimbal_rad, DecodeFault* fault) noexcept {
  RangeCheck check(fault);
  if (check.in_range({"gimbal.yaw_rad", "gimbal.pitch_rad", "gimbal.roll_rad"}, gimbal_rad,
                     physics::kPi)) {
    return DecodeStatus::ok;
  }
  set_part(fault, DecodeFault::Part::seeker);
  return DecodeStatus::invalid_pose;
}

DecodeStatus check_fov_h(double fov_h_rad, DecodeFault* fault) noexcept {
  // The scenario's own range, which is narrower, is checked where the frame is used.
  constexpr limits::Interval kFovRad{limits::kFieldOfViewDeg.lo * physics::kDegree,
                                     limits::kFieldOfViewDeg.hi * physics::kDegree};
  RangeCheck check(fault);
  return check.in_range("fov_h_rad", fov_h_rad, kFovRad) ? DecodeStatus::ok
                                                         : DecodeStatus::invalid_view;
}

DecodeStatus from_proto(const v1::HostFrame& in, HostFrameData& out, DecodeFault* fault) noexcept {
  out.frame_number = in.frame_number();
  out.sim_time_ns = in.sim_time_ns();
  out.run_id = in.run_id();
  out.received_ns = 0;
  out.entity_count = 0;
  out.environment.reset();
  out.fov_h_rad.reset();
  out.gimbal_rad.reset();
  out.part_count = 0;
  if (in.protocol_version() != kProtocolVersion) return DecodeStatus::wrong_version;
  if (static_cast<std::size_t>(in.entities_size()) > kMaxEntitiesPerFrame ||
      static_cast<std::size_t>(in.parts_size()) > kMaxPartsPerFrame) {
    return DecodeStatus::oversize;
  }
  RangeCheck check(fault);
  if (out.sim_time_ns > kMaxSimTimeNs || out.sim_time_ns < -kMaxSimTimeNs) {
    constexpr auto kLimit = static_cast<double>(kMaxSimTimeNs);
    static_cast<void>(
        check.in_range("sim_time_ns", static_cast<double>(out.sim_time_ns), {-kLimit, kLimit}));
    return DecodeStatus::malformed;
  }
  if (!check.present("seeker", in.has_seeker())) return DecodeStatus::invalid_pose;
  if (auto status = from_proto(in.seeker(), out.seeker, out.seeker_rates, fault);
      status != DecodeStatus::ok) {
    set_part(fault, DecodeFault::Part::seeker);
    return status;
  }
  for (const v1::EntityState& entity : in.entities()) {
    const std::uint32_t index = out.entity_count;
    if (auto status = from_proto(entity, out.entities[index], fault); status != DecodeStatus::ok) {
      return status;
    }
    if (repeats_an_id(out, index)) {
      if (fault != nullptr) fault->kind = DecodeFault::Kind::repeated;
      set_part(fault, DecodeFault::Part::entity, out.entities[index].entity_id);
      return DecodeStatus::malformed;
    }
    ++out.entity_count;
  }
  if (in.has_gimbal()) {
    const v1::Gimbal& gimbal = in.gimbal();
    out.gimbal_rad = glm::dvec3(gimbal.yaw_rad(), gimbal.pitch_rad(), gimbal.roll_rad());
    if (auto status = check_gimbal(*out.gimbal_rad, fault); status != DecodeStatus::ok) {
      return status;
    }
  }
  if (in.has_fov_h_rad()) {
    out.fov_h_rad = in.fov_h_rad();
    if (auto status = check_fov_h(*out.fov_h_rad, fault); status != DecodeStatus::ok) {
      return status;
    }
  }
  if (auto status = read_parts(in, out, fault); status != DecodeStatus::ok) return status;
  if (in.has_environment()) {
    return from_proto(in.environment(), out.environment.emplace(), fault);
  }
  return DecodeStatus::ok;
}

void append_control_record(const v1::ControlRecord& message, std::vector<std::byte>& out) {
  const std::size_t body_bytes = message.ByteSizeLong();
  const std::size_t at = out.size();
  out.resize(at + kRecordHeaderBytes + body_bytes);
  encode_record_header(
      RecordKind::control, static_cast<std::uint32_t>(body_bytes),
      std::span<std::byte, kRecordHeaderBytes>(out.data() + at, kRecordHeaderBytes));
  message.SerializeWithCachedSizesToArray(
      reinterpret_cast<std::uint8_t*>(out.data() + at + kRecordHeaderBytes));
}

bool parse_control_record(std::span<const std::byte> body, v1::ControlRecord& out) {
  quiet_protobuf();
  return body.size() <= std::numeric_limits<int>::max() &&
         out.ParseFromArray(body.data(), static_cast<int>(body.size())) &&
         out.body_case() != v1::ControlRecord::BODY_NOT_SET;
}

}  // namespace emit::protocol
