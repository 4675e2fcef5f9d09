// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/fit.hpp"
#include "emit/reference/layer_solver.hpp"

namespace emit::reference {

/// Part of a history over which the drive is linear. Some steps have the true temperature at their
/// end.
struct FitStep {
  double dt_s = 0.0;
  physics::FosterDrive<double> begin;  ///< air_offset_k is an offset from physics::kReferenceK
  physics::FosterDrive<double> end;
  std::optional<FaceMoisture> begin_water;  ///< what the reference takes for the moist drive
  std::optional<FaceMoisture> end_water;
  double truth_k = 0.0;     ///< temperature at the end of the step
  double weight = 0.0;      ///< weight of the residual; 0 if there is none
  std::uint32_t gains = 0;  ///< index of the step's length in step_lengths_s
};
/// History of a surface.
struct FitHistory {
  std::string name;
  bool judged = true;
  std::vector<FitStep> steps;
};

/// Everything that the fit of one material runs over: a shared beginning, and histories that start
/// at its end.
struct FitProblem {
  double emissivity_frac = 1.0;
  double base_k = 0.0;
  double initial_k = 0.0;
  double resistance_m2k_w = 0.0;
  double core_conductance_w_m2_k = 0.0;  ///< used by emit2014
  FitHistory beginning;                  ///< spin-up; it may have residuals of its own
  std::vector<FitHistory> histories;
  std::vector<double> step_lengths_s;
  double truth_at_start_k = 0.0;  ///< true temperature at the start of the histories

  /// Fills FitStep::gains and step_lengths_s.
  void index_steps();
};

/// Runs the reference over the spin-up and the five histories. Errors: those of fit_material().
[[nodiscard]] physics::Result<FitProblem> material_problem(const scene::Material& material,
                                                           std::span<const GroundForcing> forcing,
                                                           double start_s, double initial_k,
                                                           const FitOptions& options);
/// Makes a problem of one history from a curve. Errors: invalid_argument (fewer than 8 points,
/// times that go back), config.
[[nodiscard]] physics::Result<FitProblem> curve_problem(const scene::Material& material,
                                                        std::span<const CurvePoint> curve);

/// Computes the residuals (model - truth) * weight of a foster model with given modes, in a fixed
/// order.
void foster_residuals(const FitProblem& problem, const physics::FosterNetwork& network,
                      std::vector<double>& out);
/// Computes the residuals of an emit2014 model with given modes, in the same order.
void emit2014_residuals(const FitProblem& problem, std::span<const scene::RelaxationMode> modes,
                        std::vector<double>& out);
/// Returns the number of residuals.
[[nodiscard]] std::size_t residual_count(const FitProblem& problem);
/// Returns the error of every history, from residuals in that order.
[[nodiscard]] std::vector<FitResidual> summarise(const FitProblem& problem,
                                                 std::span<const double> residuals);

}  // namespace emit::reference
