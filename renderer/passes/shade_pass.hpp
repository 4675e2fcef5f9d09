// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "draw/camera_setup.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"
#include "passes/shade_tiles.hpp"
#include "shared/shade_params.glsl.h"
#include "surface/run/cached_surface.hpp"

namespace emit::renderer {

/// Shade of entities per pixel, between the geometry pass and the radiance pass. It works only in
/// the part of the image that exposure tiles and entity shadow depth maps reach. See
/// passes/shade.comp. Owner: CachedStage. Thread: the one that owns the GL context. Real time:
/// create() and begin() are setup only, the rest is RT-safe.
class ShadePass {
 public:
  /// Compiles the pass and allocates the textures for `entities` entities. `software` says that the
  /// device is a CPU. Errors: gpu (names the shader).
  /// @pre entities >= 1
  [[nodiscard]] static physics::Result<ShadePass> create(std::size_t entities, bool software);
  /// Reads the response of the materials of a new surface.
  void begin(const ExposureTiles& tiles);

  /// Sets up the parameters of a frame from the surface, which has been advanced to the frame.
  /// Fills only memory of the CPU.
  void prepare(CachedSurface& surface, const glm::dvec3& camera_world_m, const CameraSetup& camera,
               const gpu::FrameParams& frame) noexcept;
  /// Sends the parameters, and the exposure tiles and shadow depth maps that changed, to the
  /// device.
  void upload(const CachedSurface& surface) noexcept;
  /// Applies the shade to the geometry buffer.
  void dispatch() const noexcept;

 private:
  explicit ShadePass(std::size_t entities);
  void prepare_exposure_tiles(const ExposureTiles& shade, const glm::dvec3& relworld_from_rel_m,
                              const CameraSetup& camera, const gpu::FrameParams& frame) noexcept;
  void prepare_entity_shadows(CachedSurface& surface, const glm::dvec3& relworld_from_rel_m,
                              const CameraSetup& camera, const gpu::FrameParams& frame) noexcept;

  gl::Program program_;
  std::uint32_t rows_ = 1;      ///< blocks of 8 x 8 pixels per work group
  gl::Texture exposure_tiles_;  ///< RGBA32F, one layer per exposure tile: shade by mode
  gl::Texture tops_;  ///< R32F, one layer per exposure tile: height at which the shade began, m
  gl::Texture shadow_maps_;  ///< R32F, one layer per entity: depth, m
  gl::Buffer response_;      ///< weights of the four modes of each material, K
  gl::BufferTexture response_table_;
  gpu::ShadeParams params_{};
  std::vector<gpu::ExposureTileParams> exposure_tile_params_;
  std::vector<gpu::EntityShadowParams> entity_shadow_params_;
  ShadeTiles tiles_;
  gl::Buffer params_buffer_;
  gl::Buffer exposure_tile_buffer_;
  gl::BufferTexture exposure_tile_table_;
  gl::Buffer entity_shadow_buffer_;
  gl::BufferTexture entity_shadow_table_;
  gl::Buffer tile_buffer_;
  gl::BufferTexture tile_table_;
  gl::Buffer list_buffer_;
  gl::BufferTexture list_table_;
  std::vector<std::uint32_t> sent_;  ///< revision of each entity's depth map on the device
};

}  // namespace emit::renderer
