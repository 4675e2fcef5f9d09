// SPDX-License-Identifier: Apache-2.0
#include "tool/lab/fit_measured.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>

#include "emit/config/load.hpp"
#include "emit/reference/measured_plate.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/logger/ground_signs.hpp"
#include "tool/logger/logger_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/json.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

using physics::Result;
using reference::PlateEstimate;
using reference::PlateNumber;

constexpr PlateNumber kAllNumbers[] = {PlateNumber::absorptance, PlateNumber::inertia,
                                       PlateNumber::film, PlateNumber::base};

std::vector<PlateNumber> chosen_numbers(const std::vector<std::string>& names) {
  if (names.empty()) return {PlateNumber::inertia, PlateNumber::base};
  std::vector<PlateNumber> out;
  for (const PlateNumber number : kAllNumbers) {
    if (std::ranges::find(names, reference::name_of(number)) != names.end()) out.push_back(number);
  }
  return out;
}

/// All that the command found.
struct Outcome {
  LoggerRecord record;
  MeasuredGround ground;
  DayHeat heat;
  std::vector<GroundSign> signs;
  std::vector<double> before_k;  ///< model before the fit
  reference::PlateFit fit;
};

Result<Outcome> find_outcome(const MeasuredFitOptions& options) {
  Outcome out;
  auto record = read_logger(options.logger, options.record);
  if (!record) return tl::unexpected(std::move(record.error()));
  out.record = std::move(*record);
  auto ground = measured_ground(options.ground, out.record);
  if (!ground) return tl::unexpected(std::move(ground.error()));
  out.ground = std::move(*ground);
  const auto named = [&](const physics::Error& error) {
    return tl::unexpected(
        physics::Error{error.code, fmt::format("{}: {}", options.logger.string(), error.text)});
  };
  auto before_k = reference::plate_history_k(out.ground.setup, out.record.rows, out.ground.numbers);
  if (!before_k) return named(before_k.error());
  out.before_k = std::move(*before_k);
  auto fit = reference::fit_plate(out.ground.setup, out.record.rows, out.ground.numbers,
                                  chosen_numbers(options.numbers));
  if (!fit) return named(fit.error());
  out.fit = std::move(*fit);
  auto heat = day_heat(out.record, out.ground);
  if (!heat) return named(heat.error());
  out.heat = *heat;
  out.signs = ground_signs(out.record, out.ground, out.heat);
  std::ranges::move(fit_signs(out.record, out.ground, out.fit), std::back_inserter(out.signs));
  return out;
}

std::string toml_of(const Outcome& found) {
  std::string text =
      fmt::format("# Fitted to {}: {:.2f} K RMS, {:.2f} K at most.\n",
                  found.record.file.filename().string(), found.fit.rms_k, found.fit.max_k);
  for (const PlateEstimate& estimate : found.fit.estimates) {
    text += fmt::format("# {}: {:.4g}, 99 % interval {:.4g} to {:.4g}\n",
                        reference::name_of(estimate.number), estimate.value, estimate.low,
                        estimate.high);
  }
  const bool film_fitted = std::ranges::any_of(
      found.fit.estimates, [](const PlateEstimate& e) { return e.number == PlateNumber::film; });
  if (film_fitted) {
    text += "# A material has no factor of the film: state film_w_m2_k in the weather for it.\n";
  }
  for (const GroundSign& sign : found.signs) {
    text +=
        fmt::format("# {}: {}\n", sign.breaks_model ? "Does not hold" : "Less certain", sign.text);
  }
  return text + config::print_material(with_numbers(found.ground.material, found.fit.numbers));
}

Json outcome_json(const Outcome& found) {
  Json out = Json::object();
  out.set("logger", found.record.file.string()).set("material", found.ground.material.name);
  out.set("rows", found.record.rows.size());
  for (const auto& [name, model_k] :
       {std::pair{"before", &found.before_k}, std::pair{"after", &found.fit.model_k}}) {
    Json json = Json::object();
    add_difference(json, difference_of(found.record, *model_k));
    out.set(name, std::move(json));
  }
  out.set("converged", found.fit.converged).set("iterations", std::uint64_t{found.fit.iterations});
  out.set("independent_rows", found.fit.independent_rows);
  out.set("confidence", "99 %, of all numbers together");
  Json numbers = Json::array();
  for (const PlateEstimate& estimate : found.fit.estimates) {
    numbers.push(Json::object()
                     .set("number", reference::name_of(estimate.number))
                     .set("value", estimate.value)
                     .set("standard_error", estimate.standard_error)
                     .set("low", estimate.low)
                     .set("high", estimate.high));
  }
  out.set("numbers", std::move(numbers));
  out.set("absorptance_frac", found.fit.numbers.absorptance_frac);
  out.set("emissivity_frac", found.fit.numbers.emissivity_frac);
  out.set("inertia_factor", found.fit.numbers.inertia_factor);
  out.set("film_factor", found.fit.numbers.film_factor);
  out.set("base_k", found.fit.numbers.base_k);
  Json signs = Json::array();
  for (const GroundSign& sign : found.signs) {
    signs.push(Json::object()
                   .set("kind", sign.kind)
                   .set("text", sign.text)
                   .set("breaks_model", sign.breaks_model));
  }
  out.set("signs", std::move(signs));
  Json origins = Json::array();
  for (const std::string& origin : found.ground.origins) origins.push(origin);
  out.set("origins", std::move(origins));
  Json notes = Json::array();
  for (const std::string& note : found.record.notes) notes.push(note);
  return out.set("notes", std::move(notes));
}

void print_outcome(std::FILE* out, const Outcome& found) {
  fmt::print(out, "{}: {} rows over {:.1f} h\n", found.record.file.filename().string(),
             found.record.rows.size(),
             (found.record.rows.back().time_s - found.record.rows.front().time_s) / 3600.0);
  for (const std::string& note : found.record.notes) fmt::print(out, "  {}\n", note);
  for (const std::string& origin : found.ground.origins) fmt::print(out, "  {}\n", origin);
  TextTable table({"number", "value", "standard error", "99 % from", "to"});
  for (const PlateEstimate& estimate : found.fit.estimates) {
    table.add({reference::name_of(estimate.number), fmt::format("{:.4g}", estimate.value),
               fmt::format("{:.2g}", estimate.standard_error), fmt::format("{:.4g}", estimate.low),
               fmt::format("{:.4g}", estimate.high)});
  }
  fmt::print(out, "\n{}", table.to_string());
  fmt::print(
      out,
      "interval of all numbers together; it counts noise and its correlation in time ({:.0f} "
      "independent rows), not errors of the model or of the other numbers\n\n",
      found.fit.independent_rows);
  TextTable errors({"", "rms K", "bias K", "max K"});
  for (const auto& [name, model_k] :
       {std::pair{"before the fit", &found.before_k}, std::pair{"after it", &found.fit.model_k}}) {
    const Difference d = difference_of(found.record, *model_k);
    errors.add({name, fmt::format("{:.2f}", d.rms_k), fmt::format("{:+.2f}", d.bias_k),
                fmt::format("{:.2f}", d.max_k)});
  }
  fmt::print(out, "{}", errors.to_string());
  if (!found.fit.converged) fmt::print(out, "the fit has not converged\n");
  for (const GroundSign& sign : found.signs) {
    fmt::print(out, "{}: {}\n", sign.breaks_model ? "DOES NOT HOLD" : "less certain", sign.text);
  }
}

std::vector<double> measured_k(const LoggerRecord& record) {
  std::vector<double> out;
  for (const reference::LoggerRow& row : record.rows) out.push_back(row.surface_k);
  return out;
}

std::vector<Plot> plots_of(const Outcome& found) {
  Plot surface = record_plot("surface, " + found.record.file.filename().string(), "surface, K");
  surface.series = {record_series("before the fit", found.record, found.before_k),
                    record_series("fitted", found.record, found.fit.model_k),
                    record_series("measured", found.record, measured_k(found.record))};
  surface.series.back().emphasis = true;
  Plot residual = record_plot("model less measurement", "K");
  for (const auto& [name, model_k] :
       {std::pair{"before the fit", &found.before_k}, std::pair{"fitted", &found.fit.model_k}}) {
    std::vector<double> error_k = *model_k;
    for (std::size_t i = 0; i < error_k.size(); ++i) error_k[i] -= found.record.rows[i].surface_k;
    residual.series.push_back(record_series(name, found.record, error_k));
  }
  return {surface, residual};
}

Result<void> write_text(const std::filesystem::path& path, const std::string& text) {
  auto file = ReplacingFile::create(path);
  if (!file) return tl::unexpected(std::move(file.error()));
  if (auto done = file->write(text); !done) return done;
  return file->commit();
}

std::string history_csv(const Outcome& found) {
  std::string text = "time_s,surface_k,before_k,fitted_k\n";
  for (std::size_t i = 0; i < found.record.rows.size(); ++i) {
    text += fmt::format("{},{:.4f},{:.4f},{:.4f}\n", found.record.rows[i].time_s,
                        found.record.rows[i].surface_k, found.before_k[i], found.fit.model_k[i]);
  }
  return text;
}

}  // namespace

int run_measured_fit(const MeasuredFitOptions& options) {
  const auto found = find_outcome(options);
  if (!found) return fail_call(found.error());
  print_outcome(options.toml == "-" ? stderr : text_stream(options.json), *found);
  if (options.toml) {
    if (auto done = write_text(*options.toml, toml_of(*found)); !done) return fail(done.error());
  }
  if (options.history) {
    if (auto done = write_text(*options.history, history_csv(*found)); !done) {
      return fail(done.error());
    }
  }
  if (options.plot) {
    if (auto done = write_svg(*options.plot, plots_of(*found)); !done) return fail(done.error());
  }
  if (!options.json) return kExitOk;
  if (auto done = write_json(*options.json, outcome_json(*found)); !done) return fail(done.error());
  return kExitOk;
}

void add_measured_fit_options(CommandLine& line, MeasuredFitOptions& options) {
  const Option measured = line.path(
      "--measured", options.logger,
      "Fit numbers of level ground to a logger's record instead, CSV with time_s, ghi_w_m2 "
      "(or dni_w_m2 and dhi_w_m2), longwave_down_w_m2, air_k or air_c, wind_m_s (or "
      "film_w_m2_k) and surface_k, surface_c or longwave_up_w_m2; optional: "
      "reflected_w_m2, rh_pct, latent_w_m2 (evaporation, which dry materials lose)");
  line.option("--number", options.numbers,
              "Number to fit with --measured: absorptance; inertia, a factor on conductivity and "
              "heat capacity of all layers; film, a factor; base, the temperature below the last "
              "layer. Repeatable; default: inertia and base")
      .repeatable()
      .one_of({"absorptance", "inertia", "film", "base"})
      .needs(measured);
  for (Option& option : add_logger_options(line, options.record)) option.needs(measured);
  for (Option& option : add_ground_options(line, options.ground)) option.needs(measured);
  line.output_file("--plot", options.plot, "With --measured: diagrams as SVG").needs(measured);
  line.output_file("--history", options.history,
                   "With --measured: CSV of measured surface, model before and after the fit")
      .needs(measured);
}

}  // namespace emit::tool
