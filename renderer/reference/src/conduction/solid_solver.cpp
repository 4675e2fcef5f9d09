// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/solid_solver.hpp"

#include <fmt/format.h>
#include <tbb/blocked_range.h>

#include <algorithm>
#include <cmath>

#include "emit/physics/check.hpp"
#include "emit/threads/parallel.hpp"
#include "solid_linear.hpp"
#include "solid_mesh.hpp"

namespace emit::reference {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

// TR-BDF2 (Bank et al. 1985) with the third-order companion of Hosea and Shampine (1996): the
// trapezium to t + gamma dt, then BDF2. Both stages share the matrix M / (d dt) + K.
constexpr double kSqrt2 = 1.4142135623730950488;
constexpr double kGamma = 2.0 - kSqrt2;
constexpr double kD = kGamma / 2.0;
constexpr double kW = kSqrt2 / 4.0;
constexpr double kError0 = kW - (1.0 - kW) / 3.0;
constexpr double kError1 = kW - (3.0 * kW + 1.0) / 3.0;
constexpr double kError2 = kD - kD / 3.0;

/// Share of the step tolerance at which linear solves and Newton's iteration stop.
constexpr double kSolveShare = 1e-3;
constexpr int kMaxNewton = 12;
constexpr std::size_t kGrain = 8192;

/// Calls body(i) for i < n, in parallel.
template <class Body>
void for_range(std::size_t n, const Body& body) {
  threads::parallel_ranges(tbb::blocked_range<std::size_t>(0, n, kGrain), [&](const auto& range) {
    for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
  });
}

/// Sums term(i) for i < n in fixed chunks, which gives the same bits for any number of threads.
template <class Term>
double sum_of(std::size_t n, const Term& term) {
  const std::size_t chunks = (n + kGrain - 1) / kGrain;
  std::vector<double> partial(chunks, 0.0);
  threads::parallel_ranges(tbb::blocked_range<std::size_t>(0, chunks, 1), [&](const auto& range) {
    for (std::size_t chunk = range.begin(); chunk != range.end(); ++chunk) {
      double sum = 0.0;
      const std::size_t end = std::min(n, (chunk + 1) * kGrain);
      for (std::size_t i = chunk * kGrain; i < end; ++i) sum += term(i);
      partial[chunk] = sum;
    }
  });
  double total = 0.0;
  for (const double value : partial) total += value;
  return total;
}

}  // namespace

/// Mesh, options, state and work space of a solver.
struct SolidSolver::Data {
  SolidMesh mesh;
  SolidOptions options;
  SolidLinear linear;
  SolidState state;

  // Drive of the exposed faces, and its sums over the surface nodes.
  std::vector<double> face_k, absorbed_w_m2, film_w_m2_k, air_k;
  std::vector<double> supply_w, film_w_k;
  // Values per free node.
  std::vector<double> shift, base_k, right, delta, flow0_w, flow1_w, flow2_w;
  // Temperatures of all nodes at both stages.
  std::vector<double> stage1_k, stage2_k;
  // Heat and flow of the step that was attempted last.
  double pending_heat_j = 0.0;
  double pending_flow_w = 0.0;

  Data(SolidMesh&& m, const SolidOptions& o)
      : mesh(std::move(m)), options(o), linear(mesh, o.linear) {
    const std::size_t n = mesh.free_count;
    const std::size_t all = mesh.nodes_m.size();
    for (auto* vector : {&face_k, &absorbed_w_m2, &film_w_m2_k, &air_k}) {
      vector->resize(mesh.faces.size());
    }
    for (auto* vector : {&supply_w, &film_w_k}) vector->resize(mesh.surface_nodes.size());
    for (auto* vector : {&shift, &base_k, &right, &delta, &flow0_w, &flow1_w, &flow2_w}) {
      vector->resize(n);
    }
    for (auto* vector : {&stage1_k, &stage2_k}) vector->resize(all);
    state.slope_w.assign(n, 0.0);
    state.node_k.assign(all, 0.0);
    state.step_s = options.first_step_s;
    hold_fixed(state.node_k);
  }
  Data(const Data&) = delete;
  Data& operator=(const Data&) = delete;

  /// Sets the nodes of fixed temperature.
  void hold_fixed(std::vector<double>& kelvin) const {
    std::copy(mesh.fixed_k.begin(), mesh.fixed_k.end(),
              kelvin.begin() + static_cast<std::ptrdiff_t>(mesh.free_count));
  }

  Result<void> evaluate_drive(double time_s, const std::vector<double>& kelvin,
                              const DriveFunction& drive);
  void net_flow(const std::vector<double>& kelvin, std::vector<double>& out);
  [[nodiscard]] double boundary_flow_w(const std::vector<double>& kelvin) const;
  Result<void> solve_stage(double step_s, std::vector<double>& kelvin, bool factorise);
  Result<double> attempt(double step_s, const DriveFunction& drive);
  void accept(double to_s);
};

/// Calls the drive for a time and sums its terms over the surface nodes. Errors: internal (the
/// drive is not finite).
Result<void> SolidSolver::Data::evaluate_drive(double time_s, const std::vector<double>& kelvin,
                                               const DriveFunction& drive) {
  // Average the corners of every face.
  for_range(mesh.faces.size(), [&](std::size_t f) {
    double sum = 0.0;
    for (const std::uint32_t node : mesh.faces[f].nodes) sum += kelvin[node];
    face_k[f] = 0.25 * sum;
  });
  drive(time_s, face_k, {absorbed_w_m2, film_w_m2_k, air_k});
  // Give a quarter of each face to each of its corners.
  for_range(mesh.surface_nodes.size(), [&](std::size_t s) {
    double supply = 0.0;
    double film = 0.0;
    for (std::uint32_t at = mesh.face_start[s]; at < mesh.face_start[s + 1]; ++at) {
      const std::uint32_t f = mesh.node_faces[at];
      const double quarter = 0.25 * mesh.faces[f].area_m2;
      supply += quarter * (absorbed_w_m2[f] + film_w_m2_k[f] * air_k[f]);
      film += quarter * film_w_m2_k[f];
    }
    supply_w[s] = supply;
    film_w_k[s] = film;
  });
  // Refuse a drive that is not finite.
  const double check =
      sum_of(supply_w.size(), [&](std::size_t s) { return supply_w[s] + film_w_k[s]; });
  if (!std::isfinite(check)) {
    return make_error(ErrorCode::internal,
                      fmt::format("solid solver: the drive at {} s is not finite", time_s));
  }
  return {};
}

/// Computes the power into every free node under the drive that was evaluated last.
void SolidSolver::Data::net_flow(const std::vector<double>& kelvin, std::vector<double>& out) {
  linear.flow(kelvin, out);
  for_range(mesh.surface_nodes.size(), [&](std::size_t s) {
    const double t = kelvin[mesh.surface_nodes[s]];
    out[mesh.surface_nodes[s]] +=
        supply_w[s] - film_w_k[s] * t - mesh.emission_w_k4[s] * t * t * t * t;
  });
}

/// Returns the power through exposed faces and from fixed nodes. It is what all free nodes together
/// gain.
double SolidSolver::Data::boundary_flow_w(const std::vector<double>& kelvin) const {
  const double faces = sum_of(mesh.surface_nodes.size(), [&](std::size_t s) {
    const double t = kelvin[mesh.surface_nodes[s]];
    return supply_w[s] - film_w_k[s] * t - mesh.emission_w_k4[s] * t * t * t * t;
  });
  // Fixed neighbours are the last ones of a row.
  const double fixed = sum_of(mesh.free_count, [&](std::size_t i) {
    double sum = 0.0;
    for (std::uint32_t at = mesh.row_start[i + 1]; at-- > mesh.row_start[i];) {
      const std::uint32_t column = mesh.columns[at];
      if (column < mesh.free_count) break;
      sum += mesh.conductance_w_k[at] * (kelvin[column] - kelvin[i]);
    }
    return sum;
  });
  return faces + fixed;
}

/// Solves M (T - base) / (d dt) = net flow(T) by Newton, from the guess in `kelvin`.
Result<void> SolidSolver::Data::solve_stage(double step_s, std::vector<double>& kelvin,
                                            bool factorise) {
  const double scale = 1.0 / (kD * step_s);
  const double tolerance = kSolveShare * options.tolerance_k;
  for (int iteration = 0; iteration < kMaxNewton; ++iteration) {
    // Compute the residual and the diagonal that the time step adds to the matrix.
    net_flow(kelvin, right);
    for_range(mesh.free_count, [&](std::size_t i) {
      shift[i] = mesh.capacity_j_k[i] * scale;
      right[i] -= shift[i] * (kelvin[i] - base_k[i]);
    });
    // Add the slope of the convection and of the emission at the surface.
    for_range(mesh.surface_nodes.size(), [&](std::size_t s) {
      const std::uint32_t node = mesh.surface_nodes[s];
      const double t = std::max(kelvin[node], 1.0);
      shift[node] += film_w_k[s] + 4.0 * mesh.emission_w_k4[s] * t * t * t;
    });
    // Factorise once per step; later iterations reuse the factor as a preconditioner.
    if (factorise && iteration == 0) {
      ++state.stats.factorisations;
      if (!linear.factorise(shift)) {
        return make_error(ErrorCode::internal, "solid solver: the matrix is not positive definite");
      }
    }
    const int used = linear.solve(shift, right, delta, tolerance);
    if (used < 0) {
      return make_error(ErrorCode::internal, "solid solver: the linear system did not converge");
    }
    state.stats.linear_iterations += static_cast<std::uint64_t>(used);
    ++state.stats.newton_iterations;
    for_range(mesh.free_count, [&](std::size_t i) { kelvin[i] += delta[i]; });
    // Stop when the linearised emission is accurate enough.
    double worst = 0.0;
    for (const std::uint32_t node : mesh.surface_nodes) {
      // The linearisation leaves at most 6 T^2 delta^2 of the emission, whose slope is 4 T^3.
      const double left = 1.5 * delta[node] * delta[node] / std::max(kelvin[node], 1.0);
      worst = std::max(worst, left);
    }
    if (worst <= tolerance) return {};
    if (!std::isfinite(worst)) break;
  }
  return make_error(ErrorCode::internal, "solid solver: Newton's iteration did not converge");
}

/// Attempts one step from the state. The stages end in stage1_k and stage2_k. Returns the error
/// estimate, K.
Result<double> SolidSolver::Data::attempt(double step_s, const DriveFunction& drive) {
  const double t0 = state.time_s;
  const std::vector<double>& start_k = state.node_k;
  const std::size_t n = mesh.free_count;
  // Evaluate the flow at the start, unless the last step left it.
  if (!state.has_slope) {
    if (auto done = evaluate_drive(t0, start_k, drive); !done) return tl::unexpected(done.error());
    net_flow(start_k, state.slope_w);
    state.flow_w = boundary_flow_w(start_k);
    state.has_slope = true;
  }
  const std::vector<double>& flow0 = state.slope_w;

  // Bound the explicit prediction. It is wild in cells that answer faster than the step, but the
  // emission needs a temperature near the truth.
  const auto bounded = [](double from, double change) {
    return from + std::clamp(change, -5.0, 5.0);
  };
  hold_fixed(stage1_k);
  hold_fixed(stage2_k);
  // Stage 1: the trapezium to t + gamma dt.
  for_range(n, [&](std::size_t i) {
    const double rate = flow0[i] / mesh.capacity_j_k[i];
    base_k[i] = start_k[i] + kD * step_s * rate;
    stage1_k[i] = bounded(start_k[i], kGamma * step_s * rate);
  });
  if (auto done = evaluate_drive(t0 + kGamma * step_s, stage1_k, drive); !done) {
    return tl::unexpected(done.error());
  }
  if (auto done = solve_stage(step_s, stage1_k, true); !done) return tl::unexpected(done.error());
  const double boundary1_w = boundary_flow_w(stage1_k);

  // Stage 2: BDF2 to t + dt, predicted by the parabola through the start and stage 1.
  constexpr double kC1 = 1.0 / (kGamma * (2.0 - kGamma));
  constexpr double kC0 = (1.0 - kGamma) * (1.0 - kGamma) * kC1;
  for_range(n, [&](std::size_t i) {
    const double capacity = mesh.capacity_j_k[i];
    flow1_w[i] = capacity * (stage1_k[i] - base_k[i]) / (kD * step_s);
    base_k[i] = kC1 * stage1_k[i] - kC0 * start_k[i];
    const double first = kGamma * step_s * flow0[i] / capacity;
    const double bend = stage1_k[i] - start_k[i] - first;
    stage2_k[i] = bounded(start_k[i], first / kGamma + bend / (kGamma * kGamma));
  });
  if (auto done = evaluate_drive(t0 + step_s, stage2_k, drive); !done) {
    return tl::unexpected(done.error());
  }
  if (auto done = solve_stage(step_s, stage2_k, false); !done) return tl::unexpected(done.error());
  const double boundary2_w = boundary_flow_w(stage2_k);
  // Combine the flows of the stages to the third-order estimate of the error.
  for_range(n, [&](std::size_t i) {
    flow2_w[i] = mesh.capacity_j_k[i] * (stage2_k[i] - base_k[i]) / (kD * step_s);
    right[i] = (kError0 * flow0[i] + kError1 * flow1_w[i] + kError2 * flow2_w[i]) / kD;
  });
  // Solve with the implicit matrix: it removes from the estimate what the scheme itself damps.
  if (linear.solve(shift, right, delta, 0.05 * options.tolerance_k) < 0) {
    return make_error(ErrorCode::internal, "solid solver: the error estimate did not converge");
  }
  double worst = 0.0;
  for (std::size_t i = 0; i < n; ++i) worst = std::max(worst, std::abs(delta[i]));
  // Keep the heat of the step until the step is accepted.
  pending_heat_j = step_s * (kW * state.flow_w + kW * boundary1_w + kD * boundary2_w);
  pending_flow_w = boundary2_w;
  return worst;
}

/// Takes over the step that was attempted last.
void SolidSolver::Data::accept(double to_s) {
  state.time_s = to_s;
  state.node_k.swap(stage2_k);
  state.slope_w.swap(flow2_w);
  state.flow_w = pending_flow_w;
  state.heat_in_j += pending_heat_j;
  ++state.stats.steps;
}

Result<SolidSolver> SolidSolver::create(
    const SolidGrid& grid, const std::function<FaceCondition(const SolidFace&)>& condition,
    const SolidOptions& options) {
  if (!(options.tolerance_k > 0.0 && options.min_step_s > 0.0 &&
        options.first_step_s >= options.min_step_s && options.max_step_s >= options.min_step_s)) {
    return make_error(ErrorCode::invalid_argument,
                      "solid solver: tolerance and steps must be positive");
  }
  auto mesh = build_solid_mesh(grid, condition);
  if (!mesh) return tl::unexpected(std::move(mesh.error()));
  return SolidSolver(std::make_unique<Data>(std::move(*mesh), options));
}

SolidSolver::SolidSolver(std::unique_ptr<Data> data) : data_(std::move(data)) {}
SolidSolver::~SolidSolver() = default;
SolidSolver::SolidSolver(SolidSolver&&) noexcept = default;
SolidSolver& SolidSolver::operator=(SolidSolver&&) noexcept = default;

std::span<const SolidFace> SolidSolver::faces() const noexcept {
  return data_->mesh.faces;
}
std::span<const glm::dvec3> SolidSolver::nodes_m() const noexcept {
  return data_->mesh.nodes_m;
}
std::size_t SolidSolver::free_nodes() const noexcept {
  return data_->mesh.free_count;
}

void SolidSolver::set_uniform(double time_s, double temperature_k) {
  set_temperature(time_s, [temperature_k](const glm::dvec3&) { return temperature_k; });
}

void SolidSolver::set_temperature(double time_s,
                                  const std::function<double(const glm::dvec3&)>& kelvin) {
  Data& d = *data_;
  for (std::size_t i = 0; i < d.mesh.free_count; ++i) {
    d.state.node_k[i] = kelvin(d.mesh.nodes_m[i]);
  }
  d.state.time_s = time_s;
  d.state.step_s = d.options.first_step_s;
  d.state.has_slope = false;
  d.state.heat_in_j = 0.0;
}

Result<void> SolidSolver::advance(double to_s, const DriveFunction& drive,
                                  const std::function<bool(double time_s)>& after_step) {
  Data& d = *data_;
  const SolidOptions& options = d.options;
  if (!(to_s >= d.state.time_s)) {
    return make_error(
        ErrorCode::invalid_argument,
        fmt::format("solid solver: cannot go back from {} s to {} s", d.state.time_s, to_s));
  }
  while (d.state.time_s < to_s) {
    const double left = to_s - d.state.time_s;
    double step_s = std::clamp(d.state.step_s, options.min_step_s, options.max_step_s);
    const bool last = step_s >= left * (1.0 - 1e-9);
    // Stretch or halve the step near the end, so that no tiny step is left over.
    if (last) {
      step_s = left;
    } else if (step_s > 0.5 * left) {
      step_s = 0.5 * left;
    }
    const auto error_k = d.attempt(step_s, drive);
    const bool failed = !error_k || !std::isfinite(*error_k);
    // Reject the step and repeat with a smaller one.
    if ((failed || *error_k > options.tolerance_k) && step_s > options.min_step_s) {
      ++d.state.stats.rejected;
      const double shrink =
          failed ? 0.25 : std::clamp(0.9 * std::cbrt(options.tolerance_k / *error_k), 0.1, 0.8);
      d.state.step_s = std::max(options.min_step_s, step_s * shrink);
      continue;
    }
    if (failed) {
      return error_k ? make_error(ErrorCode::internal, "solid solver: the result is not finite")
                     : tl::unexpected(error_k.error());
    }
    // Accept the step and choose the next one by the error of third order.
    d.accept(last ? to_s : d.state.time_s + step_s);
    const double growth =
        std::clamp(0.9 * std::cbrt(options.tolerance_k / std::max(*error_k, 1e-12)), 0.2, 2.0);
    // Do not shrink the next step after one that the end cut short: it says little about the next.
    const double next_s = step_s * growth;
    d.state.step_s = std::min(options.max_step_s, step_s < 0.99 * d.state.step_s && growth > 1.0
                                                      ? std::max(d.state.step_s, next_s)
                                                      : next_s);
    if (after_step && !after_step(d.state.time_s)) return {};
  }
  return {};
}

Result<double> SolidSolver::step(double to_s, const DriveFunction& drive) {
  Data& d = *data_;
  if (!(to_s > d.state.time_s)) {
    return make_error(ErrorCode::invalid_argument, "solid solver: a step must go forward");
  }
  auto error_k = d.attempt(to_s - d.state.time_s, drive);
  if (!error_k) return error_k;
  if (!std::isfinite(*error_k)) {
    return make_error(ErrorCode::internal, "solid solver: the result is not finite");
  }
  d.accept(to_s);
  return error_k;
}

double SolidSolver::time_s() const noexcept {
  return data_->state.time_s;
}
std::span<const double> SolidSolver::node_k() const noexcept {
  return data_->state.node_k;
}

double SolidSolver::face_k(std::size_t face) const noexcept {
  EMIT_DCHECK_OP(face, <, data_->mesh.faces.size());
  double sum = 0.0;
  for (const std::uint32_t node : data_->mesh.faces[face].nodes) sum += data_->state.node_k[node];
  return 0.25 * sum;
}

double SolidSolver::face_k_at(std::size_t face, const glm::dvec3& point_m) const noexcept {
  EMIT_DCHECK_OP(face, <, data_->mesh.faces.size());
  const SolidFace& f = data_->mesh.faces[face];
  // Interpolate between the corners in the two axes of the face.
  const auto u = static_cast<glm::dvec3::length_type>(f.axis == 0 ? 1 : 0);
  const auto v = static_cast<glm::dvec3::length_type>(f.axis == 2 ? 1 : 2);
  const auto share = [&](glm::dvec3::length_type a) {
    return std::clamp((point_m[a] - f.low_m[a]) / (f.high_m[a] - f.low_m[a]), 0.0, 1.0);
  };
  const double x = share(u);
  const double y = share(v);
  const auto t = [&](std::size_t corner) { return data_->state.node_k[f.nodes[corner]]; };
  return (1.0 - y) * ((1.0 - x) * t(0) + x * t(1)) + y * ((1.0 - x) * t(2) + x * t(3));
}

double SolidSolver::heat_j() const noexcept {
  const Data& d = *data_;
  return sum_of(d.mesh.free_count,
                [&](std::size_t i) { return d.mesh.capacity_j_k[i] * d.state.node_k[i]; });
}
double SolidSolver::heat_in_j() const noexcept {
  return data_->state.heat_in_j;
}

const SolidStats& SolidSolver::stats() const noexcept {
  return data_->state.stats;
}
SolidState SolidSolver::state() const {
  return data_->state;
}

Result<void> SolidSolver::restore(const SolidState& state) {
  const SolidState& mine = data_->state;
  if (state.node_k.size() != mine.node_k.size() || state.slope_w.size() != mine.slope_w.size()) {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("solid solver: the saved state has {} nodes, this one {}",
                                  state.node_k.size(), mine.node_k.size()));
  }
  data_->state = state;
  return {};
}

}  // namespace emit::reference
