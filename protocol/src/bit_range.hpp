// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <algorithm>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>

/// Ranges of bits in an array of 64-bit words. Precondition of all: the range lies within the
/// words.
namespace emit::protocol::bits {

/// Calls visit(word index, mask of the range's bits in it).
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

[[nodiscard]] inline std::size_t count_set(std::span<const std::uint64_t> words, std::size_t begin,
                                           std::size_t count) noexcept {
  std::size_t set = 0;
  for_each_word(begin, count, [&](std::size_t index, std::uint64_t mask) {
    set += static_cast<std::size_t>(std::popcount(words[index] & mask));
  });
  return set;
}

inline void set_range(std::span<std::uint64_t> words, std::size_t begin,
                      std::size_t count) noexcept {
  for_each_word(begin, count, [&](std::size_t index, std::uint64_t mask) { words[index] |= mask; });
}

}  // namespace emit::protocol::bits
