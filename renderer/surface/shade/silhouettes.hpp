// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/ext/vector_float4.hpp>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/rays/caster_rays.hpp"
#include "threads/worker_pool.hpp"

namespace emit::renderer {

/// A silhouette where its body stands: place of a point p (rel axes of the rays, m) on it, along
/// the sun's rays.
struct PlacedSilhouette {
  glm::vec4 column;      ///< dot with (p, 1): texels from the first column
  glm::vec4 row;         ///< likewise
  glm::vec4 depth_m;     ///< likewise: m away from the sun, from the body's origin
  float mean_m = 0.0F;   ///< depth of what shades, on average
  float texel_m = 1.0F;  ///< width of a texel
  glm::vec2 half{0.0F};  ///< texels from the middle to the body's outermost ones
};

/// Entities as the sun sees them from behind: by texel of a square the depth of the surface that is
/// farthest from the sun. What lies deeper is in the shade.
///
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor is RT-safe; look() sends 16,384 rays where a body has turned to the sun, for so
/// many bodies per frame and no more.
class Silhouettes {
 public:
  static constexpr std::uint32_t kSide = 128;
  /// Depth where nothing shades.
  static constexpr float kOpenM = 1e30F;

  Silhouettes() = default;
  /// `bounds_m`: of each entity, axes of its body.
  explicit Silhouettes(std::span<const scene::Aabb> bounds_m);

  /// Neighbours of a texel say what lies within that many texels of a place in it.
  static constexpr float kAround = 1.0F;

  /// Bodies that one frame looks at anew.
  static constexpr int kLooksPerFrame = 8;
  /// How far outlines may be those of a body that is turned a little further: those of pictures,
  /// and of what is smeared over a step anyway.
  static constexpr float kSharpRad = 4e-3F;
  static constexpr float kSmearedRad = 2e-2F;

  [[nodiscard]] std::size_t size() const noexcept { return tiles_.size(); }
  void begin_frame() noexcept { looks_left_ = kLooksPerFrame; }
  /// Sees to it that the silhouette is that of a body which has the sun in the direction of the
  /// unit vector `to_sun_body`, to `most_turn_rad`. False: not to ten times that, as too many
  /// others have turned.
  bool look(std::size_t mover, const glm::vec3& to_sun_body, float most_turn_rad,
            const CasterRays& rays, threads::WorkerPool& workers) noexcept;
  /// Where the body casts it with the sun in the direction of the unit vector `to_sun`, rel axes.
  /// @pre look() for about this direction
  [[nodiscard]] PlacedSilhouette place(std::size_t mover, const MoverPlacement& placement,
                                       const glm::vec3& to_sun) const noexcept;
  /// Share of the disc of `radius_texels` around a place that is shaded at that depth, as seen by
  /// every `stride`th of EMIT_SHADE_TAPS looks from `first` on; the sum over all first < stride is
  /// that by all of them.
  [[nodiscard]] float shaded_frac(std::size_t mover, float column, float row, float depth_m,
                                  float radius_texels, std::uint32_t first = 0,
                                  std::uint32_t stride = 1) const noexcept;
  /// Depth of the surface in a place of the silhouette that is farthest from the sun; the mean of
  /// all where there is none.
  [[nodiscard]] float caster_m(std::size_t mover, float column, float row) const noexcept;
  /// kSide rows of kSide depths, and how often they were made anew.
  [[nodiscard]] std::span<const float> depths_m(std::size_t mover) const noexcept {
    return tiles_[mover].depth_m;
  }
  [[nodiscard]] std::uint32_t revision(std::size_t mover) const noexcept {
    return tiles_[mover].revision;
  }
  /// Of the body's box; 0: it has no surface.
  [[nodiscard]] float diagonal_m(std::size_t mover) const noexcept;
  /// Width of the rim that penumbra and texels add to a shadow so far behind the body.
  [[nodiscard]] float rim_m(std::size_t mover, float way_m) const noexcept;
  /// Middle of the body's box, rel.
  [[nodiscard]] glm::vec3 middle_m(std::size_t mover,
                                   const MoverPlacement& placement) const noexcept;
  /// Corners of the body's box, rel.
  [[nodiscard]] std::array<glm::vec3, 8> corners_m(std::size_t mover,
                                                   const MoverPlacement& placement) const noexcept;
  /// Height of the body's box in the axes of `placement`, above its origin.
  [[nodiscard]] float top_m(std::size_t mover, const MoverPlacement& placement) const noexcept;

 private:
  struct Tile {
    scene::Aabb box_m;
    glm::vec3 to_sun{0.0F};  ///< body axes, like the next two
    glm::vec3 across{1.0F, 0.0F, 0.0F};
    glm::vec3 along{0.0F, 1.0F, 0.0F};
    glm::vec2 corner_m{0.0F};
    glm::vec2 half{0.0F};
    float texel_m = 1.0F;
    float mean_m = 0.0F;
    std::uint32_t revision = 0;
    std::vector<float> depth_m;
    /// The greatest depth of a texel and the eight around it; -kOpenM: some are
    /// open; kOpenM: all are.
    std::vector<float> around_m;
  };
  static void look_around(Tile& tile) noexcept;

  std::vector<Tile> tiles_;
  std::vector<MoverPlacement> alone_;  ///< scratch: all but one away
  int looks_left_ = kLooksPerFrame;
};

/// Box on a level plane around all that a silhouette may shade of it, penumbra included.
struct ShadedBox {
  glm::vec2 low_m;
  glm::vec2 high_m;
};
[[nodiscard]] ShadedBox shaded_box(const PlacedSilhouette& silhouette, float plane_m) noexcept;

/// Radius of the penumbra's disc in texels, at least what smooths the texels' own edges.
[[nodiscard]] float penumbra_texels(const PlacedSilhouette& silhouette, float depth_m) noexcept;

}  // namespace emit::renderer
