// SPDX-License-Identifier: Apache-2.0
#include "fit_history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "emit/physics/constants.hpp"
#include "emit/physics/evaporation.hpp"
#include "emit/physics/sun.hpp"
#include "emit/physics/weather.hpp"
#include "emit/reference/layer_solver.hpp"
#include "emit/reference/surface_forcing.hpp"
#include "emit/scene/base.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::FosterDrive;
using physics::make_error;
using physics::Result;

// Histories are compared at this interval. Sharp edges of the shade lie on the grid.
constexpr double kSampleS = 20.0;
constexpr double kAfterEdgeS = 600.0;
constexpr double kAfterEdgeWeight = 2.0;
constexpr double kFineAfterEdgeS = 180.0;
constexpr double kSpinUpStepS = 180.0;
constexpr double kDayS = 86'400.0;
// The day before has about a third of all weight. With much less the search sacrifices the slow
// modes for 0.03 K in the five histories, at 1 K over the day.
constexpr double kDayBeforeWeight = 1.5;
constexpr double kDayBeforeEveryS = 300.0;

/// Shade between two times after the start of the history.
struct Shade {
  double begin_s;
  double end_s;
};
/// One of the five histories that judge a fit.
struct Scenario {
  const char* name;
  std::array<Shade, 2> shades;
};
constexpr double kAlways = 1e9;
constexpr std::array<Scenario, 5> kScenarios = {{
    {"sun", {{{0, 0}, {0, 0}}}},
    {"shade", {{{0, kAlways}, {0, 0}}}},
    {"shadow enters", {{{4500, kAlways}, {0, 0}}}},
    {"shadow leaves", {{{0, 7200}, {0, 0}}}},
    {"two passing shadows", {{{3600, 4800}, {8400, 9000}}}},
}};

/// Returns true if the middle of an interval lies in shade.
bool shaded(const Scenario& scenario, double begin_s, double end_s) noexcept {
  const double middle_s = 0.5 * (begin_s + end_s);
  return std::any_of(scenario.shades.begin(), scenario.shades.end(), [&](const Shade& shade) {
    return middle_s > shade.begin_s && middle_s < shade.end_s;
  });
}

/// Returns the seconds since the last edge at or before `time_s`. The start counts as an edge if it
/// is shaded, because the spin-up is not.
double since_edge_s(const Scenario& scenario, double time_s) noexcept {
  double since = kAlways;
  for (const Shade& shade : scenario.shades) {
    if (shade.end_s <= shade.begin_s) continue;
    for (const double edge_s : {shade.begin_s, shade.end_s}) {
      if (time_s >= edge_s) since = std::min(since, time_s - edge_s);
    }
  }
  return since;
}

/// Piecewise linear table of forcing.
class ForcingTable {
 public:
  explicit ForcingTable(std::span<const GroundForcing> rows) : rows_(rows) {}
  /// Returns the value at a time. At a jump it is the value after it, or the value before it if
  /// `before` is set.
  [[nodiscard]] GroundForcing at(double time_s, bool before) const noexcept {
    const auto next = before ? std::lower_bound(rows_.begin(), rows_.end(), time_s, earlier)
                             : std::upper_bound(rows_.begin(), rows_.end(), time_s, later);
    if (next == rows_.begin()) return rows_.front();
    if (next == rows_.end()) return rows_.back();
    const GroundForcing& a = *(next - 1);
    const GroundForcing& b = *next;
    const double f = b.time_s > a.time_s ? (time_s - a.time_s) / (b.time_s - a.time_s) : 1.0;
    const auto mix = [&](double GroundForcing::*m) { return a.*m + f * (b.*m - a.*m); };
    return {time_s,
            mix(&GroundForcing::direct_w_m2),
            mix(&GroundForcing::diffuse_w_m2),
            mix(&GroundForcing::longwave_w_m2),
            mix(&GroundForcing::film_w_m2_k),
            mix(&GroundForcing::air_k),
            mix(&GroundForcing::vapour_pa),
            mix(&GroundForcing::pressure_pa)};
  }

 private:
  static bool earlier(const GroundForcing& row, double t) noexcept { return row.time_s < t; }
  static bool later(double t, const GroundForcing& row) noexcept { return t < row.time_s; }
  std::span<const GroundForcing> rows_;
};

/// Input of a face at an instant, for the model and for the reference.
struct FaceInput {
  FosterDrive<double> drive;
  std::optional<FaceMoisture> water;
};
/// Returns the input of a level, open surface of a material, physics.md eq. 16. `moisture` is dry
/// for models without evaporation.
FaceInput input_of(const scene::Material& material, const physics::MoistSurface& moisture,
                   const GroundForcing& f, double sun_frac) noexcept {
  const double shortwave_w_m2 = f.direct_w_m2 * sun_frac + f.diffuse_w_m2;
  FaceInput out{.drive = {.absorbed_w_m2 = material.solar_absorptance_frac * shortwave_w_m2 +
                                           material.emissivity_frac * f.longwave_w_m2,
                          .film_w_m2_k = f.film_w_m2_k,
                          .air_offset_k = f.air_k - physics::kReferenceK},
                .water = std::nullopt};
  if (moisture.dry()) return out;
  physics::add_moisture(moisture, physics::moist_air(f.air_k, f.pressure_pa, f.vapour_pa),
                        shortwave_w_m2, out.drive);
  out.water = FaceMoisture{.vapour_pa = f.vapour_pa,
                           .pressure_pa = f.pressure_pa,
                           .wetness_frac = moisture.wetness_frac,
                           .resistance_s_m = light_resistance_s_m(moisture, shortwave_w_m2)};
  return out;
}

/// Returns the input between `a` (f = 0) and `b` (f = 1), linear in f.
FaceInput between(const FaceInput& a, const FaceInput& b, double f) noexcept {
  FaceInput out{.drive = physics::lerp(a.drive, b.drive, f), .water = a.water};
  if (!a.water || !b.water) return out;
  const auto mix = [&](double FaceMoisture::*m) {
    return *a.water.*m + f * (*b.water.*m - *a.water.*m);
  };
  out.water->vapour_pa = mix(&FaceMoisture::vapour_pa);
  out.water->pressure_pa = mix(&FaceMoisture::pressure_pa);
  out.water->resistance_s_m = mix(&FaceMoisture::resistance_s_m);
  return out;
}

/// Sets the input of a step.
void set_ends(const FaceInput& begin, const FaceInput& end, FitStep& step) noexcept {
  step.begin = begin.drive;
  step.begin_water = begin.water;
  step.end = end.drive;
  step.end_water = end.water;
}

/// Converts a drive to the reference solver's units.
FaceState face_of(const FosterDrive<double>& drive,
                  const std::optional<FaceMoisture>& water) noexcept {
  return {drive.absorbed_w_m2, drive.film_w_m2_k, physics::kReferenceK + drive.air_offset_k,
          std::nullopt, water};
}

/// Advances the solver along a history and fills in the truth at the end of every step.
void run_reference(LayerSolver& solver, double emissivity_frac, FitHistory& history) {
  for (FitStep& step : history.steps) {
    const double begin_s = solver.time_s();
    solver.advance(FaceSegment{begin_s, begin_s + step.dt_s, face_of(step.begin, step.begin_water),
                               face_of(step.end, step.end_water)},
                   emissivity_frac);
    step.truth_k = solver.face_k();
  }
}

/// Checks that a material has layers to fit.
Result<void> check_material(const scene::Material& material) {
  if (material.prescribed_k || material.layers.empty()) {
    return make_error(ErrorCode::config,
                      fmt::format("material '{}' has no layers to fit", material.name));
  }
  return {};
}

/// Returns a problem with the properties of a material and no histories yet.
FitProblem problem_of(const scene::Material& material, double initial_k) {
  FitProblem problem;
  problem.emissivity_frac = material.emissivity_frac;
  problem.base_k = material.base_k;
  problem.initial_k = initial_k;
  for (const scene::Layer& layer : material.layers) {
    problem.resistance_m2k_w += layer.thickness_m / layer.conductivity_w_m_k;
  }
  const scene::Layer& first = material.layers.front();
  problem.core_conductance_w_m2_k =
      material.core_conductance_w_m2_k.value_or(first.conductivity_w_m_k / first.thickness_m);
  return problem;
}

}  // namespace

std::vector<GroundForcing> ground_forcing(const scene::ScenarioDesc& scenario, double begin_s,
                                          double end_s, double step_s) {
  const physics::GeoPlace place{physics::Radians(scenario.place.lat_rad),
                                physics::Radians(scenario.place.lon_rad),
                                physics::Metres(scenario.place.height_m)};
  const std::vector<physics::WeatherSample>& rows = scenario.weather;
  const double dew_point_k = scene::usual_dew_point_k(scenario);
  std::vector<GroundForcing> out;
  const auto count = static_cast<std::size_t>(std::ceil((end_s - begin_s) / step_s)) + 1;
  // Sample the forcing. Direct sun is that on level ground, after clouds.
  for (std::size_t i = 0; i < count; ++i) {
    const double time_s = std::min(begin_s + static_cast<double>(i) * step_s, end_s);
    const std::int64_t sim_ns = std::llround(time_s * 1e9);
    const std::int64_t utc_ns = scenario.epoch_utc_ns + sim_ns;
    const physics::SunPosition sun = physics::sun_position(utc_ns, place);
    const physics::Forcing f =
        rows.empty() ? physics::forcing_from_clear_sky(scenario.clear_sky, place, sun, utc_ns)
                     : physics::at_place(physics::forcing_from_rows(rows, sim_ns), place, sun);
    out.push_back({time_s,
                   f.direct_normal_w_m2 * (1.0 - f.cloud_frac) * std::max(0.0, sun.direction_enu.z),
                   f.diffuse_horizontal_w_m2, f.longwave_down_w_m2, physics::typical_film_w_m2_k(f),
                   f.air_k, physics::with_vapour(f, dew_point_k).vapour_pa,
                   physics::standard_pressure_pa(f.height_m)});
  }
  return out;
}

void FitProblem::index_steps() {
  step_lengths_s.clear();
  const auto index = [this](FitHistory& history) {
    for (FitStep& step : history.steps) {
      // Look up the length among the known ones, to rounding.
      const auto found = std::find_if(
          step_lengths_s.begin(), step_lengths_s.end(),
          [&](double known_s) { return std::abs(known_s - step.dt_s) < 1e-9 * known_s; });
      step.gains = static_cast<std::uint32_t>(found - step_lengths_s.begin());
      if (found == step_lengths_s.end()) step_lengths_s.push_back(step.dt_s);
    }
  };
  index(beginning);
  for (FitHistory& history : histories) index(history);
}

Result<FitProblem> material_problem(const scene::Material& material,
                                    std::span<const GroundForcing> forcing, double start_s,
                                    double initial_k, const FitOptions& options) {
  if (auto ok = check_material(material); !ok) return tl::unexpected(ok.error());
  if (forcing.size() < 2 || forcing.front().time_s > start_s - options.spin_up_s + 1e-6 ||
      forcing.back().time_s < start_s + options.history_s - 1e-6) {
    return make_error(ErrorCode::invalid_argument,
                      "the forcing does not cover spin-up and histories");
  }
  FitProblem problem = problem_of(material, material.initial_k.value_or(initial_k));
  const ForcingTable table(forcing);
  // The published model has no evaporation, so its truth has none either.
  const physics::MoistSurface moisture =
      options.model == FitModel::foster ? scene::moisture_of(material) : physics::MoistSurface{};

  // Build the spin-up: full sun, with residuals over the last day.
  const double begin_s = start_s - options.spin_up_s;
  const auto spin_steps = static_cast<std::size_t>(std::ceil(options.spin_up_s / kSpinUpStepS));
  problem.beginning.name = "day before";
  problem.beginning.judged = false;
  double next_sample_s = -kDayS;
  for (std::size_t i = 0; i < spin_steps; ++i) {
    const double a_s =
        begin_s + options.spin_up_s * static_cast<double>(i) / static_cast<double>(spin_steps);
    const double b_s =
        begin_s + options.spin_up_s * static_cast<double>(i + 1) / static_cast<double>(spin_steps);
    FitStep step;
    step.dt_s = options.spin_up_s / static_cast<double>(spin_steps);
    set_ends(input_of(material, moisture, table.at(a_s, false), 1.0),
             input_of(material, moisture, table.at(b_s, true), 1.0), step);
    if (b_s - start_s >= next_sample_s) {
      step.weight = kDayBeforeWeight;
      next_sample_s = b_s - start_s + kDayBeforeEveryS;
    }
    problem.beginning.steps.push_back(step);
  }
  // Build the five histories.
  const auto samples = static_cast<std::size_t>(std::ceil(options.history_s / kSampleS));
  for (const Scenario& scenario : kScenarios) {
    FitHistory history;
    history.name = scenario.name;
    for (std::size_t i = 0; i < samples; ++i) {
      const double a_s = options.history_s * static_cast<double>(i) / static_cast<double>(samples);
      const double b_s =
          options.history_s * static_cast<double>(i + 1) / static_cast<double>(samples);
      const double sun_frac = shaded(scenario, a_s, b_s) ? 0.0 : 1.0;
      const FaceInput begin =
          input_of(material, moisture, table.at(start_s + a_s, false), sun_frac);
      const FaceInput end = input_of(material, moisture, table.at(start_s + b_s, true), sun_frac);
      // Split the steps after an edge: the model is to be judged, not the length of its steps.
      const double since_s = since_edge_s(scenario, b_s);
      const int split = since_s <= kFineAfterEdgeS ? 8 : 1;
      for (int part = 0; part < split; ++part) {
        FitStep step;
        step.dt_s = (b_s - a_s) / split;
        set_ends(between(begin, end, part / static_cast<double>(split)),
                 between(begin, end, (part + 1) / static_cast<double>(split)), step);
        if (part + 1 == split) step.weight = since_s <= kAfterEdgeS ? kAfterEdgeWeight : 1.0;
        history.steps.push_back(step);
      }
    }
    problem.histories.push_back(std::move(history));
  }
  problem.index_steps();

  // Solve for the truth by the reference, first along the spin-up, then along every history from
  // its end.
  const std::vector<SolidLayer> layers = solid_layers(material.layers);
  auto mesh = LayerMesh::build(layers, {BaseKind::fixed_temperature, material.base_k},
                               {.shortest_time_s = 5.0});
  if (!mesh) return tl::unexpected(std::move(mesh.error()));
  LayerSolver solver(*mesh, {.tolerance_k = options.reference_tolerance_k});
  solver.start(steady_profile(layers, problem.initial_k, material.base_k), 0.0);
  run_reference(solver, material.emissivity_frac, problem.beginning);
  problem.truth_at_start_k = solver.face_k();
  std::vector<double> nodes_k(mesh->nodes());
  solver.copy_nodes_k(nodes_k);
  for (FitHistory& history : problem.histories) {
    solver.start_nodes(nodes_k, 0.0);
    run_reference(solver, material.emissivity_frac, history);
  }
  return problem;
}

Result<FitProblem> curve_problem(const scene::Material& material,
                                 std::span<const CurvePoint> curve) {
  if (auto ok = check_material(material); !ok) return tl::unexpected(ok.error());
  if (curve.size() < 8) {
    return make_error(ErrorCode::invalid_argument, "a curve needs at least 8 points");
  }
  FitProblem problem = problem_of(material, curve.front().temperature_k);
  problem.truth_at_start_k = curve.front().temperature_k;
  FitHistory history;
  history.name = "curve";
  const auto drive = [](const CurvePoint& p) {
    return FosterDrive<double>{p.absorbed_w_m2, p.film_w_m2_k, p.air_k - physics::kReferenceK};
  };
  // Split every interval of the curve, with the truth at its end.
  for (std::size_t i = 1; i < curve.size(); ++i) {
    const double dt_s = curve[i].time_s - curve[i - 1].time_s;
    if (!(dt_s >= 0.0)) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("time_s goes back at point {}", i + 1));
    }
    if (dt_s == 0.0) continue;  // the forcing jumps here
    constexpr int kSplit = 4;
    for (int part = 0; part < kSplit; ++part) {
      FitStep step;
      step.dt_s = dt_s / kSplit;
      step.begin = physics::lerp(drive(curve[i - 1]), drive(curve[i]), part / double{kSplit});
      step.end = physics::lerp(drive(curve[i - 1]), drive(curve[i]), (part + 1) / double{kSplit});
      if (part + 1 == kSplit) {
        step.truth_k = curve[i].temperature_k;
        step.weight = 1.0;
      }
      history.steps.push_back(step);
    }
  }
  problem.histories.push_back(std::move(history));
  problem.index_steps();
  return problem;
}

std::size_t residual_count(const FitProblem& problem) {
  std::size_t count = 0;
  const auto add = [&count](const FitHistory& history) {
    for (const FitStep& step : history.steps) count += step.weight > 0.0 ? 1U : 0U;
  };
  add(problem.beginning);
  for (const FitHistory& history : problem.histories) add(history);
  return count;
}

void foster_residuals(const FitProblem& problem, const physics::FosterNetwork& network,
                      std::vector<double>& out) {
  out.clear();
  // Compute the gains of all step lengths once.
  std::vector<physics::FosterGains<double>> gains;
  for (const double dt_s : problem.step_lengths_s) {
    gains.push_back(physics::foster_gains(dt_s, network));
  }
  const auto surface = physics::foster_surface(network, problem.emissivity_frac, problem.base_k,
                                               physics::kReferenceK);
  physics::FosterState<double> start = physics::foster_steady(
      (problem.initial_k - problem.base_k) / network.resistance_m2k_w(), surface);
  // Run a history and collect its weighted errors.
  const auto run = [&](const FitHistory& history, physics::FosterState<double>& x) {
    for (const FitStep& step : history.steps) {
      physics::foster_step(x, step.begin, step.end, gains[step.gains], surface);
      if (step.weight > 0.0) {
        out.push_back(step.weight *
                      (physics::kReferenceK + physics::foster_offset_k(x, surface) - step.truth_k));
      }
    }
  };
  // Run the spin-up once and every history from its end.
  run(problem.beginning, start);
  for (const FitHistory& history : problem.histories) {
    physics::FosterState<double> x = start;
    run(history, x);
  }
}

void emit2014_residuals(const FitProblem& problem, std::span<const scene::RelaxationMode> modes,
                        std::vector<double>& out) {
  out.clear();
  // Solve physics.md eq. 4 without convection, as the published model does.
  const auto equilibrium_k = [&](const FosterDrive<double>& drive) {
    const double g = problem.core_conductance_w_m2_k;
    return physics::solve_equilibrium<double>(
               {problem.emissivity_frac * physics::kStefanBoltzmannWPerM2K4, g,
                drive.absorbed_w_m2 + g * problem.base_k})
        .temperature_k;
  };
  // Start every history at the true temperature and relax by physics.md eq. 6.
  for (const FitHistory& history : problem.histories) {
    std::vector<double> x(modes.size(), problem.truth_at_start_k);
    for (const FitStep& step : history.steps) {
      const double u0 = equilibrium_k(step.begin);
      const double u1 = equilibrium_k(step.end);
      double t_k = 0.0;
      for (std::size_t i = 0; i < modes.size(); ++i) {
        x[i] = physics::relax_linear(x[i], u0, u1,
                                     physics::relaxation_gains(step.dt_s, modes[i].tau_s));
        t_k += modes[i].weight_frac * x[i];
      }
      if (step.weight > 0.0) out.push_back(step.weight * (t_k - step.truth_k));
    }
  }
}

std::vector<FitResidual> summarise(const FitProblem& problem, std::span<const double> residuals) {
  std::vector<FitResidual> out;
  std::size_t next = 0;
  // Take the residuals of one history, in the order in which they were made.
  const auto add = [&](const FitHistory& history) {
    FitResidual residual{history.name, 0.0, 0.0, history.judged};
    double sum = 0.0;
    std::size_t count = 0;
    for (const FitStep& step : history.steps) {
      if (step.weight <= 0.0 || next >= residuals.size()) continue;
      const double error_k = residuals[next++] / step.weight;
      sum += error_k * error_k;
      residual.max_k = std::max(residual.max_k, std::abs(error_k));
      ++count;
    }
    if (count == 0) return;
    residual.rms_k = std::sqrt(sum / static_cast<double>(count));
    out.push_back(residual);
  };
  add(problem.beginning);
  for (const FitHistory& history : problem.histories) add(history);
  return out;
}

}  // namespace emit::reference
