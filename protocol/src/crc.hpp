// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>

namespace emit::protocol {

/// Returns the CRC-32C, computed by tables, eight bytes a step. It runs on any CPU. `crc` continues
/// an earlier call. RT-safe, like all functions of this file.
[[nodiscard]] std::uint32_t crc32c_portable(std::span<const std::byte> bytes,
                                            std::uint32_t crc = 0) noexcept;

/// Returns the CRC-32C, computed by the CPU's instruction, three streams at a time.
/// @pre has_crc32c_instruction()
[[nodiscard]] std::uint32_t crc32c_hardware(std::span<const std::byte> bytes,
                                            std::uint32_t crc = 0) noexcept;
/// Returns true when the CPU has the instructions that crc32c_hardware() needs.
[[nodiscard]] bool has_crc32c_instruction() noexcept;

/// Returns the CRC-32C, computed by carry-less products of 32 bytes, and by the instruction for
/// short pieces.
/// @pre has_crc32c_folding()
[[nodiscard]] std::uint32_t crc32c_folding(std::span<const std::byte> bytes,
                                           std::uint32_t crc = 0) noexcept;
/// Returns true when the CPU has the instructions that crc32c_folding() needs.
[[nodiscard]] bool has_crc32c_folding() noexcept;

/// Returns the CRC-32C, computed by carry-less products of 64 bytes.
/// @pre has_crc32c_wide_folding()
[[nodiscard]] std::uint32_t crc32c_wide_folding(std::span<const std::byte> bytes,
                                                std::uint32_t crc = 0) noexcept;
/// Returns true when the CPU has the instructions that crc32c_wide_folding() needs.
[[nodiscard]] bool has_crc32c_wide_folding() noexcept;

/// Returns the CRC-32 of zlib, PNG and MCAP (reflected 0x04C11DB7). `crc` continues an earlier
/// call.
[[nodiscard]] std::uint32_t crc32(std::span<const std::byte> bytes, std::uint32_t crc = 0) noexcept;

}  // namespace emit::protocol
