// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/ext/vector_double3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "emit/physics/error.hpp"

/// Transient heat conduction in solids of three dimensions: finite volumes around the nodes of a
/// graded, axis-aligned grid, so that the temperature of a face is an unknown of its own and no
/// half-cell stands between it and the balance. rho c dT/dt = div(k grad T); at an exposed face
///   -k dT/dn = -(E + h (T_air - T) - eps sigma T^4)
/// with the absorbed flux E given face by face. TR-BDF2 in time: second order, L-stable, with an
/// embedded third-order estimate of the error. Plane and one-dimensional problems are grids one
/// cell deep.
namespace emit::reference {

/// Homogeneous and isotropic.
struct SolidMaterial {
  double conductivity_w_m_k = 0.0;
  double heat_capacity_j_m3_k = 0.0;  ///< density times specific heat
};

/// Values of SolidGrid::cells besides the index of a material.
inline constexpr std::uint16_t kVoidCell = 0xffff;  ///< no solid
/// kFixedCell + i: held at SolidGrid::fixed_cell_k[i], i < 255. Materials stay below.
inline constexpr std::uint16_t kFixedCell = 0xff00;

/// Grid lines along each axis and what fills the cells between them.
struct SolidGrid {
  std::array<std::vector<double>, 3> lines_m;  ///< strictly ascending, at least two per axis
  std::vector<SolidMaterial> materials;
  std::vector<std::uint16_t> cells;  ///< at index(i, j, k): material, kVoidCell or kFixedCell + i
  std::vector<double> fixed_cell_k;

  [[nodiscard]] std::size_t count(std::size_t axis) const noexcept {
    return lines_m[axis].size() - 1;
  }
  [[nodiscard]] std::size_t index(std::size_t i, std::size_t j, std::size_t k) const noexcept {
    return i + count(0) * (j + count(1) * k);
  }
};

/// A rectangle between a solid cell and what is not solid.
struct SolidFace {
  /// Nodes at the corners: (low, low), (high, low), (low, high), (high, high) in the two axes of
  /// the plane, taken in ascending order.
  std::array<std::uint32_t, 4> nodes{};
  glm::dvec3 low_m{0.0};   ///< corner with the smallest coordinates
  glm::dvec3 high_m{0.0};  ///< corner with the greatest; equal to low_m along `axis`
  std::uint8_t axis = 0;   ///< of the normal: 0 x, 1 y, 2 z
  std::int8_t sign = 1;    ///< +1: the outside lies towards greater coordinates
  std::uint16_t material = 0;
  std::uint32_t cell = 0;          ///< the solid cell, SolidGrid::index()
  std::uint32_t outside_cell = 0;  ///< the cell across, kOutsideGrid at the rim of the grid
  double area_m2 = 0.0;

  [[nodiscard]] glm::dvec3 centre_m() const noexcept { return 0.5 * (low_m + high_m); }
  [[nodiscard]] glm::dvec3 normal() const noexcept {
    glm::dvec3 n(0.0);
    n[axis] = sign;
    return n;
  }
};
inline constexpr std::uint32_t kOutsideGrid = 0xffffffffU;

enum class FaceKind : std::uint8_t { adiabatic, exposed, fixed };
/// What holds at a face.
struct FaceCondition {
  FaceKind kind = FaceKind::adiabatic;
  double emissivity_frac = 0.0;  ///< exposed, >= 0: emits eps sigma T^4
  double fixed_k = 0.0;          ///< fixed: temperature of its four nodes
};

/// Drive of the exposed faces at one instant, one entry per exposed face each.
struct FaceDrive {
  std::span<double> absorbed_w_m2;  ///< short-wave and long-wave, into the face
  std::span<double> film_w_m2_k;    ///< convection coefficient
  std::span<double> air_k;
};

/// Fills the drive at `time_s`. `face_k` is the mean temperature of every exposed face as far as it
/// is known then (second order in the step): long-wave exchange between faces reads it. Must be a
/// function of its arguments alone. Called from the thread that advances the solver.
using DriveFunction =
    std::function<void(double time_s, std::span<const double> face_k, const FaceDrive& drive)>;

enum class LinearSolver : std::uint8_t {
  automatic,  ///< factorise small and plane grids, iterate on the rest
  cg,         ///< conjugate gradients, incomplete Cholesky by blocks, warm start
  ldlt        ///< sparse direct, symbolic factorisation once
};

struct SolidOptions {
  double tolerance_k = 0.01;  ///< error of one step, greatest over all nodes
  double first_step_s = 0.1;
  double min_step_s = 1e-3;
  double max_step_s = 600.0;
  LinearSolver linear = LinearSolver::automatic;
};

struct SolidStats {
  std::uint64_t steps = 0;
  std::uint64_t rejected = 0;
  std::uint64_t newton_iterations = 0;
  std::uint64_t linear_iterations = 0;
  std::uint64_t factorisations = 0;
};

/// All that a run carries from step to step: continuing from it gives the same bits as not having
/// stopped.
struct SolidState {
  double time_s = 0.0;
  double step_s = 0.0;          ///< proposed next
  bool has_slope = false;       ///< false at the start and after a jump of the drive
  std::vector<double> node_k;   ///< all nodes
  std::vector<double> slope_w;  ///< net power into every free node at time_s
  double flow_w = 0.0;          ///< power through the boundary at time_s
  double heat_in_j = 0.0;       ///< since the start
  SolidStats stats;
};

/// Owner: the caller. Thread: one at a time; it spreads its work over oneTBB's threads, and the
/// result does not depend on their number. Setup class: allocates, seconds to hours.
///   auto solver = SolidSolver::create(grid, condition, {});
///   solver->set_uniform(0.0, 293.15);
///   solver->advance(3600.0, drive);
///   double top = solver->face_k(0);
class SolidSolver {
 public:
  /// `condition` is asked once for every face. Nodes of held cells and of fixed faces keep their
  /// temperature. Errors: invalid_argument (grid lines, cell or material values, more than 2^31
  /// nodes, no solid cell).
  [[nodiscard]] static physics::Result<SolidSolver> create(
      const SolidGrid& grid, const std::function<FaceCondition(const SolidFace&)>& condition,
      const SolidOptions& options);
  ~SolidSolver();
  SolidSolver(SolidSolver&&) noexcept;
  SolidSolver& operator=(SolidSolver&&) noexcept;

  /// Exposed faces, in the order of FaceDrive.
  [[nodiscard]] std::span<const SolidFace> faces() const noexcept;
  [[nodiscard]] std::span<const glm::dvec3> nodes_m() const noexcept;
  [[nodiscard]] std::size_t free_nodes() const noexcept;

  /// Start temperatures; nodes of fixed temperature keep theirs.
  void set_uniform(double time_s, double temperature_k);
  void set_temperature(double time_s, const std::function<double(const glm::dvec3&)>& kelvin);

  /// To `to_s` by adaptive steps that end there. `after_step` (may be empty) is called with the
  /// time reached; false from it stops the run there without error. Errors: invalid_argument
  /// (backwards), internal (no convergence at the smallest step, a drive that is not finite).
  [[nodiscard]] physics::Result<void> advance(
      double to_s, const DriveFunction& drive,
      const std::function<bool(double time_s)>& after_step = {});
  /// One step to `to_s` without error control; the estimate of its error, K.
  [[nodiscard]] physics::Result<double> step(double to_s, const DriveFunction& drive);
  /// Forgets the slope of the last step: the drive jumps here.
  void note_jump(double next_step_s);

  [[nodiscard]] double time_s() const noexcept;
  [[nodiscard]] std::span<const double> node_k() const noexcept;
  /// Mean over the corners of exposed face `face`.
  [[nodiscard]] double face_k(std::size_t face) const noexcept;
  /// Bilinear on the face; the point is clamped to it.
  [[nodiscard]] double face_k_at(std::size_t face, const glm::dvec3& point_m) const noexcept;

  /// Sum of heat capacity times temperature over the free nodes, J (of the grid's extent).
  [[nodiscard]] double heat_j() const noexcept;
  /// Heat that flowed in through exposed faces and from fixed nodes since the start, J, summed with
  /// the weights of the time scheme.
  [[nodiscard]] double heat_in_j() const noexcept;

  [[nodiscard]] const SolidStats& stats() const noexcept;
  [[nodiscard]] SolidState state() const;
  /// Errors: invalid_argument when the number of nodes differs.
  [[nodiscard]] physics::Result<void> restore(const SolidState& state);

 private:
  struct Data;
  explicit SolidSolver(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

}  // namespace emit::reference
