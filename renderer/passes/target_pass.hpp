// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <glm/ext/vector_uint4.hpp>
#include <span>
#include <vector>

#include "draw/target_window.hpp"
#include "emit/physics/error.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"
#include "passes/gas_pass.hpp"
#include "passes/geometry_pass.hpp"
#include "passes/radiance_pass.hpp"
#include "shared/target_params.glsl.h"

namespace emit::renderer {

/// Small targets: every window of DrawLists::find_targets() is drawn into its tile of a geometry
/// buffer, its samples get their radiance, and their average over each pixel replaces the share of
/// the pixel that the target covers (passes/target_rows.comp, passes/target_pixels.comp). The work
/// is that of the windows' samples and pixels. Without targets nothing is done.
/// Call order of a frame: prepare(), upload(), draw_geometry(), resolve().
/// Thread: the one that owns the GL context. Real time: create() is setup only, the rest is
/// RT-safe.
class TargetPass {
 public:
  /// Compiles the pass for `planes`, of which the first are those of the bands; with `coverage` one
  /// plane follows that holds the share of targets. `setup` is that of the camera's geometry pass.
  /// Errors: gpu (names the shader or the render target).
  [[nodiscard]] static physics::Result<TargetPass> create(const gl::EglContext& context,
                                                          std::uint32_t planes, bool coverage,
                                                          GeometryPass::Setup setup);
  /// Takes the windows of a frame. `frame` is complete.
  /// @pre At most EMIT_MAX_TARGETS windows.
  void prepare(std::span<const TargetWindow> windows, const ViewVolume& view,
               const gpu::FrameParams& frame) noexcept;
  void upload() const noexcept;
  /// Draws the geometry of the windows.
  void draw_geometry(const SceneVertexArrays& vertices, const DrawLists& lists,
                     const gl::Buffer& records) const noexcept;
  /// Returns the parameters of the frame as the windows of prepare() see it, in their order.
  [[nodiscard]] const gpu::FrameParams& window_frame(std::size_t target) const noexcept {
    return frames_[target].params;
  }
  [[nodiscard]] std::size_t windows() const noexcept { return params_.count; }
  /// Adds the targets to the planes of `output`, which starts with them; counters of flagged pixels
  /// lie from `stats_offset` on. `gas`, if there is any, is drawn over the samples. `frame_buffer`
  /// holds the parameters of the frame. Afterwards frame, output and geometry are bound as the
  /// radiance pass of the windows needs them.
  void resolve(const RadiancePass& radiance, const GasPass* gas, const gl::Buffer& frame_buffer,
               const gl::Buffer& output, std::size_t stats_offset) const noexcept;

 private:
  /// Parameters of the frame as a window sees it, padded to an offset that every device accepts.
  struct alignas(256) WindowFrame {
    gpu::FrameParams params;
  };

  gl::Program rows_program_;
  gl::Program pixels_program_;
  std::vector<GeometryPass> geometry_;  ///< one; it has no empty state
  gl::Buffer samples_;                  ///< planes of the samples of all windows
  gl::BufferTexture samples_view_;
  gl::Buffer rows_;  ///< sums over rows of samples
  gl::BufferTexture rows_view_;
  gl::Buffer frames_buffer_;
  gl::Buffer params_buffer_;
  gl::Buffer stats_buffer_;
  std::array<WindowFrame, EMIT_MAX_TARGETS> frames_{};
  std::array<GeometryPass::View, EMIT_MAX_TARGETS> views_{};
  gpu::TargetsParams params_{};
  glm::uvec2 groups_{0};  ///< columns of pixels, and rows of pixels, of the largest window
};

}  // namespace emit::renderer
