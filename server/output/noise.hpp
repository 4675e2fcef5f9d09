// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <span>

/// Random numbers that depend on their place alone: a number is a function of seed, stream, frame,
/// row and column. So a replay has the bits of the run, and frames can be made in any order.
/// Any thread. RT-safe.
namespace emit::server {

/// Four random words of a counter under a key: Philox-4x32-10 (Salmon and others, Parallel random
/// numbers: as easy as 1, 2, 3; SC11, 2011).
[[nodiscard]] std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                                  std::array<std::uint32_t, 2> key) noexcept;

/// Streams are independent of each other.
enum class NoiseStream : std::uint32_t {
  temporal = 1,
  pixel_gain = 2,
  pixel_offset = 3,
  bad_pixels = 4,
  row_drift = 5,
  column_drift = 6,
};

/// Place of a row of numbers.
struct NoisePlace {
  std::uint32_t seed = 1;
  NoiseStream stream = NoiseStream::temporal;
  std::uint64_t frame = 0;
  std::uint32_t row = 0;
};

/// Fills `out` with normal numbers of mean 0 and standard deviation 1, by the method of Box and
/// Muller. Their distribution follows the normal one to 1e-6; none exceeds 5.9.
void normal_row(const NoisePlace& place, std::span<float> out) noexcept;

/// The same, for a processor without AVX2. It gives the same bits. For tests.
void normal_row_plain(const NoisePlace& place, std::span<float> out) noexcept;

/// Returns a number of 1/f noise in time, standard deviation 1: a sum of levels of which each
/// stays the same for twice as many frames as the one before (Voss's method; Gardner, Scientific
/// American 238, 1978). Its spectrum follows 1/f from a half to 1 / 2^kDriftLevels per frame.
inline constexpr std::uint32_t kDriftLevels = 12;
[[nodiscard]] float drift_at(const NoisePlace& place) noexcept;

}  // namespace emit::server
