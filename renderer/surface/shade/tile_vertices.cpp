// SPDX-License-Identifier: Apache-2.0
#include "surface/shade/tile_vertices.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

namespace emit::renderer {
namespace {

/// Smallest change of a vertex that is sent to the device, in K.
constexpr float kMinChangeK = 5e-5F;
/// Time after which the vertices of a tile are gathered anew: the shadow of a parked entity creeps
/// over vertices that it did not reach before.
constexpr std::int64_t kGatherNs = 10'000'000'000;
/// Limits of the squares by which vertices are found: smallest side, largest number along an axis.
constexpr float kMinSquareM = 4.0F;
constexpr int kMaxSquares = 1024;

/// A_k at a place, interpolated between texels along the sun's ray; 0 above the shaded height.
glm::vec4 shade_at(const ExposureTile& tile, const glm::vec2& slope,
                   const glm::vec3& position_m) noexcept {
  constexpr std::uint32_t kSide = ExposureTile::kSide;
  // Follow the sun's ray from the place to the plane.
  const float height_m = position_m.z - tile.plane_m;
  const glm::vec2 at = (glm::vec2(position_m) - height_m * slope - tile.first_m) / tile.texel_m;
  constexpr float kLast = kSide - 1.001F;
  const glm::vec2 inside = glm::clamp(at, 0.0F, kLast);
  const glm::ivec2 first(glm::floor(inside));
  const glm::vec2 way = inside - glm::vec2(first);
  const std::size_t i =
      static_cast<std::size_t>(first.y) * kSide + static_cast<std::size_t>(first.x);
  const std::size_t nearest = i + (way.x < 0.5F ? 0U : 1U) + (way.y < 0.5F ? 0U : kSide);
  if (height_m > tile.top_m[nearest]) return glm::vec4(0.0F);
  return glm::mix(glm::mix(tile.shade[i], tile.shade[i + 1], way.x),
                  glm::mix(tile.shade[i + kSide], tile.shade[i + kSide + 1], way.x), way.y);
}

}  // namespace

TileVertices::TileVertices(const SurfaceSamples& all, std::uint32_t drawn) : sums_k_(drawn, 0.0F) {
  changes_.add(0, drawn);
  // Find the box of the static vertices.
  glm::vec3 low_m(std::numeric_limits<float>::infinity());
  glm::vec3 high_m = -low_m;
  const auto counts = [&](std::uint32_t i) { return all.samples[i].entity < 0; };
  for (std::uint32_t i = 0; i < drawn; ++i) {
    if (!counts(i)) continue;
    low_m = glm::min(low_m, all.samples[i].position_m);
    high_m = glm::max(high_m, all.samples[i].position_m);
  }
  if (!(low_m.x <= high_m.x)) return;
  lowest_m_ = low_m.z;
  highest_m_ = high_m.z;
  squares_m_ = glm::vec2(low_m);
  square_m_ = std::max(
      {kMinSquareM, (high_m.x - low_m.x) / kMaxSquares, (high_m.y - low_m.y) / kMaxSquares});
  squares_ = glm::ivec2(glm::floor(glm::vec2(high_m - low_m) / square_m_)) + 1;
  const auto square_of = [&](std::uint32_t i) {
    const glm::ivec2 at(
        glm::floor((glm::vec2(all.samples[i].position_m) - squares_m_) / square_m_));
    return static_cast<std::size_t>(at.y) * static_cast<std::size_t>(squares_.x) +
           static_cast<std::size_t>(at.x);
  };
  // Sort the vertices by square: count them, add the counts up, then fill.
  first_of_square_.assign(
      static_cast<std::size_t>(squares_.x) * static_cast<std::size_t>(squares_.y) + 1, 0);
  for (std::uint32_t i = 0; i < drawn; ++i) {
    if (counts(i)) ++first_of_square_[square_of(i) + 1];
  }
  for (std::size_t s = 1; s < first_of_square_.size(); ++s) {
    first_of_square_[s] += first_of_square_[s - 1];
  }
  of_square_.resize(first_of_square_.back());
  std::vector<std::uint32_t> next(first_of_square_.begin(), first_of_square_.end() - 1);
  for (std::uint32_t i = 0; i < drawn; ++i) {
    if (counts(i)) of_square_[next[square_of(i)]++] = i;
  }
}

void TileVertices::gather(ExposureTile& tile, const SurfaceSamples& all, const glm::vec2& slope,
                          std::int64_t at_ns) const noexcept {
  tile.vertices_ns = at_ns;
  tile.vertices.clear();
  tile.fine = false;
  if (of_square_.empty()) return;
  const float own_m = tile.texel_m * ExposureTile::kOwnSide;
  const glm::vec2 low_m = own_m * glm::vec2(tile.cell);
  const glm::vec2 high_m = low_m + own_m;
  // Find the squares from which the sun's rays lead into the tile.
  const glm::vec2 reach_m = std::max(tile.reach_m, -tile.lowest_m) * glm::abs(slope);
  const auto square_at = [&](const glm::vec2& at_m) {
    return glm::clamp(glm::ivec2(glm::floor((at_m - squares_m_) / square_m_)), glm::ivec2(0),
                      squares_ - 1);
  };
  const glm::ivec2 first = square_at(low_m - reach_m);
  const glm::ivec2 last = square_at(high_m + reach_m);
  for (int y = first.y; y <= last.y; ++y) {
    for (int x = first.x; x <= last.x; ++x) {
      const std::size_t square =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(squares_.x) +
          static_cast<std::size_t>(x);
      for (std::uint32_t k = first_of_square_[square]; k < first_of_square_[square + 1]; ++k) {
        const glm::vec3& position_m = all.samples[of_square_[k]].position_m;
        const float height_m = position_m.z - tile.plane_m;
        if (height_m > tile.reach_m || height_m < tile.lowest_m) continue;
        const glm::vec2 at_m = glm::vec2(position_m) - height_m * slope;
        if (glm::any(glm::lessThan(at_m, low_m)) || glm::any(glm::greaterThanEqual(at_m, high_m))) {
          continue;
        }
        if (tile.vertices.size() == ExposureTile::kMaxVertices) {
          tile.vertices.clear();
          tile.fine = true;
          return;
        }
        tile.vertices.push_back({of_square_[k], shade_at(tile, slope, position_m)});
      }
    }
  }
  // Sort them, because neighbours in memory go to the device in one range.
  std::ranges::sort(tile.vertices, {}, &ExposureTile::Vertex::sample);
}

void TileVertices::hide(ExposureTile& tile) noexcept {
  for (const ExposureTile::Vertex& vertex : tile.vertices) {
    sums_k_[vertex.sample] -= vertex.shown_k;
    changes_.add(vertex.sample, 1);
  }
  tile.vertices.clear();
}

void TileVertices::show(ExposureTile& tile, const SurfaceSamples& all,
                        const ShadeResponse& response, const glm::vec2& slope,
                        std::int64_t now_ns) noexcept {
  // Gather the vertices again from time to time, because the sun moves on.
  if (tile.vertices_ns <= now_ns - kGatherNs) {
    hide(tile);
    gather(tile, all, slope, now_ns);
  }
  // Correct each vertex whose value has changed by more than the device needs to know.
  for (ExposureTile::Vertex& vertex : tile.vertices) {
    const SurfaceSample& sample = all.samples[vertex.sample];
    if (tile.changed) vertex.shade = shade_at(tile, slope, sample.position_m);
    const float shown_k =
        glm::dot(response.weights_k()[sample.material], tile.left_frac * vertex.shade);
    if (std::abs(shown_k - vertex.shown_k) < kMinChangeK) continue;
    sums_k_[vertex.sample] += shown_k - vertex.shown_k;
    vertex.shown_k = shown_k;
    changes_.add(vertex.sample, 1);
  }
}

}  // namespace emit::renderer
