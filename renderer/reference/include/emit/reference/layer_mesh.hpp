// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// One-dimensional body of layers under a surface point, cut into linear finite elements.
///
/// Nodes stand on the face, on every interface and on the base, so that the kink of the profile at
/// an interface is exact: integrated against a hat function, conduction through a cell is
/// k/h (T_i - T_i+1) without error. The only error is in the heat stored under a hat, which each
/// row of the mass matrix takes from the node and its two neighbours so that it is exact for every
/// profile of temperature change, flux change and curvature that crosses the node (with the kink
/// of an interface). Lengths are graded in the diffusion coordinate s = integral dz / sqrt(a), in
/// which that profile is smooth across interfaces. Rows whose neighbours are too unlike for three
/// points fall back to the consistent mass of linear elements, second order.
namespace emit::reference {

/// A layer as conduction sees it. Strictly positive and finite.
struct SolidLayer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double heat_capacity_j_m3_k = 0.0;  ///< density times specific heat
};
[[nodiscard]] std::vector<SolidLayer> solid_layers(std::span<const scene::Layer> layers);

enum class BaseKind : std::uint8_t {
  fixed_temperature,  ///< held at Base::temperature_k
  adiabatic,          ///< no flux
  /// The last layer goes on downwards to where nothing of the run arrives: 10 diffusion lengths
  /// sqrt(a * horizon_s) below its top, where the base temperature is held.
  deep_ground,
};
struct Base {
  BaseKind kind = BaseKind::fixed_temperature;
  double temperature_k = 288.15;  ///< not used by adiabatic
};

/// How fine. The defaults keep the face within about a millikelvin of the limit for forcing with
/// steps of hundreds of W/m2 (validation.md).
struct MeshOptions {
  /// How soon after a jump of the forcing the face temperature must be right, s: the first cell is
  /// sqrt(a * shortest_time_s) / cells_per_length long.
  double shortest_time_s = 10.0;
  double cells_per_length = 6.0;
  double growth_frac = 0.1;     ///< growth of the cell length per length of depth, in s
  std::uint32_t min_cells = 6;  ///< per layer
  bool fine_base = false;       ///< grade towards the base too: it jumps at the start
  double horizon_s = 2.0e5;     ///< length of the run; deep_ground only
  std::uint32_t refine = 1;     ///< multiplies the number of cells of every layer, 1..64
};

/// Immutable: one mesh serves all points of a material, on any number of threads.
class LayerMesh {
 public:
  /// Errors: invalid_argument naming the layer or option; more than 20000 cells.
  [[nodiscard]] static physics::Result<LayerMesh> build(std::span<const SolidLayer> layers,
                                                        const Base& base,
                                                        const MeshOptions& options = {});

  /// Nodes from the face (0) to the base; at least two.
  [[nodiscard]] std::size_t nodes() const noexcept { return depth_m_.size(); }
  [[nodiscard]] std::span<const double> depth_m() const noexcept { return depth_m_; }
  /// Per cell between node i and i + 1.
  [[nodiscard]] std::span<const double> conductance_w_m2_k() const noexcept {
    return conductance_w_m2_k_;
  }
  [[nodiscard]] std::span<const double> capacity_j_m2_k() const noexcept {
    return capacity_j_m2_k_;
  }
  /// Row of the mass matrix per node, J m-2 K-1: weights of the node above, the node and the node
  /// below. Positive, diagonally dominant; all rows together add up to the whole body.
  [[nodiscard]] std::span<const double> mass_above() const noexcept { return mass_above_; }
  [[nodiscard]] std::span<const double> mass_own() const noexcept { return mass_own_; }
  [[nodiscard]] std::span<const double> mass_below() const noexcept { return mass_below_; }
  [[nodiscard]] const Base& base() const noexcept { return base_; }
  /// True when the last node is held at base().temperature_k.
  [[nodiscard]] bool base_held() const noexcept { return base_.kind != BaseKind::adiabatic; }
  /// sqrt(k rho c) of the outermost layer, W s^0.5 m-2 K-1.
  [[nodiscard]] double face_effusivity() const noexcept { return face_effusivity_; }

 private:
  void assemble_mass();

  Base base_;
  std::vector<double> depth_m_;
  std::vector<double> conductance_w_m2_k_;
  std::vector<double> capacity_j_m2_k_;
  std::vector<double> mass_above_;
  std::vector<double> mass_own_;
  std::vector<double> mass_below_;
  double face_effusivity_ = 0.0;
};

/// Point of a piecewise linear profile; constant outside.
struct ProfilePoint {
  double depth_m = 0.0;
  double temperature_k = 0.0;
};

/// Steady profile through the resistances d/k of the layers: face_k at the face, base_k below.
[[nodiscard]] std::vector<ProfilePoint> steady_profile(std::span<const SolidLayer> layers,
                                                       double face_k, double base_k);

}  // namespace emit::reference
