// SPDX-License-Identifier: Apache-2.0
#include "passes/target_pass.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/common.hpp>
#include <glm/ext/vector_double2.hpp>
#include <utility>

#include "draw/image_window.hpp"
#include "emit/physics/check.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::renderer {
namespace {

constexpr std::uint32_t kTilesAcross = 8;
constexpr std::uint32_t kTilesDown = EMIT_MAX_TARGETS / kTilesAcross;
static_assert(EMIT_MAX_TARGETS % kTilesAcross == 0);
constexpr glm::uvec2 kBufferSamples = EMIT_TARGET_SIDE * glm::uvec2(kTilesAcross, kTilesDown);
constexpr std::uint32_t kPlaneSamples = kBufferSamples.x * kBufferSamples.y;
// A window touches at most one pixel more than its size, rounded up.
static_assert(EMIT_TARGET_COLUMNS > scene::kMaxSmallTargetPx + 1);
/// Side of a work group of the two passes over pixels and rows.
constexpr std::uint32_t kGroup = 8;

/// First column and row of a tile in the buffer of all windows.
glm::uvec2 tile_at(std::size_t target) noexcept {
  const auto t = static_cast<std::uint32_t>(target);
  return EMIT_TARGET_SIDE * glm::uvec2(t % kTilesAcross, t / kTilesAcross);
}

}  // namespace

physics::Result<TargetPass> TargetPass::create(const gl::EglContext& context, std::uint32_t planes,
                                               bool coverage, GeometryPass::Setup setup) {
  const std::uint32_t bands = setup.bands;
  EMIT_CHECK_OP(bands, <=, planes);
  TargetPass pass;
  const std::vector<gl::Define> defines{{"EMIT_BANDS", fmt::format("{}u", bands)},
                                        {"EMIT_PLANES", fmt::format("{}u", planes)},
                                        {"EMIT_COVERAGE", coverage ? "1" : "0"}};
  auto rows = gl::Program::compute("passes/target_rows.comp", defines);
  if (!rows) return tl::unexpected(std::move(rows.error()));
  pass.rows_program_ = std::move(*rows);
  auto pixels = gl::Program::compute("passes/target_pixels.comp", defines);
  if (!pixels) return tl::unexpected(std::move(pixels.error()));
  pass.pixels_program_ = std::move(*pixels);
  setup.width_px = kBufferSamples.x;
  setup.height_px = kBufferSamples.y;
  setup.content = GeometryPass::Content::samples_and_objects;
  auto geometry = GeometryPass::create(context, setup);
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  pass.geometry_.push_back(std::move(*geometry));
  // Allocate the buffers for the largest number of targets.
  pass.samples_ = gl::Buffer(std::size_t{planes} * kPlaneSamples * sizeof(float), nullptr, 0);
  pass.samples_view_ = gl::BufferTexture(GL_R32F, pass.samples_);
  const std::size_t sums = std::size_t{EMIT_MAX_TARGETS} * EMIT_TARGET_SIDE * EMIT_TARGET_COLUMNS;
  pass.rows_ = gl::Buffer(sums * (bands + 2) * sizeof(float), nullptr, 0);
  pass.rows_view_ = gl::BufferTexture(GL_R32F, pass.rows_);
  pass.frames_buffer_ = gl::Buffer::dynamic(sizeof(pass.frames_));
  pass.params_buffer_ = gl::Buffer::dynamic(sizeof(pass.params_));
  pass.stats_buffer_ = gl::Buffer(sizeof(gpu::FrameStatsGpu), nullptr, 0);
  return pass;
}

void TargetPass::prepare(std::span<const TargetWindow> windows, const ViewVolume& view,
                         const gpu::FrameParams& frame) noexcept {
  EMIT_CHECK_OP(windows.size(), <=, std::size_t{EMIT_MAX_TARGETS});
  params_.count = static_cast<std::uint32_t>(windows.size());
  params_.samples_width = kBufferSamples.x;
  params_.samples_plane = kPlaneSamples;
  groups_ = glm::uvec2(0U);
  const glm::dvec2 image_px(frame.output_px);
  const glm::dvec2 half_tan(view.tan_half_h, view.tan_half_v);
  for (std::size_t t = 0; t < windows.size(); ++t) {
    const TargetWindow& window = windows[t];
    const glm::uvec2 first = tile_at(t);
    const glm::uvec4 tile(first, first + window.samples);
    views_[t] = {window.single_sided, window.double_sided, tile, tile};
    // Let the pixels of the frame be the samples of the tile.
    gpu::FrameParams& params = frames_[t].params;
    params = frame;
    params.sun_radius_px = 0.0F;  // samples that miss the target do not count
    params.moon_radius_px = 0.0F;
    params.rendered_px = kBufferSamples;
    params.rendered_plane_px = kPlaneSamples;
    params.rendered_window_px = tile;
    const glm::dvec2 sample_px = window.size_px() / glm::dvec2(window.samples);
    const glm::dvec2 tan_per_px = 2.0 * half_tan / image_px;
    params.ray_per_px = glm::vec2(tan_per_px * sample_px);
    params.ray_at_corner =
        glm::vec2(tan_per_px * (window.first_px - sample_px * glm::dvec2(first)) - half_tan);
    // Describe the pixels that the window touches.
    const glm::uvec2 first_px(glm::clamp(glm::floor(window.first_px), glm::dvec2(0.0), image_px));
    const glm::uvec2 end_px(glm::clamp(glm::ceil(window.end_px), glm::dvec2(0.0), image_px));
    const glm::uvec2 pixels = glm::min(end_px - first_px, glm::uvec2(EMIT_TARGET_COLUMNS));
    gpu::TargetParams& target = params_.targets[t];
    target.tile = glm::uvec4(first, window.samples);
    target.place_px = glm::uvec4(first_px, pixels);
    target.origin = glm::vec2((window.first_px - glm::dvec2(first_px)) / sample_px);
    target.per_px = glm::vec2(1.0 / sample_px);
    target.object = window.object + 1;
    groups_ = glm::max(groups_, pixels);
  }
}

void TargetPass::upload() const noexcept {
  if (params_.count == 0) return;
  frames_buffer_.upload(std::span(frames_).first(params_.count));
  params_buffer_.upload(std::span(&params_, 1));
}

void TargetPass::draw_geometry(const SceneVertexArrays& vertices, const DrawLists& lists,
                               const gl::Buffer& records) const noexcept {
  if (params_.count == 0) return;
  geometry_.front().draw(vertices, lists, records, std::span(views_).first(params_.count));
}

void TargetPass::resolve(const RadiancePass& radiance, const GasPass* gas,
                         const gl::Buffer& frame_buffer, const gl::Buffer& output,
                         std::size_t stats_offset) const noexcept {
  if (params_.count == 0) return;
  // Compute the radiance of all samples.
  const std::uint32_t zero = 0;
  glClearNamedBufferData(stats_buffer_.id(), GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &zero);
  geometry_.front().bind_textures();
  samples_.bind_storage(EMIT_BIND_OUTPUT);
  stats_buffer_.bind_storage(EMIT_BIND_STATS);
  for (std::uint32_t t = 0; t < params_.count; ++t) {
    frames_buffer_.bind_uniform(EMIT_BIND_FRAME, t * sizeof(WindowFrame), sizeof(gpu::FrameParams));
    radiance.dispatch(window_size_px(frames_[t].params.rendered_window_px));
  }
  if (gas != nullptr) {
    for (std::size_t t = 0; t < params_.count; ++t) gas->draw(t + 1);
  }
  // Add up the rows of the windows.
  glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
  frame_buffer.bind_uniform(EMIT_BIND_FRAME);
  params_buffer_.bind_uniform(EMIT_BIND_TARGETS);
  samples_view_.bind(EMIT_TEX_TARGET_PLANES);
  rows_.bind_storage(EMIT_BIND_OUTPUT);
  rows_program_.use();
  const glm::uvec2 groups = (groups_ + kGroup - 1U) / kGroup;
  glDispatchCompute(groups.x, EMIT_TARGET_SIDE / kGroup, params_.count);
  // Add up the pixels.
  glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT | GL_SHADER_STORAGE_BARRIER_BIT);
  rows_view_.bind(EMIT_TEX_TARGET_ROWS);
  output.bind_storage(EMIT_BIND_OUTPUT, 0, stats_offset);
  output.bind_storage(EMIT_BIND_STATS, stats_offset, sizeof(gpu::FrameStatsGpu));
  stats_buffer_.bind_storage(EMIT_BIND_TARGET_STATS);
  pixels_program_.use();
  glDispatchCompute(groups.x, groups.y, params_.count);
}

}  // namespace emit::renderer
