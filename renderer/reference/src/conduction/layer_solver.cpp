// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/layer_solver.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::reference {
namespace {

constexpr double kSigma = physics::kStefanBoltzmannWPerM2K4;

// TR-BDF2 written as a diagonally implicit method: stages at gamma and 1, weights w, w, d.
constexpr double kGamma = 2.0 - std::numbers::sqrt2;
constexpr double kW = std::numbers::sqrt2 / 4.0;
constexpr double kD = 0.5 * kGamma;

/// Number of halvings of the finest step. A step is length / 2^level, and a position counts parts
/// of length / 2^kFinest.
constexpr int kFinest = 46;
constexpr std::uint64_t kWhole = std::uint64_t{1} << kFinest;
constexpr std::size_t kCachedSteps = 32;
constexpr int kNewtonLimit = 60;

/// Face with the balance of a FaceSegment.
struct BalanceFace {
  static constexpr bool kHeld = false;
  const FaceSegment& segment;
  double emission_w_m2_k4;

  [[nodiscard]] FaceFlux at(double frac, double face_k) const noexcept {
    const auto mix = [frac](double a, double b) { return a + frac * (b - a); };
    const FaceState& a = segment.start;
    const FaceState& b = segment.end;
    const auto convection_w_m2 = [&](double k) {
      const double h_w_m2_k = mix(a.film_at_w_m2_k(k), b.film_at_w_m2_k(k));
      const double air_k = mix(a.air_k, b.air_k);
      const double sensible_w_m2 = h_w_m2_k * (air_k - k);
      if (!a.moisture || !b.moisture || !(h_w_m2_k > 0.0)) return sensible_w_m2;
      const FaceMoisture now{
          .vapour_pa = mix(a.moisture->vapour_pa, b.moisture->vapour_pa),
          .pressure_pa = mix(a.moisture->pressure_pa, b.moisture->pressure_pa),
          .wetness_frac = a.moisture->wetness_frac,
          .resistance_s_m = mix(a.moisture->resistance_s_m, b.moisture->resistance_s_m),
          .film_frac = mix(a.moisture->film_frac, b.moisture->film_frac)};
      return sensible_w_m2 - now.latent_w_m2(k, air_k, h_w_m2_k);
    };
    // Take the slope of what follows the temperature by differences.
    constexpr double kDifferenceK = 0.01;
    const double slope_w_m2_k =
        a.film || b.film || a.moisture
            ? (convection_w_m2(face_k + kDifferenceK) - convection_w_m2(face_k - kDifferenceK)) /
                  (2.0 * kDifferenceK)
            : -mix(a.film_w_m2_k, b.film_w_m2_k);
    // Keep the emission odd in T, so that a trial value below 0 K pushes the iteration back up.
    const double cube = std::abs(face_k) * face_k * face_k;
    return {mix(a.absorbed_w_m2, b.absorbed_w_m2) + convection_w_m2(face_k) -
                emission_w_m2_k4 * cube * face_k,
            std::min(slope_w_m2_k, 0.0) - 4.0 * emission_w_m2_k4 * cube};
  }
};

/// Face with the caller's own boundary condition.
struct ModelFace {
  static constexpr bool kHeld = false;
  const FaceModel& model;
  double start_s;
  double length_s;

  [[nodiscard]] FaceFlux at(double frac, double face_k) const noexcept {
    return model.at(start_s + frac * length_s, face_k);
  }
};

/// Face held at a temperature that is linear in time.
struct HeldFace {
  static constexpr bool kHeld = true;
  double start_k;
  double end_k;

  [[nodiscard]] double temperature_k(double frac) const noexcept {
    return start_k + frac * (end_k - start_k);
  }
};

/// Eliminates a right-hand side from the base upwards.
void eliminate(const LayerSolver::Factors& factors, std::vector<double>& rhs) noexcept {
  for (std::size_t i = rhs.size() - 1; i-- > 0;) rhs[i] -= factors.raise[i] * rhs[i + 1];
}

/// Turns the eliminated right-hand side into the solution. Node 0 must be solved already.
void substitute(const LayerSolver::Factors& factors, std::vector<double>& x) noexcept {
  for (std::size_t i = 1; i < x.size(); ++i) {
    x[i] = x[i] * factors.pivot_inv[i] - factors.lower[i] * x[i - 1];
  }
}

}  // namespace

double saturation_pa(double temperature_k) noexcept {
  if (temperature_k < physics::kZeroCelsiusK) {
    const double t = std::max(temperature_k, 110.0);
    return std::exp(9.550426 - 5723.265 / t + 3.53068 * std::log(t) - 0.00728332 * t);
  }
  constexpr double kCriticalK = 647.096;
  constexpr double kCriticalPa = 22.064e6;
  const double t = std::min(temperature_k, 640.0);
  const double v = 1.0 - t / kCriticalK;
  const double root = std::sqrt(v);
  const double cube = v * v * v;
  return kCriticalPa * std::exp(kCriticalK / t *
                                (-7.85951783 * v + 1.84408259 * v * root - 11.7866497 * cube +
                                 22.6807411 * cube * root - 15.9618719 * cube * v +
                                 1.80122502 * cube * cube * v * root));
}

double FaceMoisture::latent_w_m2(double face_k, double air_k, double film_w_m2_k) const noexcept {
  constexpr double kGasJKgK = 287.05;
  constexpr double kHeatJKgK = 1013.0;
  constexpr double kVapourRatio = 0.622;
  const double density_kg_m3 = pressure_pa / (kGasJKgK * air_k);
  const double film_s_m = density_kg_m3 * kHeatJKgK / film_w_m2_k;
  const double excess_pa = saturation_pa(face_k) - vapour_pa;
  const bool dew = excess_pa < 0.0;
  const double open_kg_m2_s = density_kg_m3 * kVapourRatio * excess_pa / pressure_pa / film_s_m;
  const bool dry = !(wetness_frac > 0.0) && !(film_frac > 0.0);
  const double rest = wetness_frac * film_s_m / (film_s_m + resistance_s_m);
  const double share = dry ? 0.0 : dew ? 1.0 : film_frac + (1.0 - film_frac) * rest;
  const double water_kg_m2_s = share * open_kg_m2_s;
  const double latent_j_kg = 2.501e6 - 2361.0 * (air_k - physics::kZeroCelsiusK);
  return latent_j_kg * water_kg_m2_s;
}

LayerSolver::LayerSolver(const LayerMesh& mesh, const StepOptions& options)
    : mesh_(&mesh), options_(options), unknowns_(mesh.nodes() - (mesh.base_held() ? 1 : 0)) {
  // Divide tolerance and steps by the refinement.
  const double refine = std::max(1.0, static_cast<double>(options_.refine));
  options_.tolerance_k /= refine * refine * refine;
  options_.fixed_step_s /= refine;
  // Allocate all work space here, so that the steps need none.
  theta_.assign(mesh.nodes(), 0.0);
  for (auto* work : {&conducted_, &stage_, &final_, &error_, &stage_mass_, &final_mass_}) {
    work->assign(unknowns_, 0.0);
  }
  cache_.resize(kCachedSteps);
  for (Factors& factors : cache_) {
    factors.raise.assign(unknowns_, 0.0);
    factors.lower.assign(unknowns_, 0.0);
    factors.pivot_inv.assign(unknowns_, 0.0);
  }
}

void LayerSolver::reset(double time_s) {
  time_s_ = time_s;
  next_step_s_ = std::numeric_limits<double>::infinity();
  heat_in_j_m2_ = 0.0;
  heat_out_of_base_j_m2_ = 0.0;
  base_rate_k_s_ = 0.0;
  held_ = false;
  counts_ = {};
  // Hold the base and take the flux of the profile as the flux before the start.
  if (mesh_->base_held()) theta_.back() = mesh_->base().temperature_k - offset_k_;
  last_flux_w_m2_ = mesh_->conductance_w_m2_k()[0] * (theta_[0] - theta_[1]);
}

void LayerSolver::start(std::span<const ProfilePoint> profile, double time_s) {
  EMIT_CHECK(!profile.empty());
  EMIT_CHECK(std::ranges::is_sorted(profile, {}, &ProfilePoint::depth_m));
  // Interpolate the profile at every node.
  offset_k_ = mesh_->base_held() ? mesh_->base().temperature_k : profile.back().temperature_k;
  std::size_t next = 0;
  for (std::size_t i = 0; i < theta_.size(); ++i) {
    const double depth_m = mesh_->depth_m()[i];
    while (next < profile.size() && profile[next].depth_m <= depth_m) ++next;
    double temperature_k = 0.0;
    if (next == 0) {
      temperature_k = profile.front().temperature_k;
    } else if (next == profile.size()) {
      temperature_k = profile.back().temperature_k;
    } else {
      const ProfilePoint& a = profile[next - 1];
      const ProfilePoint& b = profile[next];
      temperature_k = a.temperature_k + (b.temperature_k - a.temperature_k) *
                                            ((depth_m - a.depth_m) / (b.depth_m - a.depth_m));
    }
    theta_[i] = temperature_k - offset_k_;
  }
  reset(time_s);
}

void LayerSolver::start_nodes(std::span<const double> node_k, double time_s) {
  EMIT_CHECK_OP(node_k.size(), ==, theta_.size());
  offset_k_ = mesh_->base_held() ? mesh_->base().temperature_k : node_k.back();
  for (std::size_t i = 0; i < theta_.size(); ++i) theta_[i] = node_k[i] - offset_k_;
  reset(time_s);
}

const LayerSolver::Factors& LayerSolver::factors_for(double step_s) noexcept {
  // Look for factors of this step length, the last ones first. Note the entry that was unused for
  // longest.
  ++cache_clock_;
  std::size_t oldest = 0;
  if (cache_[newest_].step_s == step_s) {
    cache_[newest_].used = cache_clock_;
    return cache_[newest_];
  }
  for (std::size_t i = 0; i < cache_.size(); ++i) {
    if (cache_[i].step_s == step_s) {
      cache_[i].used = cache_clock_;
      newest_ = i;
      return cache_[i];
    }
    if (cache_[i].used < cache_[oldest].used) oldest = i;
  }
  // Replace that entry: factorise M + d dt K from the base upwards.
  Factors& factors = cache_[oldest];
  newest_ = oldest;
  factors.step_s = step_s;
  factors.used = cache_clock_;
  const auto conductance = mesh_->conductance_w_m2_k();
  const double b = kD * step_s;
  double pivot_below = 0.0;
  double lower_below = 0.0;  // coupling of the row below to this node
  for (std::size_t i = unknowns_; i-- > 0;) {
    const double up = i > 0 ? conductance[i - 1] : 0.0;
    const double down = i + 1 < mesh_->nodes() ? conductance[i] : 0.0;
    double pivot = mesh_->mass_own()[i] + b * (up + down);
    double raise = 0.0;
    if (i + 1 < unknowns_) {
      raise = (mesh_->mass_below()[i] - b * down) / pivot_below;
      pivot -= raise * lower_below;
    }
    lower_below = i > 0 ? mesh_->mass_above()[i] - b * up : 0.0;
    factors.raise[i] = raise;
    factors.lower[i] = lower_below / pivot;
    factors.pivot_inv[i] = i == 0 ? pivot : 1.0 / pivot;
    pivot_below = pivot;
  }
  return factors;
}

void LayerSolver::conduct() noexcept {
  const auto conductance = mesh_->conductance_w_m2_k();
  double from_above = 0.0;
  for (std::size_t i = 0; i < unknowns_; ++i) {
    const double down = i + 1 < theta_.size() ? conductance[i] * (theta_[i] - theta_[i + 1]) : 0.0;
    conducted_[i] = from_above - down;
    from_above = down;
  }
}

void LayerSolver::multiply_mass(const std::vector<double>& in, double base,
                                std::vector<double>& out) const noexcept {
  // The node below the last unknown is a held base, and changes by `base`.
  const auto above = mesh_->mass_above();
  const auto own = mesh_->mass_own();
  const auto below = mesh_->mass_below();
  const std::size_t last = unknowns_ - 1;
  if (last == 0) {
    out[0] = own[0] * in[0] + below[0] * base;
    return;
  }
  out[0] = own[0] * in[0] + below[0] * in[1];
  for (std::size_t i = 1; i < last; ++i) {
    out[i] = above[i] * in[i - 1] + own[i] * in[i] + below[i] * in[i + 1];
  }
  out[last] = above[last] * in[last - 1] + own[last] * in[last] + below[last] * base;
}

template <class Face>
double LayerSolver::solve_face(const Face& face, double frac, double pivot, double rhs, double gain,
                               double guess_k, FaceFlux& flux) noexcept {
  // Solve pivot x = rhs + gain q(T + x) by Newton. The function is increasing and, for radiation,
  // convex, so the iteration cannot cycle.
  const double base_k = offset_k_ + theta_[0];
  double x = guess_k;
  for (int i = 0; i < kNewtonLimit; ++i) {
    flux = face.at(frac, base_k + x);
    double slope = pivot - gain * flux.slope_w_m2_k;
    if (!(slope > 0.0)) slope = pivot;
    const double change = (rhs + gain * flux.flux_w_m2 - pivot * x) / slope;
    x += change;
    if (std::abs(change) <= 4.0e-15 * (std::abs(base_k) + std::abs(x))) {
      flux.flux_w_m2 += flux.slope_w_m2_k * change;  // the flux at the converged temperature
      return x;
    }
  }
  ++counts_.newton_unconverged;
  return x;
}

template <class Face>
LayerSolver::StepOutcome LayerSolver::try_step(double start_frac, double step_frac, double step_s,
                                               const Face& face, bool estimate) noexcept {
  const Factors& factors = factors_for(step_s);
  const double b = kD * step_s;
  const double pivot = factors.pivot_inv[0];
  const std::size_t n = unknowns_;
  StepOutcome outcome;
  FaceFlux flux_start;
  FaceFlux flux_stage;
  FaceFlux flux_end;
  // Evaluate the flux at the start of the step.
  if constexpr (!Face::kHeld) flux_start = face.at(start_frac, offset_k_ + theta_[0]);

  // Solve the first stage, the trapezium to t + gamma dt. The unknowns are increments on the start
  // of the step: (M + b K) x = right-hand side.
  // A base that moves adds a known term to the last of them.
  const double base_step_k = base_rate_k_s_ * step_s;
  const double base_stage_k = kGamma * base_step_k;
  const double base_pull = mesh_->base_held()
                               ? b * mesh_->conductance_w_m2_k()[n - 1] - mesh_->mass_below()[n - 1]
                               : 0.0;
  for (std::size_t i = 0; i < n; ++i) stage_[i] = 2.0 * b * conducted_[i];
  stage_[n - 1] += base_pull * base_stage_k;
  stage_[0] += b * flux_start.flux_w_m2;
  eliminate(factors, stage_);
  const double stage_frac = start_frac + kGamma * step_frac;
  if constexpr (Face::kHeld) {
    stage_[0] = face.temperature_k(stage_frac) - offset_k_ - theta_[0];
  } else {
    stage_[0] = solve_face(face, stage_frac, pivot, stage_[0], b, 0.0, flux_stage);
  }
  substitute(factors, stage_);
  multiply_mass(stage_, base_stage_k, stage_mass_);

  // Solve the second stage, BDF2 to the end of the step.
  for (std::size_t i = 0; i < n; ++i) final_[i] = kW / kD * stage_mass_[i] + b * conducted_[i];
  final_[n - 1] += base_pull * base_step_k;
  eliminate(factors, final_);
  if constexpr (Face::kHeld) {
    final_[0] = face.temperature_k(start_frac + step_frac) - offset_k_ - theta_[0];
  } else {
    final_[0] =
        solve_face(face, start_frac + step_frac, pivot, final_[0], b, stage_[0] / kGamma, flux_end);
  }
  substitute(factors, final_);
  outcome.face_flux_w_m2 = flux_end.flux_w_m2;

  // Estimate the error by the embedded third-order method; the implicit matrix damps it like the
  // step.
  if (estimate) {
    multiply_mass(final_, base_step_k, final_mass_);
    for (std::size_t i = 0; i < n; ++i) {
      error_[i] = 4.0 / 3.0 * kW * step_s * conducted_[i] -
                  (1.0 + 2.0 * kW) / (3.0 * kD) * stage_mass_[i] + 2.0 / 3.0 * final_mass_[i];
    }
    error_[0] += 4.0 / 3.0 * kW * step_s * flux_start.flux_w_m2;
    eliminate(factors, error_);
    if constexpr (Face::kHeld) {
      error_[0] = 0.0;
    } else {
      error_[0] /= pivot - b * std::min(0.0, flux_end.slope_w_m2_k);
    }
    substitute(factors, error_);
    for (const double e : error_) outcome.error_k = std::max(outcome.error_k, std::abs(e));
  }

  // Sum the heat of the step with the weights of the method.
  const std::size_t last = mesh_->nodes() - 1;
  outcome.base_change_k = base_step_k;
  if (mesh_->base_held()) {
    const double own_j_m2 =
        mesh_->mass_above()[last] * final_[n - 1] + mesh_->mass_own()[last] * base_step_k;
    const double now_k = theta_[n - 1] - theta_[last];
    outcome.base_heat_j_m2 =
        step_s * mesh_->conductance_w_m2_k()[n - 1] *
            (now_k + kW * (stage_[n - 1] - base_stage_k) + kD * (final_[n - 1] - base_step_k)) -
        own_j_m2;
    if constexpr (Face::kHeld) outcome.heat_j_m2 += own_j_m2;
  }
  // A held face takes the flux that the stored heat requires.
  if constexpr (Face::kHeld) {
    multiply_mass(final_, base_step_k, final_mass_);
    for (const double heat : final_mass_) outcome.heat_j_m2 += heat;
  } else {
    outcome.heat_j_m2 =
        step_s * (kW * (flux_start.flux_w_m2 + flux_stage.flux_w_m2) + kD * flux_end.flux_w_m2) -
        outcome.base_heat_j_m2;
  }
  return outcome;
}

void LayerSolver::accept(const StepOutcome& outcome) noexcept {
  for (std::size_t i = 0; i < unknowns_; ++i) theta_[i] += final_[i];
  if (mesh_->base_held()) theta_.back() += outcome.base_change_k;
  heat_in_j_m2_ += outcome.heat_j_m2;
  heat_out_of_base_j_m2_ += outcome.base_heat_j_m2;
  last_flux_w_m2_ = outcome.face_flux_w_m2;
  ++counts_.accepted;
  conduct();
}

template <class Face>
void LayerSolver::run(double end_s, const Face& face) noexcept {
  const double start_s = time_s_;
  const double length_s = end_s - start_s;
  if (!(length_s > 0.0)) return;
  held_ = Face::kHeld;
  conduct();

  // Take equal steps if the error control is off.
  if (options_.fixed_step_s > 0.0) {
    const double count = std::max(1.0, std::ceil(length_s / options_.fixed_step_s * (1.0 - 1e-12)));
    const double step_s = length_s / count;
    for (double i = 0.0; i < count; i += 1.0) {
      accept(try_step(i / count, 1.0 / count, step_s, face, false));
    }
    time_s_ = end_s;
    return;
  }

  double wanted_s = std::min(next_step_s_, options_.max_step_s);
  if constexpr (!Face::kHeld) {
    // Choose the first step after a jump of the flux. The face then follows sqrt(t); the step shall
    // move it by some thirty tolerances, but not be shorter than the first cell can resolve.
    const double jump = std::abs(face.at(0.0, face_k()).flux_w_m2 - last_flux_w_m2_);
    const double rise = 30.0 * options_.tolerance_k * mesh_->face_effusivity() / jump;
    const double cell_s = mesh_->capacity_j_m2_k()[0] / mesh_->conductance_w_m2_k()[0];
    const double restart_s = std::max(0.785 * rise * rise, 0.05 * cell_s);
    if (restart_s < wanted_s) wanted_s = restart_s;  // the comparison is false for NaN
  }
  // Turn the wanted step into a level, at which a step is length / 2^level.
  int level = 0;
  if (wanted_s < length_s) {
    level = std::min(kFinest, static_cast<int>(std::ceil(std::log2(length_s / wanted_s) - 1e-9)));
  }
  // Find the coarsest level that the largest step allows.
  const int coarsest =
      options_.max_step_s < length_s
          ? std::min(kFinest,
                     static_cast<int>(std::ceil(std::log2(length_s / options_.max_step_s) - 1e-9)))
          : 0;

  // Step through the segment.
  std::uint64_t position = 0;
  double error_k = 0.0;
  while (position < kWhole) {
    const double part = std::ldexp(1.0, -level);
    const StepOutcome outcome =
        try_step(static_cast<double>(position) / static_cast<double>(kWhole), part, length_s * part,
                 face, true);
    error_k = outcome.error_k;
    if (!(error_k <= options_.tolerance_k) && level < kFinest) {
      // Reject the step and refine by the third-order rate of the error.
      ++counts_.rejected;
      const double excess = std::log2(error_k / options_.tolerance_k) / 3.0;
      level += std::isfinite(excess) ? std::clamp(static_cast<int>(std::ceil(excess)), 1, 8) : 1;
      level = std::min(level, kFinest);
      continue;
    }
    if (!(error_k <= options_.tolerance_k)) ++counts_.at_floor;
    accept(outcome);
    position += kWhole >> level;
    // Coarsen when the error is small, but only where a step of twice the length would start.
    const bool aligned = level > 0 && ((position >> (kFinest - level)) & 1) == 0;
    if (aligned && level > coarsest && error_k < 0.1 * options_.tolerance_k) --level;
  }
  // Remember the step length for the next segment.
  next_step_s_ = std::ldexp(length_s, -level);
  if (level == 0 && error_k < 0.1 * options_.tolerance_k) next_step_s_ *= 2.0;
  time_s_ = end_s;
}

void LayerSolver::advance(const FaceSegment& segment, double emissivity_frac) noexcept {
  EMIT_CHECK(std::abs(segment.start_s - time_s_) <= 1e-6 * std::max(1.0, std::abs(time_s_)));
  run(segment.end_s, BalanceFace{segment, emissivity_frac * kSigma});
}

void LayerSolver::advance(double end_s, const FaceModel& face) noexcept {
  run(end_s, ModelFace{face, time_s_, end_s - time_s_});
}

void LayerSolver::advance_held(double end_s, double start_k, double end_k) noexcept {
  if (!(end_s > time_s_)) return;
  // Apply a jump of the face temperature, with the heat that it stores, and restart with a small
  // step.
  const double jump_k = start_k - offset_k_ - theta_[0];
  if (jump_k != 0.0) {
    theta_[0] += jump_k;
    heat_in_j_m2_ += (mesh_->mass_own()[0] + mesh_->mass_above()[1]) * jump_k;
    next_step_s_ =
        std::min(next_step_s_, 0.05 * mesh_->capacity_j_m2_k()[0] / mesh_->conductance_w_m2_k()[0]);
  }
  face_rate_k_s_ = (end_k - start_k) / (end_s - time_s_);
  run(end_s, HeldFace{start_k, end_k});
}

void LayerSolver::move_base(double temperature_k, double rate_k_s) noexcept {
  EMIT_CHECK(mesh_->base_held());
  // Apply a jump of the temperature, with the heat that it stores.
  const double jump_k = temperature_k - offset_k_ - theta_.back();
  const double stored_j_m2 =
      (mesh_->mass_own().back() + mesh_->mass_below()[unknowns_ - 1]) * jump_k;
  theta_.back() += jump_k;
  heat_in_j_m2_ += stored_j_m2;
  heat_out_of_base_j_m2_ -= stored_j_m2;
  base_rate_k_s_ = rate_k_s;
}

double LayerSolver::temperature_k(double depth_m) const noexcept {
  const auto depths = mesh_->depth_m();
  const auto conductance = mesh_->conductance_w_m2_k();
  const auto capacity = mesh_->capacity_j_m2_k();
  if (!(depth_m > 0.0)) return face_k();
  if (depth_m >= depths.back()) return offset_k_ + theta_.back();
  // Interpolate linearly in the cell that contains the depth.
  const auto above = static_cast<std::size_t>(
                         std::upper_bound(depths.begin(), depths.end(), depth_m) - depths.begin()) -
                     1;
  const double x = (depth_m - depths[above]) / (depths[above + 1] - depths[above]);
  const double linear = theta_[above] + x * (theta_[above + 1] - theta_[above]);
  // A profile that was just set may have kinks next to the cell: no curvature is known yet.
  if (counts_.accepted == 0) return offset_k_ + linear;

  // Add the curvature that the heat equation gives for the rates of change of both nodes.
  const auto rate_k_s = [&](std::size_t node) {
    const std::size_t last = theta_.size() - 1;
    if (node == 0 && held_) return face_rate_k_s_;
    if (node == last && mesh_->base_held()) return base_rate_k_s_;
    double gain =
        node == 0 ? last_flux_w_m2_ : conductance[node - 1] * (theta_[node - 1] - theta_[node]);
    double heat = node == 0 ? 0.0 : 0.5 * capacity[node - 1];
    if (node < last) {
      gain -= conductance[node] * (theta_[node] - theta_[node + 1]);
      heat += 0.5 * capacity[node];
    }
    return gain / heat;
  };
  const double y = 1.0 - x;
  const double bend = rate_k_s(above) * (y - y * y * y) + rate_k_s(above + 1) * (x - x * x * x);
  return offset_k_ + linear - capacity[above] / conductance[above] / 6.0 * bend;
}

void LayerSolver::copy_nodes_k(std::span<double> out) const noexcept {
  for (std::size_t i = 0; i < std::min(out.size(), theta_.size()); ++i) {
    out[i] = offset_k_ + theta_[i];
  }
}

double LayerSolver::stored_heat_j_m2() const noexcept {
  double heat = 0.0;
  const std::size_t last = theta_.size() - 1;
  for (std::size_t i = 0; i < last; ++i) {
    heat += mesh_->mass_own()[i] * theta_[i] + mesh_->mass_below()[i] * theta_[i + 1] +
            mesh_->mass_above()[i + 1] * theta_[i];
  }
  heat += mesh_->mass_own()[last] * theta_[last];
  return heat;
}

void face_history(LayerSolver& solver, std::span<const ProfilePoint> profile,
                  std::span<const ForcingRow> rows, double emissivity_frac,
                  std::span<const double> times_s, std::span<double> out_k) noexcept {
  EMIT_CHECK(!rows.empty());
  EMIT_CHECK(std::ranges::is_sorted(rows, {}, &ForcingRow::time_s));
  EMIT_CHECK(std::ranges::is_sorted(times_s));
  EMIT_CHECK_OP(times_s.size(), ==, out_k.size());
  solver.start(profile, rows.front().time_s);
  std::size_t row = 0;
  for (std::size_t i = 0; i < times_s.size(); ++i) {
    while (solver.time_s() < times_s[i]) {
      // Cut the time up to the next answer at the rows of the table.
      while (row + 1 < rows.size() && rows[row + 1].time_s <= solver.time_s()) ++row;
      const double now_s = solver.time_s();
      FaceSegment segment{now_s, times_s[i], rows[row].face, rows[row].face};
      if (row + 1 < rows.size()) {
        const ForcingRow& a = rows[row];
        const ForcingRow& b = rows[row + 1];
        segment.end_s = std::min(times_s[i], b.time_s);
        const auto at = [&](double time_s) {
          const double f = (time_s - a.time_s) / (b.time_s - a.time_s);
          const auto mix = [f](double x, double y) { return x + f * (y - x); };
          std::optional<FaceFilm> film = a.face.film;
          if (film && b.face.film) {
            film->air = physics::between_films(a.face.film->air, b.face.film->air, f);
          }
          std::optional<FaceMoisture> moisture = a.face.moisture;
          if (moisture && b.face.moisture) {
            moisture->vapour_pa = mix(a.face.moisture->vapour_pa, b.face.moisture->vapour_pa);
            moisture->pressure_pa = mix(a.face.moisture->pressure_pa, b.face.moisture->pressure_pa);
            moisture->resistance_s_m =
                mix(a.face.moisture->resistance_s_m, b.face.moisture->resistance_s_m);
            moisture->film_frac = mix(a.face.moisture->film_frac, b.face.moisture->film_frac);
          }
          return FaceState{mix(a.face.absorbed_w_m2, b.face.absorbed_w_m2),
                           mix(a.face.film_w_m2_k, b.face.film_w_m2_k),
                           mix(a.face.air_k, b.face.air_k), film, moisture};
        };
        segment.start = now_s == a.time_s ? a.face : at(now_s);
        segment.end = segment.end_s == b.time_s ? b.face : at(segment.end_s);
      }
      solver.advance(segment, emissivity_frac);
    }
    out_k[i] = solver.face_k();
  }
}

}  // namespace emit::reference
