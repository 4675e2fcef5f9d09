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
#include "draw/camera_setup.hpp"
#include "passes/shade_tiles.hpp"
#include "shared/shade_params.glsl.h"
#include "surface/run/cached_surface.hpp"

namespace emit::renderer {

/// Shade of entities by pixel, between geometry and radiance: only where pages and shadows lie in
/// the picture. Owner: CachedStage. Real time: all but create() and resize() RT-safe.
class ShadePass {
 public:
  /// `software`: the device is a CPU.
  [[nodiscard]] static physics::Result<ShadePass> create(std::size_t entities, bool software);
  /// For another surface.
  void begin(const ShadePages& pages);

  /// What a frame needs, from the surface as it is advanced to that.
  void prepare(CachedSurface& surface, const glm::dvec3& camera_world_m, const CameraSetup& camera,
               const gpu::FrameParams& frame) noexcept;
  void upload(const CachedSurface& surface) noexcept;
  void dispatch() const noexcept;

 private:
  explicit ShadePass(std::size_t entities);
  void prepare_pages(const ShadePages& shade, const glm::dvec3& relworld_from_rel_m,
                     const CameraSetup& camera, const gpu::FrameParams& frame) noexcept;
  void prepare_silhouettes(CachedSurface& surface, const glm::dvec3& relworld_from_rel_m,
                           const CameraSetup& camera, const gpu::FrameParams& frame) noexcept;

  gl::Program program_;
  std::uint32_t rows_ = 1;   ///< of groups of pixels, done by one
  gl::Texture pages_;        ///< RGBA32F, a layer each
  gl::Texture tops_;         ///< R32F, a layer each
  gl::Texture silhouettes_;  ///< R32F, a layer each
  gl::Buffer response_;      ///< by material, 4 floats
  gl::BufferTexture response_table_;
  gpu::ShadeParams params_{};
  std::vector<gpu::PageParams> page_params_;
  std::vector<gpu::SilhouetteParams> silhouette_params_;
  ShadeTiles tiles_;
  gl::Buffer params_buffer_;
  gl::Buffer page_buffer_;
  gl::BufferTexture page_table_;
  gl::Buffer silhouette_buffer_;
  gl::BufferTexture silhouette_table_;
  gl::Buffer tile_buffer_;
  gl::BufferTexture tile_table_;
  gl::Buffer list_buffer_;
  gl::BufferTexture list_table_;
  std::vector<std::uint32_t> sent_;  ///< by entity: revision of the silhouette on the device
};

}  // namespace emit::renderer
