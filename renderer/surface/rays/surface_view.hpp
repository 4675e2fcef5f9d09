// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>

#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// Rays of a thermal sample into its hemisphere: those that look for faces, and those that look for
/// the sky, of which an error of a hundredth is worth a tenth of a kelvin.
inline constexpr std::uint32_t kSampleViewRays = 256;
inline constexpr std::uint32_t kSampleSkyRays = 1024;

/// A point of a surface and the side it looks to, in the axes of CasterRay.
struct ViewPoint {
  glm::vec3 position_m{0.0F};
  glm::vec3 normal{0.0F, 0.0F, 1.0F};  ///< unit length, to the side that looks
  /// Unit tangent from the point into the faces it belongs to; zero where it lies inside a face. On
  /// an edge or a corner it decides which side of the neighbouring faces the point is on.
  glm::vec3 inward{0.0F};
  /// Rays start this far off the surface and off the edge; well above the float32 resolution at
  /// position_m.
  float offset_m = 1e-3F;
};

/// Part of what a point sees: `weight_frac` of its hemisphere (cosine-weighted) shows the
/// neighbourhood of one place of a face.
struct SeenFace {
  std::uint32_t instance = 0;   ///< index into SceneGeometry::instances
  std::uint32_t triangle = 0;   ///< of its mesh: first index / 3
  glm::vec2 barycentric{0.0F};  ///< weights of the triangle's second and third vertex
  float weight_frac = 0.0F;
  float distance_m = 0.0F;
  bool front = true;          ///< the side its winding calls outside is seen
  glm::vec3 normal{0.0F};     ///< geometric, unit length, to the outside of the winding
  glm::vec3 direction{0.0F};  ///< unit length, from the point to the place
};

/// sky_frac + far_frac + the weights of `seen` = 1.
struct SurfaceView {
  static constexpr std::size_t kMaxSeen = 24;
  float sky_frac = 0.0F;  ///< left the scene at or above the horizon (+z is up)
  float far_frac = 0.0F;  ///< left the scene below the horizon
  std::uint32_t seen_count = 0;
  std::array<SeenFace, kMaxSeen> seen;
};

/// Cosine-weighted shares of a hemisphere; the rest shows faces.
struct ViewShares {
  float sky_frac = 0.0F;  ///< left the scene at or above the horizon (+z is up)
  float far_frac = 0.0F;  ///< left the scene below the horizon
  /// What sky_frac grows by when the normal turns: d sky_frac = dot(to_sky, d normal).
  glm::vec3 to_sky{0.0F};
};

/// Cosine-weighted view of a point by a fixed set of directions around its normal: an equal-area
/// spiral on the unit disc lifted to the hemisphere (Malley's method), so every ray weighs the
/// same. View factors come out within about 1/rays^0.75. Immutable, any thread, no allocation after
/// construction.
class ViewSampler {
 public:
  static constexpr std::uint32_t kMaxRays = 256;  ///< of view()

  /// `rays` is brought up to a multiple of 16, at least 16.
  explicit ViewSampler(std::uint32_t rays);

  /// What is open, by rays that need not know what stops them: by a quarter of them where these
  /// meet nothing, as on open ground.
  [[nodiscard]] ViewShares shares(const CasterRays& casters, const ViewPoint& point,
                                  const CasterSelection& selection) const noexcept;

  /// More than kMaxSeen hits are joined with their neighbours in direction, of one instance and
  /// alike in orientation first; the most central hit stands for the group. Faces seen from behind
  /// are hits like others. @pre made with at most kMaxRays
  [[nodiscard]] SurfaceView view(const CasterRays& casters, const ViewPoint& point,
                                 const CasterSelection& selection) const noexcept;

 private:
  /// True when a quarter of the rays, spread evenly, all leave the scene.
  [[nodiscard]] bool nothing_near(const CasterRays& casters, const ViewPoint& point,
                                  const CasterSelection& selection) const noexcept;

  std::vector<glm::vec3> directions_;  ///< (tangent, bitangent, normal), neighbours side by side
};

/// A face that meets the point's own at a convex edge: heat also leaves through it.
struct AdjacentFace {
  glm::vec3 normal{0.0F};   ///< outward, unit length, axes of the point
  float distance_m = 0.0F;  ///< from the point, along `normal`, to the face's plane
};
struct AdjacentFaces {
  std::array<AdjacentFace, 3> faces;  ///< nearest first
  std::uint32_t count = 0;
};

/// Looks for them inside the body, just below the surface along eight tangents: faces met from
/// behind, their planes within `reach_m`, whose normal is more than 60 degrees from the point's. Of
/// faces less than 40 degrees apart, such as the facets of a round side, the nearest counts. A
/// surface that bounds no body has none.
[[nodiscard]] AdjacentFaces adjacent_faces(const CasterRays& casters, const ViewPoint& point,
                                           float reach_m,
                                           const CasterSelection& selection) noexcept;

}  // namespace emit::renderer
