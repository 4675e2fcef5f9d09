// SPDX-License-Identifier: Apache-2.0
#include "tool/nature/weather_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <limits>
#include <optional>
#include <string_view>
#include <vector>

#include "emit/config/load.hpp"
#include "emit/config/weather_planes.hpp"
#include "emit/config/weather_report.hpp"
#include "emit/physics/csv.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

using config::WeatherReport;

struct WeatherOptions {
  std::filesystem::path file;
  std::string scenario;
  std::optional<std::filesystem::path> plot;
  std::optional<std::filesystem::path> json;
  std::vector<config::WeatherPlane> planes;
  std::optional<std::filesystem::path> planes_csv;
  double every_s = 900.0;
};

constexpr const char* kMonths[] = {"Jan", "Feb", "Mar", "Apr", "May", "Jun",
                                   "Jul", "Aug", "Sep", "Oct", "Nov", "Dec"};
constexpr double kZeroCelsiusK = 273.15;

const char* format_name(WeatherReport::Format format) {
  switch (format) {
    case WeatherReport::Format::epw:
      return "EPW";
    case WeatherReport::Format::tmy3:
      return "TMY3";
    case WeatherReport::Format::csv:
      break;
  }
  return "CSV";
}

/// Returns the years as text: one, or the first and the last of several.
std::string years_text(const std::vector<int>& years) {
  if (years.empty()) return "none";
  if (years.size() == 1) return std::to_string(years.front());
  return fmt::format("{} to {}, {} of them", years.front(), years.back(), years.size());
}

void print_report(std::FILE* out, const WeatherReport& report) {
  fmt::print(out, "format    {}, {} records, usually one every {:g} s\n",
             format_name(report.format), report.records, report.spacing_s);
  if (report.lat_deg) {
    fmt::print(out, "place     {} ({:.3f}, {:.3f}), {:.0f} m, UTC{:+g} h\n", report.site,
               *report.lat_deg, *report.lon_deg, report.height_m, report.zone_h);
    fmt::print(out, "years     {}\n", years_text(report.years));
  }
  fmt::print(out, "from      {}\nto        {}\n\n", report.first, report.last);
  fmt::print(out, "{:<20}{:>8}{:>10}{:>10}{:>10}{:>10}\n", "column", "unit", "least", "mean",
             "most", "missing");
  for (const config::WeatherColumn& column : report.columns) {
    fmt::print(out, "{:<20}{:>8}{:>10.2f}{:>10.2f}{:>10.2f}{:>10}\n", column.name, column.unit,
               column.least, column.mean, column.most, column.missing);
  }
  if (!report.months.empty()) {
    fmt::print(out, "\n{:<8}{:>8}{:>10}{:>16}{:>18}{:>16}\n", "month", "air C", "wind m/s",
               "beam kWh/m2/d", "diffuse kWh/m2/d", "long-wave W/m2");
  }
  for (const config::WeatherMonth& month : report.months) {
    fmt::print(out, "{:<8}{:>8.1f}{:>10.1f}{:>16.2f}{:>18.2f}{:>16.0f}\n", kMonths[month.month - 1],
               month.air_k - kZeroCelsiusK, month.wind_m_s, month.beam_kwh_m2_day,
               month.diffuse_kwh_m2_day, month.longwave_w_m2);
  }
  fmt::print(out, "\n");
  constexpr std::size_t kMostGaps = 10;
  for (std::size_t i = 0; i < std::min(report.gaps.size(), kMostGaps); ++i) {
    fmt::print(out, "gap       from {} to {}\n", report.gaps[i].from, report.gaps[i].to);
  }
  if (report.gaps.size() > kMostGaps) {
    fmt::print(out, "gap       and {} more\n", report.gaps.size() - kMostGaps);
  }
  if (report.has_sun) {
    fmt::print(out, "{:<12}{:>9}{:>15}{:>13}{:>17}\n", "sun's height", "records", "median W/m2",
               "most W/m2", "clear sky W/m2");
  }
  for (const config::WeatherSunBin& bin : report.sun_bins) {
    fmt::print(out, "{:<12}{:>9}{:>15.0f}{:>13.0f}{:>17.0f}\n",
               fmt::format("{:g}-{:g} deg", bin.from_deg, bin.from_deg + 5.0), bin.records,
               bin.median_w_m2, bin.most_w_m2, bin.clear_w_m2);
  }
  if (report.has_sun) fmt::print(out, "\n");
  if (report.beam_below_horizon > 0) {
    fmt::print(out,
               "sun       {} records have direct sun, {:.2f} kWh/m2 in all, while it is below the "
               "horizon; a simulation leaves that out\n",
               report.beam_below_horizon, report.beam_below_horizon_kwh_m2);
  }
  for (const std::string& note : report.notes) fmt::print(out, "note      {}\n", note);
}

Json json_of(const WeatherReport& report) {
  Json out = Json::object();
  out.set("format", format_name(report.format)).set("records", report.records);
  out.set("spacing_s", report.spacing_s).set("first", report.first).set("last", report.last);
  if (report.lat_deg) {
    out.set("site", report.site).set("lat_deg", *report.lat_deg).set("lon_deg", *report.lon_deg);
    out.set("height_m", report.height_m).set("zone_h", report.zone_h);
  }
  Json years = Json::array();
  for (const int year : report.years) years.push(year);
  Json columns = Json::array();
  for (const config::WeatherColumn& column : report.columns) {
    columns.push(Json::object()
                     .set("name", column.name)
                     .set("unit", column.unit)
                     .set("least", column.least)
                     .set("mean", column.mean)
                     .set("most", column.most)
                     .set("missing", column.missing));
  }
  Json months = Json::array();
  for (const config::WeatherMonth& month : report.months) {
    months.push(Json::object()
                    .set("month", month.month)
                    .set("air_k", month.air_k)
                    .set("wind_m_s", month.wind_m_s)
                    .set("beam_kwh_m2_day", month.beam_kwh_m2_day)
                    .set("diffuse_kwh_m2_day", month.diffuse_kwh_m2_day)
                    .set("longwave_w_m2", month.longwave_w_m2));
  }
  Json heights = Json::array();
  for (const config::WeatherSunBin& bin : report.sun_bins) {
    heights.push(Json::object()
                     .set("from_deg", bin.from_deg)
                     .set("records", bin.records)
                     .set("median_w_m2", bin.median_w_m2)
                     .set("most_w_m2", bin.most_w_m2)
                     .set("clear_w_m2", bin.clear_w_m2));
  }
  out.set("beam_by_height", std::move(heights));
  Json gaps = Json::array();
  for (const config::WeatherGap& gap : report.gaps) {
    gaps.push(Json::object().set("from", gap.from).set("to", gap.to));
  }
  Json notes = Json::array();
  for (const std::string& note : report.notes) notes.push(note);
  out.set("years", std::move(years)).set("columns", std::move(columns));
  out.set("months", std::move(months)).set("gaps", std::move(gaps));
  if (report.has_sun) {
    out.set("beam_below_horizon_records", report.beam_below_horizon);
    out.set("beam_below_horizon_kwh_m2", report.beam_below_horizon_kwh_m2);
  } else {
    out.set("beam_below_horizon_records", nullptr).set("beam_below_horizon_kwh_m2", nullptr);
  }
  return out.set("notes", std::move(notes));
}

/// Returns the diagram of the direct sun over the height of the sun.
Plot height_plot(const WeatherReport& report) {
  Plot plot{.title = "direct sun over the height of the sun",
            .x = {.label = "height of the sun, deg"},
            .y = {.label = "direct normal, W/m2"},
            .series = {{.label = "very clear sky", .points = {}, .line = true, .markers = false},
                       {.label = "greatest", .points = {}, .line = true},
                       {.label = "median", .points = {}, .line = true, .emphasis = true}}};
  for (const config::WeatherSunBin& bin : report.sun_bins) {
    const double middle_deg = bin.from_deg + 2.5;
    plot.series[0].points.push_back({middle_deg, bin.clear_w_m2, {}});
    plot.series[1].points.push_back({middle_deg, bin.most_w_m2, {}});
    plot.series[2].points.push_back(
        {middle_deg, bin.median_w_m2, fmt::format("{} records", bin.records)});
  }
  return plot;
}

PlotSeries curve(std::string label, bool markers = false) {
  return {.label = std::move(label), .points = {}, .line = true, .markers = markers};
}

/// Returns diagrams by hour of the day for every third month, and by month.
std::vector<Plot> year_plots(const WeatherReport& report) {
  Plot beam{.title = "direct sun by hour",
            .x = {.label = "hour of the day, local standard time"},
            .y = {.label = "direct normal, W/m2"},
            .series = {}};
  Plot air{.title = "air by hour",
           .x = {.label = "hour of the day, local standard time"},
           .y = {.label = "air, C"},
           .series = {}};
  Plot year{.title = "sun by month",
            .x = {.label = "month"},
            .y = {.label = "kWh/m2 a day"},
            .series = {curve("direct normal", true), curve("diffuse horizontal", true)}};
  Plot means{.title = "air by month",
             .x = {.label = "month"},
             .y = {.label = "air, C"},
             .series = {curve("mean", true)}};
  for (const config::WeatherMonth& month : report.months) {
    const auto m = static_cast<double>(month.month);
    year.series[0].points.push_back({m, month.beam_kwh_m2_day, {}});
    year.series[1].points.push_back({m, month.diffuse_kwh_m2_day, {}});
    means.series[0].points.push_back({m, month.air_k - kZeroCelsiusK, {}});
    if (month.month % 3 != 0) continue;
    PlotSeries sun = curve(kMonths[month.month - 1]);
    PlotSeries warm = sun;
    for (std::size_t h = 0; h < 24; ++h) {
      const double hour = static_cast<double>(h) + 0.5;
      sun.points.push_back({hour, month.beam_w_m2[h], {}});
      warm.points.push_back({hour, month.hourly_air_k[h] - kZeroCelsiusK, {}});
    }
    beam.series.push_back(std::move(sun));
    air.series.push_back(std::move(warm));
  }
  return {beam, air, year, means};
}

/// Returns diagrams of a table over simulation time.
std::vector<Plot> table_plots(const WeatherReport& report) {
  Plot sun{
      .title = "radiation",
      .x = {.label = "simulation time, h"},
      .y = {.label = "W/m2"},
      .series = {curve("direct normal"), curve("diffuse horizontal"), curve("long-wave down")}};
  Plot air{.title = "air",
           .x = {.label = "simulation time, h"},
           .y = {.label = "air, C; wind, m/s"},
           .series = {curve("air"), curve("wind")}};
  for (const config::WeatherRow& row : report.rows) {
    const double hour = row.time_s / 3600.0;
    sun.series[0].points.push_back({hour, row.direct_normal_w_m2, {}});
    sun.series[1].points.push_back({hour, row.diffuse_horizontal_w_m2, {}});
    sun.series[2].points.push_back({hour, row.longwave_down_w_m2, {}});
    air.series[0].points.push_back({hour, row.air_k - kZeroCelsiusK, {}});
    air.series[1].points.push_back({hour, row.wind_m_s, {}});
  }
  return {sun, air};
}

std::vector<Plot> plots_of(const WeatherReport& report) {
  std::vector<Plot> plots = report.months.empty() ? table_plots(report) : year_plots(report);
  if (!report.sun_bins.empty()) plots.push_back(height_plot(report));
  return plots;
}

/// Reads the planes of --planes.
physics::Result<void> parse_planes(const std::string& text,
                                   std::vector<config::WeatherPlane>& out) {
  out.clear();
  std::string_view rest = text;
  while (!rest.empty()) {
    const std::string_view item = rest.substr(0, rest.find(','));
    rest.remove_prefix(std::min(rest.size(), item.size() + 1));
    const std::size_t colon = item.find(':');
    const auto number = [](std::string_view cell) {
      return physics::csv_number(cell).value_or(std::numeric_limits<double>::quiet_NaN());
    };
    const double azimuth_deg = number(item.substr(0, colon));
    const double tilt_deg = number(colon == std::string_view::npos ? "" : item.substr(colon + 1));
    // Numbers that are not finite fail the comparisons.
    if (!(azimuth_deg >= 0.0 && azimuth_deg <= 360.0) || !(tilt_deg >= 0.0 && tilt_deg <= 180.0)) {
      return physics::make_error(
          physics::ErrorCode::invalid_argument,
          fmt::format("'{}' is not AZIMUTH:TILT, 0 to 360 and 0 to 180 degrees", item));
    }
    out.push_back({azimuth_deg, tilt_deg});
  }
  if (!out.empty()) return {};
  return physics::make_error(physics::ErrorCode::invalid_argument, "names no plane");
}

std::string planes_csv_text(const WeatherOptions& options, const config::PlaneCourse& course) {
  std::string out =
      "time_s,sun_azimuth_deg,sun_elevation_deg,dni_w_m2,dhi_w_m2,longwave_down_w_m2,"
      "air_k,wind_m_s,rain_mm_h";
  for (const config::WeatherPlane& plane : options.planes) {
    const std::string name = fmt::format("{:g}_{:g}_w_m2", plane.azimuth_deg, plane.tilt_deg);
    out += fmt::format(",beam_{},sky_{}", name, name);
  }
  out += '\n';
  for (const config::PlaneInstant& row : course.instants) {
    out += fmt::format("{},{:.5f},{:.5f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}", row.time_s,
                       row.sun_azimuth_deg, row.sun_elevation_deg, row.direct_normal_w_m2,
                       row.diffuse_horizontal_w_m2, row.longwave_down_w_m2, row.air_k, row.wind_m_s,
                       row.rain_mm_h);
    for (const config::PlaneIrradiance& plane : row.planes) {
      fmt::format_to(std::back_inserter(out), ",{:.4f},{:.4f}", plane.beam_w_m2, plane.sky_w_m2);
    }
    out += '\n';
  }
  return out;
}

void print_planes(std::FILE* out, const WeatherOptions& options,
                  const config::PlaneCourse& course) {
  fmt::print(out, "{:<22}{:>12}{:>12}\n", "plane: azimuth, tilt", "beam kWh/m2", "sky kWh/m2");
  for (std::size_t p = 0; p < options.planes.size(); ++p) {
    fmt::print(
        out, "{:<22}{:>12.1f}{:>12.1f}\n",
        fmt::format("{:g}, {:g} deg", options.planes[p].azimuth_deg, options.planes[p].tilt_deg),
        course.sums[p].beam_kwh_m2, course.sums[p].sky_kwh_m2);
  }
  fmt::print(out, "\n");
}

/// Writes what falls on the planes.
int run_planes(const WeatherOptions& options) {
  std::optional<config::WeatherOrigin> origin;
  if (!options.scenario.empty()) {
    const auto scenario = load_scenario_choice({.scenario = options.scenario, .set = {}});
    if (!scenario) return fail_config(scenario.error());
    origin = config::WeatherOrigin{scenario->place, scenario->epoch_utc_ns};
  }
  const auto course =
      config::weather_on_planes(options.file, origin, options.planes, options.every_s);
  if (!course) return fail_call(course.error());
  for (const std::string& warning : course->warnings) warn(warning);
  print_planes(text_stream(options.planes_csv), options, *course);
  if (!options.planes_csv) return kExitOk;
  const std::string text = planes_csv_text(options, *course);
  if (*options.planes_csv == "-") {
    return std::fwrite(text.data(), 1, text.size(), stdout) == text.size()
               ? kExitOk
               : fail(kExitFailure, "standard output: write failed");
  }
  std::ofstream file(*options.planes_csv, std::ios::binary);
  file << text;
  file.close();
  return file ? kExitOk : fail(kExitFailure, options.planes_csv->string() + ": write failed");
}

/// Reads the file. A scenario gives a table its place and epoch, and adds what it says about the
/// file: its span, gaps, place and years.
physics::Result<WeatherReport> read_report(const WeatherOptions& options) {
  if (options.scenario.empty()) return config::report_weather(options.file);
  const auto file = std::filesystem::absolute(options.file).string();
  const auto scenario = load_scenario_choice(
      {.scenario = options.scenario, .set = {fmt::format("weather.file={}", file)}});
  if (!scenario) return tl::unexpected<physics::Error>(scenario.error());
  auto report = config::report_weather(
      options.file, config::WeatherOrigin{scenario->place, scenario->epoch_utc_ns});
  if (!report) return report;
  for (const std::string& warning : scenario->warnings) {
    const bool is_known = std::ranges::find(report->notes, warning) != report->notes.end();
    if (!is_known && warning.find(options.file.filename().string()) != std::string::npos) {
      report->notes.push_back(warning);
    }
  }
  return report;
}

int run(const WeatherOptions& options) {
  if (!options.planes.empty()) return run_planes(options);
  const auto report = read_report(options);
  if (!report) return fail(report.error());
  print_report(text_stream(options.json), *report);
  if (!report->has_sun) {
    fmt::print(text_stream(options.json),
               "note      a table has no place: with --scenario the direct sun is held against the "
               "height of the sun\n");
  }
  if (options.plot) {
    if (auto written = write_svg(*options.plot, plots_of(*report)); !written) {
      return fail(written.error());
    }
  }
  if (options.json) {
    if (auto written = write_json(*options.json, json_of(*report)); !written) {
      return fail(written.error());
    }
  }
  return kExitOk;
}

void add_options(CommandLine& line, WeatherOptions& options) {
  line.path("file", options.file, "Weather file: CSV table, EPW or TMY3").required();
  line.option(
          "--scenario", options.scenario,
          "Scenario that takes the file: gives a CSV table its place and epoch, and adds what the "
          "scenario says about span, gaps, place and years")
      .type_name("SCENARIO");
  const Option plot = line.output_file("--plot", options.plot, "Diagrams: SVG file");
  const Option json = add_json(line, options.json);
  Option planes =
      line.parsed(
              "--planes",
              [&options](const std::string& text) { return parse_planes(text, options.planes); },
              "Instead of the report: sun and sky light on planes over the file's year, with the "
              "sun of a simulation. Azimuth of the normal clockwise from north, tilt from level, "
              "as 180:90,270:30. The ground reflects nothing, the sky is the same all over")
          .type_name("AZIMUTH:TILT,...");
  planes.excludes(plot);
  planes.excludes(json);
  line.output_file("--planes-csv", options.planes_csv,
                   "Instants of --planes: CSV file, in seconds of local standard time since 1 "
                   "January, of a table in simulation time")
      .needs(planes);
  line.option("--every", options.every_s, "Seconds between the instants of --planes")
      .in_range(1.0, 3600.0)
      .show_default()
      .needs(planes);
}

}  // namespace

void add_weather(CommandLine& tool) {
  tool.command<WeatherOptions>(
      {.name = "weather",
       .text = "Show what a weather file holds, lacks and would be used as",
       .example = "emit weather munich.epw --plot munich.svg"},
      add_options, run);
}

}  // namespace emit::tool
