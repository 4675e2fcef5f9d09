// SPDX-License-Identifier: Apache-2.0
// The fits run Ceres over unconstrained parameters: tau_1 = e^a, tau_i+1 = tau_i (1 + e^b_i), and
// shares by softmax with the last logit 0. Whatever the parameters are, time constants are then
// positive and ordered, and shares are positive and add up to one.
#include <ceres/ceres.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "fit_history.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kFastestTauS = 1.0;
constexpr double kSlowestTauS = 1e8;
constexpr double kMinShare = 1e-6;

/// Time constant of a mode and its share of the whole response.
struct Mode {
  double tau_s = 0.0;
  double share = 0.0;
};

/// Converts parameters to modes.
std::vector<Mode> modes_of(const double* p, std::size_t count) {
  std::vector<Mode> modes(count);
  double tau_s = std::exp(p[0]);
  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0) tau_s *= 1.0 + std::exp(p[i]);
    modes[i].tau_s = tau_s;
    modes[i].share = i + 1 < count ? std::exp(p[count + i]) : 1.0;
    sum += modes[i].share;
  }
  for (Mode& mode : modes) mode.share /= sum;
  return modes;
}

/// Converts modes to parameters.
std::vector<double> parameters_of(const std::vector<Mode>& modes) {
  const std::size_t count = modes.size();
  std::vector<double> p(2 * count - 1);
  p[0] = std::log(modes[0].tau_s);
  for (std::size_t i = 1; i < count; ++i) {
    p[i] = std::log(std::max(modes[i].tau_s / modes[i - 1].tau_s - 1.0, 1e-3));
  }
  const double last = std::max(modes.back().share, kMinShare);
  for (std::size_t i = 0; i + 1 < count; ++i) {
    p[count + i] = std::log(std::max(modes[i].share, kMinShare) / last);
  }
  return p;
}

/// Returns the network of modes with a given total resistance.
physics::FosterNetwork network_of(const std::vector<Mode>& modes, double resistance_m2k_w) {
  physics::FosterNetwork network;
  for (const Mode& mode : modes) {
    network.modes[network.count++] = {mode.tau_s, mode.share * resistance_m2k_w};
  }
  return network;
}

/// Returns modes as those of emit2014.
std::vector<scene::RelaxationMode> relaxation_of(const std::vector<Mode>& modes) {
  std::vector<scene::RelaxationMode> out;
  for (const Mode& mode : modes) out.push_back({mode.tau_s, mode.share});
  return out;
}

/// Cost function of Ceres: the residuals of a model as a function of the parameters.
class Residuals {
 public:
  Residuals(const FitProblem& problem, FitModel model, std::size_t count)
      : problem_(&problem), model_(model), count_(count) {}

  bool operator()(double const* const* parameters, double* out) const {
    const std::vector<Mode> modes = modes_of(parameters[0], count_);
    // Refuse parameters outside the range of time constants; Ceres then takes a shorter step.
    if (!(modes.back().tau_s < kSlowestTauS && modes.front().tau_s > kFastestTauS)) return false;
    std::vector<double> residuals;
    evaluate(modes, residuals);
    std::copy(residuals.begin(), residuals.end(), out);
    return std::all_of(residuals.begin(), residuals.end(),
                       [](double r) { return std::isfinite(r); });
  }

  void evaluate(const std::vector<Mode>& modes, std::vector<double>& residuals) const {
    if (model_ == FitModel::foster) {
      foster_residuals(*problem_, network_of(modes, problem_->resistance_m2k_w), residuals);
    } else {
      emit2014_residuals(*problem_, relaxation_of(modes), residuals);
    }
  }

 private:
  const FitProblem* problem_;
  FitModel model_;
  std::size_t count_;
};

/// Result of one search.
struct Solution {
  std::vector<Mode> modes;
  double cost = 0.0;
  std::uint32_t iterations = 0;
  bool converged = false;
};

/// Searches from one start for the modes of least cost.
Solution minimise(const FitProblem& problem, FitModel model, const std::vector<Mode>& start) {
  std::vector<double> p = parameters_of(start);
  // The cost function owns the residuals, as Ceres requires.
  auto cost = std::make_unique<ceres::DynamicNumericDiffCostFunction<Residuals, ceres::CENTRAL>>(
      new Residuals(problem, model, start.size()));
  cost->AddParameterBlock(static_cast<int>(p.size()));
  cost->SetNumResiduals(static_cast<int>(residual_count(problem)));
  ceres::Problem solver;
  solver.AddResidualBlock(cost.release(), nullptr, p.data());
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::DENSE_QR;
  options.max_num_iterations = 60;
  options.function_tolerance = 1e-7;
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &solver, &summary);
  Solution out;
  out.modes = modes_of(p.data(), start.size());
  // A search that could not begin has no cost that could be compared.
  out.cost =
      summary.IsSolutionUsable() ? summary.final_cost : std::numeric_limits<double>::infinity();
  out.iterations = static_cast<std::uint32_t>(summary.iterations.size());
  out.converged = summary.termination_type == ceres::CONVERGENCE;
  return out;
}

/// Returns the modes of a network with their shares of its resistance.
std::vector<Mode> shares_of(const physics::FosterNetwork& network) {
  std::vector<Mode> modes;
  for (std::size_t i = 0; i < network.count; ++i) {
    modes.push_back({std::clamp(network.modes[i].tau_s, 1.5 * kFastestTauS, kSlowestTauS / 1.5),
                     network.modes[i].resistance_m2k_w / network.resistance_m2k_w()});
  }
  return modes;
}

/// Returns the starts of the search: networks of the stack over different ranges of periods.
Result<std::vector<std::vector<Mode>>> foster_starts(const scene::Material& material,
                                                     const FitOptions& options) {
  std::vector<physics::StackLayer> layers;
  for (const scene::Layer& layer : material.layers) {
    layers.push_back({layer.thickness_m, layer.conductivity_w_m_k,
                      layer.density_kg_m3 * layer.specific_heat_j_kg_k});
  }
  // The first range is that of modes without a fit. It finds the minimum of dry soil over moist
  // soil, whose slow modes matter.
  constexpr double kPeriods[][2] = {{100.0, 864'000.0},
                                    {60.0, 172'800.0},
                                    {200.0, 86'400.0},
                                    {60.0, 20'000.0},
                                    {600.0, 172'800.0}};
  std::vector<std::vector<Mode>> starts;
  for (std::uint32_t i = 0; i < std::clamp(options.starts, 1U, 5U); ++i) {
    auto network = physics::network_of_stack(layers, {.modes = options.modes,
                                                      .shortest_period_s = kPeriods[i][0],
                                                      .longest_period_s = kPeriods[i][1]});
    if (!network) {
      return make_error(ErrorCode::config,
                        fmt::format("material '{}': {}", material.name, network.error().text));
    }
    if (i == 0 || network->count >= starts.front().size()) starts.push_back(shares_of(*network));
  }
  return starts;
}

/// Returns the starts of the search for emit2014: typical time constants.
std::vector<std::vector<Mode>> emit2014_starts(const FitOptions& options) {
  std::vector<std::vector<Mode>> starts;
  for (const auto& [fast_s, slow_s] :
       {std::pair{600.0, 7000.0}, std::pair{120.0, 2500.0}, std::pair{60.0, 20'000.0}}) {
    if (options.modes == 1)
      starts.push_back({{std::sqrt(fast_s * slow_s), 1.0}});
    else
      starts.push_back({{fast_s, 0.5}, {slow_s, 0.5}});
  }
  return starts;
}

/// Returns the network of the modes of a material, else of those of its layers.
Result<physics::FosterNetwork> own_network(const scene::Material& material,
                                           const FitOptions& options, double resistance_m2k_w) {
  physics::FosterNetwork network;
  for (const scene::FosterMode& mode : material.foster_modes) {
    if (network.count == physics::kMaxFosterModes) break;
    network.modes[network.count++] = {mode.tau_s, mode.resistance_m2k_w};
  }
  if (network.count > 0) return network;
  auto starts = foster_starts(material, options);
  if (!starts) return tl::unexpected(std::move(starts.error()));
  return network_of(starts->front(), resistance_m2k_w);
}

/// Returns the largest errors over the judged histories.
void worst_of(const std::vector<FitResidual>& residuals, double& rms_k, double& max_k) {
  for (const FitResidual& residual : residuals) {
    if (!residual.judged) continue;
    rms_k = std::max(rms_k, residual.rms_k);
    max_k = std::max(max_k, residual.max_k);
  }
}

/// Fits a model to a problem by the best of several searches.
Result<FitResult> solve(const scene::Material& material, const FitProblem& problem,
                        const FitOptions& options) {
  const std::size_t most = options.model == FitModel::foster ? physics::kMaxFosterModes : 2;
  if (options.modes < 1 || options.modes > most) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("{} modes: 1 to {} are possible", options.modes, most));
  }
  std::vector<std::vector<Mode>> starts;
  FitResult result;
  std::vector<double> residuals;
  if (options.model == FitModel::foster) {
    auto found = foster_starts(material, options);
    if (!found) return tl::unexpected(std::move(found.error()));
    starts = std::move(*found);
    // Judge the modes that follow from the layers alone, for comparison.
    Residuals(problem, options.model, starts[0].size()).evaluate(starts[0], residuals);
    worst_of(summarise(problem, residuals), result.derived_rms_k, result.derived_max_k);
  } else {
    starts = emit2014_starts(options);
  }

  // Search from every start and keep the best.
  Solution best;
  best.cost = std::numeric_limits<double>::infinity();
  for (const std::vector<Mode>& start : starts) {
    Solution solution = minimise(problem, options.model, start);
    if (solution.cost < best.cost) best = std::move(solution);
  }
  if (!std::isfinite(best.cost)) {
    return make_error(ErrorCode::internal,
                      fmt::format("material '{}': the fit found no finite model", material.name));
  }
  result.material = material.name;
  result.iterations = best.iterations;
  result.converged = best.converged;
  if (options.model == FitModel::foster) {
    result.network = network_of(best.modes, problem.resistance_m2k_w);
  } else {
    result.modes = relaxation_of(best.modes);
  }
  // Judge the result.
  Residuals(problem, options.model, best.modes.size()).evaluate(best.modes, residuals);
  result.residuals = summarise(problem, residuals);
  worst_of(result.residuals, result.rms_k, result.max_k);
  return result;
}

}  // namespace

Result<FitResult> fit_material(const scene::Material& material,
                               std::span<const GroundForcing> forcing, double start_s,
                               double initial_k, const FitOptions& options) {
  auto problem = material_problem(material, forcing, start_s, initial_k, options);
  if (!problem) return tl::unexpected(std::move(problem.error()));
  // The published model starts with the histories, so it has no spin-up.
  if (options.model == FitModel::emit2014) problem->beginning.steps.clear();
  auto result = solve(material, *problem, options);
  if (result) {
    result->horizon_s =
        options.history_s +
        (options.model == FitModel::foster ? std::min(options.spin_up_s, 86'400.0) : 0.0);
  }
  return result;
}

Result<FitResult> judge_material(const scene::Material& material,
                                 std::span<const GroundForcing> forcing, double start_s,
                                 double initial_k, const FitOptions& options) {
  auto problem = material_problem(material, forcing, start_s, initial_k, options);
  if (!problem) return tl::unexpected(std::move(problem.error()));
  FitResult result;
  result.material = material.name;
  std::vector<double> residuals;
  if (options.model == FitModel::emit2014) {
    problem->beginning.steps.clear();
    result.modes = material.modes;
    emit2014_residuals(*problem, result.modes, residuals);
  } else {
    auto network = own_network(material, options, problem->resistance_m2k_w);
    if (!network) return tl::unexpected(std::move(network.error()));
    result.network = *network;
    foster_residuals(*problem, result.network, residuals);
  }
  result.residuals = summarise(*problem, residuals);
  worst_of(result.residuals, result.rms_k, result.max_k);
  result.converged = true;
  return result;
}

Result<std::vector<CoursePoint>> day_course(const scene::Material& material,
                                            std::span<const GroundForcing> forcing, double end_s,
                                            double initial_k, const FitOptions& options) {
  // The spin-up of a problem has the day as its end. The histories after it are not needed.
  FitOptions short_options = options;
  short_options.history_s = 20.0;
  const auto problem = material_problem(material, forcing, end_s, initial_k, short_options);
  if (!problem) return tl::unexpected(problem.error());
  const auto network = own_network(material, options, problem->resistance_m2k_w);
  if (!network) return tl::unexpected(network.error());
  std::vector<double> residuals;
  foster_residuals(*problem, *network, residuals);

  // Residuals come first for the spin-up, and are there where a step has a weight.
  std::vector<CoursePoint> course;
  double time_s = end_s - options.spin_up_s;
  for (const FitStep& step : problem->beginning.steps) {
    time_s += step.dt_s;
    if (step.weight <= 0.0) continue;
    const double error_k = residuals[course.size()] / step.weight;
    course.push_back({time_s, step.truth_k, step.truth_k + error_k});
  }
  return course;
}

Result<FitResult> fit_curve(const scene::Material& material, std::span<const CurvePoint> curve,
                            const FitOptions& options) {
  auto problem = curve_problem(material, curve);
  if (!problem) return tl::unexpected(std::move(problem.error()));
  auto result = solve(material, *problem, options);
  if (result) result->horizon_s = curve.back().time_s - curve.front().time_s;
  return result;
}

}  // namespace emit::reference
