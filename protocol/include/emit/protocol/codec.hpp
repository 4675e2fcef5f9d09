// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "emit/physics/limits.hpp"
#include "emit/protocol/decode_fault.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/protocol/version.hpp"

/// Codec for host frames. It converts the wire bytes (Protobuf emit.v1.HostFrame, docs/wire.md
/// section 5) to plain structs and back.
namespace emit::protocol {

/// Largest encoded host frame, bytes: the payload of one UDP datagram over IPv4.
inline constexpr std::size_t kMaxHostFrameBytes = 65507;
/// Largest magnitude of a position coordinate, m. A larger one is refused.
inline constexpr double kMaxPositionM = physics::limits::kMaxPositionM;
/// Largest distance of a simulation time from the scenario's epoch, ns: 1e9 s, the same limit as in
/// scenarios. A larger one is refused.
inline constexpr auto kMaxSimTimeNs =
    static_cast<std::int64_t>(physics::limits::kMaxSimTimeS * 1e9);

/// Result of decoding a host frame. The values are those of emit.v1.Status.Code.
enum class DecodeStatus : std::uint8_t {
  ok = 1,
  wrong_version = 2,  ///< protocol_version is not kProtocolVersion
  oversize = 3,       ///< over kMaxHostFrameBytes, kMaxEntitiesPerFrame or kMaxPartsPerFrame
  /// The bytes are not a HostFrame, an entity id stands twice, or the simulation time exceeds
  /// kMaxSimTimeNs.
  malformed = 4,
  /// A part is missing, a number is NaN or infinite, the quaternion is not of unit length, the
  /// position is too far away, or only one of the two rates is present.
  invalid_pose = 6,
  /// A value is NaN, infinite or outside the range that docs/wire.md gives.
  invalid_environment = 13,
  invalid_view = 14,  ///< the field of view is no number, or beyond what any sensor may have
  /// The drive of a part is no number or out of range, or a part stands twice.
  invalid_part = 15,
};
/// Returns the English name of a status, for messages. RT-safe.
[[nodiscard]] std::string_view to_string(DecodeStatus status) noexcept;

/// Memory for decoding, used again for every message.
/// Thread: one owner.  Real time: the constructor allocates.
class HostFrameDecoder {
 public:
  HostFrameDecoder();
  ~HostFrameDecoder();
  HostFrameDecoder(HostFrameDecoder&&) noexcept;
  HostFrameDecoder& operator=(HostFrameDecoder&&) noexcept;

  /// Returns which field the last decode_host_frame() refused; kind none after a success.
  [[nodiscard]] const DecodeFault& fault() const noexcept { return fault_; }

 private:
  friend DecodeStatus decode_host_frame(std::span<const std::byte> bytes, HostFrameDecoder& decoder,
                                        HostFrameData& out) noexcept;
  struct Impl;
  std::unique_ptr<Impl> impl_;
  DecodeFault fault_;
};

/// Decodes one emit.v1.HostFrame. On ok `out` is written completely, and received_ns becomes 0. On
/// an error only frame_number, sim_time_ns and run_id are written, as far as they could be read,
/// else 0. Quaternions off unit length by up to 1 % are normalised. Entity ids are not looked up.
/// Thread: the owner of `decoder`.  Real time: RT-safe for messages without unknown fields.
[[nodiscard]] DecodeStatus decode_host_frame(std::span<const std::byte> bytes,
                                             HostFrameDecoder& decoder,
                                             HostFrameData& out) noexcept;

/// Returns true for an emit.v1.Status with a text, which is what emitd sends. No HostFrame of this
/// version begins like one. RT-safe.
[[nodiscard]] bool looks_like_status(std::span<const std::byte> bytes) noexcept;

/// Returns the bytes of the HostFrame in the body of a control record that holds nothing else,
/// without parsing it. Returns an empty span for any other body. RT-safe.
[[nodiscard]] std::span<const std::byte> host_frame_in_control_record(
    std::span<const std::byte> body) noexcept;

/// Memory for encoding, used again for every message.
/// Thread: one owner.  Real time: the constructor allocates.
class HostFrameEncoder {
 public:
  HostFrameEncoder();
  ~HostFrameEncoder();
  HostFrameEncoder(HostFrameEncoder&&) noexcept;
  HostFrameEncoder& operator=(HostFrameEncoder&&) noexcept;

  /// Returns the bytes of an emit.v1.HostFrame with kProtocolVersion. They stay valid until the
  /// next call. The values are not checked: the receiver refuses what is not valid. RT-safe after
  /// the first calls, which may allocate.
  /// @pre frame.entity_count <= kMaxEntitiesPerFrame
  [[nodiscard]] std::span<const std::byte> encode(const HostFrameData& frame) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
