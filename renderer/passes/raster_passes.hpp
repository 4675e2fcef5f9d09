// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>
#include <glm/ext/vector_uint4.hpp>
#include <span>

#include "gl/egl_context.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"
#include "draw/draw_lists.hpp"
#include "draw/scene_buffers.hpp"

namespace emit::renderer {

/// Vertex arrays that read SceneBuffers: all of it for the camera, positions and one LightRecord
/// per instance for shadow maps.
class SceneVertexArrays {
 public:
  SceneVertexArrays(const SceneBuffers& scene, const gl::Buffer& light_records);
  void bind_view() const noexcept { glBindVertexArray(view_.id()); }
  void bind_light() const noexcept { glBindVertexArray(light_.id()); }
  /// Where the camera's draws read the samples' two nodes of time from: two floats by vertex each.
  void read_nodes(const gl::Buffer& before, const gl::Buffer& after) const noexcept;
  /// And what entities have shaded: a float by vertex.
  void read_shade(const gl::Buffer& shade) const noexcept;

 private:
  gl::VertexArray view_;
  gl::VertexArray light_;
};

/// Paper part 1: linear depth, normal, material index and object id of the visible surface, in
/// three textures; or all that the radiance pass needs of its samples.
class GeometryPass {
 public:
  /// What it keeps of the visible surface.
  enum class Content {
    normals,  ///< distance, normal, material and object
    samples,  ///< depth, material and thermal state, which comes from the surface's samples
    samples_and_objects,  ///< the object as well
  };
  /// Vertices of samples come with what entities have shaded (SceneVertexArrays::read_shade).
  enum class Shade : std::uint8_t { none, of_entities };
  [[nodiscard]] static physics::Result<GeometryPass> create(const gl::EglContext& context,
                                                            std::uint32_t width_px,
                                                            std::uint32_t height_px,
                                                            Content content, Shade shade);
  /// Draws two parts of what `lists` found in view; `records` holds its records. Of the `size_px`
  /// only the window is touched.
  void draw(const SceneVertexArrays& vertices, const DrawLists& lists, const gl::Buffer& records,
            CommandRange single_sided, CommandRange double_sided, const glm::uvec2& size_px,
            const glm::uvec4& window_px) const noexcept;
  /// Binds what it drew to the texture units, and samples to EMIT_IMG_SURFACE.
  void bind_textures() const noexcept;

 private:
  gl::Program program_;
  gl::Texture depth_m_;
  gl::Texture normal_;
  gl::Texture ids_;
  gl::Texture surface_;  ///< of samples: passes/surface_texel.glsl
  gl::Texture depth_buffer_;
  gl::Framebuffer framebuffer_;
  bool sampled_ = false;
  bool software_ = false;
  threads::SoftwareThreads threads_;
};

/// Paper part 3: depth seen from the sun, one layer per cascade, drawn anew for every step.
class ShadowPass {
 public:
  [[nodiscard]] static physics::Result<ShadowPass> create(std::uint32_t size_px,
                                                          std::uint32_t layers);
  /// Draws into the layer of `cascade`.
  void draw(const SceneVertexArrays& vertices, std::uint32_t cascade,
            std::span<const LightCommand> commands) const noexcept;
  void bind_texture() const noexcept;

 private:
  gl::Program program_;
  gl::Texture maps_;
  gl::Framebuffer framebuffers_[4];
  GLsizei size_px_ = 0;
};

}  // namespace emit::renderer
