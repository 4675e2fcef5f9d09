// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <vector>

namespace emit::scenegen {

/// Returns a PNG image with the outline of the crown of a tree: its opacity is 1 where there are
/// leaves and 0 in the gaps. It is the same in every call. The upper edge is the top of the crown.
[[nodiscard]] std::vector<std::byte> foliage_png();

}  // namespace emit::scenegen
