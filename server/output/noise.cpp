// SPDX-License-Identifier: Apache-2.0
#include "output/noise.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>

#include "output/wide.hpp"

namespace emit::server {
namespace {

/// Counters that are worked on side by side.
constexpr std::size_t kLanes = 16;
/// One word of some counters.
template <std::size_t lanes>
using Words = std::array<std::uint32_t, lanes>;

constexpr std::uint32_t kMultiply0 = 0xD2511F53U;
constexpr std::uint32_t kMultiply1 = 0xCD9E8D57U;
constexpr std::uint32_t kBump0 = 0x9E3779B9U;
constexpr std::uint32_t kBump1 = 0xBB67AE85U;
constexpr int kRounds = 10;

template <std::size_t lanes>
EMIT_LOOP_BODY void philox_lanes(std::array<Words<lanes>, 4>& counter, std::uint32_t key0,
                                 std::uint32_t key1) noexcept {
  for (int round = 0; round < kRounds; ++round) {
    for (std::size_t l = 0; l < lanes; ++l) {
      const std::uint64_t product0 = std::uint64_t{kMultiply0} * counter[0][l];
      const std::uint64_t product1 = std::uint64_t{kMultiply1} * counter[2][l];
      const auto high0 = static_cast<std::uint32_t>(product0 >> 32U);
      const auto high1 = static_cast<std::uint32_t>(product1 >> 32U);
      counter[0][l] = high1 ^ counter[1][l] ^ key0;
      counter[1][l] = static_cast<std::uint32_t>(product1);
      counter[2][l] = high0 ^ counter[3][l] ^ key1;
      counter[3][l] = static_cast<std::uint32_t>(product0);
    }
    key0 += kBump0;
    key1 += kBump1;
  }
}

/// Natural logarithm of a number above 0 and up to 1, to 1e-7 of itself or of 1.
EMIT_LOOP_BODY float log_of(float u) noexcept {
  // Split into 2^e and m from sqrt(1/2) to sqrt(2), then sum the series of atanh.
  const auto bits = std::bit_cast<std::uint32_t>(u);
  const std::uint32_t shifted = bits - 0x3F3504F3U;
  const auto e = static_cast<float>(static_cast<std::int32_t>(shifted) >> 23);
  const float m = std::bit_cast<float>((shifted & 0x007FFFFFU) + 0x3F3504F3U);
  const float s = (m - 1.0F) / (m + 1.0F);
  const float s2 = s * s;
  const float series =
      1.0F + s2 * (1.0F / 3.0F + s2 * (1.0F / 5.0F + s2 * (1.0F / 7.0F + s2 / 9.0F)));
  return e * 0.693147181F + 2.0F * s * series;
}

/// Sine and cosine of 2 pi u.
EMIT_LOOP_BODY void circle_of(float u, float& sine, float& cosine) noexcept {
  // Take the nearest quarter turn off, and sum Taylor's series of the rest.
  const float quarters = 4.0F * u;
  const auto nearest = static_cast<std::int32_t>(quarters + 0.5F);
  const float a = (quarters - static_cast<float>(nearest)) * 1.57079633F;
  const float a2 = a * a;
  const float s = a * (1.0F + a2 * (-1.0F / 6.0F + a2 * (1.0F / 120.0F + a2 * (-1.0F / 5040.0F))));
  const float c = 1.0F + a2 * (-0.5F + a2 * (1.0F / 24.0F + a2 * (-1.0F / 720.0F + a2 / 40320.0F)));
  const bool odd = (nearest & 1) != 0;
  const float x = odd ? c : s;
  const float y = odd ? s : c;
  sine = (nearest & 2) != 0 ? -x : x;
  cosine = ((nearest + 1) & 2) != 0 ? -y : y;
}

/// Returns a number between 0 and 1, never 0 and never 1, of the upper bits of a word.
EMIT_LOOP_BODY float open_unit(std::uint32_t word) noexcept {
  return static_cast<float>(static_cast<std::int32_t>(word >> 9U)) * 0x1p-23F + 0x1p-24F;
}

constexpr std::size_t kPerBlock = 4 * kLanes;

EMIT_LOOP_BODY void normal_block(const NoisePlace& place, std::uint32_t block,
                                 std::array<float, kPerBlock>& out) noexcept {
  std::array<Words<kLanes>, 4> words;
  for (std::size_t l = 0; l < kLanes; ++l) {
    words[0][l] = static_cast<std::uint32_t>(block * kLanes + l);
    words[1][l] = place.row;
    words[2][l] = static_cast<std::uint32_t>(place.frame);
    words[3][l] = static_cast<std::uint32_t>(place.frame >> 32U);
  }
  philox_lanes(words, place.seed, static_cast<std::uint32_t>(place.stream));
  for (std::size_t pair = 0; pair < 2; ++pair) {
    std::array<float, kLanes> radius;
    std::array<float, kLanes> sine;
    std::array<float, kLanes> cosine;
    for (std::size_t l = 0; l < kLanes; ++l) {
      radius[l] = -2.0F * log_of(open_unit(words[2 * pair][l]));
    }
    for (float& r : radius) r = std::sqrt(r);
    for (std::size_t l = 0; l < kLanes; ++l) {
      circle_of(open_unit(words[2 * pair + 1][l]), sine[l], cosine[l]);
    }
    for (std::size_t l = 0; l < kLanes; ++l) {
      out[2 * pair * kLanes + l] = radius[l] * cosine[l];
      out[(2 * pair + 1) * kLanes + l] = radius[l] * sine[l];
    }
  }
}

EMIT_LOOP_BODY void normal_row_body(const NoisePlace& place, std::span<float> out) noexcept {
  std::array<float, kPerBlock> block;
  for (std::uint32_t b = 0; std::size_t{b} * kPerBlock < out.size(); ++b) {
    normal_block(place, b, block);
    const std::size_t first = std::size_t{b} * kPerBlock;
    std::copy_n(block.data(), std::min(kPerBlock, out.size() - first), out.data() + first);
  }
}

EMIT_WIDE_TARGET void normal_row_wide(const NoisePlace& place, std::span<float> out) noexcept {
  normal_row_body(place, out);
}

}  // namespace

std::array<std::uint32_t, 4> philox(std::array<std::uint32_t, 4> counter,
                                    std::array<std::uint32_t, 2> key) noexcept {
  std::array<Words<1>, 4> words{};
  for (std::size_t i = 0; i < 4; ++i) words[i][0] = counter[i];
  philox_lanes(words, key[0], key[1]);
  return {words[0][0], words[1][0], words[2][0], words[3][0]};
}

void normal_row_plain(const NoisePlace& place, std::span<float> out) noexcept {
  normal_row_body(place, out);
}

void normal_row(const NoisePlace& place, std::span<float> out) noexcept {
  has_wide() ? normal_row_wide(place, out) : normal_row_plain(place, out);
}

float drift_at(const NoisePlace& place) noexcept {
  // Levels change at frames of their own, so that they do not step together.
  double sum = 0.0;
  for (std::uint32_t level = 0; level < kDriftLevels; ++level) {
    const std::array<std::uint32_t, 2> key{place.seed, static_cast<std::uint32_t>(place.stream)};
    const std::uint32_t phase = philox({level, place.row, 0, ~0U}, key)[0];
    const std::uint64_t step = (place.frame + phase) >> level;
    const auto words = philox({level, place.row, static_cast<std::uint32_t>(step),
                               static_cast<std::uint32_t>(step >> 32U)},
                              key);
    float sine = 0.0F;
    float cosine = 0.0F;
    circle_of(open_unit(words[1]), sine, cosine);
    sum += static_cast<double>(std::sqrt(-2.0F * log_of(open_unit(words[0]))) * cosine);
  }
  return static_cast<float>(sum / std::sqrt(double{kDriftLevels}));
}

}  // namespace emit::server
