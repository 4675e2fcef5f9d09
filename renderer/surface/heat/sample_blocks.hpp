// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Samples that lie near each other in groups of up to kBlockSamples, and a ball around each group:
/// what is near something is found without asking every sample.
/// Immutable after construction; any thread.
class SampleBlocks {
 public:
  static constexpr std::size_t kBlockSamples = 64;
  struct Block {
    glm::vec3 centre_m{0.0F};  ///< as the samples' positions
    float radius_m = 0.0F;
    std::int32_t mover = -1;  ///< of all its samples
    std::uint32_t first = 0;
    std::uint32_t count = 0;
  };

  SampleBlocks() = default;
  explicit SampleBlocks(const SurfaceSamples& all);

  [[nodiscard]] std::span<const Block> blocks() const noexcept { return blocks_; }
  /// Ascending; of sheets the side that is carried on, whose other side belongs to it.
  [[nodiscard]] std::span<const std::uint32_t> samples(std::size_t block) const noexcept {
    return std::span(order_).subspan(blocks_[block].first, blocks_[block].count);
  }

 private:
  std::vector<Block> blocks_;
  std::vector<std::uint32_t> order_;
};

}  // namespace emit::renderer
