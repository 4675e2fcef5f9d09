// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/physics/foster.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/scene_desc.hpp"

namespace emit::tool {

/// Sun and sky that a surface point sees at an instant.
struct PointView {
  glm::dvec3 normal{0.0, 0.0, 1.0};
  double sun_frac = 0.0;  ///< of the sun's disc
  double sky_frac = 0.0;  ///< emit2014: of the full sphere; foster: cosine-weighted
};

/// The renderer's thermal models in double, with other time steps: their formulas without the
/// renderer's shadow maps and history steps. Immutable: any number of threads.
class ConvergedModel {
 public:
  /// Integrates from the spin-up's start on without shadows (foster alone), then over the intervals
  /// between `nodes_ns`, the first of which is the history's start. Errors: config (materials).
  [[nodiscard]] static physics::Result<ConvergedModel> create(
      const scene::ScenarioDesc& scenario, std::span<const scene::Material> materials,
      std::span<const std::int64_t> nodes_ns);

  /// Number of nodes of the history, those given to create().
  [[nodiscard]] std::size_t node_count() const noexcept { return forcing_.size() + 1 - history_; }

  /// Returns the temperature at the last node, K. The visible shares are linear between the nodes,
  /// and so is the flux they let through (foster) or the equilibrium they lead to (emit2014).
  /// @pre one view per node
  [[nodiscard]] double temperature_k(std::uint32_t material, std::span<const PointView> view) const;

  /// Returns the direct sun at a node, W/m2 across its direction. The vector points towards the
  /// sun. Zero at night.
  [[nodiscard]] const glm::dvec3& sun_w_m2(std::size_t node) const noexcept;

 private:
  /// Gains of an interval, by its length.
  struct Gains {
    std::vector<physics::RelaxationGains<double>> modes;  ///< emit2014
    physics::FosterLadder ladder;                         ///< foster
  };

  [[nodiscard]] double relaxed_k(std::uint32_t material, std::span<const PointView> view) const;
  [[nodiscard]] double foster_k(std::uint32_t material, std::span<const PointView> view) const;
  [[nodiscard]] const Gains& gains(std::uint32_t material, std::size_t interval) const noexcept {
    return gains_[material * lengths_ + length_of_[interval]];
  }

  scene::ThermalModel model_ = scene::ThermalModel::emit2014;
  double initial_k_ = 0.0;
  std::vector<scene::Material> materials_;
  std::vector<renderer::FosterMaterial> foster_;
  std::vector<renderer::IntervalForcing> forcing_;  ///< spin-up, then history
  std::vector<std::uint32_t> length_of_;            ///< per interval
  std::vector<Gains> gains_;                        ///< by material and length
  std::size_t lengths_ = 0;
  std::size_t history_ = 0;  ///< first interval of the history
};

}  // namespace emit::tool
