// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "surface/model/drive_sensitivity.hpp"
#include "surface/rays/hot_parts.hpp"
#include "surface/rays/interval_rays.hpp"
#include "surface/warm_up/surface_bend.hpp"
#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Judge of triangles: it decides which ones are too coarse, and how much that matters. A triangle
/// is halved
/// - while it is wider than some pixels, so that nothing slips between its corners unseen;
/// - if rays from points between its corners meet shade or sun that the corners do not know of;
/// - if its newest vertex differs from the mean of its parents by more than the tolerance allows;
/// - if the surface as loaded faces elsewhere than its corners;
/// - near edges and feet of bodies, because heat moves along the surface there;
/// - if sunlight fell on its corners unequally of late, because an edge of a shadow runs through;
/// - if an edge of a shadow will run through it at the instant of a planned frame.
///
/// A triangle is never halved below some pixels at the nearest place of the camera. The limit is
/// one pixel along edges of shadows and between temperatures far apart. If no place of the camera
/// sees the triangle, only the first reason counts. Triangles in the field of view come first.
/// Small bodies are halved as though they were some pixels wide, because an error there would
/// change the whole body; that comes last.
class SurfaceRefinement {
 public:
  /// Keeps references: `inputs` and `sensitivity` must outlive it.
  SurfaceRefinement(const SurfaceInputs& inputs, const DriveSensitivity& sensitivity,
                    const RefineView& view, const SurfaceModelOptions& options);

  /// Greatest need of a mesh's leaves, and of those in the field of view. It is 0 if none is too
  /// coarse. The leaves that are too coarse are counted in every instance.
  struct Most {
    float need = 0.0F;
    float in_view = 0.0F;
    std::size_t coarse_leaves = 0;
  };
  /// Judges the leaves of `mesh` that are new since the last call. `of_mesh` are the patches of its
  /// instances. Call it for each mesh in turn, after its vertices were sampled.
  Most judge(std::uint32_t mesh, const RefinedMesh& refined, std::span<const SurfacePatch> patches,
             std::span<const std::uint32_t> of_mesh);

  /// A leaf that is too coarse. Its need is its error in tolerances times its width in pixels; out
  /// of view a small share of that counts. Leaves wider than the limit for all triangles come
  /// before all others.
  struct Need {
    std::uint32_t slot = 0;
    float need = 0.0F;
  };
  /// Lists the leaves of `mesh` whose need is greater than `above`; replaces the contents of
  /// `needs`.
  void list(std::uint32_t mesh, float above, std::vector<Need>& needs) const;
  /// Sets the need of those slots to 0 that stayed whole although they were to be halved.
  void leave(std::uint32_t mesh, const RefinedMesh& refined, std::span<const std::uint32_t> slots);

 private:
  struct Judged;
  /// A place of the camera, rel axes.
  struct Eye {
    glm::vec3 rel_m{0.0F};
    glm::vec3 boresight{0.0F};
  };
  /// Need of a leaf on one patch. `body_m` is the width of the whole body in m.
  [[nodiscard]] Judged need(const RefinedMesh& refined, std::uint32_t slot,
                            const SurfacePatch& patch, float body_m) const;
  /// Returns true if rays from some place of the camera reach the triangle, or if it belongs to an
  /// entity.
  [[nodiscard]] bool seen(const std::array<glm::vec3, 3>& corners_m, const RefinedMesh& refined,
                          std::uint32_t slot, const SurfacePatch& patch) const;
  /// Greatest widths of a triangle in pixels over the places of the camera: of its longest edge, of
  /// a square as large as the triangle looks where the camera has it in view, and of that square
  /// from anywhere. `finer` is the factor by which a small body counts as larger than it is.
  struct Width {
    float edge_px = 0.0F;
    float in_view_px = 0.0F;
    float anywhere_px = 0.0F;
    float finer = 1.0F;
  };
  /// The corners are relative to `origin_m`, in the axes of rel.
  [[nodiscard]] Width width(const std::array<glm::vec3, 3>& corners_m, const glm::vec3& origin_m,
                            float longest_m, float body_m,
                            std::span<const Eye> eyes) const noexcept;
  /// Range of temperature of the corners, K, if sunlight fell unequally on them of late; else 0.
  [[nodiscard]] float shadow_edge_k(const RefinedMesh& refined, std::uint32_t slot,
                                    const SurfacePatch& patch) const;
  /// Greatest error, K, from shade or sun that only points between the corners meet. Intervals
  /// count in which the corners agree that the sun shone or that it did not.
  [[nodiscard]] float missed_shade_k(const RefinedMesh& refined, std::uint32_t slot,
                                     const SurfacePatch& patch) const;
  /// Greatest error, K, from the radiation of hot parts of entities that corners far apart do not
  /// meet.
  [[nodiscard]] float missed_heat_k(const std::array<glm::vec3, 3>& corners_m,
                                    const glm::vec3& normal) const;
  /// Returns true if the edge of a shadow of static geometry will run through the triangle at the
  /// instant of a planned frame.
  [[nodiscard]] bool shadow_edge_comes(const RefinedMesh& refined, std::uint32_t slot,
                                       const SurfacePatch& patch) const;

  const SurfaceInputs& in_;
  const DriveSensitivity& sensitivity_;
  SurfaceBend bend_;
  std::vector<Eye> eyes_;
  /// Places of the camera relative to each entity where its script brings it closest to the
  /// middle of the image, moved so that the entity may stay where it is. They look all around an
  /// entity that no script moves.
  std::vector<std::vector<Eye>> eyes_of_entity_;
  std::vector<float> body_m_;  ///< by instance: width of its body
  float pixel_rad_ = 1e-3F;
  float field_rad_ = 0.0F;
  float tolerance_k_ = 0.1F;
  bool lateral_ = true;
  /// Width of triangles at an edge, and distance from it up to which they grow; 0 where heat does
  /// not move along the surface.
  struct CreaseSize {
    float least_m = 0.0F;
    float reach_m = 0.0F;
  };
  std::vector<CreaseSize> crease_sizes_;  ///< by material
  HotParts hot_;                          ///< empty without exchange
  std::vector<std::size_t> hot_since_;    ///< intervals from which on they stand as they do
  std::size_t recent_ = 0;                ///< first interval that counts as recent
  std::vector<IntervalRays> coming_;      ///< rays to the sun at the instants of planned frames
  /// Judgement of a leaf: the node of the mesh that was judged, and its need.
  struct Judged {
    std::uint32_t node = 0xffffffffU;
    float need = 0.0F;
    bool in_view = false;
    float finer_need = 0.0F;  ///< need in the smaller pixels of a small body
  };
  /// Judgements by mesh, then slot.
  std::vector<std::vector<Judged>> judged_;
};

}  // namespace emit::renderer
