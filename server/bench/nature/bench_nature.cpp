// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>

#include "bench/nature/nature_benches.hpp"
#include "bench/nature/nature_study.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

struct NatureOptions {
  std::vector<std::string> days;
  LoggerOptions record;
  GroundOptions ground;
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> plot;
};

/// Bars of the RMS over a day.
constexpr double kLibraryBarK = 1.5;
constexpr double kFittedBarK = 1.0;

/// Files as they are, and the CSV files of folders by name.
Result<std::vector<std::filesystem::path>> files_of(const std::vector<std::string>& days) {
  std::vector<std::filesystem::path> files;
  for (const std::string& day : days) {
    if (!std::filesystem::is_directory(day)) {
      files.emplace_back(day);
      continue;
    }
    std::vector<std::filesystem::path> inside;
    for (const auto& entry : std::filesystem::directory_iterator(day)) {
      if (entry.is_regular_file() && entry.path().extension() == ".csv") {
        inside.push_back(entry.path());
      }
    }
    std::ranges::sort(inside);
    if (inside.empty()) {
      return make_error(ErrorCode::not_found, fmt::format("{}: there is no .csv file in it", day));
    }
    files.insert(files.end(), inside.begin(), inside.end());
  }
  return files;
}

Json numbers_json(const reference::PlateNumbers& numbers) {
  return Json::object()
      .set("absorptance_frac", numbers.absorptance_frac)
      .set("emissivity_frac", numbers.emissivity_frac)
      .set("inertia_factor", numbers.inertia_factor)
      .set("film_factor", numbers.film_factor)
      .set("base_k", numbers.base_k);
}

/// Beginning of a result: one case of a day. The keys `site`, `fitted`, `rms_k`, `bias_k`, `max_k`
/// and `hours` are the contract of the suite.
Json begin_case(const NatureDay& day, const char* name, Json fitted, const Difference& difference) {
  const LoggerRecord& record = day.record;
  Json out = Json::object();
  out.set("site", record.file.stem().string()).set("day", record.file.filename().string());
  out.set("case", name).set("fitted", std::move(fitted));
  out.set("hours", (record.rows.back().time_s - record.rows.front().time_s) / 3600.0);
  add_difference(out, difference);
  return out;
}

Json case_json(Json out, const NatureCase& result, double bar_k, bool is_fitted) {
  out.set("bar_rms_k", bar_k).set("within_bar", result.difference.rms_k <= bar_k);
  out.set("measured_in_band_frac", result.within_frac);
  out.set("numbers", numbers_json(result.numbers));
  Json effects = Json::array();
  for (const InputEffect& effect : result.effects) {
    Json json = Json::object();
    json.set("input", effect.input).set("range", effect.range).set("source", effect.source);
    json.set("rms_k", effect.rms_k).set("max_k", effect.max_k);
    if (is_fitted) {
      json.set("low_numbers", numbers_json(effect.low_numbers));
      json.set("high_numbers", numbers_json(effect.high_numbers));
    }
    effects.push(std::move(json));
  }
  return out.set("inputs", std::move(effects));
}

/// Adds the cases of a day to the results. What belongs to the day stands in its first case.
void add_day(const NatureDay& day, Json& results) {
  Json out = begin_case(day, "nothing_fitted", Json::array(), day.library.difference);
  out.set("rows", day.record.rows.size()).set("material", day.ground.material.name);
  Json signs = Json::array();
  for (const GroundSign& sign : day.signs) {
    signs.push(Json::object()
                   .set("kind", sign.kind)
                   .set("text", sign.text)
                   .set("breaks_model", sign.breaks_model));
  }
  // A fit that went wrong says nothing about the layers of the library.
  const bool holds = std::ranges::none_of(
      day.signs, [](const GroundSign& sign) { return sign.breaks_model && sign.kind != "fit"; });
  out.set("dry_layers_hold", holds).set("signs", std::move(signs));
  Json origins = Json::array();
  for (const std::string& origin : day.ground.origins) origins.push(origin);
  Json notes = Json::array();
  for (const std::string& note : day.record.notes) notes.push(note);
  out.set("origins", std::move(origins)).set("notes", std::move(notes));
  out.set("day_heat", Json::object()
                          .set("hours", day.heat.hours)
                          .set("net_radiation_w_m2", day.heat.net_radiation_w_m2)
                          .set("to_air_w_m2", day.heat.to_air_w_m2)
                          .set("to_ground_w_m2", day.heat.to_ground_w_m2)
                          .set("missing_w_m2", day.heat.missing_w_m2));
  results.push(case_json(std::move(out), day.library, kLibraryBarK, false));
  results.push(begin_case(day, "nothing_fitted_real_time", Json::array(), day.real_time));
  Json names = Json::array();
  Json estimates = Json::array();
  for (const reference::PlateEstimate& estimate : day.fit.estimates) {
    names.push(reference::name_of(estimate.number));
    estimates.push(Json::object()
                       .set("number", reference::name_of(estimate.number))
                       .set("value", estimate.value)
                       .set("low", estimate.low)
                       .set("high", estimate.high));
  }
  Json fitted = begin_case(day, "two_fitted", std::move(names), day.fitted.difference);
  fitted.set("estimates", std::move(estimates));
  results.push(case_json(std::move(fitted), day.fitted, kFittedBarK, true));
}

void print_day(std::FILE* out, const NatureDay& day) {
  fmt::print(out, "\n{}\n", day.record.file.filename().string());
  for (const std::string& note : day.record.notes) fmt::print(out, "  {}\n", note);
  for (const std::string& origin : day.ground.origins) fmt::print(out, "  {}\n", origin);
  TextTable table({"", "rms K", "bar K", "bias K", "max K", "measured in band"});
  for (const auto& [name, result, bar_k] :
       {std::tuple{"nothing fitted", &day.library, kLibraryBarK},
        std::tuple{"inertia and base fitted", &day.fitted, kFittedBarK}}) {
    const Difference& d = result->difference;
    table.add({name, fmt::format("{:.2f}", d.rms_k),
               fmt::format("{:g} {}", bar_k, d.rms_k <= bar_k ? "held" : "MISSED"),
               fmt::format("{:+.2f}", d.bias_k), fmt::format("{:.2f}", d.max_k),
               fmt::format("{:.0f} %", 100.0 * result->within_frac)});
  }
  table.add({"nothing fitted, real-time model", fmt::format("{:.2f}", day.real_time.rms_k), "",
             fmt::format("{:+.2f}", day.real_time.bias_k),
             fmt::format("{:.2f}", day.real_time.max_k), ""});
  fmt::print(out, "{}", table.to_string());
  std::string hours;
  for (const double max_k : day.library.difference.max_by_hour_k) {
    hours += fmt::format(" {:.1f}", max_k);
  }
  fmt::print(out, "max by hour, nothing fitted:{}\n", hours);
  hours.clear();
  for (const double max_k : day.fitted.difference.max_by_hour_k) {
    hours += fmt::format(" {:.1f}", max_k);
  }
  fmt::print(out, "max by hour, two fitted:    {}\n", hours);
  for (const reference::PlateEstimate& estimate : day.fit.estimates) {
    fmt::print(out, "fitted {} {:.3g}, 99 % interval {:.3g} to {:.3g}\n",
               reference::name_of(estimate.number), estimate.value, estimate.low, estimate.high);
  }
  TextTable effects({"input", "range", "rms K, nothing fitted", "rms K, refitted"});
  for (const InputEffect& effect : day.library.effects) {
    const auto refitted = std::ranges::find(day.fitted.effects, effect.input, &InputEffect::input);
    effects.add(
        {effect.input, effect.range, fmt::format("{:.2f}", effect.rms_k),
         refitted == day.fitted.effects.end() ? "" : fmt::format("{:.2f}", refitted->rms_k)});
  }
  fmt::print(out, "{}", effects.to_string());
  if (day.heat.hours > 0.0) {
    fmt::print(
        out,
        "by day over {:.1f} h: net radiation {:.0f} W/m2, to the air {:.0f}, into dry layers "
        "{:.0f}, missing {:.0f}\n",
        day.heat.hours, day.heat.net_radiation_w_m2, day.heat.to_air_w_m2, day.heat.to_ground_w_m2,
        day.heat.missing_w_m2);
  }
  for (const GroundSign& sign : day.signs) {
    fmt::print(out, "{}: {}\n", sign.breaks_model ? "DOES NOT HOLD" : "less certain", sign.text);
  }
}

Plot day_plot(const NatureDay& day, const NatureCase& result, const std::string& name) {
  const LoggerRecord& record = day.record;
  Plot plot = record_plot(fmt::format("{}, {}: {:.2f} K RMS", record.file.stem().string(), name,
                                      result.difference.rms_k),
                          "surface, K");
  PlotSeries band = record_series("band of the inputs", record, result.high_k);
  PlotSeries low = record_series("", record, result.low_k);
  band.points.insert(band.points.end(), low.points.rbegin(), low.points.rend());
  band.area = true;
  std::vector<double> measured_k;
  for (const reference::LoggerRow& row : record.rows) measured_k.push_back(row.surface_k);
  PlotSeries measured = record_series("measured", record, measured_k);
  measured.emphasis = true;
  plot.series = {std::move(band), std::move(measured),
                 record_series("model", record, result.model_k)};
  return plot;
}

int run(const NatureOptions& options) {
  const auto files = files_of(options.days);
  if (!files) return fail(files.error());
  Progress progress("bench nature", files->size() * study_runs());
  std::uint64_t done = 0;
  std::vector<NatureDay> days;
  for (const std::filesystem::path& file : *files) {
    auto day =
        study_day(file, options.record, options.ground, [&] { progress.advance_to(++done); });
    if (!day) {
      progress.finish();
      return fail_call(day.error());
    }
    days.push_back(std::move(*day));
  }
  progress.finish();
  std::FILE* text = text_stream(options.json);
  fmt::print(text, "commit {}\n", kCommit);
  Json results = Json::array();
  std::vector<Plot> plots;
  for (const NatureDay& day : days) {
    print_day(text, day);
    add_day(day, results);
    plots.push_back(day_plot(day, day.library, "nothing fitted"));
    plots.push_back(day_plot(day, day.fitted, "two numbers fitted"));
  }
  if (options.plot) {
    if (auto written = write_svg(*options.plot, plots); !written) return fail(written.error());
  }
  if (!options.json) return kExitOk;
  Json json = Json::object();
  json.set("device", "cpu").set("commit", kCommit).set("suite", "nature");
  json.set("results", std::move(results));
  if (auto written = write_json(*options.json, json); !written) return fail(written.error());
  return kExitOk;
}

void add_options(CommandLine& line, NatureOptions& options) {
  line.option("days", options.days,
              "Records of loggers, one a day, or folders of them: CSV with the columns of emit fit "
              "--measured")
      .required()
      .type_name("FILE|FOLDER");
  line.option("--material", options.ground.material, "Ground: material of the library")
      .type_name("NAME")
      .show_default();
  line.path("--library", options.ground.library, "Material library; default: the shipped one");
  add_logger_options(line, options.record);
  add_ground_options(line, options.ground);
  line.output_file("--plot", options.plot,
                   "Model over measurement with the band of the inputs, as SVG");
  add_json(line, options.json);
}

}  // namespace

void add_bench_nature(CommandLine& bench) {
  bench.command<NatureOptions>(
      {.name = "nature",
       .text = "Level ground under measured weather against its measured surface",
       .example = "emit bench nature days/ --json nature.json --plot nature.svg"},
      add_options, run);
}

}  // namespace emit::tool
