// SPDX-License-Identifier: Apache-2.0
// Model of the surface temperature of a layered body under absorbed flux, air and its own
// radiation.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "emit/physics/constants.hpp"
#include "emit/physics/equilibrium.hpp"
#include "emit/physics/foster.hpp"
#include "emit/physics/relaxation.hpp"
#include "emit/reference/layer_mesh.hpp"
#include "emit/reference/layer_solver.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using reference::LayerMesh;
using reference::LayerSolver;
using reference::ProfilePoint;
using reference::SolidLayer;

constexpr std::size_t kScenarios = 4;
/// Tolerance at refine 1, K.
constexpr double kToleranceK = 1.0e-4;

/// Checked request.
struct History {
  std::vector<SolidLayer> layers;
  std::vector<ProfilePoint> initial;
  double base_k = 0.0;
  double emissivity_frac = 0.0;
  double film_w_m2_k = 0.0;
  std::vector<double> time_s;
  std::vector<double> air_k;
  std::array<std::vector<double>, kScenarios> absorbed_w_m2;
};
using Temperatures = std::array<std::vector<double>, kScenarios>;

Result<History> read_history(const EvaluateRequest& request, const physics::CsvTable& table) {
  const HistoryOptions& options = request.history;
  const auto missing = [](std::string_view option) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("model 'surface-history' needs {}", option));
  };
  if (options.layers.empty()) return missing("--layers d:k:rc,...");
  if (!options.base_k) return missing("--base-k");
  if (!options.emissivity_frac) return missing("--emissivity");
  if (!options.film_w_m2_k) return missing("--film-w-m2-k");
  if (options.initial.empty()) return missing("--initial z:T,...");
  const auto out_of_range = [](std::string_view option) {
    return make_error(ErrorCode::invalid_argument, fmt::format("{}: out of range", option));
  };
  const auto in = [](double value, double lo, double hi) { return value >= lo && value <= hi; };
  if (!in(*options.base_k, 0.0, 1e4)) return out_of_range("--base-k");
  if (!in(*options.emissivity_frac, 0.0, 1.0)) return out_of_range("--emissivity");
  if (!in(*options.film_w_m2_k, 0.0, 1e6)) return out_of_range("--film-w-m2-k");

  History history;
  for (const HistoryLayer& layer : options.layers) {
    for (const double value :
         {layer.thickness_m, layer.conductivity_w_m_k, layer.heat_capacity_j_m3_k}) {
      if (!(value > 0.0 && std::isfinite(value))) return out_of_range("--layers");
    }
    history.layers.push_back(
        {layer.thickness_m, layer.conductivity_w_m_k, layer.heat_capacity_j_m3_k});
  }
  double above_m = -1.0;
  for (const HistoryPoint& point : options.initial) {
    if (!(point.depth_m >= 0.0 && point.depth_m > above_m && std::isfinite(point.depth_m) &&
          in(point.temperature_k, 0.0, 1e4))) {
      return out_of_range("--initial (depths must ascend from 0)");
    }
    above_m = point.depth_m;
    history.initial.push_back({point.depth_m, point.temperature_k});
  }
  history.base_k = *options.base_k;
  history.emissivity_frac = *options.emissivity_frac;
  history.film_w_m2_k = *options.film_w_m2_k;

  auto columns = read_columns<2 + kScenarios>(table, {"t_s", "Tair", "E0", "E1", "E2", "E3"});
  if (!columns) return tl::unexpected(std::move(columns.error()));
  for (std::size_t c = 0; c < columns->size(); ++c) {
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const double value = (*columns)[c][row];
      if (!std::isfinite(value) || (c == 0 && row > 0 && value < (*columns)[0][row - 1])) {
        return make_error(ErrorCode::parse,
                          fmt::format("{}:{}: forcing must be finite and times ascend",
                                      table.name(), table.line_of(row)));
      }
    }
  }
  history.time_s = std::move((*columns)[0]);
  history.air_k = std::move((*columns)[1]);
  for (std::size_t s = 0; s < kScenarios; ++s) {
    history.absorbed_w_m2[s] = std::move((*columns)[2 + s]);
  }
  return history;
}

double start_k(const History& history) {
  return history.initial.front().temperature_k;
}

Result<LayerMesh> history_mesh(const History& history, std::uint32_t refine) {
  reference::MeshOptions options;
  options.refine = refine;
  // A base that starts at another temperature sends a wave of its own upwards.
  options.fine_base = history.initial.back().temperature_k != history.base_k;
  return LayerMesh::build(history.layers, {reference::BaseKind::fixed_temperature, history.base_k},
                          options);
}

Result<Temperatures> by_reference(const History& history, std::uint32_t refine) {
  const auto mesh = history_mesh(history, refine);
  if (!mesh) return tl::unexpected(mesh.error());
  reference::StepOptions steps;
  steps.tolerance_k = kToleranceK;
  steps.refine = refine;
  LayerSolver solver(*mesh, steps);
  Temperatures out;
  for (std::size_t s = 0; s < kScenarios; ++s) {
    std::vector<reference::ForcingRow> rows;
    for (std::size_t i = 0; i < history.time_s.size(); ++i) {
      rows.push_back({history.time_s[i],
                      {history.absorbed_w_m2[s][i], history.film_w_m2_k, history.air_k[i]}});
    }
    out[s].resize(rows.size());
    reference::face_history(solver, history.initial, rows, history.emissivity_frac, history.time_s,
                            out[s]);
  }
  return out;
}

/// Computes the temperatures by the published model: physics.md eq. 4 on the first layer over its
/// core, without convection, relaxed by the material's modes (eq. 5 and 6), with an equilibrium
/// that is linear between rows.
Result<Temperatures> by_emit2014(const History& history, const std::vector<HistoryMode>& modes) {
  double weights = 0.0;
  for (const HistoryMode& mode : modes) {
    weights += mode.tau_s > 0.0 ? mode.weight_frac : physics::kPi * 1e9;
  }
  if (modes.empty() || !(std::abs(weights - 1.0) < 1e-6)) {
    return make_error(ErrorCode::invalid_argument,
                      "model 'surface-history' with emit2014 needs modes with weights adding to 1");
  }
  const double conductance =
      history.layers.front().conductivity_w_m_k / history.layers.front().thickness_m;
  const double emission = history.emissivity_frac * physics::kStefanBoltzmannWPerM2K4;
  Temperatures out;
  for (std::size_t s = 0; s < kScenarios; ++s) {
    const auto equilibrium_k = [&](std::size_t row) {
      return physics::solve_equilibrium<double>(
                 {emission, conductance,
                  history.absorbed_w_m2[s][row] + conductance * history.base_k})
          .temperature_k;
    };
    std::vector<double> state(modes.size(), start_k(history));
    out[s].assign(history.time_s.size(), start_k(history));
    for (std::size_t row = 1; row < history.time_s.size(); ++row) {
      const double before = equilibrium_k(row - 1);
      const double now = equilibrium_k(row);
      double sum = 0.0;
      for (std::size_t m = 0; m < modes.size(); ++m) {
        const auto gains = physics::relaxation_gains(history.time_s[row] - history.time_s[row - 1],
                                                     modes[m].tau_s);
        state[m] = physics::relax_linear(state[m], before, now, gains);
        sum += modes[m].weight_frac * state[m];
      }
      out[s][row] = sum;
    }
  }
  return out;
}

/// Returns states whose free decay with an insulated face is nearest to that of the body from its
/// initial profile. At t = 0 their sum is exactly the face's temperature.
Result<physics::FosterState<double>> initial_states(const History& history,
                                                    const physics::FosterNetwork& network) {
  const auto mesh = history_mesh(history, 1);
  if (!mesh) return tl::unexpected(mesh.error());
  LayerSolver solver(*mesh, {});
  solver.start(history.initial, 0.0);
  const std::size_t n = network.count;
  const double total_k = start_k(history) - history.base_k;
  // The unknowns are all states but the slowest, which takes the rest. Solve the normal equations
  // by elimination.
  std::array<std::array<double, physics::kMaxFosterModes>, physics::kMaxFosterModes> a{};
  const std::size_t unknowns = n - 1;
  const double slow_tau_s = network.modes[n - 1].tau_s;
  for (int sample = 0; sample < 120; ++sample) {
    const double time_s = 20.0 * std::pow(1.08, sample);  // samples from 20 s to two days
    solver.advance({solver.time_s(), time_s, {}, {}}, 0.0);
    const double slow = std::exp(-time_s / slow_tau_s);
    const double target = solver.face_k() - history.base_k - total_k * slow;
    std::array<double, physics::kMaxFosterModes> row{};
    for (std::size_t i = 0; i < unknowns; ++i) {
      row[i] = std::exp(-time_s / network.modes[i].tau_s) - slow;
    }
    for (std::size_t i = 0; i < unknowns; ++i) {
      for (std::size_t j = 0; j < unknowns; ++j) a[i][j] += row[i] * row[j];
      a[i][unknowns] += row[i] * target;
    }
  }
  physics::FosterState<double> x{};
  for (std::size_t i = 0; i < unknowns; ++i) {
    a[i][i] += 1e-9;  // regularisation for two states that decay alike
    for (std::size_t j = i + 1; j < unknowns; ++j) {
      const double factor = a[j][i] / a[i][i];
      for (std::size_t c = i; c <= unknowns; ++c) a[j][c] -= factor * a[i][c];
    }
  }
  double rest_k = total_k;
  for (std::size_t i = unknowns; i-- > 0;) {
    double value = a[i][unknowns];
    for (std::size_t j = i + 1; j < unknowns; ++j) value -= a[i][j] * x[j];
    x[i] = value / a[i][i];
    rest_k -= x[i];
  }
  x[n - 1] = rest_k;
  return x;
}

Result<Temperatures> by_foster(const History& history, std::uint32_t refine) {
  std::vector<physics::StackLayer> stack;
  for (const SolidLayer& layer : history.layers) {
    stack.push_back({layer.thickness_m, layer.conductivity_w_m_k, layer.heat_capacity_j_m3_k});
  }
  const auto network = physics::network_of_stack(stack);
  if (!network) return tl::unexpected(network.error());
  const auto start = initial_states(history, *network);
  if (!start) return tl::unexpected(start.error());
  const double reference_k = history.base_k;
  const auto surface =
      physics::foster_surface(*network, history.emissivity_frac, history.base_k, reference_k);
  Temperatures out;
  for (std::size_t s = 0; s < kScenarios; ++s) {
    const auto drive = [&](std::size_t row) {
      return physics::FosterDrive<double>{history.absorbed_w_m2[s][row], history.film_w_m2_k,
                                          history.air_k[row] - reference_k};
    };
    physics::FosterState<double> x = *start;
    out[s].assign(history.time_s.size(), start_k(history));
    for (std::size_t row = 1; row < history.time_s.size(); ++row) {
      const double dt_s = history.time_s[row] - history.time_s[row - 1];
      const auto gains = physics::foster_gains(dt_s / refine, *network);
      for (std::uint32_t part = 0; part < refine; ++part) {
        physics::foster_step(
            x, physics::lerp(drive(row - 1), drive(row), static_cast<double>(part) / refine),
            physics::lerp(drive(row - 1), drive(row), static_cast<double>(part + 1) / refine),
            gains, surface);
      }
      out[s][row] = reference_k + physics::foster_offset_k(x, surface);
    }
  }
  return out;
}

}  // namespace

Result<std::string> run_surface_history(const EvaluateRequest& request,
                                        const physics::CsvTable& table) {
  if (request.refine != 1 && request.refine != 2 && request.refine != 4) {
    return make_error(ErrorCode::invalid_argument, "--refine must be 1, 2 or 4");
  }
  const auto history = read_history(request, table);
  if (!history) return tl::unexpected(history.error());
  auto result = [&]() -> Result<Temperatures> {
    if (table.rows() == 0) return Temperatures{};
    switch (request.history.model) {
      case HistoryModel::emit2014:
        return by_emit2014(*history, request.history.modes);
      case HistoryModel::foster:
        return by_foster(*history, request.refine);
      case HistoryModel::reference:
        break;
    }
    return by_reference(*history, request.refine);
  }();
  if (!result) return tl::unexpected(std::move(result.error()));
  // The first row is the start, so it has no result.
  for (auto& column : *result) {
    if (!column.empty()) column.front() = kUndefined<double>;
  }
  return write_csv(kSurfaceHistoryOutputs, *result);
}

}  // namespace emit::verify
