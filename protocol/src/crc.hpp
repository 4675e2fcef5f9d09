// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

namespace emit::protocol {

/// CRC-32C by tables, eight bytes a step; any CPU. Same interface as crc32c().
[[nodiscard]] std::uint32_t crc32c_portable(std::span<const std::byte> bytes,
                                            std::uint32_t crc = 0) noexcept;

/// CRC-32C by the CPU's instruction, three streams at a time. Precondition:
/// has_crc32c_instruction().
[[nodiscard]] std::uint32_t crc32c_hardware(std::span<const std::byte> bytes,
                                            std::uint32_t crc = 0) noexcept;
[[nodiscard]] bool has_crc32c_instruction() noexcept;

/// CRC-32C by carry-less products of 32 bytes; short pieces by the instruction. Precondition:
/// has_crc32c_folding().
[[nodiscard]] std::uint32_t crc32c_folding(std::span<const std::byte> bytes,
                                           std::uint32_t crc = 0) noexcept;
[[nodiscard]] bool has_crc32c_folding() noexcept;

/// The same by products of 64 bytes. Precondition: has_crc32c_wide_folding().
[[nodiscard]] std::uint32_t crc32c_wide_folding(std::span<const std::byte> bytes,
                                                std::uint32_t crc = 0) noexcept;
[[nodiscard]] bool has_crc32c_wide_folding() noexcept;

/// CRC-32 of zlib, PNG and MCAP (reflected 0x04C11DB7); `crc` continues an earlier call.
[[nodiscard]] std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc = 0) noexcept;

}  // namespace emit::protocol
