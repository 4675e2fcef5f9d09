// SPDX-License-Identifier: Apache-2.0
#include "emit/reference/fit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "emit/config/load.hpp"
#include "emit/physics/csv.hpp"
#include "emit/physics/nearest_name.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/lab/lab.hpp"
#include "tool/support/console.hpp"
#include "tool/support/json.hpp"
#include "tool/support/library_edit.hpp"
#include "tool/support/progress.hpp"
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
  std::optional<std::filesystem::path> json;
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

/// What a curve's material is looked up in: the shipped library.
Result<scene::ScenarioDesc> library_scenario(const std::vector<std::string>& set) {
  auto file = config::resolve_scenario("block-on-road");
  if (!file) return tl::unexpected(std::move(file.error()));
  config::LoadOptions options;
  options.require_scene_files = false;
  return config::load_scenario(*file, set, options);
}

int run(const FitOptions& command) {
  reference::FitOptions options;
  options.model =
      command.model == "emit2014" ? reference::FitModel::emit2014 : reference::FitModel::foster;
  const bool foster = options.model == reference::FitModel::foster;
  options.modes = command.modes.value_or(foster ? 4U : 2U);
  if (!foster && options.modes > 2) return fail(kExitUsage, "emit2014 has at most 2 modes");

  const bool curve_input = is_curve(command.input.scenario);
  if (curve_input && command.materials.size() != 1) {
    return fail(kExitUsage, "a curve belongs to one material: name it with --material");
  }
  auto scenario =
      curve_input ? library_scenario(command.input.set) : load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  for (const std::string& text : scenario->warnings) warn(text);

  std::vector<const scene::Material*> materials;
  for (const std::string& name : command.materials) {
    const auto found = std::find_if(scenario->materials.begin(), scenario->materials.end(),
                                    [&](const scene::Material& m) { return m.name == name; });
    if (found == scenario->materials.end()) {
      std::vector<std::string> known;
      for (const scene::Material& m : scenario->materials) known.push_back(m.name);
      return fail(kExitUsage, fmt::format("there is no material '{}'{}", name,
                                          physics::did_you_mean(name, known)));
    }
    materials.push_back(&*found);
  }
  if (command.materials.empty()) {
    for (const scene::Material& material : scenario->materials) {
      if (!material.prescribed_k) materials.push_back(&material);
    }
  }

  std::vector<reference::CurvePoint> curve;
  std::vector<reference::GroundForcing> forcing;
  const double start_s = static_cast<double>(scenario->thermal.history_start_ns) * 1e-9;
  options.history_s = command.history_s;
  options.spin_up_s = command.spin_up_s;
  if (curve_input) {
    auto read = read_curve(command.input.scenario);
    if (!read) return fail_call(read.error());
    curve = std::move(*read);
  } else {
    constexpr double kForcingStepS = 60.0;
    forcing = reference::ground_forcing(*scenario, start_s - options.spin_up_s,
                                        start_s + options.history_s, kForcingStepS);
  }

  TextTable table({"material", "rms K", "max K", "derived rms K", "max K", "modes"});
  Json results = Json::array();
  std::vector<LibraryEntry> entries;
  Progress bar("fitting", materials.size());
  for (std::size_t i = 0; i < materials.size(); ++i) {
    const scene::Material& material = *materials[i];
    const auto fit = curve_input ? reference::fit_curve(material, curve, options)
                                 : reference::fit_material(material, forcing, start_s,
                                                           scenario->thermal.initial_k, options);
    if (!fit) {
      bar.finish();
      return fail_call(fit.error());
    }
    bar.advance_to(i + 1);
    table.add({material.name + (material.dry_layers_valid ? "" : " (dry layers not valid)"),
               fmt::format("{:.3f}", fit->rms_k), fmt::format("{:.3f}", fit->max_k),
               foster ? fmt::format("{:.3f}", fit->derived_rms_k) : "-",
               foster ? fmt::format("{:.3f}", fit->derived_max_k) : "-", modes_text(*fit)});
    results.push(json_of(*fit, material, options.model));
    entries.push_back({*fit, foster});
  }
  bar.finish();
  std::FILE* text = text_stream(command.json);
  fmt::print(text, "{}", table.to_string());
  if (!curve_input) {
    fmt::print(text,
               "worst of five histories of {:.0f} s from {:.0f} s on, after {:.0f} s of "
               "spin-up; reference within {:.0e} K a step\n",
               options.history_s, start_s, options.spin_up_s, options.reference_tolerance_k);
  }
  if (command.out) {
    if (auto ok = write_library(command.library, entries, *command.out); !ok) {
      return fail(ok.error());
    }
  }
  if (command.json) {
    Json json = Json::object();
    json.set("scenario", command.input.scenario).set("results", std::move(results));
    if (auto ok = write_json(*command.json, json); !ok) return fail(ok.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, FitOptions& options) {
  line.option("input", options.input.scenario,
              "Scenario: its place, date, weather and materials, over five histories of sun and "
              "shade. Or a curve, CSV with time_s, absorbed_w_m2, film_w_m2_k, air_k, "
              "temperature_k")
      .required()
      .type_name("SCENARIO|CURVE.csv");
  add_set(line, options.input.set);
  line.option("--material", options.materials, "Material; repeatable; default: all of the scenario")
      .repeatable()
      .type_name("NAME");
  line.option("--modes", options.modes, "foster: 2 to 4, default 4; emit2014: 1 or 2, default 2")
      .type_name("N")
      .in_range(1, 4);
  line.option("--model", options.model, "Model whose modes are fitted")
      .one_of({"foster", "emit2014"})
      .show_default();
  line.seconds("--spin-up-s", options.spin_up_s, "Unshadowed time before the histories")
      .in_range(0.0, 3.2e7)
      .show_default();
  line.seconds("--history-s", options.history_s, "Length of a history")
      .in_range(600.0, 864'000.0)
      .show_default();
  line.path("--library", options.library, "Library to start from; default: the shipped one");
  line.output_file("--out", options.out, "Library to write: the same with the fitted modes");
  add_json(line, options.json);
}

}  // namespace

void add_fit(CommandLine& tool) {
  tool.command<FitOptions>(kFitText, add_options, run);
}

}  // namespace emit::tool
