// SPDX-License-Identifier: Apache-2.0
#include "surface/heat/sample_blocks.hpp"

#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <tuple>

namespace emit::renderer {
namespace {

constexpr int kBits = 16;  ///< bits of one coordinate on the curve

/// Spreads the low 16 bits of a number to every third bit of the result.
std::uint64_t spread(std::uint64_t x) noexcept {
  x = (x | (x << 32U)) & 0xffff00000000ffffULL;
  x = (x | (x << 16U)) & 0x00ff0000ff0000ffULL;
  x = (x | (x << 8U)) & 0xf00f00f00f00f00fULL;
  x = (x | (x << 4U)) & 0x30c30c30c30c30c3ULL;
  return (x | (x << 2U)) & 0x9249249249249249ULL;
}

/// Returns the position on a curve through the box (Morton order). Points that are near in space
/// are mostly near on it.
std::uint64_t place_on_curve(const glm::vec3& at_m, const glm::vec3& low_m,
                             float width_m) noexcept {
  const float scale = static_cast<float>((1 << kBits) - 1) / width_m;
  const glm::vec3 cell =
      glm::clamp((at_m - low_m) * scale, 0.0F, static_cast<float>((1 << kBits) - 1));
  return spread(static_cast<std::uint64_t>(cell.x)) |
         (spread(static_cast<std::uint64_t>(cell.y)) << 1U) |
         (spread(static_cast<std::uint64_t>(cell.z)) << 2U);
}

}  // namespace

SampleBlocks::SampleBlocks(const SurfaceSamples& all) {
  const std::vector<SurfaceSample>& samples = all.samples;
  if (samples.empty()) return;
  // Find the cube that holds all samples, for the scale of the curve.
  glm::vec3 low_m = samples.front().position_m;
  glm::vec3 high_m = low_m;
  for (const SurfaceSample& sample : samples) {
    low_m = glm::min(low_m, sample.position_m);
    high_m = glm::max(high_m, sample.position_m);
  }
  const glm::vec3 size_m = high_m - low_m;
  const float width_m = std::max({size_m.x, size_m.y, size_m.z, 1e-6F});
  // Sort the samples by entity, then along the curve.
  using Key = std::tuple<std::int32_t, std::uint64_t, std::uint32_t>;
  std::vector<Key> keys;
  for (std::uint32_t i = 0; i < samples.size(); ++i) {
    if (!steps_itself(all, i)) continue;
    keys.emplace_back(samples[i].entity, place_on_curve(samples[i].position_m, low_m, width_m), i);
  }
  std::ranges::sort(keys);
  // Cut the sorted list into groups: a new one begins with another entity or when the last one is
  // full.
  for (const auto& [entity, place, index] : keys) {
    if (blocks_.empty() || blocks_.back().entity != entity ||
        blocks_.back().count == kBlockSamples) {
      blocks_.push_back({.entity = entity, .first = static_cast<std::uint32_t>(order_.size())});
    }
    ++blocks_.back().count;
    order_.push_back(index);
  }
  // Find the ball of every group. Its centre is that of the box around the positions.
  for (Block& block : blocks_) {
    const auto own = std::span(order_).subspan(block.first, block.count);
    std::ranges::sort(own);
    glm::vec3 least_m = samples[own.front()].position_m;
    glm::vec3 most_m = least_m;
    for (const std::uint32_t i : own) {
      least_m = glm::min(least_m, samples[i].position_m);
      most_m = glm::max(most_m, samples[i].position_m);
    }
    block.centre_m = 0.5F * (least_m + most_m);
    for (const std::uint32_t i : own) {
      block.radius_m =
          std::max(block.radius_m, glm::distance(block.centre_m, samples[i].position_m));
    }
  }
}

}  // namespace emit::renderer
