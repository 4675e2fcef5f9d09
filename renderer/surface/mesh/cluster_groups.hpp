// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

namespace emit::renderer {

/// A cluster as its neighbours see it.
struct GroupMember {
  std::vector<std::uint32_t> places;  ///< ids of the places of its vertices, ascending, each once
  glm::vec3 centre_m{0.0F};
};

/// Puts clusters together in groups of up to `most`, those first that share many places. Indices
/// into `members`; every member is in one group. O(n log n). Setup only.
[[nodiscard]] std::vector<std::vector<std::uint32_t>> group_neighbours(
    std::span<const GroupMember> members, std::size_t most);

}  // namespace emit::renderer
