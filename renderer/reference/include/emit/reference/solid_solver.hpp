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

/// Transient heat conduction in three-dimensional solids: rho c dT/dt = div(k grad T). Finite
/// volumes lie around the nodes of a graded, axis-aligned grid. The temperature of a face is
/// thereby an unknown of its own, and no half-cell stands between it and the balance. At an exposed
/// face
///   -k dT/dn = -(E + h (T_air - T) - eps sigma T^4)
/// with the absorbed flux E given face by face. Time steps are TR-BDF2: second order, L-stable,
/// with an embedded third-order estimate of the error. Plane and one-dimensional problems are grids
/// that are one cell deep.
namespace emit::reference {

/// Homogeneous, isotropic material.
struct SolidMaterial {
  double conductivity_w_m_k = 0.0;
  double heat_capacity_j_m3_k = 0.0;  ///< density times specific heat
};

/// Values of SolidGrid::cells besides the index of a material.
inline constexpr std::uint16_t kVoidCell = 0xffff;  ///< the cell holds no solid
/// Code kFixedCell + i: the cell is held at SolidGrid::fixed_cell_k[i], i < 255. Material indices
/// are smaller.
inline constexpr std::uint16_t kFixedCell = 0xff00;

/// Grid lines along each axis and the content of the cells between them.
struct SolidGrid {
  std::array<std::vector<double>, 3> lines_m;  ///< strictly ascending, at least two per axis
  std::vector<SolidMaterial> materials;
  std::vector<std::uint16_t> cells;  ///< per index(i, j, k): material, kVoidCell or kFixedCell + i
  std::vector<double> fixed_cell_k;

  [[nodiscard]] std::size_t count(std::size_t axis) const noexcept {
    return lines_m[axis].size() - 1;
  }
  [[nodiscard]] std::size_t index(std::size_t i, std::size_t j, std::size_t k) const noexcept {
    return i + count(0) * (j + count(1) * k);
  }
};

/// Rectangle between a solid cell and a cell that is not solid.
struct SolidFace {
  /// Nodes at the corners: (low, low), (high, low), (low, high), (high, high) in the two axes of
  /// the plane, taken in ascending order.
  std::array<std::uint32_t, 4> nodes{};
  glm::dvec3 low_m{0.0};   ///< corner with the smallest coordinates
  glm::dvec3 high_m{0.0};  ///< corner with the greatest; equal to low_m along `axis`
  std::uint8_t axis = 0;   ///< axis of the normal: 0 x, 1 y, 2 z
  std::int8_t sign = 1;    ///< +1 if the outside lies towards greater coordinates, else -1
  std::uint16_t material = 0;
  std::uint32_t cell = 0;  ///< SolidGrid::index() of the solid cell
  /// The cell on the other side; kOutsideGrid at the rim of the grid.
  std::uint32_t outside_cell = 0;
  double area_m2 = 0.0;

  [[nodiscard]] glm::dvec3 centre_m() const noexcept { return 0.5 * (low_m + high_m); }
  [[nodiscard]] glm::dvec3 normal() const noexcept {
    glm::dvec3 n(0.0);
    n[axis] = sign;
    return n;
  }
};
/// Value of SolidFace::outside_cell at the rim of the grid.
inline constexpr std::uint32_t kOutsideGrid = 0xffffffffU;

/// Kind of boundary condition.
enum class FaceKind : std::uint8_t { adiabatic, exposed, fixed };
/// Boundary condition of a face.
struct FaceCondition {
  FaceKind kind = FaceKind::adiabatic;
  double emissivity_frac = 0.0;  ///< exposed faces emit eps sigma T^4; 0..1
  double fixed_k = 0.0;          ///< temperature of the four nodes of a fixed face, > 0
};

/// Drive of the exposed faces at one instant. Each span has one entry per exposed face.
struct FaceDrive {
  std::span<double> absorbed_w_m2;  ///< short-wave and long-wave, into the face
  std::span<double> film_w_m2_k;    ///< convection coefficient
  std::span<double> air_k;
};

/// Fills the drive at `time_s`. `face_k` is the mean temperature of every exposed face, as known at
/// that time (second order in the step); long-wave exchange between faces reads it. The result must
/// depend on the arguments alone. The thread that advances the solver makes the call.
using DriveFunction =
    std::function<void(double time_s, std::span<const double> face_k, const FaceDrive& drive)>;

/// Solver of the linear systems.
enum class LinearSolver : std::uint8_t {
  automatic,  ///< factorise small and plane grids, iterate on the others
  cg,         ///< conjugate gradients with incomplete Cholesky by blocks
  ldlt        ///< sparse direct factor; the symbolic part is done once
};

/// Options of a SolidSolver.
struct SolidOptions {
  double tolerance_k = 0.01;  ///< largest error of one step over all nodes, K
  double first_step_s = 0.1;
  double min_step_s = 1e-3;
  double max_step_s = 600.0;
  LinearSolver linear = LinearSolver::automatic;
};

/// Counters of a SolidSolver.
struct SolidStats {
  std::uint64_t steps = 0;
  std::uint64_t rejected = 0;
  std::uint64_t newton_iterations = 0;
  std::uint64_t linear_iterations = 0;
  std::uint64_t factorisations = 0;
};

/// All that a run carries from step to step. A run that continues from it gives the same bits as a
/// run that was never stopped.
struct SolidState {
  double time_s = 0.0;
  double step_s = 0.0;          ///< proposed length of the next step
  bool has_slope = false;       ///< false at the start
  std::vector<double> node_k;   ///< temperatures of all nodes
  std::vector<double> slope_w;  ///< net power into every free node at time_s
  double flow_w = 0.0;          ///< power through the boundary at time_s
  double heat_in_j = 0.0;       ///< heat through the boundary since the start
  SolidStats stats;
};

/// Solver of transient heat conduction on a SolidGrid. Owner: the caller. Thread: one at a time.
/// The solver spreads its work over oneTBB's threads, and the result does not depend on their
/// number. Setup class: it allocates and takes seconds to hours.
///   auto solver = SolidSolver::create(grid, condition, {});
///   solver->set_uniform(0.0, 293.15);
///   solver->advance(3600.0, drive);
///   double top = solver->face_k(0);
class SolidSolver {
 public:
  /// Creates a solver. `condition` is called once for every face. Nodes of held cells and of fixed
  /// faces keep their temperature. Errors: invalid_argument (grid lines, cell or material values,
  /// more than 2^31 nodes, no solid cell, options out of range).
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

  /// Sets the start temperature of all free nodes. Nodes of fixed temperature keep theirs.
  void set_uniform(double time_s, double temperature_k);
  /// Sets the start temperature of every free node by a function of its place in m.
  void set_temperature(double time_s, const std::function<double(const glm::dvec3&)>& kelvin);

  /// Advances to `to_s` by adaptive steps that end there. After each step it calls `after_step`,
  /// which may be empty, with the time reached; a return of false stops the run there without
  /// error. Errors: invalid_argument (`to_s` lies in the past), internal (no convergence at the
  /// smallest step, a drive that is not finite).
  [[nodiscard]] physics::Result<void> advance(
      double to_s, const DriveFunction& drive,
      const std::function<bool(double time_s)>& after_step = {});
  /// Takes one step to `to_s` without error control. Returns the estimate of its error, K. Errors:
  /// those of advance().
  [[nodiscard]] physics::Result<double> step(double to_s, const DriveFunction& drive);

  [[nodiscard]] double time_s() const noexcept;
  [[nodiscard]] std::span<const double> node_k() const noexcept;
  /// Returns the mean temperature over the corners of exposed face `face`.
  /// @pre face < faces().size().
  [[nodiscard]] double face_k(std::size_t face) const noexcept;
  /// Returns the temperature at a point of a face, bilinear on the face. The point is clamped to
  /// the face.
  /// @pre face < faces().size().
  [[nodiscard]] double face_k_at(std::size_t face, const glm::dvec3& point_m) const noexcept;

  /// Returns the sum of heat capacity times temperature over the free nodes of the whole grid, J.
  [[nodiscard]] double heat_j() const noexcept;
  /// Returns the heat that flowed in through exposed faces and from fixed nodes since the start, J,
  /// summed with the weights of the time scheme.
  [[nodiscard]] double heat_in_j() const noexcept;

  [[nodiscard]] const SolidStats& stats() const noexcept;
  [[nodiscard]] SolidState state() const;
  /// Continues from a saved state. Errors: invalid_argument if the number of nodes differs.
  [[nodiscard]] physics::Result<void> restore(const SolidState& state);

 private:
  struct Data;
  explicit SolidSolver(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

}  // namespace emit::reference
