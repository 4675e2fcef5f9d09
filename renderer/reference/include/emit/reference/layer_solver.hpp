// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "emit/reference/layer_mesh.hpp"

namespace emit::reference {

/// What acts on the face at an instant:
/// q = absorbed + film (air - T) - emissivity sigma T^4, W/m2 into the body.
struct FaceState {
  double absorbed_w_m2 = 0.0;
  double film_w_m2_k = 0.0;
  double air_k = 0.0;
};

/// A stretch of time over which each of the face's values is linear.
struct FaceSegment {
  double start_s = 0.0;
  double end_s = 0.0;
  FaceState start;
  FaceState end;
};

/// Row of a forcing table: linear between rows, two rows at one time are a jump.
struct ForcingRow {
  double time_s = 0.0;
  FaceState face;
};

/// Net flux into the body for a face temperature, with its slope (<= 0 for a stable surface).
struct FaceFlux {
  double flux_w_m2 = 0.0;
  double slope_w_m2_k = 0.0;
};
/// A boundary of the caller's own, smooth in time over the stretch it is used for.
class FaceModel {
 public:
  virtual ~FaceModel() = default;
  [[nodiscard]] virtual FaceFlux at(double time_s, double face_k) const noexcept = 0;
};

struct StepOptions {
  /// Largest error of one step, K (embedded third-order estimate); the temperature follows within a
  /// few times this. refine divides it by refine^3, which divides the steps by refine.
  double tolerance_k = 1.0e-3;
  double max_step_s = 3.0e7;
  /// > 0: no error control, every segment is cut into equal steps of at most this (divided by
  /// refine). For convergence studies.
  double fixed_step_s = 0.0;
  std::uint32_t refine = 1;
};

/// Counters since start().
struct StepCounts {
  std::uint64_t accepted = 0;
  std::uint64_t rejected = 0;
  std::uint64_t at_floor = 0;  ///< accepted above the tolerance: no smaller step is resolved
  std::uint64_t newton_unconverged = 0;
};

/// Transient conduction in a layered body under a radiating, convecting face.
///
/// TR-BDF2 (second order, L-stable), step control by its embedded third-order estimate. Steps are
/// power-of-two parts of a segment, so they end exactly on its ends, where forcing may jump, and so
/// that factorised matrices are met again. The tridiagonal system is eliminated from the base
/// upwards, which leaves one scalar equation for the face; Newton solves it to rounding, so each
/// stage satisfies the non-linear balance exactly. Temperatures are kept as offsets.
///
/// Owner: caller, one per thread. The mesh must outlive it. No allocation after construction except
/// in the functions that return vectors.
///
///   LayerSolver solver(mesh, {.tolerance_k = 1e-3});
///   solver.start(profile, t0_s);
///   for (const FaceSegment& segment : segments) solver.advance(segment, emissivity);
///   solver.face_k();
class LayerSolver {
 public:
  explicit LayerSolver(const LayerMesh& mesh, const StepOptions& options = {});

  /// Sets the profile (constant beyond its ends) and the clock, forgets the step size. A held base
  /// takes its own temperature. @pre profile is not empty, ascending in depth.
  void start(std::span<const ProfilePoint> profile, double time_s);
  /// The same with a temperature per node.
  void start_nodes(std::span<const double> node_k, double time_s);

  /// Steps to the end of the segment. @pre segment.start_s is the solver's time (to rounding).
  void advance(const FaceSegment& segment, double emissivity_frac) noexcept;
  /// The same with the caller's own boundary.
  void advance(double end_s, const FaceModel& face) noexcept;
  /// Face held at a temperature, linear in time over the stretch; a jump at its start is taken.
  void advance_held(double end_s, double start_k, double end_k) noexcept;

  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] double face_k() const noexcept { return offset_k_ + theta_[0]; }
  /// At any depth, clamped to the body: cubic in each cell, with the curvature that the heat
  /// equation gives for the present rate of change.
  [[nodiscard]] double temperature_k(double depth_m) const noexcept;
  /// Per node of the mesh.
  void copy_nodes_k(std::span<double> out) const noexcept;

  /// Heat above the reference temperature of the solver, J/m2: only differences mean something.
  [[nodiscard]] double stored_heat_j_m2() const noexcept;
  /// Integral since start() of the flux into the face less that out of the base, J/m2, with the
  /// weights of the method: equals the change of stored_heat_j_m2() to rounding. A held face takes
  /// what the balance leaves for it.
  [[nodiscard]] double heat_in_j_m2() const noexcept { return heat_in_j_m2_; }
  [[nodiscard]] const StepCounts& counts() const noexcept { return counts_; }
  [[nodiscard]] const LayerMesh& mesh() const noexcept { return *mesh_; }

  /// Of one step length: the tridiagonal matrix M + d dt K, eliminated from the base upwards.
  struct Factors {
    double step_s = -1.0;
    std::uint64_t used = 0;
    std::vector<double> raise;      ///< coupling of row i to node i + 1 over the pivot there
    std::vector<double> lower;      ///< coupling of row i to node i - 1 over its pivot
    std::vector<double> pivot_inv;  ///< 1 / pivot; node 0 holds the pivot itself
  };

 private:
  struct StepOutcome {
    double error_k = 0.0;
    double heat_j_m2 = 0.0;
    double face_flux_w_m2 = 0.0;
  };

  void reset(double time_s);
  [[nodiscard]] const Factors& factors_for(double step_s) noexcept;
  template <class Face>
  void run(double end_s, const Face& face) noexcept;
  template <class Face>
  [[nodiscard]] StepOutcome try_step(double start_frac, double step_frac, double step_s,
                                     const Face& face, bool estimate) noexcept;
  template <class Face>
  [[nodiscard]] double solve_face(const Face& face, double frac, double pivot, double rhs,
                                  double gain, double guess_k, FaceFlux& flux) noexcept;
  void conduct() noexcept;
  void accept(const StepOutcome& outcome) noexcept;
  void multiply_mass(const std::vector<double>& in, std::vector<double>& out) const noexcept;

  const LayerMesh* mesh_;
  StepOptions options_;
  std::size_t unknowns_ = 0;  ///< nodes less the held base
  double offset_k_ = 0.0;     ///< nodes are offset_k_ + theta_
  double time_s_ = 0.0;
  double next_step_s_ = 0.0;
  double last_flux_w_m2_ = 0.0;  ///< into the face at the end of the last stretch
  double heat_in_j_m2_ = 0.0;
  double face_rate_k_s_ = 0.0;  ///< of the present stretch when the face is held
  bool held_ = false;
  StepCounts counts_;
  std::vector<double> theta_, conducted_, stage_, final_, error_, stage_mass_, final_mass_;
  std::vector<Factors> cache_;
  std::size_t newest_ = 0;
  std::uint64_t cache_clock_ = 0;
};

/// Face temperatures at ascending times under a forcing table; times before the first row or after
/// the last are answered with the face held by the first or last row's forcing. Starts at the first
/// row's time from the profile. @pre rows not empty, ascending; times ascending; same size of out.
void face_history(LayerSolver& solver, std::span<const ProfilePoint> profile,
                  std::span<const ForcingRow> rows, double emissivity_frac,
                  std::span<const double> times_s, std::span<double> out_k) noexcept;

}  // namespace emit::reference
