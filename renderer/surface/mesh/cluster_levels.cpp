// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/cluster_levels.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <utility>

#include "emit/threads/parallel.hpp"
#include "surface/mesh/cluster_groups.hpp"
#include "surface/mesh/edge_collapse.hpp"
#include "surface/mesh/nearest_triangle.hpp"

namespace emit::renderer {
namespace {

/// Largest number of clusters that are simplified together.
constexpr std::size_t kGroupClusters = 8;
/// Largest share of its triangles that a group may keep to get a coarser level.
constexpr double kSensitivityFrac = 0.75;
/// Largest share of all triangles that a new level may have; the build ends with a larger one.
constexpr double kLevelFrac = 0.95;
/// Share of the surface of a group that may have larger errors than stated.
constexpr float kRareFrac = 0.01F;
/// Number of instances whose temperatures guide the collapse; all are measured afterwards.
constexpr std::size_t kGuides = 4;

using Indices = std::vector<std::uint32_t>;

/// Cluster during the build: its triangles (indices into the mesh), its bounds and its errors.
struct Node {
  Indices indices;
  scene::Cluster bounds;
  ClusterLevel level;
  bool finest = true;  ///< its triangles are those of the mesh
};

/// Triangles with a local numbering of their vertices, so that work is proportional to their number
/// and not to that of the mesh.
struct Local {
  Indices global;  ///< vertex of the mesh, by local vertex
  Indices indices;
  std::vector<glm::vec3> positions_m;
};

/// Numbers the vertices of some triangles from 0, in the order of the mesh.
Local localised(const scene::Mesh& mesh, std::span<const std::uint32_t> indices) {
  Local local;
  local.global.assign(indices.begin(), indices.end());
  std::ranges::sort(local.global);
  local.global.erase(std::unique(local.global.begin(), local.global.end()), local.global.end());
  for (const std::uint32_t v : local.global) local.positions_m.push_back(mesh.positions_m[v]);
  local.indices.reserve(indices.size());
  for (const std::uint32_t v : indices) {
    local.indices.push_back(static_cast<std::uint32_t>(std::ranges::lower_bound(local.global, v) -
                                                       local.global.begin()));
  }
  return local;
}

/// Builds the levels of one mesh, submesh by submesh.
class Builder {
 public:
  Builder(const scene::Mesh& mesh, const VertexValues& values)
      : mesh_(mesh), values_(values), place_(scene::place_numbers(mesh.positions_m, mesh.indices)) {
    // Choose the guides evenly from all instances.
    const std::size_t guides = std::min(kGuides, values.size());
    for (std::size_t i = 0; i < guides; ++i) guides_.push_back(i * values.size() / guides);
  }

  /// Returns the clusters of all levels of one submesh, the finest first. Clusters of a group stay
  /// together.
  [[nodiscard]] std::vector<Node> build(std::span<const std::uint32_t> indices) const;

 private:
  /// Coarser clusters that replace a group, and their error. They are empty if nothing replaces the
  /// group and its clusters stay.
  struct Merged {
    std::vector<Node> nodes;
    LevelError error;
  };
  [[nodiscard]] std::vector<Node> cut(std::span<const std::uint32_t> indices) const;
  /// Simplifies a group and cuts the result into clusters.
  [[nodiscard]] Merged merge(std::span<const Node> nodes,
                             std::span<const std::uint32_t> group) const;
  /// Returns about half of the triangles, in local numbers.
  [[nodiscard]] Indices collapse(const Local& local) const;
  /// Measures the error of `coarse` triangles (local numbers) against the finer ones in `local`.
  [[nodiscard]] LevelError measure(const Local& local, std::span<const std::uint32_t> coarse) const;

  const scene::Mesh& mesh_;
  const VertexValues& values_;
  Indices place_;                    ///< by vertex; equal for equal positions
  std::vector<std::size_t> guides_;  ///< indices into `values_`
};

std::vector<Node> Builder::cut(std::span<const std::uint32_t> indices) const {
  Local local = localised(mesh_, indices);
  std::vector<Node> nodes;
  for (const scene::Cluster& cluster : scene::cut_into_clusters(local.positions_m, local.indices)) {
    Node& node = nodes.emplace_back();
    node.bounds = cluster;
    const auto part = std::span(local.indices).subspan(cluster.first_index, cluster.index_count);
    for (const std::uint32_t v : part) node.indices.push_back(local.global[v]);
    node.level.own.centre_m = cluster.centre_m;
    node.level.own.radius_m = cluster.radius_m;
  }
  return nodes;
}

Indices Builder::collapse(const Local& local) const {
  CollapseInput input;
  Indices place(local.global.size());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> by_place(place.size());
  for (std::uint32_t v = 0; v < place.size(); ++v) by_place[v] = {place_[local.global[v]], v};
  std::ranges::sort(by_place);
  for (std::size_t i = 0; i < by_place.size(); ++i) {
    // Give all copies of a position the number of the first one.
    const bool copy = i > 0 && by_place[i].first == by_place[i - 1].first;
    place[by_place[i].second] = copy ? place[by_place[i - 1].second] : by_place[i].second;
  }
  input.positions_m = local.positions_m;
  input.place = place;
  input.indices = local.indices;
  input.tolerance_k = kLevelDifferencesK[1];
  // Gather the temperatures of the guides at the local vertices.
  std::vector<std::vector<float>> values_k;
  for (const std::size_t i : guides_) {
    std::vector<float>& here_k = values_k.emplace_back();
    for (const std::uint32_t v : local.global) here_k.push_back(values_[i][v]);
  }
  input.values_k.assign(values_k.begin(), values_k.end());
  return collapse_edges(input, local.indices.size() / 6);
}

LevelError Builder::measure(const Local& local, std::span<const std::uint32_t> coarse) const {
  // Give each vertex a third of the area of its triangles: its share of the surface.
  std::vector<float> area_m2(local.global.size(), 0.0F);
  float whole_m2 = 0.0F;
  for (std::size_t i = 0; i < local.indices.size(); i += 3) {
    const std::uint32_t* c = &local.indices[i];
    const auto at_m = [&](std::size_t k) { return local.positions_m[c[k]]; };
    const float third_m2 = glm::length(glm::cross(at_m(1) - at_m(0), at_m(2) - at_m(0))) / 6.0F;
    for (std::size_t k = 0; k < 3; ++k) area_m2[c[k]] += third_m2;
    whole_m2 += 3.0F * third_m2;
  }
  // Mark vertices that are still there: they have no error.
  for (const std::uint32_t v : coarse) area_m2[v] = -1.0F;
  const NearestTriangle nearest(local.positions_m, coarse);
  LevelError error;
  // Lists of (longest edge, area) of vertices with an error: one list for each of
  // kLevelDifferencesK and one for all vertices that are gone.
  std::array<std::vector<std::pair<float, float>>, kLevelDifferencesK.size() + 1> wrong;
  for (std::uint32_t v = 0; v < area_m2.size(); ++v) {
    if (area_m2[v] < 0.0F) continue;
    // Find the coarse triangle that stands for this vertex. If several meet at the place, take the
    // one that faces alike.
    const auto hit = nearest.find(local.positions_m[v], mesh_.normals[local.global[v]]);
    error.deviation_m = std::max(error.deviation_m, hit.distance_m);
    const std::uint32_t* corner = &coarse[3 * std::size_t{hit.triangle}];
    // Find the largest difference of temperature over all instances.
    float difference_k = 0.0F;
    for (const std::span<const float> value_k : values_) {
      float there_k = 0.0F;
      for (glm::length_t k = 0; k < 3; ++k) {
        there_k += hit.weight[k] * value_k[local.global[corner[k]]];
      }
      difference_k = std::max(difference_k, std::abs(there_k - value_k[local.global[v]]));
    }
    const std::pair<float, float> here{nearest.longest_edge_m(hit.triangle), area_m2[v]};
    wrong.back().push_back(here);
    for (std::size_t i = 0; i < kLevelDifferencesK.size(); ++i) {
      if (difference_k > kLevelDifferencesK[i]) wrong[i].push_back(here);
    }
  }
  // Take the longest edge of each list after the largest ones have filled the rare share of the
  // surface.
  for (std::size_t i = 0; i < wrong.size(); ++i) {
    std::ranges::sort(wrong[i], std::greater{});
    float above_m2 = 0.0F;
    for (const auto& [edge_m, part_m2] : wrong[i]) {
      above_m2 += part_m2;
      if (above_m2 <= kRareFrac * whole_m2) continue;
      (i < error.edge_m.size() ? error.edge_m[i] : error.size_m) = edge_m;
      break;
    }
  }
  return error;
}

Builder::Merged Builder::merge(std::span<const Node> nodes,
                               std::span<const std::uint32_t> group) const {
  // Gather the triangles of the group and simplify them.
  Indices fine;
  for (const std::uint32_t n : group) {
    fine.insert(fine.end(), nodes[n].indices.begin(), nodes[n].indices.end());
  }
  const Local local = localised(mesh_, fine);
  Indices coarse = collapse(local);
  if (coarse.empty() ||
      static_cast<double>(coarse.size()) > kSensitivityFrac * static_cast<double>(fine.size())) {
    return {};
  }
  Merged merged;
  LevelError& error = merged.error;
  error = measure(local, coarse);
  // Combine the errors with those of the finer clusters: deviations add up, and a coarser level
  // must never look better than what it replaces, from no place.
  float deviation_m = 0.0F;
  glm::vec3 low_m(std::numeric_limits<float>::infinity());
  glm::vec3 high_m(-std::numeric_limits<float>::infinity());
  for (const std::uint32_t n : group) {
    const LevelError& own = nodes[n].level.own;
    deviation_m = std::max(deviation_m, own.deviation_m);
    error.size_m = std::max(error.size_m, own.size_m);
    for (std::size_t i = 0; i < own.edge_m.size(); ++i) {
      error.edge_m[i] = std::max(error.edge_m[i], own.edge_m[i]);
    }
    low_m = glm::min(low_m, own.centre_m - own.radius_m);
    high_m = glm::max(high_m, own.centre_m + own.radius_m);
  }
  error.deviation_m += deviation_m;
  // Find a sphere that holds the spheres of all finer clusters.
  error.centre_m = 0.5F * (low_m + high_m);
  for (const std::uint32_t n : group) {
    const LevelError& own = nodes[n].level.own;
    error.radius_m =
        std::max(error.radius_m, glm::distance(own.centre_m, error.centre_m) + own.radius_m);
  }
  error.radius_m *= 1.0F + 1e-5F;  // room for rounding in float32
  // Cut the coarser triangles into clusters. They share one error, so that they appear together.
  for (std::uint32_t& v : coarse) v = local.global[v];
  merged.nodes = cut(coarse);
  for (Node& node : merged.nodes) {
    node.level.own = error;
    node.finest = false;
  }
  return merged;
}

std::vector<Node> Builder::build(std::span<const std::uint32_t> indices) const {
  std::vector<Node> done;
  std::vector<Node> nodes = cut(indices);
  for (;;) {
    // Group neighbouring clusters of this level.
    std::vector<GroupMember> members(nodes.size());
    std::size_t before = 0;
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      Indices& places = members[n].places;
      for (const std::uint32_t v : nodes[n].indices) places.push_back(place_[v]);
      std::ranges::sort(places);
      places.erase(std::unique(places.begin(), places.end()), places.end());
      members[n].centre_m = nodes[n].bounds.centre_m;
      before += nodes[n].indices.size();
    }
    const auto groups = group_neighbours(members, kGroupClusters);
    // Simplify the groups on all cores.
    std::vector<Merged> merged(groups.size());
    threads::parallel_parts(groups.size(), 1, [&](std::size_t first, std::size_t last) {
      for (std::size_t g = first; g < last; ++g) merged[g] = merge(nodes, groups[g]);
    });
    // Collect the next level: coarser clusters, and clusters that nothing replaces.
    std::vector<Node> next;
    std::size_t after = 0;
    for (std::size_t g = 0; g < groups.size(); ++g) {
      for (const std::uint32_t n : groups[g]) {
        if (merged[g].nodes.empty()) {  // the next round may group it with other neighbours
          after += nodes[n].indices.size();
          next.push_back(std::move(nodes[n]));
          continue;
        }
        nodes[n].level.coarser = merged[g].error;
        nodes[n].level.has_coarser = true;
        done.push_back(std::move(nodes[n]));
      }
      for (Node& node : merged[g].nodes) {
        after += node.indices.size();
        next.push_back(std::move(node));
      }
    }
    nodes = std::move(next);
    if (static_cast<double>(after) > kLevelFrac * static_cast<double>(before)) break;
  }
  std::ranges::move(nodes, std::back_inserter(done));
  return done;
}

}  // namespace

ClusterLevels build_cluster_levels(scene::Mesh& mesh, const VertexValues& values) {
  ClusterLevels out;
  if (mesh.positions_m.empty()) {
    out.of_submesh.resize(mesh.submeshes.size());
    return out;
  }
  // Build the levels of all submeshes on all cores.
  const Builder builder(mesh, values);
  std::vector<std::vector<Node>> built(mesh.submeshes.size());
  threads::parallel_parts(built.size(), 1, [&](std::size_t first, std::size_t last) {
    for (std::size_t k = first; k < last; ++k) {
      const scene::Submesh& submesh = mesh.submeshes[k];
      if (submesh.index_count == 0) continue;
      built[k] =
          builder.build(std::span(mesh.indices).subspan(submesh.first_index, submesh.index_count));
    }
  });
  // Lay the clusters out submesh by submesh.
  Indices finest(mesh.indices.size());
  Indices coarser;
  for (std::size_t k = 0; k < built.size(); ++k) {
    const scene::Submesh& submesh = mesh.submeshes[k];
    const ClusterLevels::Range range{static_cast<std::uint32_t>(out.clusters.size()), 0};
    out.of_submesh.push_back(range);
    if (submesh.index_count == 0) continue;
    // Put the finest clusters first: they keep the submesh's range of indices.
    std::uint32_t place = submesh.first_index;
    std::vector<Node>& nodes = built[k];
    std::stable_partition(nodes.begin(), nodes.end(), [](const Node& node) { return node.finest; });
    for (Node& node : nodes) {
      const auto count = static_cast<std::uint32_t>(node.indices.size());
      node.bounds.index_count = count;
      if (node.finest) {
        node.bounds.first_index = place;
        std::ranges::copy(node.indices, finest.begin() + place);
        place += count;
      } else {
        node.bounds.first_index = static_cast<std::uint32_t>(finest.size() + coarser.size());
        coarser.insert(coarser.end(), node.indices.begin(), node.indices.end());
      }
      out.clusters.push_back(node.bounds);
      out.levels.push_back(node.level);
    }
    out.of_submesh.back().count = static_cast<std::uint32_t>(out.clusters.size()) - range.first;
  }
  mesh.indices = std::move(finest);
  mesh.indices.insert(mesh.indices.end(), coarser.begin(), coarser.end());
  return out;
}

}  // namespace emit::renderer
