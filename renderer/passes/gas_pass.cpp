// SPDX-License-Identifier: Apache-2.0
#include "passes/gas_pass.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_double2.hpp>
#include <glm/geometric.hpp>
#include <utility>

#include "emit/physics/check.hpp"

namespace emit::renderer {
namespace {

/// Distance from the middle of a puff, in standard deviations, beyond which it is left out: its
/// column is 4e-6 of that through the middle there.
constexpr double kReachSigmas = 5.0;
glm::uvec2 tiles_across(const glm::uvec2& size_px) noexcept {
  return (size_px + EMIT_GAS_TILE - 1U) / glm::uvec2(EMIT_GAS_TILE);
}
std::size_t tile_count(const glm::uvec2& size_px) noexcept {
  const glm::uvec2 tiles = tiles_across(size_px);
  return std::size_t{tiles.x} * tiles.y;
}

/// Rectangle of an image in its pixels.
struct Extent {
  glm::dvec2 first{0.0};
  glm::dvec2 end{0.0};
};

/// Range of tangents under which a ball is seen along one axis. False if it is not all in front.
bool tangents_of(double across_m, double ahead_m, double radius_m, double& low,
                 double& high) noexcept {
  const double range_m = std::hypot(across_m, ahead_m);
  if (range_m <= radius_m) return false;
  const double middle = std::atan2(across_m, ahead_m);
  const double half = std::asin(radius_m / range_m);
  constexpr double kWidest = 1.5;
  if (middle - half < -kWidest || middle + half > kWidest) return false;
  low = std::tan(middle - half);
  high = std::tan(middle + half);
  return true;
}

/// Tiles that the window of an image touches. They lie on one grid, so that a pixel has the same
/// tile in every window.
struct TileRange {
  glm::uvec2 first{0};
  glm::uvec2 end{0};
};
TileRange tiles_of(const gpu::GasImage& image) noexcept {
  return {glm::uvec2(image.window_px.x, image.window_px.y) / EMIT_GAS_TILE,
          tiles_across(glm::uvec2(image.window_px.z, image.window_px.w))};
}

/// Part of an image that a puff reaches, within the tiles; all of them where it is not bounded.
Extent extent_of(const gpu::GasPuff& puff, const gpu::GasImage& image,
                 const TileRange& tiles) noexcept {
  const glm::dvec2 window_first(tiles.first * EMIT_GAS_TILE);
  const glm::dvec2 window_end(tiles.end * EMIT_GAS_TILE);
  Extent out{window_first, window_end};
  const glm::dvec2 per_px(image.ray_per_px);
  const glm::dvec2 corner(image.ray_at_corner);
  if ((static_cast<unsigned>(puff.kind) & EMIT_GAS_SMALL) != 0) {
    // Convert from pixels of the output image to those of this one.
    const glm::dvec2 side(image.side_px);
    const glm::dvec2 tan =
        (glm::dvec2(puff.centre_px) - glm::dvec2(image.px_at_axis)) / glm::dvec2(image.px_per_tan);
    const glm::dvec2 middle = (tan - corner) / per_px;
    const glm::dvec2 sigma_px(std::sqrt(double{puff.covariance_px2.x}),
                              std::sqrt(double{puff.covariance_px2.z}));
    const glm::dvec2 reach = kReachSigmas * sigma_px / side + 1.0;
    out = {middle - reach, middle + reach};
  } else {
    const double radius_m =
        kReachSigmas / std::sqrt(double{std::min(puff.per_across_m2, puff.per_along_axis_m2)});
    const glm::dvec3 centre_m(puff.centre_m);
    if (centre_m.z < -radius_m) return {window_first, window_first};
    glm::dvec2 low;
    glm::dvec2 high;
    if (tangents_of(centre_m.x, centre_m.z, radius_m, low.x, high.x) &&
        tangents_of(centre_m.y, centre_m.z, radius_m, low.y, high.y)) {
      const glm::dvec2 a = (low - corner) / per_px;
      const glm::dvec2 b = (high - corner) / per_px;
      out = {glm::min(a, b), glm::max(a, b)};
    }
  }
  return {glm::clamp(glm::floor(out.first), window_first, window_end),
          glm::clamp(glm::ceil(out.end), window_first, window_end)};
}

/// Samples along the side of a pixel of an image that a puff asks for.
std::uint32_t samples_for(const gpu::GasPuff& puff, const gpu::GasImage& image) noexcept {
  const auto kind = static_cast<unsigned>(puff.kind);
  if ((kind & EMIT_GAS_SMALL) == 0 || kind >> EMIT_GAS_SAMPLES_SHIFT != 0) return 1;
  const float sigma_px = gas_least_sigma_px(puff.covariance_px2);
  const float side_px = std::max(image.side_px.x, image.side_px.y);
  return std::clamp(static_cast<std::uint32_t>(std::ceil(kGasSampleSigmas * side_px / sigma_px)),
                    1U, kMostGasSamples);
}

}  // namespace

float gas_least_sigma_px(const glm::vec3& covariance_px2) noexcept {
  const float middle = 0.5F * (covariance_px2.x + covariance_px2.z);
  const float half = 0.5F * (covariance_px2.x - covariance_px2.z);
  const float least = middle - std::sqrt(half * half + covariance_px2.y * covariance_px2.y);
  return std::sqrt(std::max(least, 0.0F));
}

GasTiles::GasTiles(const glm::uvec2& size_px) {
  const glm::uvec2 target_px(EMIT_TARGET_SIDE);
  puffs_.reserve(EMIT_MAX_GAS_PUFFS);
  // A tile may stand at any place of a target's tile: count one more each way.
  const std::size_t target_tiles = tile_count(target_px + glm::uvec2(EMIT_GAS_TILE));
  tiles_.reserve(tile_count(size_px) + EMIT_MAX_TARGETS * target_tiles);
  grid_.resize(std::max(tile_count(size_px), target_tiles));
  touched_.reserve(grid_.size());
}

void GasTiles::begin(std::span<const gpu::GasPuff> puffs,
                     std::span<const glm::vec4, EMIT_MAX_BANDS> term_frac) noexcept {
  EMIT_CHECK_OP(puffs.size(), <=, std::size_t{EMIT_MAX_GAS_PUFFS});
  puffs_.assign(puffs.begin(), puffs.end());
  std::ranges::copy(term_frac, term_frac_.begin());
  count_ = 0;
  tiles_.clear();
}

void GasTiles::add_output(const gpu::FrameParams& frame) noexcept {
  EMIT_CHECK_OP(count_, ==, std::size_t{0});
  const glm::vec2 depth_per_px = glm::vec2(frame.rendered_px) / glm::vec2(frame.output_px);
  gpu::GasImage image{};
  image.ray_per_px = frame.ray_per_px * depth_per_px;
  image.ray_at_corner = frame.ray_at_corner;
  image.px_per_tan = 1.0F / image.ray_per_px;
  image.px_at_axis = -image.ray_at_corner / image.ray_per_px;
  image.depth_per_px = depth_per_px;
  image.side_px = glm::vec2(1.0F);
  image.window_px = frame.output_window_px;
  image.width_px = frame.output_px.x;
  image.plane_px = frame.output_plane_px;
  image.near_m = frame.near_m;
  add(image);
}

void GasTiles::add_target(const gpu::FrameParams& window) noexcept {
  EMIT_CHECK_OP(count_, >=, std::size_t{1});
  EMIT_CHECK_OP(count_, <, images_.size());
  const gpu::GasImage& output_image = output();
  gpu::GasImage image{};
  image.ray_per_px = window.ray_per_px;
  image.ray_at_corner = window.ray_at_corner;
  image.px_per_tan = output_image.px_per_tan;
  image.px_at_axis = output_image.px_at_axis;
  image.depth_per_px = glm::vec2(1.0F);
  image.side_px = window.ray_per_px * output_image.px_per_tan;
  image.window_px = window.rendered_window_px;
  image.width_px = window.rendered_px.x;
  image.plane_px = window.rendered_plane_px;
  image.near_m = window.near_m;
  add(image);
}

std::uint32_t GasTiles::output_samples(const glm::uvec2& px) const noexcept {
  for (const gpu::GasTile& tile : std::span(tiles_).first(images_.front().tiles)) {
    const glm::uvec2 first(tile.place.x, tile.place.y);
    if (px.x >= first.x && px.y >= first.y && px.x < first.x + EMIT_GAS_TILE &&
        px.y < first.y + EMIT_GAS_TILE) {
      return tile.place.z;
    }
  }
  return 0;
}

void GasTiles::add(const gpu::GasImage& image) noexcept {
  Image& out = images_[count_++];
  out.params = image;
  out.params.first_tile = static_cast<std::uint32_t>(tiles_.size());
  std::ranges::copy(term_frac_, out.params.term_frac);
  touched_.clear();
  const TileRange range = tiles_of(image);
  const std::uint32_t across = range.end.x - range.first.x;
  const auto touch = [&](const glm::uvec2& place) -> gpu::GasTile& {
    const std::uint32_t index = (place.y - range.first.y) * across + (place.x - range.first.x);
    gpu::GasTile& tile = grid_[index];
    if (tile.place.z == 0) {
      touched_.push_back(index);
      tile.place = glm::uvec4(EMIT_GAS_TILE * place, 1, 0);
    }
    return tile;
  };
  const auto set = [](gpu::GasTile& tile, std::size_t puff) {
    tile.puffs[puff / 128][static_cast<glm::length_t>(puff / 32 % 4)] |= 1U << (puff % 32);
  };
  // Note every puff in the tiles that it reaches. Those that reach all, such as smoke around the
  // sensor, are noted once.
  gpu::GasTile all{};
  bool everywhere = false;
  for (std::size_t p = 0; p < puffs_.size(); ++p) {
    const Extent extent = extent_of(puffs_[p], image, range);
    if (extent.first.x >= extent.end.x || extent.first.y >= extent.end.y) continue;
    const std::uint32_t samples = samples_for(puffs_[p], image);
    const glm::uvec2 first = glm::uvec2(extent.first) / EMIT_GAS_TILE;
    const glm::uvec2 last = (glm::uvec2(extent.end) - 1U) / EMIT_GAS_TILE;
    if (samples == 1 && first == range.first && last + 1U == range.end) {
      set(all, p);
      everywhere = true;
      continue;
    }
    for (std::uint32_t row = first.y; row <= last.y; ++row) {
      for (std::uint32_t column = first.x; column <= last.x; ++column) {
        gpu::GasTile& tile = touch({column, row});
        tile.place.z = std::max(tile.place.z, samples);
        set(tile, p);
      }
    }
  }
  for (std::uint32_t row = range.first.y; everywhere && row < range.end.y; ++row) {
    for (std::uint32_t column = range.first.x; column < range.end.x; ++column) {
      (void)touch({column, row});
    }
  }
  // A first picture without gas has an empty tile, because drivers compile when something is drawn
  // for the first time.
  if (!drawn_ && touched_.empty() && !everywhere) {
    touched_.push_back(0);
    grid_[0].place = glm::uvec4(EMIT_GAS_TILE * range.first, 1, 0);
  }
  drawn_ = true;
  // List the tiles and clear the grid for the next image.
  for (const std::uint32_t index : touched_) {
    gpu::GasTile& tile = grid_[index];
    for (std::size_t i = 0; i < EMIT_GAS_PUFF_BITS; ++i) tile.puffs[i] |= all.puffs[i];
    tiles_.push_back(tile);
    tile = gpu::GasTile{};
  }
  out.tiles = static_cast<std::uint32_t>(touched_.size());
  out.params.tiles = out.tiles;
}

GasPass::GasPass(const Setup& setup)
    : tiles_(setup.output_px),
      puff_buffer_(gl::Buffer::dynamic(EMIT_MAX_GAS_PUFFS * sizeof(gpu::GasPuff))),
      puff_texels_(GL_RGBA32F, puff_buffer_),
      tile_buffer_(gl::Buffer::dynamic(tiles_.capacity() * sizeof(gpu::GasTile))),
      image_buffer_(gl::Buffer::dynamic(sizeof(padded_))) {}

physics::Result<GasPass> GasPass::create(const Setup& setup) {
  GasPass pass(setup);
  std::vector<gl::Define> defines{{"EMIT_BANDS", fmt::format("{}", setup.bands)}};
  if (setup.reversed_depth) defines.push_back({"EMIT_CACHED", "1"});
  auto program = gl::Program::compute("passes/gas.comp", defines);
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  return pass;
}

void GasPass::upload() noexcept {
  if (tiles_.tiles().empty()) return;
  puff_buffer_.upload(tiles_.puffs());
  tile_buffer_.upload(tiles_.tiles());
  const auto images = tiles_.images();
  for (std::size_t i = 0; i < images.size(); ++i) padded_[i].params = images[i].params;
  image_buffer_.upload(std::span<const PaddedImage>(padded_).first(images.size()));
}

void GasPass::draw(std::size_t image) const noexcept {
  const auto images = tiles_.images();
  if (image >= images.size() || images[image].tiles == 0) return;
  image_buffer_.bind_uniform(EMIT_BIND_GAS, image * sizeof(PaddedImage), sizeof(gpu::GasImage));
  tile_buffer_.bind_storage(EMIT_BIND_GAS_TILES);
  puff_texels_.bind(EMIT_TEX_GAS_PUFFS);
  program_.use();
  // The pixels that the passes before wrote are read here.
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
  const std::uint32_t tiles = images[image].tiles;
  constexpr std::uint32_t kColumns = EMIT_GAS_DISPATCH_COLUMNS;
  glDispatchCompute(std::min(tiles, kColumns), (tiles + kColumns - 1) / kColumns, 1);
}

}  // namespace emit::renderer
