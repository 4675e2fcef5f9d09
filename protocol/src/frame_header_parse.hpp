// SPDX-License-Identifier: Apache-2.0
#pragma once
#include "emit/protocol/frame_header.hpp"

namespace emit::protocol {

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

/// decode_frame_header() without the text: RT-safe. `header` is filled for none and payload_size.
[[nodiscard]] HeaderFault parse_frame_header(std::span<const std::byte> bytes,
                                             FrameHeader& header) noexcept;

}  // namespace emit::protocol
