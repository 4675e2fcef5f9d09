// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"
#include "emit/scene/scene_desc.hpp"

/// One-dimensional stack of layers below a surface point, cut into linear finite elements.
///
/// Nodes lie on the face, on every interface and on the base, so that the kink of the profile at an
/// interface is exact. Integrated against a hat function, conduction through a cell is k/h (T_i -
/// T_i+1) without error. The only error is in the heat stored under a hat. Each row of the mass
/// matrix weights the node and its two neighbours such that the stored heat is exact for every
/// profile of temperature change, flux change and curvature that crosses the node, with the kink of
/// an interface.
/// Cell lengths are graded in the diffusion coordinate s = integral dz / sqrt(a), in which that
/// profile is smooth across interfaces. A row whose neighbours are too unlike for three points uses
/// the consistent mass of linear elements, which is second order.
namespace emit::reference {

/// One layer of solid for heat conduction. All values are positive and finite.
struct SolidLayer {
  double thickness_m = 0.0;
  double conductivity_w_m_k = 0.0;
  double heat_capacity_j_m3_k = 0.0;  ///< density times specific heat
};
/// Converts the layers of a scene material.
[[nodiscard]] std::vector<SolidLayer> solid_layers(std::span<const scene::Layer> layers);

/// Condition at the base of the stack.
enum class BaseKind : std::uint8_t {
  fixed_temperature,  ///< held at Base::temperature_k
  adiabatic,          ///< no flux through the base
  /// The last layer is extended down to where nothing of the run arrives. The base temperature is
  /// held 10 diffusion lengths sqrt(a * horizon_s) below the top of that layer.
  deep_ground,
};
/// Base of a stack.
struct Base {
  BaseKind kind = BaseKind::fixed_temperature;
  double temperature_k = 288.15;  ///< not used by adiabatic
};

/// Fineness of a mesh. The defaults keep the face within about a millikelvin of the limit for
/// forcing with steps of hundreds of W/m2 (validation.md).
struct MeshOptions {
  /// Time in s after a jump of the forcing from which on the face temperature must be right. The
  /// first cell is sqrt(a * shortest_time_s) / cells_per_length long.
  double shortest_time_s = 10.0;
  double cells_per_length = 6.0;
  double growth_frac = 0.1;     ///< growth of the cell length per length of depth, in s
  std::uint32_t min_cells = 6;  ///< number of cells per layer, at least
  bool fine_base = false;       ///< true grades towards the base too: it jumps at the start
  double horizon_s = 2.0e5;     ///< length of the run; used by deep_ground only
  std::uint32_t refine = 1;     ///< multiplies the number of cells of every layer, 1..64
};

/// Finite element mesh of a stack of layers. It is immutable: one mesh serves all points of a
/// material on any number of threads.
class LayerMesh {
 public:
  /// Builds the mesh. Errors: invalid_argument, naming the layer or option, or for more than 20000
  /// cells.
  [[nodiscard]] static physics::Result<LayerMesh> build(std::span<const SolidLayer> layers,
                                                        const Base& base,
                                                        const MeshOptions& options = {});

  /// Number of nodes, at least two. Node 0 is the face, the last node is the base.
  [[nodiscard]] std::size_t nodes() const noexcept { return depth_m_.size(); }
  /// Depth of every node below the face, m.
  [[nodiscard]] std::span<const double> depth_m() const noexcept { return depth_m_; }
  /// Conductance of the cell between node i and i + 1.
  [[nodiscard]] std::span<const double> conductance_w_m2_k() const noexcept {
    return conductance_w_m2_k_;
  }
  /// Heat capacity of the cell between node i and i + 1.
  [[nodiscard]] std::span<const double> capacity_j_m2_k() const noexcept {
    return capacity_j_m2_k_;
  }
  /// Row of the mass matrix of every node, J m-2 K-1: the weights of the node above, the node
  /// itself and the node below. The weights are not negative and diagonally dominant; all rows
  /// together add up to the heat capacity of the whole stack.
  [[nodiscard]] std::span<const double> mass_above() const noexcept { return mass_above_; }
  [[nodiscard]] std::span<const double> mass_own() const noexcept { return mass_own_; }
  [[nodiscard]] std::span<const double> mass_below() const noexcept { return mass_below_; }
  [[nodiscard]] const Base& base() const noexcept { return base_; }
  /// True if the last node is held at base().temperature_k.
  [[nodiscard]] bool base_held() const noexcept { return base_.kind != BaseKind::adiabatic; }
  /// Thermal effusivity sqrt(k rho c) of the outermost layer, W s^0.5 m-2 K-1.
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

/// Point of a piecewise linear temperature profile, which is constant beyond its ends.
struct ProfilePoint {
  double depth_m = 0.0;
  double temperature_k = 0.0;
};

/// Returns the steady profile through the resistances d/k of the layers, from `face_k` at the face
/// to `base_k` at the base.
[[nodiscard]] std::vector<ProfilePoint> steady_profile(std::span<const SolidLayer> layers,
                                                       double face_k, double base_k);

}  // namespace emit::reference
