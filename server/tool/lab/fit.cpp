// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/fit.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "emit/config/load.hpp"
#include "emit/physics/csv.hpp"
#include "emit/scene/base.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/lab/fit_materials.hpp"
#include "tool/lab/fit_measured.hpp"
#include "tool/lab/lab.hpp"
#include "tool/support/console.hpp"
#include "tool/support/json.hpp"
#include "tool/support/library_edit.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct FitOptions {
  ScenarioChoice input;  ///< a scenario, or a curve (*.csv)
  std::vector<std::string> materials;
  std::optional<std::size_t> modes;
  std::string model = "foster";
  double spin_up_s = 172'800.0;
  double history_s = 12'600.0;
  std::filesystem::path library;  ///< empty: the shipped one
  std::optional<std::filesystem::path> out;
  std::optional<std::filesystem::path> toml;
  std::optional<std::filesystem::path> json;
  MeasuredFitOptions measured;
};

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr const char* kColumns[] = {"time_s", "absorbed_w_m2", "film_w_m2_k", "air_k",
                                    "temperature_k"};

/// CSV with a header row; columns in any order, others are ignored.
Result<std::vector<reference::CurvePoint>> read_curve(const std::filesystem::path& file) {
  const auto table = physics::CsvTable::read(file);
  if (!table) return tl::unexpected(table.error());
  std::array<std::vector<double>, std::size(kColumns)> columns;
  for (std::size_t i = 0; i < columns.size(); ++i) {
    auto column = table->numbers(kColumns[i]);
    if (!column) return tl::unexpected(std::move(column.error()));
    columns[i] = std::move(*column);
    for (std::size_t row = 0; row < columns[i].size(); ++row) {
      if (std::isfinite(columns[i][row])) continue;
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("{}:{}: column '{}': {} is not finite", file.string(),
                                    table->line_of(row), kColumns[i], columns[i][row]));
    }
  }
  std::vector<reference::CurvePoint> curve;
  for (std::size_t row = 0; row < table->rows(); ++row) {
    curve.push_back(
        {columns[0][row], columns[1][row], columns[2][row], columns[3][row], columns[4][row]});
  }
  return curve;
}

Json json_of(const reference::FitResult& fit, const scene::Material& material,
             reference::FitModel model) {
  Json out = Json::object();
  out.set("material", fit.material);
  out.set("model", model == reference::FitModel::foster ? "foster" : "emit2014");
  out.set("rms_k", fit.rms_k).set("max_k", fit.max_k).set("horizon_s", fit.horizon_s);
  if (model == reference::FitModel::foster) {
    out.set("derived_rms_k", fit.derived_rms_k).set("derived_max_k", fit.derived_max_k);
  }
  out.set("dry_layers_valid", material.dry_layers_valid);
  out.set("converged", fit.converged).set("iterations", std::uint64_t{fit.iterations});
  Json modes = Json::array();
  for (std::size_t i = 0; i < fit.network.count; ++i) {
    modes.push(Json::object()
                   .set("tau_s", fit.network.modes[i].tau_s)
                   .set("resistance_m2k_w", fit.network.modes[i].resistance_m2k_w));
  }
  for (const scene::RelaxationMode& mode : fit.modes) {
    modes.push(Json::object().set("tau_s", mode.tau_s).set("weight_frac", mode.weight_frac));
  }
  out.set("modes", std::move(modes));
  Json residuals = Json::array();
  for (const reference::FitResidual& r : fit.residuals) {
    residuals.push(Json::object()
                       .set("history", r.history)
                       .set("rms_k", r.rms_k)
                       .set("max_k", r.max_k)
                       .set("judged", r.judged));
  }
  out.set("residuals", std::move(residuals));
  return out;
}

std::string modes_text(const reference::FitResult& fit) {
  std::string text;
  for (std::size_t i = 0; i < fit.network.count; ++i) {
    text += fmt::format("{}{:.4g} s {:.4g}", i > 0 ? ", " : "", fit.network.modes[i].tau_s,
                        fit.network.modes[i].resistance_m2k_w);
  }
  for (std::size_t i = 0; i < fit.modes.size(); ++i) {
    text += fmt::format("{}{:.4g} s {:.3f}", i > 0 ? ", " : "", fit.modes[i].tau_s,
                        fit.modes[i].weight_frac);
  }
  return text;
}

bool is_curve(const std::string& input) {
  return std::filesystem::path(input).extension() == ".csv";
}

/// Materials to fit, and the curve or the forcing of a scenario that they are fitted to.
struct FitInput {
  std::vector<scene::Material> materials;
  std::vector<reference::CurvePoint> curve;  ///< empty: the scenario's forcing counts
  std::vector<reference::GroundForcing> forcing;
  double start_s = 0.0;
  double initial_k = 0.0;
};

/// Reads a curve and its material.
Result<FitInput> curve_input(const FitOptions& command) {
  const auto library = fit_library(command.library);
  if (!library) return tl::unexpected(library.error());
  const auto known = config::load_materials(*library, command.input.set);
  if (!known) return tl::unexpected(known.error());
  // A base that the library does not state follows from the place and date of a shipped scenario.
  const auto file = config::resolve_scenario("block-on-road");
  if (!file) return tl::unexpected(file.error());
  config::LoadOptions options;
  options.require_scene_files = false;
  auto scenario = config::load_scenario(*file, {}, options);
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  scenario->materials = *known;
  scene::resolve_bases(*scenario);
  FitInput input;
  auto materials = fit_materials(scenario->materials, command.materials);
  if (!materials) return tl::unexpected(std::move(materials.error()));
  input.materials = std::move(*materials);
  for (const scene::Material& material : input.materials) {
    if (material.base_stated || material.prescribed_k) continue;
    warn(fmt::format("material '{}' states no base_k: {:.1f} K is taken, that of block-on-road",
                     material.name, material.base_k));
  }
  auto curve = read_curve(command.input.scenario);
  if (!curve) return tl::unexpected(std::move(curve.error()));
  input.curve = std::move(*curve);
  return input;
}

/// Reads a scenario and makes the forcing of its histories.
Result<FitInput> scenario_input(const FitOptions& command) {
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return tl::unexpected(scenario.error());
  for (const std::string& text : scenario->warnings) warn(text);
  FitInput input;
  auto materials = fit_materials(scenario->materials, command.materials);
  if (!materials) return tl::unexpected(std::move(materials.error()));
  input.materials = std::move(*materials);
  constexpr double kForcingStepS = 60.0;
  input.start_s = static_cast<double>(scenario->thermal.history_start_ns) * 1e-9;
  input.initial_k = scenario->thermal.initial_k;
  input.forcing = reference::ground_forcing(*scenario, input.start_s - command.spin_up_s,
                                            input.start_s + command.history_s, kForcingStepS);
  return input;
}

int fail_input(const physics::Error& error) {
  return error.code == ErrorCode::config ? fail_config(error) : fail_call(error);
}

/// Fits and their texts.
struct FitOutput {
  TextTable table{{"material", "rms K", "max K", "derived rms K", "max K", "modes"}};
  Json results = Json::array();
  std::vector<LibraryEntry> entries;
  std::string toml;
};

/// Worst error over the judged histories, RMS and greatest, that needs no further mode.
constexpr double kEnoughRmsK = 0.02;
constexpr double kEnoughMaxK = 0.1;

/// Share of the RMS error of a measured curve that a mode more must take away to be kept: noise has
/// no modes.
constexpr double kWorthAModeFrac = 0.1;

/// Fits one material with the modes of `options`, or with the fewest modes that are enough if
/// `fewest`. A network of more modes costs time in every step. Errors: those of the fit.
Result<reference::FitResult> fit_one(const scene::Material& material, const FitInput& input,
                                     reference::FitOptions options, bool fewest) {
  const std::size_t most = options.modes;
  const bool measured = !input.curve.empty();
  std::optional<reference::FitResult> before;
  for (options.modes = fewest ? 1 : most;; ++options.modes) {
    auto fit = measured ? reference::fit_curve(material, input.curve, options)
                        : reference::fit_material(material, input.forcing, input.start_s,
                                                  input.initial_k, options);
    const bool last = options.modes >= most;
    if (!fit) {
      // Too few modes may have no model at all.
      if (last) return before ? Result<reference::FitResult>(*before) : std::move(fit);
      continue;
    }
    if (measured && before && fit->rms_k > (1.0 - kWorthAModeFrac) * before->rms_k) return *before;
    const bool enough = fit->rms_k <= kEnoughRmsK && fit->max_k <= kEnoughMaxK;
    if (enough || last) return fit;
    before = std::move(*fit);
  }
}

/// Fits every material. Errors: those of the fit.
Result<FitOutput> fit_all(const FitInput& input, const reference::FitOptions& options,
                          bool fewest) {
  const bool foster = options.model == reference::FitModel::foster;
  FitOutput out;
  Progress bar("fitting", input.materials.size());
  for (std::size_t i = 0; i < input.materials.size(); ++i) {
    const scene::Material& material = input.materials[i];
    const auto fit = fit_one(material, input, options, fewest);
    if (!fit) {
      bar.finish();
      return tl::unexpected(fit.error());
    }
    bar.advance_to(i + 1);
    out.table.add({material.name + (material.dry_layers_valid ? "" : " (dry layers not valid)"),
                   fmt::format("{:.3f}", fit->rms_k), fmt::format("{:.3f}", fit->max_k),
                   foster ? fmt::format("{:.3f}", fit->derived_rms_k) : "-",
                   foster ? fmt::format("{:.3f}", fit->derived_max_k) : "-", modes_text(*fit)});
    out.results.push(json_of(*fit, material, options.model));
    out.entries.push_back({*fit, foster});
    out.toml += fitted_material_toml(material, *fit, foster);
  }
  bar.finish();
  return out;
}

/// Writes the files that were asked for.
Result<void> write_files(const FitOptions& command, FitOutput& output) {
  if (command.out) {
    auto done = write_library(command.library, output.entries, *command.out);
    if (!done) return done;
  }
  if (command.toml) {
    auto file = ReplacingFile::create(*command.toml);
    if (!file) return tl::unexpected(std::move(file.error()));
    if (auto done = file->write(output.toml); !done) return done;
    if (auto done = file->commit(); !done) return done;
  }
  if (!command.json) return {};
  Json json = Json::object();
  json.set("scenario", command.input.scenario).set("results", std::move(output.results));
  return write_json(*command.json, json);
}

/// Fits numbers of the ground to a logger's record.
int run_measured(const FitOptions& command) {
  if (command.materials.size() > 1) {
    return fail(kExitUsage, "--measured takes one --material: the ground below the logger");
  }
  if (command.out) return fail(kExitUsage, "--out: --measured writes a material with --toml");
  MeasuredFitOptions measured = command.measured;
  if (!command.materials.empty()) measured.ground.material = command.materials.front();
  measured.ground.library = command.library;
  measured.toml = command.toml;
  measured.json = command.json;
  return run_measured_fit(measured);
}

int run(const FitOptions& command) {
  if (command.input.scenario.empty() == command.measured.logger.empty()) {
    return fail(kExitUsage, "name a scenario, a curve, or --measured LOGGER.csv");
  }
  if (!command.measured.logger.empty()) return run_measured(command);
  reference::FitOptions options;
  options.model =
      command.model == "emit2014" ? reference::FitModel::emit2014 : reference::FitModel::foster;
  const bool foster = options.model == reference::FitModel::foster;
  options.modes = command.modes.value_or(foster ? physics::kMaxFosterModes : 2U);
  if (!foster && options.modes > 2) return fail(kExitUsage, "emit2014 has at most 2 modes");
  options.history_s = command.history_s;
  options.spin_up_s = command.spin_up_s;
  const bool curve = is_curve(command.input.scenario);
  if (curve && command.materials.size() != 1) {
    return fail(kExitUsage, "a curve belongs to one material: name it with --material");
  }
  const auto input = curve ? curve_input(command) : scenario_input(command);
  if (!input) return fail_input(input.error());
  if (command.out) {
    const auto library = fit_library(command.library);
    if (!library) return fail(library.error());
    const auto good = check_fit_library(*library, input->materials, command.input.scenario);
    if (!good) return fail_input(good.error());
  }
  auto output = fit_all(*input, options, foster && !command.modes);
  if (!output) return fail_call(output.error());
  std::FILE* text = command.toml == "-" ? stderr : text_stream(command.json);
  fmt::print(text, "{}", output->table.to_string());
  if (!curve) {
    fmt::print(text,
               "worst of five histories of {:.0f} s from {:.0f} s on, after {:.0f} s of "
               "spin-up; reference within {:.0e} K a step\n",
               options.history_s, input->start_s, options.spin_up_s, options.reference_tolerance_k);
  }
  if (auto done = write_files(command, *output); !done) return fail(done.error());
  return kExitOk;
}

void add_options(CommandLine& line, FitOptions& options) {
  line.option("input", options.input.scenario,
              "Scenario: its place, date, weather and materials, over five histories of sun and "
              "shade. Or a curve, CSV with time_s, absorbed_w_m2, film_w_m2_k, air_k, "
              "temperature_k")
      .type_name("SCENARIO|CURVE.csv");
  add_set(line, options.input.set);
  line.option("--material", options.materials,
              "Material; repeatable; default: all of the scenario, or soil with --measured")
      .repeatable()
      .type_name("NAME");
  line.option("--modes", options.modes,
              "foster: 1 to 6, default: the fewest that bring the worst error below 0.02 K RMS "
              "and 0.1 K, or, with a curve, until one more takes less than a tenth of the error "
              "away; emit2014: 1 or 2, default 2")
      .type_name("N")
      .in_range(1, 6);
  line.option("--model", options.model, "Model whose modes are fitted")
      .one_of({"foster", "emit2014"})
      .show_default();
  line.seconds("--spin-up-s", options.spin_up_s, "Unshadowed time before the histories")
      .in_range(0.0, 3.2e7)
      .show_default();
  line.seconds("--history-s", options.history_s, "Length of a history")
      .in_range(600.0, 864'000.0)
      .show_default();
  line.path(
      "--library", options.library,
      "Library that --out starts from and that a curve's material is of; default: the shipped "
      "one");
  line.output_file(
      "--out", options.out,
      "Library to write: that of --library with the fitted modes of its own materials");
  line.output_file(
      "--toml", options.toml,
      "Tables [[material]] with the fitted modes, to paste into a scenario or library; "
      "-: standard output");
  add_json(line, options.json);
  add_measured_fit_options(line, options.measured);
}

}  // namespace

void add_fit(CommandLine& tool) {
  tool.command<FitOptions>(kFitText, add_options, run);
}

}  // namespace emit::tool
