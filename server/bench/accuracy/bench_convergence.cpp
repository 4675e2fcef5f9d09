// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <vector>

#include "bench/accuracy/accuracy_benches.hpp"
#include "emit/physics/constants.hpp"
#include "emit/reference/layer_mesh.hpp"
#include "emit/reference/layer_solver.hpp"
#include "emit/reference/solid_solver.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

struct ConvergenceOptions {
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> plot;
};

using physics::Result;
using reference::SolidSolver;

constexpr double kEmissivityFrac = 0.93;
constexpr double kStartK = 290.0;

/// Absorbed flux of an hour of a morning. It starts in balance and without a kink, so that the
/// order is that of the scheme and not of the start.
double absorbed_w_m2(double time_s) {
  const double swing = std::sin(time_s * physics::kPi / 7200.0);
  return physics::kStefanBoltzmannWPerM2K4 * kEmissivityFrac * std::pow(kStartK, 4) +
         700.0 * std::pow(swing, 3);
}
constexpr double kFilmWM2K = 13.3;
constexpr double kEndS = 3600.0;

class Morning final : public reference::FaceModel {
 public:
  [[nodiscard]] reference::FaceFlux at(double time_s, double face_k) const noexcept override {
    const double emission =
        physics::kStefanBoltzmannWPerM2K4 * kEmissivityFrac * std::pow(face_k, 4);
    return {absorbed_w_m2(time_s) + kFilmWM2K * (kStartK - face_k) - emission,
            -kFilmWM2K - 4.0 * emission / face_k};
  }
};

/// The ground is asphalt on gravel on soil.
const std::vector<reference::SolidLayer> kGround{
    {0.03, 0.7, 1.9504e6}, {0.3, 1.5, 1.9e6}, {1.55, 1.2, 2.2e6}};

/// Returns temperatures at fixed places after the hour.
Result<std::vector<double>> layers_k(std::uint32_t refine, std::uint32_t steps) {
  reference::MeshOptions options;
  options.shortest_time_s = 100.0;
  options.cells_per_length = 1.0;
  options.growth_frac = 0.2;
  options.min_cells = 3;
  options.refine = refine;
  auto mesh = reference::LayerMesh::build(
      kGround, {reference::BaseKind::fixed_temperature, kStartK}, options);
  if (!mesh) return tl::unexpected(std::move(mesh.error()));
  reference::StepOptions step;
  step.fixed_step_s = kEndS / steps;
  reference::LayerSolver solver(*mesh, step);
  const reference::ProfilePoint start[] = {{0.0, kStartK}};
  solver.start(start, 0.0);
  solver.advance(kEndS, Morning());
  std::vector<double> kelvin;
  for (const double depth_m : {0.0, 0.015, 0.03, 0.045, 0.1}) {
    kelvin.push_back(solver.temperature_k(depth_m));
  }
  return kelvin;
}

/// Returns temperatures of ground half in the sun: a strip 0.32 m wide and 0.16 m deep, one cell
/// across.
Result<std::vector<double>> solid_k(std::uint32_t cells, std::uint32_t steps) {
  constexpr double kWidthM = 0.32;
  constexpr double kDepthM = 0.16;
  reference::SolidGrid grid;
  for (std::uint32_t i = 0; i <= 2 * cells; ++i) {
    grid.lines_m[0].push_back(kWidthM * i / (2.0 * cells));
  }
  grid.lines_m[1] = {0.0, 1.0};
  for (std::uint32_t i = 0; i <= cells; ++i) {
    grid.lines_m[2].push_back(kDepthM * i / static_cast<double>(cells));
  }
  grid.materials = {{0.7, 2120.0 * 920.0}};
  grid.cells.assign(grid.count(0) * grid.count(1) * grid.count(2), 0);
  reference::SolidOptions options;
  options.tolerance_k = 1e-7;  // of the iterations: the steps are given
  auto solver = SolidSolver::create(
      grid,
      [](const reference::SolidFace& face) {
        const bool top = face.axis == 2 && face.sign > 0;
        return reference::FaceCondition{
            top ? reference::FaceKind::exposed : reference::FaceKind::adiabatic, kEmissivityFrac,
            0.0};
      },
      options);
  if (!solver) return tl::unexpected(std::move(solver.error()));
  solver->set_uniform(0.0, kStartK);
  const auto faces = solver->faces();
  const reference::DriveFunction drive = [faces](double time_s, std::span<const double>,
                                                 const reference::FaceDrive& out) {
    for (std::size_t f = 0; f < faces.size(); ++f) {
      // The edge of light is smooth, because a function that a grid cannot resolve has no order.
      const double x = faces[f].centre_m().x / kWidthM;
      const double lit_frac = 0.5 - 0.5 * std::cos(physics::kPi * x);
      out.absorbed_w_m2[f] =
          absorbed_w_m2(0.0) + lit_frac * (absorbed_w_m2(time_s) - absorbed_w_m2(0.0));
      out.film_w_m2_k[f] = kFilmWM2K;
      out.air_k[f] = kStartK;
    }
  };
  for (std::uint32_t i = 1; i <= steps; ++i) {
    auto done = solver->step(kEndS * i / steps, drive);
    if (!done) return tl::unexpected(std::move(done.error()));
  }
  // The places are nodes of every grid of this family.
  std::vector<double> kelvin;
  const auto places = solver->nodes_m();
  const auto on_coarsest = [](double x_m) {
    const double cells_of_4 = x_m / 0.04;
    return std::abs(cells_of_4 - std::round(cells_of_4)) < 1e-6;
  };
  for (std::size_t i = 0; i < places.size(); ++i) {
    if (places[i].y < 0.5 && on_coarsest(places[i].x) && on_coarsest(places[i].z)) {
      kelvin.push_back(solver->node_k()[i]);
    }
  }
  return kelvin;
}

struct Study {
  const char* solver;   ///< "layer": one dimension, "solid": three
  const char* axis;     ///< "time" or "space"
  const char* refined;  ///< what the refinement counts
  const char* unit;
  double size_at_one;  ///< step or cell of refinement 1
  std::vector<std::uint32_t> refinements;
  std::uint32_t finest;  ///< refinement of the reference
  std::function<Result<std::vector<double>>(std::uint32_t)> run;
};

struct Row {
  const Study* study = nullptr;
  std::uint32_t refinement = 0;
  double size = 0.0;
  double max_error_k = 0.0;
  double order = 0.0;  ///< against the previous row; NaN in the first
};

Result<std::vector<Row>> converge(const Study& study, Progress& progress, std::uint64_t& done) {
  const auto truth = study.run(study.finest);
  if (!truth) return tl::unexpected(truth.error());
  progress.advance_to(++done);
  std::vector<Row> rows;
  for (const std::uint32_t refinement : study.refinements) {
    if (InterruptGuard::interrupted()) {
      return physics::make_error(physics::ErrorCode::internal, "stopped");
    }
    const auto values = study.run(refinement);
    if (!values) return tl::unexpected(values.error());
    Row row{&study, refinement, study.size_at_one / refinement, 0.0, std::nan("")};
    for (std::size_t i = 0; i < values->size(); ++i) {
      row.max_error_k = std::max(row.max_error_k, std::abs((*values)[i] - (*truth)[i]));
    }
    if (!rows.empty()) {
      row.order = std::log(rows.back().max_error_k / row.max_error_k) /
                  std::log(static_cast<double>(refinement) / rows.back().refinement);
    }
    rows.push_back(row);
    progress.advance_to(++done);
  }
  return rows;
}

Plot diagram(const std::vector<Row>& rows) {
  const Study& study = *rows.front().study;
  Plot plot;
  plot.title = fmt::format("{} dimension{}, {}", std::string_view(study.solver) == "layer" ? 1 : 3,
                           std::string_view(study.solver) == "layer" ? "" : "s", study.axis);
  plot.x = {study.refined, PlotScale::logarithmic};
  plot.y = {"largest error, K", PlotScale::logarithmic};
  PlotSeries measured;
  measured.label = "solver";
  measured.line = measured.emphasis = true;
  PlotSeries second;
  second.label = "second order";
  second.line = true;
  second.markers = false;
  for (const Row& row : rows) {
    const auto at = static_cast<double>(row.refinement);
    measured.points.push_back({at, row.max_error_k, fmt::format("{:.3g} K", row.max_error_k)});
    const double shrunk = row.size / rows.front().size;
    second.points.push_back({at, rows.front().max_error_k * shrunk * shrunk, ""});
  }
  plot.series = {second, measured};
  return plot;
}

int run(const ConvergenceOptions& command) {
  const std::array<Study, 4> studies{{
      {"layer",
       "time",
       "steps",
       "s",
       kEndS,
       {16, 32, 64, 128, 256},
       4096,
       [](std::uint32_t steps) { return layers_k(8, steps); }},
      {"layer",
       "space",
       "cells over those of the coarsest mesh",
       "of the coarsest",
       1.0,
       {1, 2, 4, 8, 16},
       64,
       [](std::uint32_t refine) { return layers_k(refine, 1024); }},
      {"solid",
       "time",
       "steps",
       "s",
       kEndS,
       {8, 16, 32, 64, 128},
       1024,
       [](std::uint32_t steps) { return solid_k(16, steps); }},
      {"solid",
       "space",
       "cells in 0.16 m",
       "m",
       0.16,
       {4, 8, 16, 32},
       128,
       [](std::uint32_t cells) { return solid_k(cells, 64); }},
  }};
  std::uint64_t work = 0;
  for (const Study& study : studies) work += 1 + study.refinements.size();
  const InterruptGuard interrupt;
  Progress progress("bench convergence", work);
  std::uint64_t done = 0;
  TextTable table({"solver", "axis", "refinement", "step or cell", "max error K", "order"});
  Json results = Json::array();
  std::vector<Plot> plots;
  for (const Study& study : studies) {
    const auto rows = converge(study, progress, done);
    if (!rows) return fail(rows.error());
    for (const Row& row : *rows) {
      table.add({study.solver, study.axis, fmt::format("{}", row.refinement),
                 fmt::format("{:.4g} {}", row.size, study.unit),
                 fmt::format("{:.3g}", row.max_error_k),
                 std::isnan(row.order) ? "" : fmt::format("{:.2f}", row.order)});
      Json json = Json::object();
      json.set("solver", study.solver).set("axis", study.axis);
      json.set("refinement", row.refinement).set("size", row.size).set("size_unit", study.unit);
      json.set("max_error_k", row.max_error_k);
      json.set("order", std::isnan(row.order) ? Json(nullptr) : Json(row.order));
      json.set("reference", fmt::format("the same solver at refinement {}", study.finest));
      results.push(std::move(json));
    }
    plots.push_back(diagram(*rows));
  }
  if (command.json != std::filesystem::path("-")) {
    fmt::print("commit {}\n{}", kCommit, table.to_string());
  }
  if (command.plot) {
    if (auto written = write_svg(*command.plot, plots); !written) return fail(written.error());
  }
  if (!command.json) return kExitOk;
  Json json = Json::object();
  json.set("device", "cpu").set("commit", kCommit).set("suite", "convergence");
  json.set("results", std::move(results));
  if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  return kExitOk;
}

void add_options(CommandLine& line, ConvergenceOptions& options) {
  line.output_file("--plot", options.plot, "Write the diagrams as SVG");
  add_json(line, options.json);
}

}  // namespace

void add_bench_convergence(CommandLine& bench) {
  bench.command<ConvergenceOptions>(
      {.name = "convergence",
       .text = "How the error of the reference solvers falls with their cells and steps",
       .example = "emit bench convergence --plot convergence.svg"},
      add_options, run);
}

}  // namespace emit::tool
