// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <string>
#include <string_view>

/// Enumerations of the control connection, with the values of the Protobuf messages in
/// proto/emit/v1. Every program that speaks the protocol uses these.
namespace emit::protocol {

/// Role of a peer, with the values of emit.v1.Hello.Role.
enum class PeerRole : std::uint8_t { none = 0, host = 1, client = 2, recorder = 3 };

/// Command of a host, with the values of emit.v1.Command.Kind.
enum class CommandKind : std::uint8_t { start = 1, stop = 2, hold = 3, step = 4, reset = 5 };
/// Names of the commands in outputs, by value; the first one is no command.
inline constexpr std::array<std::string_view, 6> kCommandNames{"unknown", "start", "stop",
                                                               "hold",    "step",  "reset"};
/// Returns the name of a command; "unknown" for a number that is none. RT-safe.
[[nodiscard]] constexpr std::string_view command_name(std::uint64_t kind) noexcept {
  return kCommandNames[kind < kCommandNames.size() ? kind : 0];
}

/// Answer to a message of a peer, with the values of emit.v1.Status.Code.
enum class StatusCode : std::uint8_t {
  ok = 1,
  wrong_version = 2,
  oversize = 3,
  malformed = 4,
  unknown_entity = 5,
  invalid_pose = 6,
  time_backwards = 7,
  duplicate_frame = 8,
  unknown_channel = 9,
  not_allowed = 10,
  overloaded = 11,
  internal = 12,
  invalid_environment = 13,
  invalid_view = 14,
  invalid_part = 15,
  unknown_part = 16,
};

/// Detail of a `not_allowed` status for a host frame whose run another host has replaced.
inline constexpr std::uint64_t kDetailOldRun = 1U << 16;
/// The detail of an `ok` status for a host frame that is stored, but makes no frame: emitd is
/// stopped.
inline constexpr std::uint64_t kDetailStopped = 1U << 17;

/// Returns the detail of an `unknown_part` status.
[[nodiscard]] constexpr std::uint64_t part_detail(std::uint32_t entity_id,
                                                  std::uint32_t part_id) noexcept {
  return std::uint64_t{entity_id} << 32U | part_id;
}

/// Returns the English text of a status. Thread: any. It allocates.
/// @param detail  unknown_entity, overloaded: the entity's id; unknown_part: part_detail();
/// not_allowed: the command's kind or
///   kDetailOldRun; ok: the command's kind or kDetailStopped; other codes ignore it.
[[nodiscard]] std::string status_text(StatusCode code, std::uint64_t detail);

}  // namespace emit::protocol
