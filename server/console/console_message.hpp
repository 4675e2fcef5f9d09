// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>

#include "emit/protocol/frame_header.hpp"

namespace emit::server {

/// Bytes in front of the pixels of a binary message to the console, little endian; docs/console.md
/// has the layout.
inline constexpr std::size_t kConsoleHeaderBytes = 128;
inline constexpr std::uint32_t kConsoleMagic = 0x46434D45;  ///< "EMCF" as bytes E M C F
inline constexpr std::uint16_t kConsoleVersion = 1;

/// Writes the header of a message. RT-safe.
/// @param sequence  number of the message, which counts up from 1
[[nodiscard]] std::array<std::byte, kConsoleHeaderBytes> console_header(
    const protocol::FrameHeader& header, std::uint64_t sequence) noexcept;

/// Returns a JSON string with its quotes. Bytes that are not printable ASCII become '?', because
/// peers choose some of the text.
[[nodiscard]] std::string json_string(std::string_view text);

}  // namespace emit::server
