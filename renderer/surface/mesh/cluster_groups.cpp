// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/cluster_groups.hpp"

#include <algorithm>
#include <utility>

#include "emit/scene/clusters.hpp"

namespace emit::renderer {
namespace {

/// Member that shares places with another one.
struct Neighbour {
  std::uint32_t member = 0;
  std::uint32_t shared = 0;  ///< number of places that both have
};

/// Returns, for each member, the members that share places with it.
std::vector<std::vector<Neighbour>> find_neighbours(std::span<const GroupMember> members) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> uses;  // place, member
  for (std::uint32_t m = 0; m < members.size(); ++m) {
    for (const std::uint32_t place : members[m].places) uses.emplace_back(place, m);
  }
  // Bring the users of each place together and note every pair of them.
  std::ranges::sort(uses);
  std::vector<std::vector<std::uint32_t>> met(members.size());
  for (std::size_t first = 0; first < uses.size();) {
    std::size_t end = first;
    while (end < uses.size() && uses[end].first == uses[first].first) ++end;
    for (std::size_t a = first; a < end; ++a) {
      for (std::size_t b = first; b < end; ++b) {
        if (a != b) met[uses[a].second].push_back(uses[b].second);
      }
    }
    first = end;
  }
  // Count how often a pair was noted: that is the number of places that the two share.
  std::vector<std::vector<Neighbour>> neighbours(members.size());
  for (std::size_t m = 0; m < members.size(); ++m) {
    std::ranges::sort(met[m]);
    for (const std::uint32_t other : met[m]) {
      if (neighbours[m].empty() || neighbours[m].back().member != other) {
        neighbours[m].push_back({other, 0});
      }
      ++neighbours[m].back().shared;
    }
  }
  return neighbours;
}

}  // namespace

std::vector<std::vector<std::uint32_t>> group_neighbours(std::span<const GroupMember> members,
                                                         std::size_t most) {
  std::vector<std::vector<std::uint32_t>> groups;
  if (members.empty()) return groups;
  const std::vector<std::vector<Neighbour>> neighbours = find_neighbours(members);
  std::vector<glm::vec3> centres_m;
  for (const GroupMember& member : members) centres_m.push_back(member.centre_m);
  // Start groups in the order of a curve through space, so that what is left over lies together.
  const std::vector<std::uint32_t> order = scene::curve_order(centres_m);
  std::vector<bool> taken(members.size(), false);
  std::vector<Neighbour> rim;
  std::size_t next = 0;
  for (const std::uint32_t seed : order) {
    if (taken[seed]) continue;
    std::vector<std::uint32_t> group;
    rim.clear();
    std::uint32_t latest = seed;
    for (;;) {
      taken[latest] = true;
      group.push_back(latest);
      if (group.size() == most) break;
      // Add the neighbours of the latest member to the rim of the group.
      for (const Neighbour& neighbour : neighbours[latest]) {
        const auto known = std::ranges::find(rim, neighbour.member, &Neighbour::member);
        if (known == rim.end()) {
          rim.push_back(neighbour);
        } else {
          known->shared += neighbour.shared;
        }
      }
      std::erase_if(rim, [&](const Neighbour& neighbour) { return taken[neighbour.member]; });
      // Go on with the member that shares most places with the group.
      if (!rim.empty()) {
        latest = std::ranges::max_element(rim, {}, &Neighbour::shared)->member;
        continue;
      }
      // Continue with the next free member along the curve if the group has no neighbour left:
      // loose parts join what lies near them.
      while (next < order.size() && taken[order[next]]) ++next;
      if (next == order.size()) break;
      latest = order[next];
    }
    groups.push_back(std::move(group));
  }
  return groups;
}

}  // namespace emit::renderer
