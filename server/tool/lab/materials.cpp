// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "emit/config/load.hpp"
#include "emit/physics/nearest_name.hpp"
#include "emit/scene/base.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/lab/fit_materials.hpp"
#include "tool/lab/lab.hpp"
#include "tool/lab/materials_report.hpp"
#include "tool/support/console.hpp"
#include "tool/support/progress.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

struct MaterialsOptions {
  std::vector<std::string> names;  ///< of materials or families; empty: all
  std::filesystem::path library;   ///< empty: the shipped one
  std::vector<std::string> climates;
  bool check = false;
  std::optional<std::filesystem::path> plot;
  std::optional<std::filesystem::path> json;
};

/// Shipped climates; the first is that of days and diagrams.
constexpr std::array<const char*, 5> kClimates{"temperate_summer", "temperate_winter", "hot_desert",
                                               "humid_tropics", "polar_overcast"};

/// Weather in which materials are held, and the materials with the bases that follow from it.
struct Climate {
  std::string name;
  scene::ScenarioDesc scenario;
};

/// Reads a shipped climate or a scenario, and gives it the materials of the library.
Result<Climate> read_climate(const std::string& name,
                             const std::vector<scene::Material>& materials) {
  auto file = config::find_data_file(fmt::format("climates/{}.toml", name));
  if (!file) file = config::resolve_scenario(name);
  if (!file) return tl::unexpected(std::move(file.error()));
  config::LoadOptions options;
  options.require_scene_files = false;
  auto scenario = config::load_scenario(*file, {}, options);
  if (!scenario) return tl::unexpected(std::move(scenario.error()));
  for (const std::string& text : scenario->warnings) warn(text);
  scenario->materials = materials;
  scene::resolve_bases(*scenario);
  return Climate{name, std::move(*scenario)};
}

/// Returns the simulated time of the first midnight after the epoch, local mean solar time.
double midnight_s(const scene::ScenarioDesc& scenario) {
  constexpr double kDayS = 86'400.0;
  constexpr double kTurnRad = 6.283185307179586;
  const double utc_s = std::fmod(static_cast<double>(scenario.epoch_utc_ns) * 1e-9, kDayS);
  const double local_s = utc_s + scenario.place.lon_rad / kTurnRad * kDayS;
  return kDayS - std::fmod(local_s + kDayS, kDayS);
}

/// Returns the materials that were named, each once, by material or by family.
Result<std::vector<MaterialEntry>> choose(const std::vector<scene::Material>& known,
                                          const std::vector<std::string>& names) {
  std::vector<MaterialEntry> chosen;
  std::vector<std::string> all;
  for (const scene::Material& material : known) {
    all.push_back(material.name);
    if (!material.family.empty()) all.push_back(material.family);
    if (names.empty()) chosen.push_back({material, {}, {}});
  }
  for (const std::string& name : names) {
    bool found = false;
    for (const scene::Material& material : known) {
      if (material.name != name && material.family != name) continue;
      found = true;
      const bool twice = std::ranges::any_of(
          chosen, [&](const MaterialEntry& entry) { return entry.material.name == material.name; });
      if (!twice) chosen.push_back({material, {}, {}});
    }
    if (!found) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("there is no material or family '{}'{}", name,
                                    physics::did_you_mean(name, all)));
    }
  }
  return chosen;
}

/// Returns the material of a climate that an entry stands for.
const scene::Material& in_climate(const Climate& climate, const MaterialEntry& entry) {
  return *std::ranges::find(climate.scenario.materials, entry.material.name,
                            &scene::Material::name);
}

constexpr double kForcingStepS = 60.0;

/// Computes the course of every material over a day of the climate.
Result<void> add_days(const Climate& climate, std::vector<MaterialEntry>& entries) {
  const reference::FitOptions options;
  const double end_s = midnight_s(climate.scenario);
  const auto forcing = reference::ground_forcing(climate.scenario, end_s - options.spin_up_s,
                                                 end_s + kForcingStepS, kForcingStepS);
  for (MaterialEntry& entry : entries) {
    if (entry.material.layers.empty() || entry.material.prescribed_k) continue;
    auto day = reference::day_course(in_climate(climate, entry), forcing, end_s,
                                     climate.scenario.thermal.initial_k, options);
    if (!day) return tl::unexpected(std::move(day.error()));
    entry.day = std::move(*day);
  }
  return {};
}

/// Judges every material in a climate, over the day before its history and over the five
/// histories.
Result<void> add_errors(const Climate& climate, std::vector<MaterialEntry>& entries) {
  const reference::FitOptions options;
  const double start_s = static_cast<double>(climate.scenario.thermal.history_start_ns) * 1e-9;
  const auto forcing = reference::ground_forcing(climate.scenario, start_s - options.spin_up_s,
                                                 start_s + options.history_s, kForcingStepS);
  for (MaterialEntry& entry : entries) {
    if (entry.material.layers.empty() || entry.material.prescribed_k) continue;
    const auto judged = reference::judge_material(in_climate(climate, entry), forcing, start_s,
                                                  climate.scenario.thermal.initial_k, options);
    if (!judged) return tl::unexpected(judged.error());
    ClimateError error{climate.name, 0.0, 0.0};
    for (const reference::FitResidual& residual : judged->residuals) {
      error.rms_k = std::max(error.rms_k, residual.rms_k);
      error.max_k = std::max(error.max_k, residual.max_k);
    }
    entry.errors.push_back(std::move(error));
  }
  return {};
}

/// Computes what the options ask for. Errors: those of the climates and of the solver.
Result<std::string> compute(const MaterialsOptions& options,
                            const std::vector<scene::Material>& known,
                            std::vector<MaterialEntry>& entries) {
  std::vector<std::string> names = options.climates;
  if (names.empty()) names.assign(kClimates.begin(), kClimates.end());
  const bool days = options.plot || !options.names.empty();
  if (!days && !options.check) return names.front();
  if (!options.check) names.resize(1);
  Progress bar("solving", names.size());
  for (std::size_t i = 0; i < names.size(); ++i) {
    const auto climate = read_climate(names[i], known);
    if (!climate) {
      bar.finish();
      return tl::unexpected(climate.error());
    }
    Result<void> done;
    if (days && i == 0) done = add_days(*climate, entries);
    if (done && options.check) done = add_errors(*climate, entries);
    if (!done) {
      bar.finish();
      return tl::unexpected(std::move(done.error()));
    }
    bar.advance_to(i + 1);
  }
  bar.finish();
  return names.front();
}

int run(const MaterialsOptions& options) {
  const auto library = fit_library(options.library);
  if (!library) return fail(library.error());
  const auto known = config::load_materials(*library);
  if (!known) return fail_config(known.error());
  auto entries = choose(*known, options.names);
  if (!entries) return fail_call(entries.error());
  const auto climate = compute(options, *known, *entries);
  if (!climate) {
    return climate.error().code == ErrorCode::config ? fail_config(climate.error())
                                                     : fail_call(climate.error());
  }

  std::FILE* text = text_stream(options.json);
  if (options.names.empty()) {
    if (!options.check) print_materials(text, *entries);
  } else {
    print_comparison(text, *entries);
    fmt::print(text, "day: level surface in sun, {}, one-dimensional reference\n", *climate);
  }
  const bool good = !options.check || print_climates(text, *entries);
  if (options.plot) {
    if (auto done = write_svg(*options.plot, material_plots(*entries, *climate)); !done) {
      return fail(done.error());
    }
  }
  if (options.json) {
    Json json = Json::object();
    json.set("library", library->string()).set("climate", *climate);
    json.set("materials", materials_json(*entries));
    if (auto done = write_json(*options.json, json); !done) return fail(done.error());
  }
  return good ? kExitOk : kExitFailure;
}

void add_options(CommandLine& line, MaterialsOptions& options) {
  line.option("name", options.names,
              "Material or family; several are compared; default: a list of all")
      .type_name("NAME");
  line.path("--library", options.library, "Library of materials; default: the shipped one");
  line.option("--climate", options.climates,
              "Climate: a shipped one, or a scenario for its place, date and weather; repeatable. "
              "The first gives the day that is shown and plotted; default: temperate_summer, and "
              "all five for --check")
      .repeatable()
      .suggest([] { return std::vector<std::string>(kClimates.begin(), kClimates.end()); })
      .may_be_file()
      .type_name("CLIMATE");
  line.flag("--check", options.check,
            "Judge the modes against the one-dimensional reference in every climate; exits 1 when "
            "one misses the bar");
  line.output_file("--plot", options.plot,
                   "Diagrams by family, temperatures over a day and emissivities: SVG file");
  add_json(line, options.json);
}

}  // namespace

void add_materials(CommandLine& tool) {
  tool.command<MaterialsOptions>(kMaterialsText, add_options, run);
}

}  // namespace emit::tool
