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
class Pose;
}  // namespace emit::v1

/// Plain structs to and from Protobuf messages, for journal and control connection. The messages
/// are only named here: who fills them includes "emit/v1/*.pb.h".
namespace emit::protocol {

void to_proto(const physics::Pose& pose, const std::optional<PoseRates>& rates, v1::Pose& out);
void to_proto(const EntityStateData& entity, v1::EntityState& out);
void to_proto(const EnvironmentData& environment, v1::Environment& out);
void to_proto(const HostFrameData& frame, v1::HostFrame& out);

/// The from_proto functions check as decode_host_frame does; on an error `out` is unspecified.
/// `fault`, where it is not null, then names the field and its value; a pose alone cannot know
/// whether it is the seeker's or an entity's.
[[nodiscard]] DecodeStatus from_proto(const v1::Pose& in, physics::Pose& pose,
                                      std::optional<PoseRates>& rates,
                                      DecodeFault* fault = nullptr) noexcept;
[[nodiscard]] DecodeStatus from_proto(const v1::EntityState& in, EntityStateData& out,
                                      DecodeFault* fault = nullptr) noexcept;
[[nodiscard]] DecodeStatus from_proto(const v1::Environment& in, EnvironmentData& out,
                                      DecodeFault* fault = nullptr) noexcept;
[[nodiscard]] DecodeStatus from_proto(const v1::HostFrame& in, HostFrameData& out,
                                      DecodeFault* fault = nullptr) noexcept;

/// Appends record header and message to `out`, ready for a TCP connection.
void append_control_record(const v1::ControlRecord& message, std::vector<std::byte>& out);

/// Body of a control record. False: malformed, or no body is set (a newer peer's).
[[nodiscard]] bool parse_control_record(std::span<const std::byte> body, v1::ControlRecord& out);

}  // namespace emit::protocol
