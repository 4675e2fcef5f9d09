// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/reassembler.hpp"

/// A client's request for fragments that it is missing: body of a record of kind RecordKind::resend
/// (docs/wire.md section 4). It goes over the control connection, so that only who subscribed can
/// ask, whatever the network forges. Fixed layout: neither end allocates for it.
namespace emit::protocol {

inline constexpr std::size_t kMaxResendRanges = 128;
inline constexpr std::size_t kResendHeaderBytes = 8;
inline constexpr std::size_t kResendRangeBytes = 8;
inline constexpr std::size_t kMaxResendBytes =
    kResendHeaderBytes + kMaxResendRanges * kResendRangeBytes;

struct ResendRequest {
  std::uint16_t stream_id = 0;
  std::uint32_t frame_id = 0;
  std::uint16_t count = 0;  ///< of `ranges`
  std::array<ByteRange, kMaxResendRanges> ranges{};
};

/// Bytes written. Precondition: count <= kMaxResendRanges. RT-safe.
std::size_t encode(const ResendRequest& request,
                   std::span<std::byte, kMaxResendBytes> out) noexcept;
/// False: malformed (length, count, an empty range, one that ends beyond 2^32). RT-safe.
[[nodiscard]] bool decode_resend(std::span<const std::byte> body, ResendRequest& out) noexcept;

}  // namespace emit::protocol
