// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <string_view>
#include <vector>

namespace emit::tool {

/// The name that a mistyped word most likely stands for, or an empty text when none is near. A name
/// is near when at most a third of the word's letters, and at least one, differ: a letter too many,
/// too few or wrong, or two neighbours swapped, each count as one.
[[nodiscard]] std::string nearest_name(std::string_view word,
                                       const std::vector<std::string>& names);

}  // namespace emit::tool
