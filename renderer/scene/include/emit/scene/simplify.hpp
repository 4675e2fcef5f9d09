// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"

namespace emit::scene {

/// From where, and how finely, a scene is looked at.
struct DetailView {
  std::span<const glm::dvec3> eyes_world_m;  ///< every place of the camera; empty: unknown
  double pixel_rad = 1e-3;                   ///< angle of a pixel
};

/// From a point to the nearest place of a box; 0 inside it and for an empty one.
[[nodiscard]] double distance_m(const Aabb& box, const glm::dvec3& point_m) noexcept;

/// Gives every static instance that looks wide from some eye a mesh of its own, so that each can be
/// cut as finely as it needs, as long as the copies have no more than some million vertices. The
/// others go on sharing with those on which a pixel is as wide to a factor of two, so that each
/// class can lose what its pixels do not show, with the same limit on copies. Where the eyes are
/// unknown all share. Instances keep their order. Setup only.
[[nodiscard]] SceneGeometry separated(SceneGeometry geometry, const DetailView& view);

/// Of half the width of a body, so that its outline keeps its area to some percent however few
/// pixels it covers.
inline constexpr double kMostBodyFrac = 0.02;

/// By mesh the distance that its surface may move when it is simplified, in the mesh's own lengths:
/// a quarter of a pixel seen from the nearest eye, `most_body_frac` of half its own width at most.
/// 0: the mesh stays as it is, because its triangles are wider than some pixels, an entity has it,
/// or the eyes are unknown.
[[nodiscard]] std::vector<double> simplify_errors(const SceneGeometry& geometry,
                                                  const DetailView& view,
                                                  double most_body_frac = kMostBodyFrac);

/// Fewer triangles where a mesh has more than its pixels can show: edge collapses by quadric error
/// (Garland and Heckbert 1997, SIGGRAPH), at most `errors` (of simplify_errors()); as that is a
/// mean over the faces around a collapse, the surface itself moves by up to twice as much. Vertices
/// are a subset of the old ones with their normals; borders of submeshes do not move, so that
/// neighbours still meet. `kept`: by mesh the triangles that stay as they are, and what they meet
/// the rest with; empty, or empty for a mesh: none. `triangles` is counted anew. Setup only: about
/// a second per million triangles. Precondition: sizes that fit.
[[nodiscard]] SceneGeometry simplified(SceneGeometry geometry, std::span<const double> errors,
                                       std::span<const std::vector<bool>> kept = {});

}  // namespace emit::scene
