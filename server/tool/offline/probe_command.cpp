// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/probe_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

#include "tool/command_line/common_options.hpp"
#include "tool/offline/probe_points.hpp"
#include "tool/offline/probe_run.hpp"
#include "tool/offline/time_list.hpp"
#include "tool/offline/time_options.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

using physics::Result;

struct ProbeOptions {
  ScenarioChoice input;
  std::vector<std::string> at;
  TimeChoice times;
  std::filesystem::path out = "-";
  std::optional<std::filesystem::path> plot;
  int gpu_index = -1;
};

/// A cell of a table: names with commas stand in quotes.
std::string cell(const std::string& text) {
  return text.find_first_of(",\"") == std::string::npos ? text : "\"" + text + "\"";
}

/// Table of all values, a row per time and point.
std::string table_of(const scene::ScenarioDesc& scenario, const ProbeRun& run,
                     const ProbeForcing& forcing) {
  const std::vector<ProbePoint>& points = run.points();
  std::string out =
      "time_s,utc,point,object,x_m,y_m,z_m,nx,ny,nz,temperature_k,sun_frac,sun_w_m2,sky_frac,"
      "flux_w_m2";
  for (const scene::SpectralBand& band : scenario.bands) {
    out += fmt::format(",radiance_{}_w_m2_sr", band.name);
  }
  out += ",sun_direct_w_m2,sky_diffuse_w_m2,sky_longwave_w_m2,air_k\n";
  const std::vector<ProbeRow>& rows = run.rows();
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const ProbeRow& row = rows[i];
    out += fmt::format("{:.9g},{},{},", row.time_s, utc_text(scenario.epoch_utc_ns, row.time_s),
                       cell(points[row.point].name));
    if (row.place) {
      const glm::dvec3& at = row.place->position_m;
      const glm::dvec3& normal = row.place->normal;
      out += fmt::format("{},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g},",
                         cell(scenario.objects[row.place->object].name), at.x, at.y, at.z, normal.x,
                         normal.y, normal.z);
    } else {
      out += ",,,,,,,";
    }
    // Nine digits keep the float values of the frame.
    out += fmt::format("{:.9g},{:.6g},{:.6g},{:.6g},{:.6g}", row.temperature_k, row.sun_frac,
                       row.sun_w_m2, row.sky_frac, row.flux_w_m2);
    for (const double radiance : row.radiance_w_m2_sr) out += fmt::format(",{:.9g}", radiance);
    const renderer::SurfaceForcing& now = forcing.at(i / points.size());
    out += fmt::format(",{:.6g},{:.6g},{:.6g},{:.6g}\n", glm::length(now.sun_w_m2),
                       now.diffuse_w_m2, now.longwave_w_m2, now.air_k);
  }
  return out;
}

Result<void> probe(const ProbeOptions& command, const scene::ScenarioDesc& scenario,
                   const std::vector<double>& times_s) {
  const InterruptGuard interrupt;
  const auto finder = ProbeFinder::create(scenario);
  if (!finder) return tl::unexpected(finder.error());
  std::vector<ProbePoint> points;
  for (const std::string& text : command.at) {
    auto read = finder->read(text);
    if (!read) return tl::unexpected(std::move(read.error()).with_context("--at"));
    points.insert(points.end(), read->begin(), read->end());
  }
  ProbeRun run(scenario, times_s, std::move(points));
  if (auto done = run.run(*finder, command.gpu_index); !done) return done;
  const auto forcing = ProbeForcing::create(scenario, times_s);
  if (!forcing) return tl::unexpected(forcing.error());
  auto file = ReplacingFile::create(command.out);
  if (!file) return tl::unexpected(std::move(file.error()));
  if (auto done = file->write(table_of(scenario, run, *forcing)); !done) return done;
  if (auto done = file->commit(); !done) return done;
  return command.plot ? write_svg(*command.plot, run.plots()) : Result<void>();
}

int run(const ProbeOptions& command) {
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  auto times_s = resolve_times(command.times, *scenario);
  if (!times_s) return fail_call(times_s.error());
  if (auto done = probe(command, *scenario, *times_s); !done) {
    return fail_call(done.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, ProbeOptions& options) {
  add_scenario(line, options.input, "scenario");
  line.option("--at", options.at,
              "Point; repeatable: x,y,z (m, the nearest surface within 2 cm), OBJECT or "
              "OBJECT:PART (middle of its largest triangle, which moves along), px:X,Y (what a "
              "pixel of the sensor shows), or a .csv table of points as for emit solve --at")
      .repeatable()
      .type_name("POINT")
      .required();
  add_times(line, "emit probe", options.times, "repeatable");
  line.output_file("--out", options.out, "CSV table, a row per time and point; -: standard output")
      .show_default();
  line.output_file("--plot", options.plot, "Histories as SVG");
  add_gpu(line, options.gpu_index);
  line.footer(
      "Columns: sun_frac is the visible share of the sun's disc, sun_w_m2 its direct flux on the "
      "face; sky_frac the cosine-weighted share of the sky; flux_w_m2 the net flux into the solid "
      "at the nearest thermal sample (thermal.method = \"cached\"). radiance of a pixel is that of "
      "the sensor's frame, to the float; radiance of other points is what a sensor sees along the "
      "normal from the sensor's distance, or from closer where something stands in between. The "
      "last columns are the weather: direct sun, diffuse sun and long-wave sky on a level face, "
      "and the air.\n"
      "Example: emit probe block-on-road --at 0,0,1 --at px:320,256 --times 06:00..09:30/10min "
      "--out block.csv --plot block.svg");
}

}  // namespace

void add_probe(CommandLine& tool) {
  tool.command<ProbeOptions>(
      {.name = "probe",
       .text = "Histories of temperature, sun, sky, flux and radiance at points, as CSV and plot",
       .example = "emit probe block-on-road --at 0,0,1 --times 06:00..09:30/10min"},
      add_options, run);
}

}  // namespace emit::tool
