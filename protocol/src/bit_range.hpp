// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

#include "emit/physics/check.hpp"

/// Operations on ranges of bits in an array of 64-bit words. All functions are RT-safe.
namespace emit::protocol::bits {

/// Calls visit(index of a word, mask of the range's bits in it) for every word of the range [begin,
/// begin + count).
template <class Visit>
void for_each_word(std::size_t begin, std::size_t count, Visit visit) noexcept {
  const std::size_t end = begin + count;
  while (begin < end) {
    const std::size_t bit = begin % 64;
    const std::size_t here = std::min(64 - bit, end - begin);
    const std::uint64_t ones = here == 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << here) - 1;
    visit(begin / 64, ones << bit);
    begin += here;
  }
}

/// Returns the number of set bits in the range.
/// @pre the range lies within the words
[[nodiscard]] inline std::size_t count_set(std::span<const std::uint64_t> words, std::size_t begin,
                                           std::size_t count) noexcept {
  EMIT_DCHECK_OP(begin + count, <=, words.size() * 64);
  std::size_t set = 0;
  for_each_word(begin, count, [&](std::size_t index, std::uint64_t mask) {
    set += static_cast<std::size_t>(std::popcount(words[index] & mask));
  });
  return set;
}

/// Sets every bit of the range.
/// @pre the range lies within the words
inline void set_range(std::span<std::uint64_t> words, std::size_t begin,
                      std::size_t count) noexcept {
  EMIT_DCHECK_OP(begin + count, <=, words.size() * 64);
  for_each_word(begin, count, [&](std::size_t index, std::uint64_t mask) { words[index] |= mask; });
}

}  // namespace emit::protocol::bits
