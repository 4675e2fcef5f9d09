// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "emit/scene/clusters.hpp"
#include "emit/scene/mesh.hpp"

namespace emit::renderer {

/// Differences that levels of detail are judged by, K.
inline constexpr std::array<float, 5> kLevelDifferencesK = {0.025F, 0.1F, 0.2F, 0.4F, 0.8F};

/// What a level of detail may get wrong.
struct LevelLimits {
  double pixel_rad = 0.0;  ///< 0: nothing
  double deviation_px = 0.25;
  double size_px = 4.0;        ///< longest edge of triangles that stand for finer ones
  double edge_px = 0.5;        ///< longest edge of triangles that differ by more than
  std::size_t difference = 0;  ///< this of kLevelDifferencesK
};

/// How far a coarser surface is from the finest one, and from where distances to it count.
/// Coordinates of the mesh, metres.
struct LevelError {
  float deviation_m = 0.0F;  ///< most that a vertex of the finest surface lies off it
  /// Longest edge of a triangle that stands for finer ones, but for a hundredth of the surface: the
  /// edge of a shadow that moves there is drawn out as much.
  float size_m = 0.0F;
  /// Longest edge of a triangle that differs somewhere by more than each of kLevelDifferencesK, but
  /// for a hundredth of the surface: an edge of a shadow is out of place by less.
  std::array<float, kLevelDifferencesK.size()> edge_m{};
  glm::vec3 centre_m{0.0F};  ///< of a sphere around all triangles that it counts for
  float radius_m = 0.0F;
};

/// From which distance on a cluster of triangles is drawn: where its own error does not show but
/// that of the coarser triangles in its place would.
struct ClusterLevel {
  LevelError own;
  LevelError coarser;
  bool has_coarser = false;
};

/// A mesh in clusters of several levels of detail which share its vertices. The finest have no
/// error; where one level meets the next no crack shows, as levels change along edges that both
/// have.
struct ClusterLevels {
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  std::vector<scene::Cluster> clusters;
  std::vector<ClusterLevel> levels;  ///< by cluster
  std::vector<Range> of_submesh;     ///< clusters of each submesh, the finest first
};

/// What the vertices of a mesh carry, in kelvin: for each instance as long as its vertices.
using VertexValues = std::vector<std::span<const float>>;

/// Cuts a mesh into clusters and these into coarser ones, until there is little to gain. The mesh's
/// triangles are put into the order of the finest clusters; those of coarser levels follow behind
/// the last submesh. Groups of neighbouring clusters lose half of their triangles at a time by
/// collapse_edges() while their common rim stays, and are cut anew; see Cignoni et al. 2005,
/// "Batched multi triangulation".
/// Setup only, on all cores: seconds per million triangles. The result depends on the input alone.
[[nodiscard]] ClusterLevels build_cluster_levels(scene::Mesh& mesh, const VertexValues& values);

}  // namespace emit::renderer
