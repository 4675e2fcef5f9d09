// SPDX-License-Identifier: Apache-2.0
// EnlargePass against bilinear interpolation in double.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "gl/egl_context.hpp"
#include "gl/objects.hpp"
#include "passes/enlarge_pass.hpp"
#include "shared/bindings.glsl.h"
#include "shared/frame_params.glsl.h"

namespace emit::test {
namespace {

constexpr std::uint32_t kBands = 2;
constexpr std::uint32_t kPlanes = 3;
/// Value of pixels that the pass must not write.
constexpr float kUntouched = -7.0F;

/// Sizes of both images and the window of the output image.
struct Case {
  glm::uvec2 rendered_px;
  glm::uvec2 output_px;
  glm::uvec4 window_px;
};

/// Rendered planes with values that differ from pixel to pixel.
class Planes {
 public:
  explicit Planes(const glm::uvec2& size_px) : size_px_(size_px) {
    for (std::uint32_t i = 0; i < kPlanes * size_px.x * size_px.y; ++i) {
      values_.push_back(static_cast<float>(1.0 + std::fmod(37.0 * i + 0.1 * i * i, 101.0)));
    }
  }
  [[nodiscard]] std::span<const float> values() const { return values_; }
  /// Value of a pixel; outside the image that of the nearest pixel.
  [[nodiscard]] double at(std::uint32_t plane, int x, int y) const {
    const auto inside = [](int at, std::uint32_t size) {
      return static_cast<std::size_t>(std::clamp(at, 0, static_cast<int>(size) - 1));
    };
    return values_[(plane * size_px_.y + inside(y, size_px_.y)) * size_px_.x +
                   inside(x, size_px_.x)];
  }
  /// Bilinear value at a position in pixels of this image. Centres of pixels lie at halves.
  [[nodiscard]] double between(std::uint32_t plane, const glm::dvec2& place) const {
    const glm::dvec2 low(std::floor(place.x - 0.5), std::floor(place.y - 0.5));
    const glm::dvec2 part = place - 0.5 - low;
    const auto x = static_cast<int>(low.x);
    const auto y = static_cast<int>(low.y);
    return std::lerp(std::lerp(at(plane, x, y), at(plane, x + 1, y), part.x),
                     std::lerp(at(plane, x, y + 1), at(plane, x + 1, y + 1), part.x), part.y);
  }
  /// Value of the pixel that holds a position.
  [[nodiscard]] double nearest(std::uint32_t plane, const glm::dvec2& place) const {
    return at(plane, static_cast<int>(place.x), static_cast<int>(place.y));
  }

 private:
  glm::uvec2 size_px_;
  std::vector<float> values_;
};

TEST(EnlargePass, RadianceIsBilinearAndOtherPlanesAreTheNearestPixels) {
  auto context = gl::EglContext::create(-1, false);
  ASSERT_TRUE(context) << context.error().text;
  const std::vector<Case> cases = {
      {{33, 24}, {130, 97}, {0, 0, 130, 97}},     {{65, 49}, {130, 97}, {0, 0, 130, 97}},
      {{130, 97}, {130, 97}, {0, 0, 130, 97}},    {{1, 1}, {130, 97}, {0, 0, 130, 97}},
      {{33, 24}, {130, 97}, {61, 39, 128, 90}},   {{98, 73}, {130, 97}, {0, 16, 1, 17}},
      {{160, 128}, {640, 512}, {0, 0, 640, 512}},
  };
  for (const Case& each : cases) {
    SCOPED_TRACE(testing::Message() << each.rendered_px.x << " -> " << each.output_px.x);
    const std::uint32_t rendered = each.rendered_px.x * each.rendered_px.y;
    const std::uint32_t pixels = each.output_px.x * each.output_px.y;
    auto pass = renderer::EnlargePass::create(kBands, kPlanes, rendered);
    ASSERT_TRUE(pass) << pass.error().text;
    const Planes planes(each.rendered_px);
    const gl::Buffer from = gl::Buffer::from(planes.values());
    glCopyNamedBufferSubData(from.id(), pass->planes().id(), 0, 0,
                             static_cast<GLsizeiptr>(planes.values().size_bytes()));
    renderer::gpu::FrameParams frame{};
    frame.rendered_px = each.rendered_px;
    frame.rendered_plane_px = rendered;
    frame.output_px = each.output_px;
    frame.output_plane_px = pixels;
    frame.output_window_px = each.window_px;
    const gl::Buffer frame_buffer =
        gl::Buffer::from(std::span<const renderer::gpu::FrameParams>(&frame, 1));
    frame_buffer.bind_uniform(EMIT_BIND_FRAME);
    std::vector<float> enlarged(std::size_t{kPlanes} * pixels, kUntouched);
    const gl::Buffer output = gl::Buffer::from(std::span<const float>(enlarged));
    output.bind_storage(EMIT_BIND_OUTPUT);
    const glm::uvec4& window_px = each.window_px;
    pass->dispatch({window_px.z - window_px.x, window_px.w - window_px.y});
    glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
    glGetNamedBufferSubData(output.id(), 0, static_cast<GLsizeiptr>(output.bytes()),
                            enlarged.data());
    ASSERT_EQ(glGetError(), static_cast<GLenum>(GL_NO_ERROR));

    std::size_t wrong = 0;
    for (std::size_t i = 0; i < enlarged.size(); ++i) {
      const auto plane = static_cast<std::uint32_t>(i / pixels);
      const auto x = static_cast<std::uint32_t>(i % pixels % each.output_px.x);
      const auto y = static_cast<std::uint32_t>(i % pixels / each.output_px.x);
      const glm::dvec2 place =
          (glm::dvec2(x, y) + 0.5) * glm::dvec2(each.rendered_px) / glm::dvec2(each.output_px);
      const bool drawn = x >= window_px.x && x < window_px.z && y >= window_px.y && y < window_px.w;
      const double expected = !drawn           ? kUntouched
                              : plane < kBands ? planes.between(plane, place)
                                               : planes.nearest(plane, place);
      // The shader computes positions in float32: they are off by 1e-5 px, and pixels differ by up
      // to 101.
      if (!(std::abs(enlarged[i] - expected) <= 5e-3)) ++wrong;
    }
    EXPECT_EQ(wrong, 0U);
  }
}

}  // namespace
}  // namespace emit::test
