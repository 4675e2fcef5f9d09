// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_float3.hpp>
#include <span>
#include <vector>

#include "emit/physics/check.hpp"
#include "surface/heat/surface_samples.hpp"

namespace emit::renderer {

/// Groups of up to kBlockSamples samples that lie near each other, with a ball around each group. A
/// search for samples near a place then tests groups in place of samples. Immutable after
/// construction; any thread.
class SampleBlocks {
 public:
  static constexpr std::size_t kBlockSamples = 64;
  /// Group of samples of one entity, or of static surfaces, and a ball that holds their positions.
  struct Block {
    glm::vec3 centre_m{0.0F};  ///< same frame as the positions of its samples
    float radius_m = 0.0F;
    std::int32_t entity = -1;  ///< entity of all its samples, or -1: static
    std::uint32_t first = 0;   ///< index of its first sample in the common order
    std::uint32_t count = 0;
  };

  SampleBlocks() = default;
  /// Sorts the samples into groups. Setup only: it allocates.
  explicit SampleBlocks(const SurfaceSamples& all);

  [[nodiscard]] std::span<const Block> blocks() const noexcept { return blocks_; }
  /// Returns the samples of a group, ascending. A sheet appears with the side that is advanced
  /// (steps_itself()); its other side follows from it.
  /// @pre block < blocks().size()
  [[nodiscard]] std::span<const std::uint32_t> samples(std::size_t block) const noexcept {
    EMIT_DCHECK_OP(block, <, blocks_.size());
    return std::span(order_).subspan(blocks_[block].first, blocks_[block].count);
  }

 private:
  std::vector<Block> blocks_;
  std::vector<std::uint32_t> order_;  ///< samples of all groups, one group after the other
};

}  // namespace emit::renderer
