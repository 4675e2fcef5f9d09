// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float2.hpp>
#include <glm/ext/vector_float3.hpp>
#include <glm/ext/vector_float4.hpp>
#include <glm/ext/vector_int2.hpp>
#include <span>
#include <vector>

#include "surface/heat/surface_node.hpp"
#include "surface/heat/surface_samples.hpp"
#include "surface/shade/exposure_tile.hpp"
#include "surface/shade/shade_response.hpp"

namespace emit::renderer {

/// Lookup of the shade of exposure tiles by static vertex. It owns the sum of all tiles' shade at
/// each vertex, and the list of vertices by square of the ground, with which it finds the vertices
/// of a tile.
///
/// Owner: ExposureTiles. Thread: the renderer's. Real time: everything but the constructor is
/// RT-safe.
class TileVertices {
 public:
  /// Sorts the static ones of the first `drawn` samples. No other sample is a vertex.
  TileVertices(const SurfaceSamples& all, std::uint32_t drawn);

  /// Brings the tile's part of sums_k() up to date. `slope` is that of ExposureTiles.
  void show(ExposureTile& tile, const SurfaceSamples& all, const ShadeResponse& response,
            const glm::vec2& slope, std::int64_t now_ns) noexcept;
  /// Takes the tile's part out of sums_k() and forgets its vertices.
  void hide(ExposureTile& tile) noexcept;

  /// Sum w_k A_k by vertex, in K.
  [[nodiscard]] std::span<const float> sums_k() const noexcept { return sums_k_; }
  [[nodiscard]] std::span<const ChangedRanges::Range> changes() const noexcept {
    return changes_.ranges();
  }
  void forget_changes() noexcept { changes_.clear(); }
  /// Heights of the lowest and the highest static vertex, rel.
  [[nodiscard]] float lowest_m() const noexcept { return lowest_m_; }
  [[nodiscard]] float highest_m() const noexcept { return highest_m_; }

 private:
  /// Finds the vertices whose shade falls into a tile.
  void gather(ExposureTile& tile, const SurfaceSamples& all, const glm::vec2& slope,
              std::int64_t at_ns) const noexcept;

  std::vector<float> sums_k_;
  ChangedRanges changes_;
  float highest_m_ = 0.0F;
  float lowest_m_ = 0.0F;
  // The static vertices, sorted into squares of the ground.
  glm::vec2 squares_m_{0.0F};
  float square_m_ = 1.0F;
  glm::ivec2 squares_{0};
  std::vector<std::uint32_t> first_of_square_;
  std::vector<std::uint32_t> of_square_;
};

}  // namespace emit::renderer
