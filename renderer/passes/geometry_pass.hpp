// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>
#include <glm/ext/vector_uint4.hpp>
#include <span>

#include "draw/draw_lists.hpp"
#include "emit/physics/error.hpp"
#include "gl/egl_context.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"
#include "passes/scene_vertex_arrays.hpp"

namespace emit::renderer {

/// Geometry buffer of the visible surface (part 1 of the paper). It holds linear depth, normal,
/// material and object in three textures, or everything that the radiance pass needs of thermal
/// samples. See passes/geometry.vert and passes/geometry.frag.
/// Thread: the one that owns the GL context. Real time: create() is setup only, the rest is
/// RT-safe.
class GeometryPass {
 public:
  /// Content of the geometry buffer.
  enum class Content {
    normals,              ///< boresight distance, normal, material and object
    samples,              ///< depth, material and the thermal state of the samples
    samples_and_objects,  ///< samples and object
  };
  /// Shade that vertices of samples bring along (SceneVertexArrays::read_shade).
  enum class Shade : std::uint8_t { none, of_entities };
  /// Purpose of a geometry buffer.
  struct Setup {
    std::uint32_t width_px = 0;
    std::uint32_t height_px = 0;
    Content content = Content::normals;
    Shade shade = Shade::none;
    std::uint32_t bands = 1;  ///< of the incoming radiance that samples have
    bool normal = false;      ///< samples have normals too, because something is glossy
    bool seen = false;        ///< vertices of samples have SceneVertexArrays::read_seen
    bool clutter = false;     ///< some materials vary: vertices have SceneVertexArrays::read_twins
  };
  /// Compiles the pass and makes the geometry buffer for images of up to the size of `setup`.
  /// Errors: gpu (names the shader or the render target). @pre 1 <= setup.bands <= EMIT_MAX_BANDS
  [[nodiscard]] static physics::Result<GeometryPass> create(const gl::EglContext& context,
                                                            const Setup& setup);
  /// One view and its place in the geometry buffer.
  struct View {
    CommandRange single_sided;  ///< parts of the camera's draws
    CommandRange double_sided;
    glm::uvec4 image_px{0};   ///< pixels of the buffer that the view covers
    glm::uvec4 window_px{0};  ///< pixels that are drawn; the others stay as they are
  };
  /// Draws views of `lists`. `records` holds the records of `lists` on the device.
  void draw(const SceneVertexArrays& vertices, const DrawLists& lists, const gl::Buffer& records,
            std::span<const View> views) const noexcept;
  /// Binds the geometry buffer to its texture units, and the texture of samples to
  /// EMIT_IMG_SURFACE.
  void bind_textures() const noexcept;

 private:
  /// Makes the window of a view empty.
  void clear(const View& view) const noexcept;

  gl::Program program_;
  gl::Texture depth_m_;
  gl::Texture normal_;
  gl::Texture ids_;
  gl::Texture surface_;   ///< state of samples as passes/surface_texel.glsl packs it
  gl::Texture incoming_;  ///< radiance that arrives at samples, by band
  gl::Texture clutter_;   ///< place in the clutter's field, see passes/clutter.glsl
  gl::Texture depth_buffer_;
  gl::Framebuffer framebuffer_;
  bool sampled_ = false;
  bool software_ = false;
  threads::SoftwareThreads threads_;
};

}  // namespace emit::renderer
