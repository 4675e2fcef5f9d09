// SPDX-License-Identifier: Apache-2.0
#include "passes/shade_pass.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <tuple>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"
#include "passes/pixel_groups.hpp"

namespace emit::renderer {
namespace {

constexpr auto kExposureTileSide = static_cast<GLsizei>(ExposureTiles::kSide);
constexpr auto kEntityShadowSide = static_cast<GLsizei>(EntityShadowMaps::kSide);

/// Smallest part of the frame's window that holds the convex hull of points in relworld axes: first
/// column, first row, end column, end row. It is empty when the hull lies outside.
glm::uvec4 part_of_window(std::span<const glm::dvec3> points_m, const CameraSetup& camera,
                          const gpu::FrameParams& frame) noexcept {
  const glm::dmat3 sensor_from_relworld = glm::transpose(camera.view.relworld_from_sensor);
  glm::dvec2 low(std::numeric_limits<double>::infinity());
  glm::dvec2 high = -low;
  const glm::dvec2 ray_per_px(frame.ray_per_px);
  const glm::dvec2 ray_at_corner(frame.ray_at_corner);
  const auto add = [&](const glm::dvec3& at) {
    const glm::dvec2 px((at.x / at.z - ray_at_corner.x) / ray_per_px.x - 0.5,
                        (at.y / at.z - ray_at_corner.y) / ray_per_px.y - 0.5);
    low = glm::min(low, px);
    high = glm::max(high, px);
  };
  // Add the points in front of the near plane, and the points at which the hull crosses it.
  const double near_m = camera.view.near_m;
  for (std::size_t i = 0; i < points_m.size(); ++i) {
    const glm::dvec3 at = sensor_from_relworld * points_m[i];
    if (at.z >= near_m) add(at);
    for (std::size_t j = i + 1; j < points_m.size(); ++j) {
      const glm::dvec3 other = sensor_from_relworld * points_m[j];
      if ((at.z >= near_m) == (other.z >= near_m)) continue;
      add(glm::mix(at, other, (near_m - at.z) / (other.z - at.z)));
    }
  }
  // Clamp the rectangle to the window.
  const glm::uvec4& window_px = frame.rendered_window_px;
  if (!(low.x <= high.x)) return {0U, 0U, 0U, 0U};
  const auto clamped = [](double value, std::uint32_t low_px, std::uint32_t high_px) {
    return static_cast<std::uint32_t>(
        std::clamp(value, static_cast<double>(low_px), static_cast<double>(high_px)));
  };
  return {clamped(std::floor(low.x), window_px.x, window_px.z),
          clamped(std::floor(low.y), window_px.y, window_px.w),
          clamped(std::ceil(high.x) + 1.0, window_px.x, window_px.z),
          clamped(std::ceil(high.y) + 1.0, window_px.y, window_px.w)};
}

bool is_empty(const glm::uvec4& px) noexcept {
  return px.x >= px.z || px.y >= px.w;
}

}  // namespace

ShadePass::ShadePass(std::size_t entities)
    : exposure_tiles_(GL_RGBA32F, kExposureTileSide, kExposureTileSide, ExposureTiles::kTiles),
      tops_(GL_R32F, kExposureTileSide, kExposureTileSide, ExposureTiles::kTiles),
      shadow_maps_(GL_R32F, kEntityShadowSide, kEntityShadowSide, static_cast<GLsizei>(entities)),
      tiles_(ExposureTiles::kTiles + entities),
      params_buffer_(gl::Buffer::dynamic(sizeof(gpu::ShadeParams))),
      exposure_tile_buffer_(
          gl::Buffer::dynamic(ExposureTiles::kTiles * sizeof(gpu::ExposureTileParams))),
      exposure_tile_table_(GL_RGBA32F, exposure_tile_buffer_),
      entity_shadow_buffer_(gl::Buffer::dynamic(entities * sizeof(gpu::EntityShadowParams))),
      entity_shadow_table_(GL_RGBA32F, entity_shadow_buffer_),
      tile_buffer_(gl::Buffer::dynamic(ShadeTiles::kMaxTiles * sizeof(gpu::ShadeTile))),
      tile_table_(GL_RGBA32UI, tile_buffer_),
      list_buffer_(
          gl::Buffer::dynamic(ShadeTiles::max_entries(ExposureTiles::kTiles + entities) * 2)),
      list_table_(GL_R16UI, list_buffer_),
      sent_(entities, 0) {
  exposure_tiles_.parameter(GL_TEXTURE_MIN_FILTER, GL_LINEAR);
  exposure_tiles_.parameter(GL_TEXTURE_MAG_FILTER, GL_LINEAR);
  exposure_tile_params_.reserve(ExposureTiles::kTiles);
  entity_shadow_params_.reserve(entities);
  // Pack two positions of taps into each entry.
  for (std::uint32_t tap = 0; tap < EMIT_SHADE_TAPS; tap += 2) {
    const auto [x, y] = shade_tap(tap);
    const auto [next_x, next_y] = shade_tap(tap + 1);
    params_.taps[tap / 2] = glm::vec4(x, y, next_x, next_y);
  }
}

physics::Result<ShadePass> ShadePass::create(std::size_t entities, bool software) {
  EMIT_CHECK_OP(entities, >=, std::size_t{1});
  ShadePass pass(entities);
  pass.rows_ = software ? 2 : 1;
  const gl::Define rows = rows_define(pass.rows_);
  auto program = gl::Program::compute("passes/shade.comp", {&rows, 1});
  if (!program) return tl::unexpected(std::move(program.error()));
  pass.program_ = std::move(*program);
  return pass;
}

void ShadePass::begin(const ExposureTiles& tiles) {
  response_ = gl::Buffer::from(tiles.response().weights_k());
  response_table_ = gl::BufferTexture(GL_RGBA32F, response_);
}

void ShadePass::prepare(CachedSurface& surface, const glm::dvec3& camera_world_m,
                        const CameraSetup& camera, const gpu::FrameParams& frame) noexcept {
  exposure_tile_params_.clear();
  entity_shadow_params_.clear();
  params_.slope = surface.exposure_tiles().slope();
  tiles_.begin(frame.rendered_window_px);
  const glm::dvec3 relworld_from_rel_m = surface.origin_world_m() - camera_world_m;
  prepare_exposure_tiles(surface.exposure_tiles(), relworld_from_rel_m, camera, frame);
  prepare_entity_shadows(surface, relworld_from_rel_m, camera, frame);
  tiles_.sort();
}

void ShadePass::prepare_exposure_tiles(const ExposureTiles& shade,
                                       const glm::dvec3& relworld_from_rel_m,
                                       const CameraSetup& camera,
                                       const gpu::FrameParams& frame) noexcept {
  const std::span<const ExposureTiles::ExposureTile> tiles = shade.tiles();
  for (std::size_t p = 0; p < tiles.size(); ++p) {
    const ExposureTiles::ExposureTile& tile = tiles[p];
    if (!tile.used || tile.fine) continue;
    // Find the part of the window that the tile may shade: from its lowest to its highest receiver,
    // along the rays of the sun.
    const glm::dvec3 first_m = glm::dvec3(tile.first_m, tile.plane_m) + relworld_from_rel_m;
    const double side_m = tile.texel_m * (ExposureTiles::kSide - 1);
    std::array<glm::dvec3, 8> corners_m;
    for (std::size_t i = 0; i < corners_m.size(); ++i) {
      const double height_m = (i & 4U) != 0U ? tile.reach_m : tile.lowest_m;
      corners_m[i] = first_m + glm::dvec3((i & 1U) != 0U ? side_m : 0.0,
                                          (i & 2U) != 0U ? side_m : 0.0, height_m);
      corners_m[i] += glm::dvec3(height_m * glm::dvec2(shade.slope()), 0.0);
    }
    const glm::uvec4 px = part_of_window(corners_m, camera, frame);
    if (is_empty(px)) continue;
    // Append its parameters.
    tiles_.add_exposure_tile(px);
    gpu::ExposureTileParams& params = exposure_tile_params_.emplace_back();
    params.first_x_m = static_cast<float>(first_m.x);
    params.first_y_m = static_cast<float>(first_m.y);
    params.plane_m = static_cast<float>(first_m.z);
    params.texels_per_m = 1.0F / tile.texel_m;
    params.reach_m = tile.reach_m;
    params.lowest_m = tile.lowest_m;
    params.layer = static_cast<float>(p);
    params.left_frac = tile.left_frac;
  }
}

void ShadePass::prepare_entity_shadows(CachedSurface& surface,
                                       const glm::dvec3& relworld_from_rel_m,
                                       const CameraSetup& camera,
                                       const gpu::FrameParams& frame) noexcept {
  const std::span<const EntityShadows::Shadow> shadows = surface.entity_shadows().shadows();
  for (std::size_t m = 0; m < shadows.size(); ++m) {
    const EntityShadows::Shadow& shadow = shadows[m];
    if (!shadow.on) continue;
    // Find the part of the window that the shadow may reach.
    std::array<glm::dvec3, std::tuple_size_v<decltype(shadow.hull_m)>> corners_m;
    for (std::size_t k = 0; k < corners_m.size(); ++k) {
      corners_m[k] = glm::dvec3(shadow.hull_m[k]) + relworld_from_rel_m;
    }
    const glm::uvec4 px = part_of_window(corners_m, camera, frame);
    if (is_empty(px)) continue;
    // Place the depth map at the pose of the frame and append its parameters.
    const PlacedShadowMap placed = surface.cast_shadow(m);
    tiles_.add_entity_shadow(px);
    gpu::EntityShadowParams& params = entity_shadow_params_.emplace_back();
    const auto from_relworld = [&](const glm::vec4& line) {
      const double shift = glm::dot(glm::dvec3(line), relworld_from_rel_m);
      return glm::vec4(glm::vec3(line), static_cast<float>(static_cast<double>(line.w) - shift));
    };
    params.column = from_relworld(placed.column);
    params.row = from_relworld(placed.row);
    params.depth_m = from_relworld(placed.depth_m);
    params.mean_depth_m = placed.mean_m;
    params.penumbra_texels_per_m =
        static_cast<float>(std::tan(physics::kSunSemiAngleRad)) / placed.texel_m;
    params.layer = static_cast<float>(m);
  }
}

void ShadePass::upload(const CachedSurface& surface) noexcept {
  // Send the exposure tiles that changed.
  glPixelStorei(GL_UNPACK_ALIGNMENT, 4);
  const std::span<const ExposureTiles::ExposureTile> tiles = surface.exposure_tiles().tiles();
  for (std::size_t p = 0; p < tiles.size(); ++p) {
    if (!tiles[p].used) continue;
    if (tiles[p].top_changed) {
      glTextureSubImage3D(tops_.id(), 0, 0, 0, static_cast<GLint>(p), kExposureTileSide,
                          kExposureTileSide, 1, GL_RED, GL_FLOAT, tiles[p].top_m.data());
    }
    if (!tiles[p].changed) continue;
    glTextureSubImage3D(exposure_tiles_.id(), 0, 0, 0, static_cast<GLint>(p), kExposureTileSide,
                        kExposureTileSide, 1, GL_RGBA, GL_FLOAT, tiles[p].shade.data());
  }
  // Send the shadow depth maps that changed.
  const EntityShadowMaps& shadow_maps = surface.entity_shadows().maps();
  for (std::size_t m = 0; m < shadow_maps.size(); ++m) {
    if (sent_[m] == shadow_maps.revision(m)) continue;
    sent_[m] = shadow_maps.revision(m);
    glTextureSubImage3D(shadow_maps_.id(), 0, 0, 0, static_cast<GLint>(m), kEntityShadowSide,
                        kEntityShadowSide, 1, GL_RED, GL_FLOAT, shadow_maps.depths_m(m).data());
  }
  // Send the parameters of the frame.
  params_buffer_.upload(std::span<const gpu::ShadeParams>(&params_, 1));
  exposure_tile_buffer_.upload(std::span<const gpu::ExposureTileParams>(exposure_tile_params_));
  entity_shadow_buffer_.upload(std::span<const gpu::EntityShadowParams>(entity_shadow_params_));
  tile_buffer_.upload(tiles_.tiles());
  list_buffer_.upload(tiles_.entries());
}

void ShadePass::dispatch() const noexcept {
  if (tiles_.tiles().empty()) return;
  program_.use();
  params_buffer_.bind_uniform(EMIT_BIND_SHADE);
  exposure_tiles_.bind(EMIT_TEX_SHADE);
  tops_.bind(EMIT_TEX_SHADE_TOP);
  shadow_maps_.bind(EMIT_TEX_ENTITY_SHADOWS);
  response_table_.bind(EMIT_TEX_RESPONSE);
  exposure_tile_table_.bind(EMIT_TEX_EXPOSURE_TILE_PARAMS);
  entity_shadow_table_.bind(EMIT_TEX_ENTITY_SHADOW_PARAMS);
  tile_table_.bind(EMIT_TEX_SHADE_TILES);
  list_table_.bind(EMIT_TEX_SHADE_LIST);
  glMemoryBarrier(GL_SHADER_IMAGE_ACCESS_BARRIER_BIT);
  glDispatchCompute(tiles_.tile_px() / 8, tiles_.tile_px() / (8 * rows_),
                    static_cast<GLuint>(tiles_.tiles().size()));
  glMemoryBarrier(GL_TEXTURE_FETCH_BARRIER_BIT);
}

}  // namespace emit::renderer
