// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/scene/mesh.hpp"
#include "surface/heat/sample_heat.hpp"
#include "surface/model/surface_model.hpp"

namespace emit::renderer {

/// Numbers the bodies of a scene, one for each placement of an object, and names the body of every
/// sample whose material rests on the interior of one (SurfaceSample::body). Objects without such
/// samples have no body. Returns the number of bodies. Setup only.
/// @pre number_samples() has laid out the model
std::size_t name_bodies(const scene::SceneGeometry& geometry, const SampleHeat& heat,
                        SurfaceModel& model);

/// Interiors of bodies (physics.md eq. 28). Each has one temperature, which all faces of the body
/// share. Temperatures are offsets from the reference temperature. Immutable after construction;
/// any thread; RT-safe except for the constructor.
class BodyNodes {
 public:
  BodyNodes() = default;
  /// Lists the samples of every body with the area that each stands for. It keeps a reference to
  /// `heat`. Setup only: it allocates.
  /// @pre name_bodies() has named the bodies of the samples
  BodyNodes(const SurfaceModel& model, const scene::SceneGeometry& geometry,
            const SampleHeat& heat);

  [[nodiscard]] std::size_t size() const noexcept { return nodes_.size(); }

  /// Inflow of a body: the heat that its faces would pass into an interior of the reference
  /// temperature, W. This is the share of one sample in it.
  /// @pre the sample has a body
  [[nodiscard]] double inflow_w(const SurfaceSamples& all, std::uint32_t sample,
                                const SampleState& state) const noexcept {
    return area_m2_[sample] *
           heat_->of_bodies().into_base_w_m2(all.samples[sample].material, state);
  }
  /// Sums the inflow of every body over its samples.
  /// @pre `out_w` has an entry for every body
  void sum_inflow(const SurfaceSamples& all, std::span<const SampleState> states,
                  std::span<double> out_w) const noexcept;

  /// Temperatures, air and inflow of a body at one end of an interval.
  struct End {
    double inflow_w = 0.0;
    double air_k = 0.0;      ///< offset
    double assumed_k = 0.0;  ///< temperature of the interior for which the faces had that inflow
  };
  /// Temperature of an interior at the end of an interval, and its mean over it.
  struct Course {
    double end_k = 0.0;
    double mean_k = 0.0;
  };
  /// Advances an interior over `dt_s`. Inflow and air go linearly from `begin` to `end`; the result
  /// is exact (physics.md eq. 6).
  [[nodiscard]] Course advance(std::size_t body, double from_k, const End& begin, const End& end,
                               double dt_s) const noexcept;
  /// Advances it too, for an inflow that a pass over the whole past has found. The faces take back
  /// a part of what a new temperature of the interior changes; it is estimated, so that few passes
  /// suffice.
  [[nodiscard]] Course correct(std::size_t body, double from_k, const End& begin, const End& end,
                               double dt_s) const noexcept;
  /// Returns the temperature at which a body starts whose materials state none.
  [[nodiscard]] double start_k(const SurfaceSamples& all, std::size_t body) const noexcept {
    const std::uint32_t sample = members_[nodes_[body].first_member];
    return heat_->of_bodies().base_offset_k(all.samples[sample].material);
  }
  /// Returns the temperature of an interior that is in balance with its faces and the air.
  [[nodiscard]] double balance_k(std::size_t body, const End& now) const noexcept;

 private:
  struct Node {
    double heat_j_k = 0.0;         ///< heat capacity of the interior
    double conductance_w_k = 0.0;  ///< from the interior into the faces, for a sudden change
    double answer_w_k = 0.0;       ///< part of it that the faces take back in time
    double ventilation_w_k = 0.0;  ///< to the outdoor air
    std::uint32_t first_member = 0;
    std::uint32_t members = 0;
  };
  [[nodiscard]] static Course advance(const Node& node, double answer_w_k, double from_k,
                                      const End& begin, const End& end, double dt_s) noexcept;

  const SampleHeat* heat_ = nullptr;
  std::vector<Node> nodes_;
  std::vector<std::uint32_t> members_;  ///< samples of the bodies, body by body, ascending
  std::vector<float> area_m2_;          ///< area that each sample stands for; empty without bodies
};

}  // namespace emit::renderer
