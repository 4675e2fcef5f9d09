// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_uint2.hpp>

#include "emit/scene/scene_desc.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"

/// Paper parts 2, 4 and 5: full-screen work in compute shaders of 8 x 8 pixels. Storage blocks are
/// bound by the renderer; each pass binds the textures and images it owns. Where the pixels begin
/// is in FrameParams, format_window_px and picture_window_px; how many they are, in the calls.
namespace emit::renderer {

/// Of groups of 8 x 8 pixels, one above the other, that one does in turn: on a CPU to begin a
/// group, and to fetch its uniforms, takes as long as some of its pixels.
[[nodiscard]] constexpr std::uint32_t pixel_rows(bool software) noexcept {
  return software ? 8 : 1;
}
/// What shaders know these by.
[[nodiscard]] gl::Define rows_define(std::uint32_t rows);

class OcclusionPass {
 public:
  [[nodiscard]] static physics::Result<OcclusionPass> create(std::uint32_t width_px,
                                                             std::uint32_t height_px);
  void dispatch(const glm::uvec2& size_px) const noexcept;
  void bind_texture() const noexcept;

 private:
  gl::Program program_;
  gl::Texture sky_frac_;
};

class ThermalPass {
 public:
  [[nodiscard]] static physics::Result<ThermalPass> create(std::uint32_t width_px,
                                                           std::uint32_t height_px,
                                                           const scene::ThermalOptions& options);
  /// Advances every visible point over the interval bound as EMIT_BIND_STEP.
  void dispatch_step(const glm::uvec2& size_px) const noexcept;
  /// Only stores the shade of that interval, for reflected sunlight.
  void dispatch_sun_only(const glm::uvec2& size_px) const noexcept;
  void bind_textures() const noexcept;

 private:
  void dispatch(const gl::Program& program, const glm::uvec2& size_px) const noexcept;

  gl::Program step_program_;
  gl::Program sun_program_;
  gl::Texture state_;  ///< two modes (foster: four), offsets in K
  GLenum state_format_ = GL_RG32F;
  gl::Texture sun_now_;  ///< visible share of the sun's disc at the frame's instant
};

/// What a scenario asks of the radiance pass; it is compiled for nothing else.
struct RadianceContent {
  std::uint32_t bands = 0;
  std::uint32_t air_terms = 0;  ///< bit per band: its air is a sum of exponential terms
  std::uint32_t air_table = 0;  ///< bit per band: its air is a table
  std::uint32_t terms = 0;      ///< most terms of a band
  std::uint32_t outputs = 0;    ///< EMIT_OUTPUT_* planes after those of the bands
};

class RadiancePass {
 public:
  [[nodiscard]] static physics::Result<RadiancePass> create(const scene::ThermalOptions& options,
                                                            const RadianceContent& content,
                                                            bool software);
  void dispatch(const glm::uvec2& size_px) const noexcept;

 private:
  gl::Program program_;
  std::uint32_t rows_ = 1;  ///< pixel_rows()
};

/// Brings what was rendered with fewer pixels to the size of the picture.
class EnlargePass {
 public:
  /// `planes`: of radiance and others, of up to `rendered_px` pixels each.
  [[nodiscard]] static physics::Result<EnlargePass> create(std::uint32_t bands,
                                                           std::uint32_t planes,
                                                           std::size_t rendered_px);
  /// Where the passes before write to.
  [[nodiscard]] const gl::Buffer& planes() const noexcept { return planes_; }
  void dispatch(const glm::uvec2& size_px) const noexcept;

 private:
  gl::Program program_;
  gl::Buffer planes_;
  gl::BufferTexture view_;
};

}  // namespace emit::renderer
