// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/matrix_double4x4.hpp>
#include <string>
#include <utility>
#include <vector>

#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// A mesh that is placed more often than this need only be handed over at its first places: plants
/// and posts that stand in thousands would cost minutes.
inline constexpr std::size_t kMaxComparedPlacements = 8;
/// cut_coplanar() leaves scenes with more triangles as they are and says so.
inline constexpr std::size_t kMaxComparedTriangles = 4'000'000;

/// One placed mesh among those that may cover each other.
struct CoplanarPart {
  std::uint32_t mesh = 0;  ///< index into the meshes; a part that is cut may get a copy of its own
  glm::dmat4 common_from_mesh{1.0};  ///< into axes that all parts share
  std::string name;                  ///< for messages: "node 'road' mesh 'road'"
  /// Parts of one group have been compared before and are not compared again; 0: no group.
  std::uint32_t group = 0;
  bool shared = false;  ///< something outside the list places the mesh too
};

/// Cuts surfaces that lie exactly in the plane of another one of a different material, such as a
/// road under its markings. A depth test decides between such surfaces by rounding, and so
/// differently from each place. Per plane the material with the smaller area stays whole, and the
/// other is cut away beneath it; the later one stays whole where both are equal.
///
/// Surfaces are in one plane when the corners of one lie within 0.2 mm of the other and both face
/// the same way, or one is double-sided. A cut reaches under the edge of the covering surface by
/// 1e-4 of its size, so that no gap opens. New vertices are set into the neighbours' edges as well.
/// A mesh that other parts share is copied before it is cut. A part that is covered altogether
/// keeps its place in the list and gets a mesh without triangles.
///
/// A mesh with many placements is compared at its first ones only, see kMaxComparedPlacements.
///
/// Returns one line for each pair of surfaces, without the name of a file. Setup only: about a
/// second per million triangles.
/// @pre every part names a mesh.
[[nodiscard]] std::vector<std::string> cut_coplanar(std::vector<Mesh>& meshes,
                                                    std::vector<CoplanarPart>& parts);

/// Removes what places a mesh that has lost all its triangles, and meshes that nothing places.
template <class Placed>
void drop_unused(std::vector<Mesh>& meshes, std::vector<Placed>& placed) {
  std::erase_if(placed, [&](const Placed& p) { return meshes[p.mesh].indices.empty(); });
  std::vector<std::uint32_t> number(meshes.size(), 0);
  for (const Placed& p : placed) number[p.mesh] = 1;
  std::uint32_t next = 0;
  for (std::size_t m = 0; m < number.size(); ++m) {
    const bool used = number[m] != 0;
    number[m] = next;
    if (!used) continue;
    if (next != m) meshes[next] = std::move(meshes[m]);
    ++next;
  }
  meshes.resize(next);
  for (Placed& p : placed) p.mesh = number[p.mesh];
}

}  // namespace emit::scene
