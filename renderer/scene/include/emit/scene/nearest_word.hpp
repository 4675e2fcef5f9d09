// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string_view>
#include <vector>

namespace emit::scene {

/// Finds the candidate that the writer of an unknown word may have meant: the one with the fewest
/// edits, at most a third of the word's length, else one that begins as the word does or with which
/// the word begins. Empty when none is near.
[[nodiscard]] std::string_view nearest_word(std::string_view word,
                                            const std::vector<std::string_view>& candidates);

}  // namespace emit::scene
