// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// Places of the camera, and the angle of its pixels.
struct DetailView {
  std::span<const glm::dvec3> eyes_world_m;  ///< every place of the camera; empty: unknown
  double pixel_rad = 1e-3;                   ///< angle of a pixel
};

/// Distance from a point to the nearest place of a box; 0 inside the box and for an empty box.
[[nodiscard]] double distance_m(const Aabb& box, const glm::dvec3& point_m) noexcept;

/// Gives every static instance that looks wide from some eye a mesh of its own, so that each can be
/// refined as finely as it needs, as long as the copies have no more than two million vertices. The
/// others share a mesh with those on which a pixel is as wide to a factor of two, so that each
/// class can lose what its pixels do not show, with the same limit on copies. All instances go on
/// sharing when the eyes are unknown. Instances keep their order. Setup only.
[[nodiscard]] SceneGeometry separated(SceneGeometry geometry, const DetailView& view);

/// Largest share of half a body's width by which its surface may move. Its outline then keeps its
/// area to some percent, however few pixels it covers.
inline constexpr double kMaxBodyFrac = 0.02;

/// Distance, by mesh, that the surface may move when it is simplified, in the mesh's own lengths: a
/// quarter of a pixel seen from the nearest eye, and at most `most_body_frac` of half its own
/// width. It is 0 for a mesh that stays as it is, because its triangles are wider than some pixels,
/// an entity has it, or the eyes are unknown.
[[nodiscard]] std::vector<double> simplify_errors(const SceneGeometry& geometry,
                                                  const DetailView& view,
                                                  double most_body_frac = kMaxBodyFrac);

/// Removes triangles from meshes that have more than their pixels can show, by edge collapses with
/// a quadric error (Garland and Heckbert 1997, SIGGRAPH). That error is a mean over the faces
/// around a collapse, so the surface itself moves by up to twice as much. Vertices are a subset of
/// the old ones with their normals. Borders of submeshes do not move, so that neighbours still
/// meet. `triangles` and the bounds are computed anew. Setup only: about a second per million
/// triangles.
///
/// @param errors  largest error by mesh, from simplify_errors()
/// @param kept    triangles, by mesh, that stay as they are together with their vertices; empty, or
///                empty for a mesh: none
/// @pre `errors` has an entry per mesh, and `kept` too unless it is empty.
[[nodiscard]] SceneGeometry simplified(SceneGeometry geometry, std::span<const double> errors,
                                       std::span<const std::vector<bool>> kept = {});

}  // namespace emit::scene
