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

/// An entity shadow depth map at one pose of its entity. It gives the place on the map of a point p
/// (rel axes, m) along the sun's rays.
struct PlacedShadowMap {
  glm::vec4 column;      ///< dot with (p, 1) gives texels from the first column
  glm::vec4 row;         ///< dot with (p, 1) gives texels from the first row
  glm::vec4 depth_m;     ///< dot with (p, 1) gives m away from the sun, from the body's origin
  float mean_m = 0.0F;   ///< mean depth of the texels that are not open
  float texel_m = 1.0F;  ///< width of a texel
  glm::vec2 half{0.0F};  ///< texels from the map's centre to the outermost ones of the entity
};

/// Entity shadow depth maps. Each is a square of texels across the direction of the sun. A texel
/// holds the depth of the entity's surface that is farthest from the sun, so every point deeper
/// than that is in the shade.
///
/// Owner: CachedSurface. Thread: the renderer's; computes on all cores. Real time: everything but
/// the constructor is RT-safe. look() sends 16,384 rays to make a map anew, for at most
/// kLooksPerFrame maps per frame.
class EntityShadowMaps {
 public:
  /// Texels along a side of a map.
  static constexpr std::uint32_t kSide = 128;
  /// Depth of open texels, where nothing shades.
  static constexpr float kOpenM = 1e30F;

  EntityShadowMaps() = default;
  /// Takes memory for one map per entity. `bounds_m` holds the box of each entity in the axes of
  /// its body.
  explicit EntityShadowMaps(std::span<const scene::Aabb> bounds_m);

  /// Largest radius, in texels, around a place in a texel for which the texel and its eight
  /// neighbours answer alone.
  static constexpr float kAround = 1.0F;

  /// Number of maps that one frame may make anew.
  static constexpr int kLooksPerFrame = 8;
  /// Turn of an entity towards the sun, in rad, after which its map is made anew: for images
  /// (kSharpRad), and for shade that is smeared over a step of time (kSmearedRad).
  static constexpr float kSharpRad = 4e-3F;
  static constexpr float kSmearedRad = 2e-2F;

  [[nodiscard]] std::size_t size() const noexcept { return maps_.size(); }
  /// Allows kLooksPerFrame new maps again.
  void begin_frame() noexcept { looks_left_ = kLooksPerFrame; }
  /// Makes the map anew if the unit vector to the sun in body axes has turned by `most_turn_rad` or
  /// more since the map was made. Returns false if the frame may make no more maps and the turn is
  /// ten times that or more.
  bool look(std::size_t entity, const glm::vec3& to_sun_body, float most_turn_rad,
            const CasterRays& rays, threads::WorkerPool& workers) noexcept;
  /// Places the map of an entity at a pose. `to_sun` is the unit vector to the sun, rel axes.
  /// @pre look() for about this direction
  [[nodiscard]] PlacedShadowMap place(std::size_t entity, const EntityPlacement& placement,
                                      const glm::vec3& to_sun) const noexcept;
  /// Shaded share of a disc of `radius_texels` around a place on the map, at a depth in m. Only
  /// every `stride`th of the EMIT_SHADE_TAPS taps from `first` on is read. The sum over all first <
  /// stride is the share of all taps.
  [[nodiscard]] float shaded_frac(std::size_t entity, float column, float row, float depth_m,
                                  float radius_texels, std::uint32_t first = 0,
                                  std::uint32_t stride = 1) const noexcept;
  /// Depth in m of the entity's surface at a place on the map. It is the mean depth if the texel is
  /// open.
  [[nodiscard]] float caster_m(std::size_t entity, float column, float row) const noexcept;
  /// Depths of a map, kSide rows of kSide texels, in m.
  [[nodiscard]] std::span<const float> depths_m(std::size_t entity) const noexcept {
    return maps_[entity].depth_m;
  }
  /// Number of times that the map was made anew.
  [[nodiscard]] std::uint32_t revision(std::size_t entity) const noexcept {
    return maps_[entity].revision;
  }
  /// Diagonal of the entity's box in m; 0 if the entity has no surface.
  [[nodiscard]] float diagonal_m(std::size_t entity) const noexcept;
  /// Width in m of the rim that penumbra and texels add to a shadow `way_m` behind the entity.
  [[nodiscard]] float rim_m(std::size_t entity, float way_m) const noexcept;
  /// Centre of the entity's box, rel.
  [[nodiscard]] glm::vec3 middle_m(std::size_t entity,
                                   const EntityPlacement& placement) const noexcept;
  /// Corners of the entity's box, rel.
  [[nodiscard]] std::array<glm::vec3, 8> corners_m(std::size_t entity,
                                                   const EntityPlacement& placement) const noexcept;
  /// Height in m of the highest corner of the entity's box above its origin, in the axes of
  /// `placement`.
  [[nodiscard]] float top_m(std::size_t entity, const EntityPlacement& placement) const noexcept;

 private:
  /// The map of one entity.
  struct Map {
    scene::Aabb box_m;
    glm::vec3 to_sun{0.0F};  ///< body axes, like the next two vectors
    glm::vec3 across{1.0F, 0.0F, 0.0F};
    glm::vec3 along{0.0F, 1.0F, 0.0F};
    /// Corner of the first texel, along `across` and `along`.
    glm::vec2 corner_m{0.0F};
    glm::vec2 half{0.0F};
    float texel_m = 1.0F;
    float mean_m = 0.0F;
    std::uint32_t revision = 0;
    std::vector<float> depth_m;
    /// Greatest depth of a texel and the eight around it. It is kOpenM if all nine are open, and
    /// -kOpenM if some are.
    std::vector<float> around_m;
  };
  /// Fills around_m.
  static void look_around(Map& map) noexcept;

  std::vector<Map> maps_;
  std::vector<EntityPlacement> alone_;  ///< scratch: placements with at most one entity present
  int looks_left_ = kLooksPerFrame;
};

/// Box on a level plane around everything there that an entity may shade, penumbra included.
struct ShadedBox {
  glm::vec2 low_m;
  glm::vec2 high_m;
};
[[nodiscard]] ShadedBox shaded_box(const PlacedShadowMap& shadow_map, float plane_m) noexcept;

/// Radius in texels of the penumbra's disc at a depth in m. It is at least as large as needed to
/// smooth the edges of the texels.
[[nodiscard]] float penumbra_texels(const PlacedShadowMap& shadow_map, float depth_m) noexcept;

}  // namespace emit::renderer
