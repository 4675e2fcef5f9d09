// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "emit/protocol/decode_fault.hpp"
#include "emit/protocol/host_frame.hpp"
#include "emit/protocol/version.hpp"

/// Host frames: wire bytes (Protobuf emit.v1.HostFrame) to plain structs and back.
namespace emit::protocol {

/// Largest encoded host frame: one UDP datagram.
inline constexpr std::size_t kMaxHostFrameBytes = 65507;
/// Positions farther from the origin are refused, m.
inline constexpr double kMaxPositionM = 1e8;
/// Simulation times farther from the scenario's epoch are refused, ns: 1e9 s, as in scenarios.
inline constexpr std::int64_t kMaxSimTimeNs = 1'000'000'000'000'000'000;

/// Values are those of emit.v1.Status.Code.
enum class DecodeStatus : std::uint8_t {
  ok = 1,
  wrong_version = 2,         ///< protocol_version is not kProtocolVersion
  oversize = 3,              ///< over kMaxHostFrameBytes or kMaxEntitiesPerFrame
  malformed = 4,             ///< not a HostFrame, an entity id twice, or beyond kMaxSimTimeNs
  invalid_pose = 6,          ///< missing part, NaN, infinite, not a unit quaternion, too far away,
                             ///< or only one of the two rates
  invalid_environment = 13,  ///< NaN, infinite or outside the ranges of docs/wire.md
};
[[nodiscard]] std::string_view to_string(DecodeStatus status) noexcept;

/// Memory for decoding, reused from message to message.
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

/// Decodes one emit.v1.HostFrame. `out` is written completely on ok (received_ns becomes 0); on an
/// error only frame_number, sim_time_ns and run_id are, as far as they could be read, else 0.
/// Quaternions off unit length by up to 1 % are normalised. Entity ids are not looked up.
/// RT-safe for messages without unknown fields.
[[nodiscard]] DecodeStatus decode_host_frame(std::span<const std::byte> bytes,
                                             HostFrameDecoder& decoder,
                                             HostFrameData& out) noexcept;

/// True for an emit.v1.Status with a text, as emitd sends: no HostFrame of this version begins like
/// one. RT-safe.
[[nodiscard]] bool looks_like_status(std::span<const std::byte> bytes) noexcept;

/// Body of a control record that holds nothing but a HostFrame: the HostFrame's bytes, without
/// parsing it. Empty when it is anything else. RT-safe.
[[nodiscard]] std::span<const std::byte> host_frame_in_control_record(
    std::span<const std::byte> body) noexcept;

/// Memory for encoding, reused from message to message.
class HostFrameEncoder {
 public:
  HostFrameEncoder();
  ~HostFrameEncoder();
  HostFrameEncoder(HostFrameEncoder&&) noexcept;
  HostFrameEncoder& operator=(HostFrameEncoder&&) noexcept;

  /// Bytes of an emit.v1.HostFrame with kProtocolVersion, valid until the next call. Does not check
  /// the values: what is not valid is refused by the receiver. RT-safe after the first calls.
  [[nodiscard]] std::span<const std::byte> encode(const HostFrameData& frame) noexcept;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace emit::protocol
