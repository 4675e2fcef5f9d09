// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "gl/objects.hpp"
#include "gl/program.hpp"
#include "passes/frame_setup.hpp"
#include "shared/shade_params.glsl.h"
#include "surface/cached_surface.hpp"

namespace emit::renderer {

/// Shade of entities by pixel, between geometry and radiance: only where pages and shadows lie in
/// the picture. Owner: CachedStage. Real time: all but create() and resize() RT-safe.
class ShadePass {
 public:
  [[nodiscard]] static physics::Result<ShadePass> create(std::size_t entities);
  /// For another surface.
  void begin(const ShadePages& pages);

  /// What a frame needs, from the surface as it is advanced to that.
  void prepare(CachedSurface& surface, const glm::dvec3& camera_world_m, const CameraSetup& camera,
               const gpu::FrameParams& frame) noexcept;
  void upload(const CachedSurface& surface) noexcept;
  void dispatch() const noexcept;

 private:
  /// At offsets that every device allows.
  struct alignas(256) PageRecord {
    gpu::PageParams params;
  };
  struct alignas(256) SilhouetteRecord {
    gpu::SilhouetteParams params;
  };

  void prepare_pages(const ShadePages& shade, const glm::dvec3& relworld_from_rel_m,
                     const CameraSetup& camera, const gpu::FrameParams& frame) noexcept;
  void prepare_silhouettes(CachedSurface& surface, const glm::dvec3& relworld_from_rel_m,
                           const CameraSetup& camera, const gpu::FrameParams& frame) noexcept;

  gl::Program pages_program_;
  gl::Program silhouettes_program_;
  gl::Texture pages_;        ///< RGBA32F, a layer each
  gl::Texture tops_;         ///< R32F, a layer each
  gl::Texture silhouettes_;  ///< R32F, a layer each
  gl::Buffer response_;      ///< by material, 4 floats
  gl::BufferTexture response_table_;
  gl::Buffer page_buffer_;
  gl::Buffer silhouette_buffer_;
  std::vector<PageRecord> page_records_;
  std::vector<SilhouetteRecord> silhouette_records_;
  std::vector<std::uint32_t> sent_;  ///< by entity: revision of the silhouette on the device
};

}  // namespace emit::renderer
