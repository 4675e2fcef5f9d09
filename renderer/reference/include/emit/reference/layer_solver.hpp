// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <cstddef>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "emit/physics/air_film.hpp"
#include "emit/reference/layer_mesh.hpp"

namespace emit::reference {

/// Film of a face that depends on its temperature, or the mean over both faces of a sheet.
struct FaceFilm {
  physics::AirFilm air;
  glm::dvec3 normal{0.0, 0.0, 1.0};
  physics::FilmSkin skin;
  bool both_sides = false;  ///< the mean of this normal and the opposite one

  /// Returns the film coefficient of a face that much warmer than the air.
  [[nodiscard]] double at_w_m2_k(double excess_k) const noexcept {
    const double front = physics::film_w_m2_k(air, normal, skin, excess_k);
    return both_sides ? 0.5 * (front + physics::film_w_m2_k(air, -normal, skin, excess_k)) : front;
  }
};

/// Exchange of water between a face and the air, at an instant.
struct FaceMoisture {
  double vapour_pa = 0.0;  ///< of the air
  double pressure_pa = 101'325.0;
  double wetness_frac = 1.0;    ///< share of the evaporation of a face that is moist all over
  double resistance_s_m = 0.0;  ///< of the surface, under the light of that instant
  double film_frac =
      0.0;  ///< share that rain has wetted, without that resistance; the rest is as above

  /// Returns the latent heat that leaves the face, W m-2, without any linearisation: the mass of
  /// water through both resistances times its heat of vaporisation. Dew forms on the whole face,
  /// without its resistance, unless the face is dry. @pre film_w_m2_k > 0 and air_k > 0
  [[nodiscard]] double latent_w_m2(double face_k, double air_k, double film_w_m2_k) const noexcept;
};
/// Returns the saturation pressure of water vapour, Pa: over water by Wagner and Pruss (1993), over
/// ice below 273.15 K by Murphy and Koop (2005). Valid for 110 to 640 K.
[[nodiscard]] double saturation_pa(double temperature_k) noexcept;

/// Values that act on the face at an instant. The flux into the solid is q = absorbed + film (air -
/// T) - emissivity sigma T^4 - latent heat, W/m2.
struct FaceState {
  double absorbed_w_m2 = 0.0;
  double film_w_m2_k = 0.0;  ///< counts if `film` is absent
  double air_k = 0.0;
  std::optional<FaceFilm> film = std::nullopt;
  std::optional<FaceMoisture> moisture = std::nullopt;  ///< absent: the face is dry

  /// Returns the film coefficient at a temperature of the face.
  [[nodiscard]] double film_at_w_m2_k(double face_k) const noexcept {
    return film ? film->at_w_m2_k(face_k - air_k) : film_w_m2_k;
  }
};

/// Stretch of time over which each value of the face is linear.
struct FaceSegment {
  double start_s = 0.0;
  double end_s = 0.0;
  FaceState start;
  FaceState end;
};

/// Row of a forcing table. Values are linear between rows; two rows at one time make a jump.
struct ForcingRow {
  double time_s = 0.0;
  FaceState face;
};

/// Net flux into the solid at a face temperature, with its slope. The slope is <= 0 for a stable
/// surface.
struct FaceFlux {
  double flux_w_m2 = 0.0;
  double slope_w_m2_k = 0.0;
};
/// Boundary condition that a caller implements. It must be smooth in time over the stretch it is
/// used for.
class FaceModel {
 public:
  virtual ~FaceModel() = default;
  /// Returns the flux at a time and a face temperature.
  [[nodiscard]] virtual FaceFlux at(double time_s, double face_k) const noexcept = 0;
};

/// Options of the time steps.
struct StepOptions {
  /// Largest error of one step, K, by the embedded third-order estimate. The error of the
  /// temperature is at most a few times this. `refine` divides it by refine^3, which divides the
  /// steps by refine.
  double tolerance_k = 1.0e-3;
  double max_step_s = 3.0e7;
  /// A value > 0 turns the error control off: every segment is cut into equal steps of at most this
  /// length, divided by `refine`. It is for convergence studies.
  double fixed_step_s = 0.0;
  std::uint32_t refine = 1;
};

/// Counters of a solver since start().
struct StepCounts {
  std::uint64_t accepted = 0;
  std::uint64_t rejected = 0;
  /// Steps accepted above the tolerance, because no smaller step is resolved.
  std::uint64_t at_floor = 0;
  std::uint64_t newton_unconverged = 0;
};

/// Solver of transient conduction in a stack of layers under a radiating, convecting face.
///
/// The method is TR-BDF2 (second order, L-stable) with step control by its embedded third-order
/// estimate. Steps are power-of-two parts of a segment. They therefore end exactly on its ends,
/// where forcing may jump, and the same factorised matrices occur again. The tridiagonal system is
/// eliminated from the base upwards, which leaves one scalar equation for the face. Newton solves
/// it to rounding, so each stage satisfies the non-linear balance exactly. Temperatures are kept as
/// offsets.
///
/// Owner: the caller, one solver per thread. The mesh must outlive it. After construction only the
/// functions that return vectors allocate.
///
///   LayerSolver solver(mesh, {.tolerance_k = 1e-3});
///   solver.start(profile, t0_s);
///   for (const FaceSegment& segment : segments) solver.advance(segment, emissivity);
///   solver.face_k();
class LayerSolver {
 public:
  explicit LayerSolver(const LayerMesh& mesh, const StepOptions& options = {});

  /// Sets the temperature profile, which is constant beyond its ends, and the clock. Forgets the
  /// step size. A held base takes its own temperature.
  /// @pre profile is not empty and ascending in depth.
  void start(std::span<const ProfilePoint> profile, double time_s);
  /// Sets the temperature of every node, and the clock.
  /// @pre node_k has one value per node of the mesh.
  void start_nodes(std::span<const double> node_k, double time_s);

  /// Steps to the end of the segment.
  /// @pre segment.start_s is time_s(), to rounding.
  void advance(const FaceSegment& segment, double emissivity_frac) noexcept;
  /// Steps to `end_s` under the caller's own boundary condition.
  void advance(double end_s, const FaceModel& face) noexcept;
  /// Steps to `end_s` with the face held at a temperature that is linear in time. A jump of the
  /// temperature at the start of the stretch is allowed.
  void advance_held(double end_s, double start_k, double end_k) noexcept;
  /// Sets the temperature at which the base is held now, and the rate at which it changes from now
  /// on, until this is called again. start() and start_nodes() hold it still at the mesh's.
  /// @pre mesh().base_held()
  void move_base(double temperature_k, double rate_k_s) noexcept;

  [[nodiscard]] double time_s() const noexcept { return time_s_; }
  [[nodiscard]] double face_k() const noexcept { return offset_k_ + theta_[0]; }
  /// Returns the temperature at a depth, which is clamped to the stack. It is cubic in each cell,
  /// with the curvature that the heat equation gives for the present rate of change.
  [[nodiscard]] double temperature_k(double depth_m) const noexcept;
  /// Copies the temperatures of the nodes, as many as `out` holds.
  void copy_nodes_k(std::span<double> out) const noexcept;

  /// Heat above the reference temperature of the solver, J/m2. Only differences have a meaning.
  [[nodiscard]] double stored_heat_j_m2() const noexcept;
  /// Integral since start() of the flux into the face minus the flux out of the base, J/m2, with
  /// the weights of the method. It equals the change of stored_heat_j_m2() to rounding. A held face
  /// takes the flux that the balance leaves for it.
  [[nodiscard]] double heat_in_j_m2() const noexcept { return heat_in_j_m2_; }
  /// Integral since start() of the flux out of a held base, J/m2, with the same weights.
  [[nodiscard]] double heat_out_of_base_j_m2() const noexcept { return heat_out_of_base_j_m2_; }
  [[nodiscard]] const StepCounts& counts() const noexcept { return counts_; }
  [[nodiscard]] const LayerMesh& mesh() const noexcept { return *mesh_; }

  /// Factorised tridiagonal matrix M + d dt K of one step length, eliminated from the base upwards.
  struct Factors {
    double step_s = -1.0;
    std::uint64_t used = 0;
    std::vector<double> raise;      ///< coupling of row i to node i + 1 over the pivot of row i + 1
    std::vector<double> lower;      ///< coupling of row i to node i - 1 over the pivot of row i
    std::vector<double> pivot_inv;  ///< 1 / pivot; node 0 holds the pivot itself
  };

 private:
  struct StepOutcome {
    double error_k = 0.0;
    double heat_j_m2 = 0.0;
    double base_heat_j_m2 = 0.0;
    double base_change_k = 0.0;
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
  void multiply_mass(const std::vector<double>& in, double base,
                     std::vector<double>& out) const noexcept;

  const LayerMesh* mesh_;
  StepOptions options_;
  std::size_t unknowns_ = 0;  ///< number of nodes without a held base
  double offset_k_ = 0.0;     ///< a node's temperature is offset_k_ + theta_
  double time_s_ = 0.0;
  double next_step_s_ = 0.0;
  /// Flux into the face at the end of the last stretch.
  double last_flux_w_m2_ = 0.0;
  double heat_in_j_m2_ = 0.0;
  double heat_out_of_base_j_m2_ = 0.0;
  double base_rate_k_s_ = 0.0;
  /// Rate of the present stretch if the face is held.
  double face_rate_k_s_ = 0.0;
  bool held_ = false;
  StepCounts counts_;
  std::vector<double> theta_, conducted_, stage_, final_, error_, stage_mass_, final_mass_;
  std::vector<Factors> cache_;
  std::size_t newest_ = 0;
  std::uint64_t cache_clock_ = 0;
};

/// Computes face temperatures at given times under a forcing table. The run starts from the profile
/// at the time of the first row. Outside the table the first or the last row's forcing holds.
/// @pre rows is not empty and ascending; times_s is ascending; out_k has the size of times_s.
void face_history(LayerSolver& solver, std::span<const ProfilePoint> profile,
                  std::span<const ForcingRow> rows, double emissivity_frac,
                  std::span<const double> times_s, std::span<double> out_k) noexcept;

}  // namespace emit::reference
