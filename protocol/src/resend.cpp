// SPDX-License-Identifier: Apache-2.0
#include "emit/protocol/resend.hpp"

#include <limits>

#include "emit/physics/check.hpp"
#include "wire_bytes.hpp"

namespace emit::protocol {

std::size_t encode(const ResendRequest& request,
                   std::span<std::byte, kMaxResendBytes> out) noexcept {
  EMIT_CHECK_OP(request.count, <=, kMaxResendRanges);
  wire::put(out, 0, request.stream_id);
  wire::put(out, 2, request.count);
  wire::put(out, 4, request.frame_id);
  std::size_t at = kResendHeaderBytes;
  for (std::size_t i = 0; i < request.count; ++i, at += kResendRangeBytes) {
    wire::put(out, at, request.ranges[i].begin);
    wire::put(out, at + 4, request.ranges[i].bytes);
  }
  return at;
}

bool decode_resend(std::span<const std::byte> body, ResendRequest& out) noexcept {
  if (body.size() < kResendHeaderBytes) return false;
  out.stream_id = wire::get<std::uint16_t>(body, 0);
  out.count = wire::get<std::uint16_t>(body, 2);
  out.frame_id = wire::get<std::uint32_t>(body, 4);
  if (out.count == 0 || out.count > kMaxResendRanges ||
      body.size() != kResendHeaderBytes + out.count * kResendRangeBytes) {
    return false;
  }
  for (std::size_t i = 0; i < out.count; ++i) {
    const std::size_t at = kResendHeaderBytes + i * kResendRangeBytes;
    ByteRange& range = out.ranges[i];
    range.begin = wire::get<std::uint32_t>(body, at);
    range.bytes = wire::get<std::uint32_t>(body, at + 4);
    if (range.bytes == 0 || range.begin > std::numeric_limits<std::uint32_t>::max() - range.bytes) {
      return false;
    }
  }
  return true;
}

}  // namespace emit::protocol
