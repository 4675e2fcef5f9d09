// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/protocol/axes.hpp"

/// Messages of a motion simulator as blocks of shared or reflective memory (docs/wire.md section
/// 13). A block is an array of 8-byte words. Its counter is the last word, and stands in the first
/// one too.
namespace emit::protocol {

inline constexpr std::uint32_t kAxesMemoryVersion = 1;
inline constexpr std::size_t kAxesCommandWords = 22;
inline constexpr std::size_t kAxesMonitorWords = 37;
/// Place of the monitor behind that of the command, bytes.
inline constexpr std::size_t kAxesMonitorAtBytes = 256;
/// Bytes of both blocks.
inline constexpr std::size_t kAxesMemoryBytes =
    kAxesMonitorAtBytes + kAxesMonitorWords * sizeof(std::uint64_t);

using AxesCommandBlock = std::span<std::uint64_t, kAxesCommandWords>;
using AxesMonitorBlock = std::span<std::uint64_t, kAxesMonitorWords>;

/// Writes a message, the copy of its counter first and its counter last.
/// Thread: one writer for a block; others may read meanwhile. RT-safe.
/// @pre at most kMaxAxes axes, and words at multiples of 8 bytes
void store_axes(AxesCommandBlock block, const AxesCommand& command) noexcept;
void store_axes(AxesMonitorBlock block, const AxesMonitor& monitor) noexcept;

enum class AxesLoadStatus : std::uint8_t {
  nothing,  ///< the counter is the one that was seen before, or 0
  torn,     ///< a writer was at work: read again later
  refused,  ///< the message is not valid; its counter is seen now
  done,
};
struct AxesLoad {
  AxesLoadStatus status = AxesLoadStatus::nothing;
  AxesFault fault = AxesFault::none;  ///< reason of refused
};
/// Reads a message that is newer than the one with the counter `seen`, and checks it as the codec
/// does. `seen` and `out` are written only when it is done; `seen` also when it is refused.
/// Thread: any. RT-safe.
/// @pre words at multiples of 8 bytes
[[nodiscard]] AxesLoad load_axes(AxesCommandBlock block, std::uint64_t& seen,
                                 AxesCommand& out) noexcept;
[[nodiscard]] AxesLoad load_axes(AxesMonitorBlock block, std::uint64_t& seen,
                                 AxesMonitor& out) noexcept;

/// Returns the counter of the latest complete message of a block; 0: there is none. RT-safe.
[[nodiscard]] std::uint64_t latest_counter(AxesCommandBlock block) noexcept;
[[nodiscard]] std::uint64_t latest_counter(AxesMonitorBlock block) noexcept;

}  // namespace emit::protocol
