// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/reassembler.hpp"

/// Request of a client for missing fragments: the body of a record of kind RecordKind::resend
/// (docs/wire.md section 4). It goes over the control connection, so that only a subscriber can
/// ask, whatever datagrams are forged. The layout is fixed: neither end allocates for it.
namespace emit::protocol {

inline constexpr std::size_t kMaxResendRanges = 128;
inline constexpr std::size_t kResendHeaderBytes = 8;
inline constexpr std::size_t kResendRangeBytes = 8;
inline constexpr std::size_t kMaxResendBytes =
    kResendHeaderBytes + kMaxResendRanges * kResendRangeBytes;

/// One request, for one frame of one stream.
struct ResendRequest {
  std::uint16_t stream_id = 0;
  std::uint32_t frame_id = 0;
  std::uint16_t count = 0;  ///< number of `ranges` in use
  std::array<ByteRange, kMaxResendRanges> ranges{};
};

/// Writes a request and returns the number of bytes written. RT-safe.
/// @pre request.count <= kMaxResendRanges
std::size_t encode(const ResendRequest& request,
                   std::span<std::byte, kMaxResendBytes> out) noexcept;
/// Reads a request. Returns false when it is malformed: a wrong length or count, an empty range, or
/// a range that ends beyond 2^32. RT-safe.
[[nodiscard]] bool decode_resend(std::span<const std::byte> body, ResendRequest& out) noexcept;

}  // namespace emit::protocol
