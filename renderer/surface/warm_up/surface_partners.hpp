// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "surface/warm_up/surface_patch.hpp"

namespace emit::renderer {

/// Finder of partners: for a sample near a convex edge, the points at the same distance from the
/// edge on the neighbouring faces (physics.md eq. 22). Owner: the builder. find() may run on many
/// threads for different vertices; everything else runs on one.
class PartnerFinder {
 public:
  /// Keeps references: both must outlive the finder.
  PartnerFinder(const SurfaceInputs& inputs, const PatchSampler& sampler)
      : in_(inputs), sampler_(sampler) {}

  /// Makes room for `vertices` vertices of a patch.
  /// @pre `patch` is the index of an instance; vertices never become fewer
  void grow(std::size_t patch, std::size_t vertices);
  /// Finds the partners of an evaluated sample. @pre grow() has made room for it
  void find(std::size_t patch, std::uint32_t vertex, const SurfaceSample& own);
  /// Number of partners that find() has found for a vertex.
  [[nodiscard]] std::size_t count(std::size_t patch, std::uint32_t vertex) const noexcept {
    return found_[patch][vertex].size();
  }
  /// Number of all partners.
  [[nodiscard]] std::size_t count() const noexcept;
  /// Removes the `count` partners that drive their samples least.
  void drop(std::size_t count);

  /// Evaluates all partners and appends one patch that holds them. Until samples are numbered,
  /// Partner::sample is an index into that patch, and a partner's own first_seen and
  /// partners[0].sample are the patch and the vertex it belongs to. `evaluated` is called with the
  /// number of partners that were evaluated since its last call. Returns false if it returned
  /// false; nothing is appended then.
  bool append(std::vector<SurfacePatch>& patches,
              const std::function<bool(std::size_t count)>& evaluated) const;

 private:
  /// A partner that was found, and its distance from the edge.
  struct Found {
    SurfaceSample sample;
    float distance_m = 0.0F;
  };
  /// Share of the partner's flux that drives each mode of a sample of `material`.
  [[nodiscard]] std::array<float, physics::kMaxFosterModes> weights(std::uint32_t material,
                                                                    float distance_m) const;
  [[nodiscard]] float greatest_weight(std::uint32_t material, float distance_m) const;

  const SurfaceInputs& in_;
  const PatchSampler& sampler_;
  std::vector<std::vector<std::vector<Found>>> found_;  ///< by patch, then vertex
};

}  // namespace emit::renderer
