// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <string>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/fit.hpp"

namespace emit::reference {

/// Part of a history over which the drive is linear; samples of the truth at some of the ends.
struct FitStep {
  double dt_s = 0.0;
  physics::FosterDrive<double> begin;  ///< air as an offset from physics::kReferenceK
  physics::FosterDrive<double> end;
  double truth_k = 0.0;     ///< at the end
  double weight = 0.0;      ///< 0: no residual here
  std::uint32_t gains = 0;  ///< which of the distinct step lengths
};

struct FitHistory {
  std::string name;
  bool judged = true;
  std::vector<FitStep> steps;
};

/// Everything a fit of one material runs over: a shared beginning, then histories that start where
/// it ends.
struct FitProblem {
  double emissivity_frac = 1.0;
  double base_k = 0.0;
  double initial_k = 0.0;
  double resistance_m2k_w = 0.0;
  double core_conductance_w_m2_k = 0.0;  ///< emit2014
  FitHistory beginning;                  ///< may have residuals of its own
  std::vector<FitHistory> histories;
  std::vector<double> step_lengths_s;
  double truth_at_start_k = 0.0;  ///< where the histories begin

  /// Fills FitStep::gains and step_lengths_s.
  void index_steps();
};

/// Runs the reference over the spin-up and the five histories.
[[nodiscard]] physics::Result<FitProblem> material_problem(const scene::Material& material,
                                                           std::span<const GroundForcing> forcing,
                                                           double start_s, double initial_k,
                                                           const FitOptions& options);
[[nodiscard]] physics::Result<FitProblem> curve_problem(const scene::Material& material,
                                                        std::span<const CurvePoint> curve);

/// Residuals (model - truth) * weight of the model with given modes, in a fixed order.
void foster_residuals(const FitProblem& problem, const physics::FosterNetwork& network,
                      std::vector<double>& out);
void emit2014_residuals(const FitProblem& problem, std::span<const scene::RelaxationMode> modes,
                        std::vector<double>& out);
[[nodiscard]] std::size_t residual_count(const FitProblem& problem);
/// Per history, from residuals in that order.
[[nodiscard]] std::vector<FitResidual> summarise(const FitProblem& problem,
                                                 std::span<const double> residuals);

}  // namespace emit::reference
