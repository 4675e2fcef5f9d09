// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "surface/model/drive_worth.hpp"
#include "surface/warm_up/surface_bend.hpp"
#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Decides which triangles are too coarse, and how much that matters. A triangle is halved
/// - down to some pixels everywhere, so that nothing slips between its corners unseen;
/// - where rays from points between its corners meet shade, or sun, that the corners know nothing
///   of;
/// - where its newest vertex is not what its parents interpolate to: the error of a linear
///   triangle is a quarter of its parent's;
/// - where the full surface faces elsewhere than its corners;
/// - near edges and feet of bodies, where heat moves along the surface;
/// - where sunlight fell on its corners unequally of late: an edge of a shadow runs through.
/// It is never halved below some pixels at the nearest place of the camera (one pixel where an edge
/// runs: of a shadow, or between temperatures far apart), and only for the first reason where no
/// place of the camera sees it. What lies in the field of view comes first. Small bodies are halved
/// as though they were some pixels wide, lest they be wrong as a whole; that comes last.
class SurfaceRefinement {
 public:
  /// `inputs` and `worth` must outlive it.
  SurfaceRefinement(const SurfaceInputs& inputs, const DriveWorth& worth, const RefineView& view,
                    const SurfaceModelOptions& options);

  /// Greatest need of a mesh's leaves, 0 where none is too coarse; and of those in the field of
  /// view.
  struct Most {
    float need = 0.0F;
    float in_view = 0.0F;
  };
  /// Looks at the leaves of `mesh` that are new since the last call. `of_mesh`: the patches that
  /// have it. Call it for each mesh in turn, after its vertices were sampled.
  Most judge(std::uint32_t mesh, const RefinedMesh& refined, std::span<const SurfacePatch> patches,
             std::span<const std::uint32_t> of_mesh);

  /// A leaf that is too coarse: the error there in tolerances times its width in pixels; a small
  /// share of that out of view. Wider ones than what is looked at everywhere come before all
  /// others.
  struct Need {
    std::uint32_t slot = 0;
    float need = 0.0F;
  };
  /// Leaves of `mesh`, as judged, that need more than `above`; replaces the contents.
  void list(std::uint32_t mesh, float above, std::vector<Need>& needs) const;
  /// Of these slots, those that stayed whole although they were to be halved need no more.
  void leave(std::uint32_t mesh, const RefinedMesh& refined, std::span<const std::uint32_t> slots);

 private:
  struct Judged;
  struct Eye {
    glm::vec3 rel_m{0.0F};
    glm::vec3 boresight{0.0F};
  };
  /// `body_m`: width of the whole body.
  [[nodiscard]] Judged need(const RefinedMesh& refined, std::uint32_t slot,
                            const SurfacePatch& patch, float body_m) const;
  [[nodiscard]] bool seen(const std::array<glm::vec3, 3>& corners_m, const RefinedMesh& refined,
                          std::uint32_t slot, const SurfacePatch& patch) const;
  /// Widths in pixels where they are greatest: of the longest edge; of a square as large as the
  /// triangle looks, from where the camera has it in view; and of that from anywhere. `finer`: by
  /// so much smaller pixels are as many as a small body is taken for.
  struct Width {
    float edge_px = 0.0F;
    float in_view_px = 0.0F;
    float anywhere_px = 0.0F;
    float finer = 1.0F;
  };
  [[nodiscard]] Width width(const std::array<glm::vec3, 3>& corners_m, float longest_m,
                            float body_m, std::span<const Eye> eyes) const noexcept;
  /// Range of temperature, K, where sunlight fell unequally on the corners of late; else 0.
  [[nodiscard]] float shadow_edge_k(const RefinedMesh& refined, std::uint32_t slot,
                                    const SurfacePatch& patch) const;
  /// What points between the corners make of it where the corners agree that the sun shone, or that
  /// it did not: greatest difference, K.
  [[nodiscard]] float missed_shade_k(const RefinedMesh& refined, std::uint32_t slot,
                                     const SurfacePatch& patch) const;

  const SurfaceInputs& in_;
  const DriveWorth& worth_;
  SurfaceBend bend_;
  std::vector<Eye> eyes_;
  /// By entity: what they are to it where its script brings it closest to the middle of their
  /// picture, as though it stayed where it is.
  std::vector<std::vector<Eye>> eyes_of_mover_;
  std::vector<float> body_m_;  ///< by instance: its width
  float pixel_rad_ = 1e-3F;
  float field_rad_ = 0.0F;
  float tolerance_k_ = 0.1F;
  RayOffsets offsets_;
  bool lateral_ = true;
  std::vector<float> diffusivity_m2_s_;  ///< by material
  std::size_t recent_ = 0;               ///< first of the intervals that count as lately
  /// By mesh, then slot: the node that was judged, and its need.
  struct Judged {
    std::uint32_t node = 0xffffffffU;
    float need = 0.0F;
    bool in_view = false;
    float finer_need = 0.0F;  ///< in the pixels that a small body is taken for
  };
  std::vector<std::vector<Judged>> judged_;
};

}  // namespace emit::renderer
