// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "gl/objects.hpp"
#include "gl/program.hpp"
#include "shared/frame_params.glsl.h"
#include "shared/gas_params.glsl.h"

namespace emit::renderer {

/// Samples along the side of a pixel: at most this many, and so many that the image of a puff has a
/// standard deviation of at least kGasSampleSigmas samples each way.
inline constexpr std::uint32_t kMostGasSamples = 8;
inline constexpr float kGasSampleSigmas = 1.5F;
/// Returns the least standard deviation of a puff's image, over all directions, in pixels.
[[nodiscard]] float gas_least_sigma_px(const glm::vec3& covariance_px2) noexcept;

/// Images that gas is drawn over: their tiles and parameters, made on the CPU.
class GasTiles {
 public:
  /// Reserves memory for an image of that size and for all small targets. Setup only.
  explicit GasTiles(const glm::uvec2& size_px);
  /// Forgets the images of the last frame. `puffs` are those of this frame, the nearest first.
  /// @pre puffs.size() <= EMIT_MAX_GAS_PUFFS
  void begin(std::span<const gpu::GasPuff> puffs,
             std::span<const glm::vec4, EMIT_MAX_BANDS> term_frac) noexcept;
  /// Adds the output image of a frame. It comes before the targets.
  void add_output(const gpu::FrameParams& frame) noexcept;
  /// Adds the samples of a small target. `window` describes them as the frame of their radiance.
  void add_target(const gpu::FrameParams& window) noexcept;

  [[nodiscard]] std::span<const gpu::GasPuff> puffs() const noexcept { return puffs_; }
  [[nodiscard]] std::span<const gpu::GasTile> tiles() const noexcept { return tiles_; }
  /// Largest number of tiles, of all images.
  [[nodiscard]] std::size_t capacity() const noexcept { return tiles_.capacity(); }
  /// An image and the number of its tiles.
  struct Image {
    gpu::GasImage params;
    std::uint32_t tiles = 0;
  };
  [[nodiscard]] std::span<const Image> images() const noexcept {
    return std::span(images_).first(count_);
  }
  /// Samples along the side of a pixel of the output image; 0: no gas reaches it. Not for frames.
  [[nodiscard]] std::uint32_t output_samples(const glm::uvec2& px) const noexcept;
  /// Parameters of the output image.
  [[nodiscard]] const gpu::GasImage& output() const noexcept { return images_.front().params; }

 private:
  void add(const gpu::GasImage& image) noexcept;
  std::vector<gpu::GasPuff> puffs_;
  std::array<glm::vec4, EMIT_MAX_BANDS> term_frac_{};
  std::array<Image, EMIT_MAX_TARGETS + 1> images_{};
  std::size_t count_ = 0;
  std::vector<gpu::GasTile> tiles_;
  std::vector<gpu::GasTile> grid_;      ///< of one image, row by row
  bool drawn_ = false;                  ///< some image has had tiles
  std::vector<std::uint32_t> touched_;  ///< of the grid, in the order of the first puff
};

/// Hot gas, smoke and flares over the finished image and over the samples of small targets
/// (passes/gas.comp). The work is that of the tiles that gas covers; without gas nothing is done.
/// Call order of a frame: tiles(), upload(), draw().
/// Thread: the one that owns the GL context. Real time: create() is setup only, the rest is
/// RT-safe.
class GasPass {
 public:
  struct Setup {
    std::uint32_t bands = 1;
    bool reversed_depth = true;  ///< false: the depth buffer holds boresight distances
    glm::uvec2 output_px{0};
  };
  /// Compiles the pass. Errors: gpu (names the shader).
  [[nodiscard]] static physics::Result<GasPass> create(const Setup& setup);

  [[nodiscard]] GasTiles& tiles() noexcept { return tiles_; }
  [[nodiscard]] const GasTiles& tiles() const noexcept { return tiles_; }
  /// Copies puffs and tiles of a frame to the device. @pre they are those of tiles()
  void upload() noexcept;
  /// Draws gas over an image: 0 is the output image, then come the targets in their order. Its
  /// planes are bound to EMIT_BIND_OUTPUT, its counters to EMIT_BIND_STATS, and its depth buffer
  /// is bound.
  void draw(std::size_t image) const noexcept;

 private:
  explicit GasPass(const Setup& setup);
  /// Parameters of an image, padded to an offset that every device accepts.
  struct alignas(256) PaddedImage {
    gpu::GasImage params;
  };
  gl::Program program_;
  GasTiles tiles_;
  std::array<PaddedImage, EMIT_MAX_TARGETS + 1> padded_{};
  gl::Buffer puff_buffer_;
  gl::BufferTexture puff_texels_;
  gl::Buffer tile_buffer_;
  gl::Buffer image_buffer_;
};

}  // namespace emit::renderer
