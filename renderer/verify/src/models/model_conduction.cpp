// SPDX-License-Identifier: Apache-2.0
// Models of conduction with known solutions. The reference solver itself answers them: its mesh,
// its time steps, its matrices. There is no closed form in this file.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <optional>

#include "emit/physics/constants.hpp"
#include "emit/reference/layer_frequency.hpp"
#include "emit/reference/layer_mesh.hpp"
#include "emit/reference/layer_solver.hpp"
#include "models.hpp"
#include "result_writer.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;
using reference::Base;
using reference::BaseKind;
using reference::LayerMesh;
using reference::LayerSolver;
using reference::MeshOptions;
using reference::ProfilePoint;
using reference::SolidLayer;
using reference::StepOptions;

/// Tolerance at refine 1, K. The result is then within a tenth of the limit of 10 mK.
constexpr double kToleranceK = 5.0e-5;
/// Number of cells per diffusion length of the shortest relevant time, and growth of the cells with
/// depth.
constexpr double kCellsPerLength = 20.0;
constexpr double kGrowthFrac = 0.04;
constexpr double kNan = kUndefined<double>;

Result<void> check_refine(const EvaluateRequest& request) {
  if (request.refine == 1 || request.refine == 2 || request.refine == 4) return {};
  return make_error(ErrorCode::invalid_argument, "--refine must be 1, 2 or 4");
}

tl::unexpected<physics::Error> bad_kind(const physics::CsvTable& table, std::size_t row,
                                        std::string_view kind, std::string_view known) {
  return make_error(ErrorCode::parse, fmt::format("{}:{}: column 'kind': '{}' is none of {}",
                                                  table.name(), table.line_of(row), kind, known));
}

/// Body of uniform temperature and what acts on it from t = 0 on.
struct Case {
  std::vector<SolidLayer> layers;
  Base base;
  double initial_k = 0.0;
  double flux_w_m2 = 0.0;
  double film_w_m2_k = 0.0;
  double ambient_k = 0.0;
  std::optional<double> held_k;  ///< temperature that holds the face, instead of a flux
};

MeshOptions mesh_options(double scale_s, std::uint32_t refine) {
  MeshOptions options;
  options.shortest_time_s = scale_s;
  options.cells_per_length = kCellsPerLength;
  options.growth_frac = kGrowthFrac;
  options.refine = refine;
  return options;
}

/// Returns the temperature at a depth and time, or nan where the body or the request is not
/// defined.
double temperature_after(const Case& c, double depth_m, double time_s, std::uint32_t refine) {
  const bool bounded = c.base.kind != BaseKind::deep_ground;
  const SolidLayer& layer = c.layers.front();
  if (!(time_s >= 0.0 && std::isfinite(time_s) && depth_m >= 0.0 && std::isfinite(depth_m)) ||
      (bounded && depth_m > layer.thickness_m) || !(c.initial_k >= 0.0) ||
      !std::isfinite(c.flux_w_m2 + c.film_w_m2_k + c.ambient_k + c.held_k.value_or(0.0)) ||
      c.film_w_m2_k < 0.0) {
    return kNan;
  }
  if (time_s == 0.0) return c.held_k && depth_m == 0.0 ? *c.held_k : c.initial_k;
  // A bounded body reaches its steady state within its own diffusion time.
  const double body_s =
      layer.thickness_m * layer.thickness_m * layer.heat_capacity_j_m3_k / layer.conductivity_w_m_k;
  MeshOptions options = mesh_options(0.04 * (bounded ? std::min(time_s, body_s) : time_s), refine);
  options.horizon_s = time_s;
  options.fine_base = c.base.kind == BaseKind::fixed_temperature;
  const auto mesh = LayerMesh::build(c.layers, c.base, options);
  if (!mesh) return kNan;
  StepOptions steps;
  steps.tolerance_k = kToleranceK;
  steps.refine = refine;
  LayerSolver solver(*mesh, steps);
  const ProfilePoint profile[] = {{0.0, c.initial_k}};
  solver.start(profile, 0.0);
  if (c.held_k) {
    solver.advance_held(time_s, *c.held_k, *c.held_k);
  } else {
    const reference::FaceState face{c.flux_w_m2, c.film_w_m2_k, c.ambient_k};
    solver.advance({0.0, time_s, face, face}, 0.0);
  }
  return solver.temperature_k(depth_m);
}

/// Returns the temperature of a semi-infinite body whose face follows amplitude cos(2 pi t /
/// period) about its mean. It starts from the periodic state of the solver's matrices and steps
/// through one more period.
double periodic_temperature(const Case& c, double amplitude_k, double period_s, double depth_m,
                            double time_s, std::uint32_t refine) {
  if (!(period_s > 0.0 && std::isfinite(period_s) && depth_m >= 0.0 && std::isfinite(depth_m) &&
        std::isfinite(time_s) && std::isfinite(amplitude_k) && c.initial_k >= 0.0)) {
    return kNan;
  }
  const double angular_per_s = 2.0 * physics::kPi / period_s;
  MeshOptions options = mesh_options(0.2 / angular_per_s, refine);
  options.horizon_s = period_s;
  const auto mesh = LayerMesh::build(c.layers, c.base, options);
  if (!mesh) return kNan;
  const auto response = periodic_response(*mesh, angular_per_s);
  const double phase = std::remainder(time_s, period_s);
  const double start_s = phase - period_s;
  const std::complex<double> swing =
      amplitude_k * std::polar(1.0, angular_per_s * start_s) / response.front();
  std::vector<double> nodes_k(mesh->nodes());
  for (std::size_t i = 0; i < nodes_k.size(); ++i) {
    nodes_k[i] = c.initial_k + (swing * response[i]).real();
  }
  StepOptions steps;
  steps.tolerance_k = kToleranceK;
  steps.refine = refine;
  LayerSolver solver(*mesh, steps);
  solver.start_nodes(nodes_k, start_s);
  // The cosine is a polygon here. Its largest deviation falls with the square of the number of
  // sides.
  const double sides = 512.0 * refine;
  const auto face_k = [&](double t) {
    return c.initial_k + amplitude_k * std::cos(angular_per_s * t);
  };
  for (double i = 0.0; i < sides; i += 1.0) {
    const double from_s = start_s + period_s * (i / sides);
    const double to_s = i + 1.0 == sides ? phase : start_s + period_s * ((i + 1.0) / sides);
    solver.advance_held(to_s, face_k(from_s), face_k(to_s));
  }
  return solver.temperature_k(depth_m);
}

}  // namespace

Result<std::string> run_conduction_slab(const EvaluateRequest& request,
                                        const physics::CsvTable& table) {
  if (auto fine = check_refine(request); !fine) return tl::unexpected(fine.error());
  const auto kinds = table.texts("kind");
  if (!kinds) return tl::unexpected(kinds.error());
  const auto columns =
      read_columns<10>(table, {"k", "rc", "d", "q", "h", "Tinf", "Td", "Ti", "x", "t"});
  if (!columns) return tl::unexpected(columns.error());
  const auto& [k, rc, d, q, h, t_inf, t_d, t_i, x, t] = *columns;
  std::vector<double> result(table.rows(), kNan);
  for (std::size_t i = 0; i < result.size(); ++i) {
    const std::string_view kind = (*kinds)[i];
    const auto split = kind.find('_');
    const std::string_view front = kind.substr(0, split);
    const std::string_view back = split == kind.npos ? "" : kind.substr(split + 1);
    if ((front != "conv" && front != "flux") || (back != "fixedT" && back != "insulated")) {
      return bad_kind(table, i, kind, "conv_fixedT, conv_insulated, flux_fixedT, flux_insulated");
    }
    Case c;
    c.layers = {{d[i], k[i], rc[i]}};
    c.base = back == "fixedT" ? Base{BaseKind::fixed_temperature, t_d[i]}
                              : Base{BaseKind::adiabatic, 0.0};
    c.initial_k = t_i[i];
    if (front == "flux") {
      c.flux_w_m2 = q[i];
    } else {
      c.film_w_m2_k = h[i];
      c.ambient_k = t_inf[i];
    }
    result[i] = temperature_after(c, x[i], t[i], request.refine);
  }
  return write_csv(kConductionOutputs, std::span(&result, 1));
}

Result<std::string> run_conduction_semi_infinite(const EvaluateRequest& request,
                                                 const physics::CsvTable& table) {
  if (auto fine = check_refine(request); !fine) return tl::unexpected(fine.error());
  const auto kinds = table.texts("kind");
  if (!kinds) return tl::unexpected(kinds.error());
  const auto columns = read_columns<9>(
      table, {"k", "rc", "q_or_amp", "h", "Tinf_or_Ts", "Ti", "period_s", "x", "t"});
  if (!columns) return tl::unexpected(columns.error());
  const auto& [k, rc, q_or_amp, h, t_face, t_i, period, x, t] = *columns;
  std::vector<double> result(table.rows(), kNan);
  for (std::size_t i = 0; i < result.size(); ++i) {
    const std::string_view kind = (*kinds)[i];
    Case c;
    // The ground continues below. The layer reaches beyond the requested point.
    c.layers = {{std::max(1.25 * x[i], 1e-9), k[i], rc[i]}};
    c.base = {BaseKind::deep_ground, t_i[i]};
    c.initial_k = t_i[i];
    if (kind == "periodic") {
      result[i] = periodic_temperature(c, q_or_amp[i], period[i], x[i], t[i], request.refine);
      continue;
    }
    if (kind == "flux") {
      c.flux_w_m2 = q_or_amp[i];
    } else if (kind == "conv") {
      c.film_w_m2_k = h[i];
      c.ambient_k = t_face[i];
    } else if (kind == "step") {
      c.held_k = t_face[i];
    } else {
      return bad_kind(table, i, kind, "flux, conv, step, periodic");
    }
    result[i] = temperature_after(c, x[i], t[i], request.refine);
  }
  return write_csv(kConductionOutputs, std::span(&result, 1));
}

Result<std::string> run_conduction_layered(const EvaluateRequest& request,
                                           const physics::CsvTable& table) {
  if (auto fine = check_refine(request); !fine) return tl::unexpected(fine.error());
  const auto bases = table.texts("base");
  if (!bases) return tl::unexpected(bases.error());
  const auto columns = read_columns<11>(
      table, {"n", "d1", "k1", "rc1", "d2", "k2", "rc2", "d3", "k3", "rc3", "period_s"});
  if (!columns) return tl::unexpected(columns.error());
  std::vector<double> modulus(table.rows(), kNan);
  std::vector<double> argument(table.rows(), kNan);
  for (std::size_t i = 0; i < table.rows(); ++i) {
    const double n = (*columns)[0][i];
    if (!(n == 1.0 || n == 2.0 || n == 3.0)) {
      return make_error(ErrorCode::parse, fmt::format("{}:{}: column 'n': must be 1, 2 or 3",
                                                      table.name(), table.line_of(i)));
    }
    const std::string_view base = (*bases)[i];
    if (base != "T" && base != "adiabatic") {
      return make_error(ErrorCode::parse,
                        fmt::format("{}:{}: column 'base': '{}' is neither 'T' nor 'adiabatic'",
                                    table.name(), table.line_of(i), base));
    }
    std::vector<SolidLayer> layers;
    for (std::size_t layer = 0; layer < static_cast<std::size_t>(n); ++layer) {
      layers.push_back({(*columns)[1 + 3 * layer][i], (*columns)[2 + 3 * layer][i],
                        (*columns)[3 + 3 * layer][i]});
    }
    const double period_s = (*columns)[10][i];
    if (!(period_s > 0.0 && std::isfinite(period_s))) continue;
    const double angular_per_s = 2.0 * physics::kPi / period_s;
    const auto mesh = LayerMesh::build(
        layers, {base == "T" ? BaseKind::fixed_temperature : BaseKind::adiabatic, 0.0},
        mesh_options(0.2 / angular_per_s, request.refine));
    if (!mesh) continue;
    const std::complex<double> z = periodic_response(*mesh, angular_per_s).front();
    modulus[i] = std::abs(z);
    argument[i] = std::arg(z);
  }
  const std::vector<double> result[] = {std::move(modulus), std::move(argument)};
  return write_csv(kConductionLayeredOutputs, result);
}

}  // namespace emit::verify
