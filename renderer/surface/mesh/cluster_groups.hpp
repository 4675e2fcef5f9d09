// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::renderer {

/// Cluster as group_neighbours() sees it: its places and its centre.
struct GroupMember {
  /// Ids of the places of its vertices, ascending, each once.
  std::vector<std::uint32_t> places;
  glm::vec3 centre_m{0.0F};
};

/// Puts clusters together in groups of up to `most`. Clusters that share many places come together
/// first. Returns indices into `members`; every member is in exactly one group. O(n log n). Setup
/// only.
[[nodiscard]] std::vector<std::vector<std::uint32_t>> group_neighbours(
    std::span<const GroupMember> members, std::size_t most);

}  // namespace emit::renderer
