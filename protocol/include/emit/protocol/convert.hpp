// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "emit/protocol/codec.hpp"
#include "emit/protocol/framing.hpp"

namespace emit::v1 {
class ControlRecord;
class EntityState;
class Environment;
class HostFrame;
class PartCommand;
class Pose;
}  // namespace emit::v1

/// Conversion between plain structs and Protobuf messages, for the journal and the control
/// connection. The messages are only declared here; code that fills them includes "emit/v1/*.pb.h".
/// Thread: any. These functions may allocate, unless a note says otherwise.
namespace emit::protocol {

/// Writes the struct into the message. Optional parts that the struct lacks are cleared.
void to_proto(const physics::Pose& pose, const std::optional<PoseRates>& rates, v1::Pose& out);
void to_proto(const EntityStateData& entity, v1::EntityState& out);
void to_proto(const EnvironmentData& environment, v1::Environment& out);
void to_proto(const PartCommandData& part, v1::PartCommand& out);
void to_proto(const HostFrameData& frame, v1::HostFrame& out);

/// Reads the struct from the message and checks the values as decode_host_frame() does
/// (docs/wire.md section 5). On an error `out` is unspecified, and `fault`, where it is not null,
/// names the field and its value; a pose alone cannot know whether it is the seeker's or an
/// entity's. RT-safe.
[[nodiscard]] DecodeStatus from_proto(const v1::Pose& in, physics::Pose& pose,
                                      std::optional<PoseRates>& rates,
                                      DecodeFault* fault = nullptr) noexcept;
[[nodiscard]] DecodeStatus from_proto(const v1::EntityState& in, EntityStateData& out,
                                      DecodeFault* fault = nullptr) noexcept;
[[nodiscard]] DecodeStatus from_proto(const v1::Environment& in, EnvironmentData& out,
                                      DecodeFault* fault = nullptr) noexcept;
[[nodiscard]] DecodeStatus from_proto(const v1::PartCommand& in, PartCommandData& out,
                                      DecodeFault* fault = nullptr) noexcept;
[[nodiscard]] DecodeStatus from_proto(const v1::HostFrame& in, HostFrameData& out,
                                      DecodeFault* fault = nullptr) noexcept;

/// Checks position and rates as decode_host_frame() does; the attitude has to be of unit length.
/// `fault`, where it is not null, names the field at fault. RT-safe.
[[nodiscard]] DecodeStatus check_pose(const physics::Pose& pose,
                                      const std::optional<PoseRates>& rates,
                                      DecodeFault* fault = nullptr) noexcept;
/// Checks weather as decode_host_frame() does. RT-safe.
[[nodiscard]] DecodeStatus check_environment(const EnvironmentData& environment,
                                             DecodeFault* fault = nullptr) noexcept;
/// Checks the drive of a part as decode_host_frame() does. RT-safe.
[[nodiscard]] DecodeStatus check_part(const PartCommandData& part,
                                      DecodeFault* fault = nullptr) noexcept;

/// Checks the yaw, pitch and roll of a gimbal, rad, as decode_host_frame() does. RT-safe.
[[nodiscard]] DecodeStatus check_gimbal(const glm::dvec3& gimbal_rad,
                                        DecodeFault* fault = nullptr) noexcept;
/// Checks a horizontal field of view, rad, as decode_host_frame() does. RT-safe.
[[nodiscard]] DecodeStatus check_fov_h(double fov_h_rad, DecodeFault* fault = nullptr) noexcept;

/// Appends a record header and the message to `out`, ready for a TCP connection (docs/wire.md
/// section 2).
void append_control_record(const v1::ControlRecord& message, std::vector<std::byte>& out);

/// Parses the body of a control record. Returns false when the body is malformed or holds no
/// message that this version knows.
[[nodiscard]] bool parse_control_record(std::span<const std::byte> body, v1::ControlRecord& out);

}  // namespace emit::protocol
