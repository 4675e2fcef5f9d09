// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <string_view>
#include <vector>

/// Suggestions for mistyped names: keys, materials, options, commands. Thread: any. Setup only.
namespace emit::physics {

/// Finds the candidate that the writer of an unknown name may have meant: the one with the fewest
/// edits, at most a third of the name's length and at least one, else one that begins as the name
/// does or with which the name begins. A letter too many, too few or wrong, or two neighbours
/// swapped, each count as one edit. Empty when none is near.
[[nodiscard]] std::string_view nearest_name(std::string_view name,
                                            const std::vector<std::string_view>& candidates);

/// Returns ", did you mean 'NEAREST'?" for the end of a message, or an empty text when no candidate
/// is near.
[[nodiscard]] std::string did_you_mean(std::string_view name,
                                       const std::vector<std::string_view>& candidates);
[[nodiscard]] std::string did_you_mean(std::string_view name,
                                       const std::vector<std::string>& candidates);

}  // namespace emit::physics
