// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <span>
#include <vector>

#include "emit/reference/surface_forcing.hpp"
#include "emit/reference/visibility.hpp"
#include "points/point_histories.hpp"

/// Other surfaces in the view of points of the one-dimensional solution. Rays of a point end on
/// patches: parts of the scenery with one material that lie close together, seen from there. The
/// history of one place stands for a patch.
namespace emit::reference {

/// Patches that the rays of many points end on.
class SightBuilder {
 public:
  /// Rays of a point's hemisphere in an epoch, and what of that counts. The rest, and what lies
  /// below the horizon, count as surroundings, as they would without exchange.
  struct EpochRays {
    std::int64_t from_ns = 0;
    const SceneInstant* instant = nullptr;  ///< of the rays
    std::vector<HemisphereRay> rays;
    std::vector<PartLink> parts;  ///< stand for the rays that end on such parts
    bool other_entities = true;
    bool scenery = true;
  };

  /// `now`: instant at which points are where they say.
  explicit SightBuilder(const SceneInstant& now) : now_(&now) {}
  /// Adds the rays of a point. `patch_factor` multiplies the size of the patches.
  [[nodiscard]] PointSight add(const SolvePoint& point, std::span<const EpochRays> epochs,
                               double patch_factor = 1.0);
  /// Returns the places that stand for the patches.
  [[nodiscard]] const std::vector<SolvePoint>& patches() const noexcept { return patches_; }

 private:
  /// Level of the size, cell on three axes, normal in steps on three axes, material, entity.
  using Key = std::array<std::int64_t, 9>;
  [[nodiscard]] std::uint32_t patch_of(const RayHit& hit, const SceneInstant& instant,
                                       double patch_factor);
  const SceneInstant* now_;
  std::map<Key, std::uint32_t> index_;
  std::vector<SolvePoint> patches_;
};

/// Radiation that leaves a patch. There are many patches and instants, hence float.
struct PatchRadiation {
  float shortwave_w_m2 = 0.0F;
  float longwave_w_m2 = 0.0F;  ///< emission and reflection
};

/// Histories of patches: the radiation of every patch at common instants, and the last state.
class PatchHistories {
 public:
  PatchHistories(std::span<const std::int64_t> nodes_ns, std::size_t patches);
  /// Returns the radiation of a patch, one per instant, to fill. Patches may be filled in parallel.
  [[nodiscard]] std::span<PatchRadiation> of(std::size_t patch) noexcept;
  /// Returns the state of a patch at the last instant, to fill likewise.
  [[nodiscard]] PatchState& last(std::size_t patch) noexcept { return last_[patch]; }
  /// Adds what a point sees of the patches to its views. The shares of patches and sky stay below
  /// one where an entity has come into the view.
  void add_to(std::span<ViewSample> views, const PointSight& sight) const;

 private:
  std::span<const std::int64_t> nodes_ns_;
  std::vector<PatchRadiation> radiation_;  ///< patch by patch
  std::vector<PatchState> last_;
};

/// Returns the radiation of a patch of temperature `kelvin` with a view at an instant.
[[nodiscard]] PatchRadiation patch_radiation(const ClimateNode& now, const SurfaceOptics& optics,
                                             const ViewSample& view,
                                             double surroundings_reflectance_frac, double kelvin);

}  // namespace emit::reference
