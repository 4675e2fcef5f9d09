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

/// Temperature differences by which levels of detail are judged, in kelvin.
inline constexpr std::array<float, 5> kLevelDifferencesK = {0.025F, 0.1F, 0.2F, 0.4F, 0.8F};

/// Errors that a level of detail may have in the image.
struct LevelLimits {
  double pixel_rad = 0.0;      ///< angle of a pixel; 0: no error is allowed
  double deviation_px = 0.25;  ///< largest distance from the finest surface
  /// Longest edge of triangles that replace finer ones.
  double size_px = 4.0;
  /// Longest edge of triangles whose temperature is wrong by more than
  /// kLevelDifferencesK[difference].
  double edge_px = 0.5;
  std::size_t difference = 0;  ///< index into kLevelDifferencesK
};

/// Errors of a coarser surface against the finest one, and the sphere from which distances to it
/// count. Coordinates are those of the mesh, in metres.
struct LevelError {
  /// Largest distance of a vertex of the finest surface from this one.
  float deviation_m = 0.0F;
  /// Longest edge of a triangle that replaces finer ones, except for the largest triangles on a
  /// hundredth of the surface. The edge of a moving shadow is blurred by as much there.
  float size_m = 0.0F;
  /// Longest edge of a triangle whose temperature differs somewhere by more than each of
  /// kLevelDifferencesK, with the same exception. The edge of a shadow is out of place by less than
  /// this.
  std::array<float, kLevelDifferencesK.size()> edge_m{};
  glm::vec3 centre_m{0.0F};  ///< centre of a sphere around all triangles that the errors count for
  float radius_m = 0.0F;
};

/// Errors that decide at which distances a cluster is drawn: its own error must not be visible, but
/// that of the coarser triangles in its place would be.
struct ClusterLevel {
  LevelError own;            ///< errors of this cluster
  LevelError coarser;        ///< errors of the triangles that replace it
  bool has_coarser = false;  ///< false: nothing replaces it
};

/// Mesh cut into clusters of several levels of detail, which share its vertices. The finest level
/// has no error. No crack shows between two levels, because levels change along edges that both
/// have.
struct ClusterLevels {
  /// Range of entries of `clusters`.
  struct Range {
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };
  std::vector<scene::Cluster> clusters;
  std::vector<ClusterLevel> levels;  ///< errors of each cluster
  std::vector<Range> of_submesh;     ///< clusters of each submesh, the finest first
};

/// Temperatures in kelvin at the vertices of a mesh, one list per instance. Each list is as long as
/// the list of vertices.
using VertexValues = std::vector<std::span<const float>>;

/// Cuts a mesh into clusters and simplifies these level by level, until there is little to gain.
/// The triangles of the mesh are sorted into the order of the finest clusters; those of coarser
/// levels follow behind the last submesh. At each level, groups of neighbouring clusters lose half
/// of their triangles by collapse_edges() while their common rim stays, and are cut into clusters
/// anew; see Cignoni et al. 2005, "Batched multi triangulation".
/// The result depends on the input alone. Setup only: it uses all cores for seconds per million
/// triangles.
[[nodiscard]] ClusterLevels build_cluster_levels(scene::Mesh& mesh, const VertexValues& values);

}  // namespace emit::renderer
