// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>

#include "surface/rays/caster_rays.hpp"

namespace emit::renderer {

/// Numbers of rays of a thermal sample into its hemisphere: those that look for faces, and those
/// that look for the sky. The sky needs more: an error of a hundredth of its share is a tenth of a
/// kelvin.
inline constexpr std::uint32_t kSampleViewRays = 256;
inline constexpr std::uint32_t kSampleSkyRays = 1024;

/// Point of a surface and the side that it looks to, in the axes of CasterRay.
struct ViewPoint {
  glm::vec3 position_m{0.0F};
  glm::vec3 normal{0.0F, 0.0F, 1.0F};  ///< unit length, to the side that looks
  /// Unit tangent from the point into the faces that it belongs to; zero if it lies inside a face.
  /// On an edge or a corner it decides on which side of the neighbouring faces the point is.
  glm::vec3 inward{0.0F};
  /// Distance from the surface and from the edge at which rays start. It must be well above the
  /// resolution of float32 at position_m.
  float offset_m = 1e-3F;
};

/// Part of the view of a point: the share `weight_frac` of its hemisphere (cosine-weighted) shows
/// the neighbourhood of one place of a face.
struct SeenFace {
  std::uint32_t instance = 0;   ///< index into SceneGeometry::instances
  std::uint32_t triangle = 0;   ///< triangle of its mesh: first index / 3
  glm::vec2 barycentric{0.0F};  ///< weights of the triangle's second and third vertex
  float weight_frac = 0.0F;
  float distance_m = 0.0F;
  bool front = true;          ///< the side that its winding calls outside is seen
  glm::vec3 normal{0.0F};     ///< geometric normal, unit length, to the outside of the winding
  glm::vec3 direction{0.0F};  ///< unit length, from the point to the place
};

/// View of a point. sky_frac + far_frac + the weights of `seen` = 1.
struct SurfaceView {
  static constexpr std::size_t kMaxSeen = 24;
  float sky_frac = 0.0F;  ///< rays that left the scene at or above the horizon (+z is up)
  float far_frac = 0.0F;  ///< rays that left the scene below the horizon
  std::uint32_t seen_count = 0;
  std::array<SeenFace, kMaxSeen> seen;
};

/// Cosine-weighted shares of a hemisphere. The rest of it shows faces.
struct ViewShares {
  float sky_frac = 0.0F;  ///< rays that left the scene at or above the horizon (+z is up)
  float far_frac = 0.0F;  ///< rays that left the scene below the horizon
  /// Derivative of sky_frac when the normal turns: d sky_frac = dot(to_sky, d normal).
  glm::vec3 to_sky{0.0F};
};

/// Opening of a hemisphere to all sides, whichever of them is up. For the unit vector `up` the
/// share that shows sky is open_frac / 2 + dot(tilt_frac, up), to the second order of spherical
/// harmonics: the share for `up` and that for `-up` sum up to open_frac, so that even orders but
/// the zeroth vanish. It is exact for an open hemisphere.
struct ViewOpening {
  float open_frac = 0.0F;
  glm::vec3 tilt_frac{0.0F};
};

/// Cosine-weighted view of a point in a fixed set of directions around its normal. They are an
/// equal-area spiral on the unit disc, lifted to the hemisphere (Malley's method), so that every
/// ray has the same weight. View factors have an error of about 1/rays^0.75. Immutable; any thread;
/// no allocation after construction.
class ViewSampler {
 public:
  static constexpr std::uint32_t kMaxRays = 256;  ///< largest number of rays for view()

  /// Makes the directions. `rays` is rounded up to a multiple of 16, at least 16.
  explicit ViewSampler(std::uint32_t rays);

  /// Returns the shares of sky and far surroundings, by rays that need not know which face stops
  /// them. If a quarter of the rays hit nothing, as on open ground, the others are not traced.
  [[nodiscard]] ViewShares shares(const CasterRays& casters, const ViewPoint& point,
                                  const CasterSelection& selection) const noexcept;

  /// Returns the opening that what is selected leaves.
  [[nodiscard]] ViewOpening opening(const CasterRays& casters, const ViewPoint& point,
                                    const CasterSelection& selection) const noexcept;

  /// Returns the view with the faces that are seen. If there are more than kMaxSeen hits,
  /// neighbours in direction are joined, first those of one instance and similar orientation; the
  /// most central hit represents a group. Faces seen from behind are hits too.
  /// @pre made with at most kMaxRays
  [[nodiscard]] SurfaceView view(const CasterRays& casters, const ViewPoint& point,
                                 const CasterSelection& selection) const noexcept;

 private:
  /// Returns true if a quarter of the rays, evenly spread, all leave the scene.
  [[nodiscard]] bool nothing_near(const CasterRays& casters, const ViewPoint& point,
                                  const CasterSelection& selection) const noexcept;

  /// Directions in the axes (tangent, bitangent, normal), neighbours side by side.
  std::vector<glm::vec3> directions_;
};

}  // namespace emit::renderer
