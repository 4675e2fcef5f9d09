// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/protocol/frame_header.hpp"

namespace emit::protocol {

/// Reason why bytes are no valid frame header.
enum class HeaderFault : std::uint8_t {
  none,
  short_input,
  magic,
  version,
  size,
  crc,
  format,
  quantity,
  payload_size,
  encoding,
  window
};

/// Decodes a frame header as decode_frame_header() does, without an error text. `header` is filled
/// for none, payload_size and window. RT-safe.
[[nodiscard]] HeaderFault parse_frame_header(std::span<const std::byte> bytes,
                                             FrameHeader& header) noexcept;

}  // namespace emit::protocol
