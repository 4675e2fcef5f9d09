// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/probe_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>
#include <optional>
#include <utility>

#include "emit/reference/nearest_surface.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/offline/offline_frames.hpp"
#include "tool/offline/probe_points.hpp"
#include "tool/offline/time_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/replacing_file.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct ProbeOptions {
  ScenarioChoice input;
  std::vector<std::string> at;
  TimeChoice times;
  std::filesystem::path out = "-";
  std::optional<std::filesystem::path> plot;
  int gpu_index = -1;
};

/// Values of one point at one instant; NaN where there are none.
struct ProbeRow {
  double time_s = 0.0;
  std::size_t point = 0;
  std::optional<ProbePlace> place{};
  double temperature_k = kNan;
  double sun_frac = kNan;
  double sun_w_m2 = kNan;
  double sky_frac = kNan;
  double flux_w_m2 = kNan;
  std::vector<double> radiance_w_m2_sr{};
};

/// Distance from which a point is looked at, m. The distance of the sensor gives the surface the
/// fineness that it has in the sensor's picture; what stands in front of it limits the distance.
double view_distance_m(const ProbePlace& place, const scene::SensorDesc& sensor,
                       const physics::Pose& sensor_pose) {
  constexpr double kLeastM = 3.0;
  constexpr double kOpenFrac = 0.9;
  const double away_m = sensor.trajectory.empty()
                            ? kLeastM
                            : glm::distance(sensor_pose.position_world_m, place.position_m);
  return std::min(std::max(away_m, kLeastM), kOpenFrac * place.open_m);
}

/// Pose of a camera on the normal of a place whose pixel in the middle shows the place.
physics::Pose view_of(const ProbePlace& place, double distance_m, const scene::SensorDesc& sensor) {
  physics::Pose pose;
  pose.position_world_m = place.position_m + distance_m * place.normal;
  const glm::dvec3 ray = pixel_direction_body(sensor, sensor.width_px / 2, sensor.height_px / 2);
  pose.world_from_body = physics::world_from_body_look_at(pose.position_world_m, place.position_m) *
                         glm::dquat(ray, glm::dvec3(1.0, 0.0, 0.0));
  return pose;
}

/// Forcing at the instants of the rows.
class ProbeForcing {
 public:
  /// Errors: those of renderer::surface_forcing().
  [[nodiscard]] static Result<ProbeForcing> create(const scene::ScenarioDesc& scenario,
                                                   std::span<const double> times_s) {
    std::vector<std::int64_t> nodes_ns;
    for (const double time_s : times_s) nodes_ns.push_back(std::llround(1e9 * time_s));
    constexpr std::int64_t kSecondNs = 1'000'000'000;
    nodes_ns.push_back(nodes_ns.back() + kSecondNs);  // an interval begins at every instant
    auto intervals = renderer::surface_forcing(scenario, nodes_ns);
    if (!intervals) return tl::unexpected(std::move(intervals.error()));
    return ProbeForcing(std::move(*intervals));
  }
  [[nodiscard]] const renderer::SurfaceForcing& at(std::size_t time) const {
    return intervals_[time].begin;
  }

 private:
  explicit ProbeForcing(std::vector<renderer::IntervalForcing> intervals)
      : intervals_(std::move(intervals)) {}
  std::vector<renderer::IntervalForcing> intervals_;
};

/// One run: it finds the points, renders a pixel for each, and writes table and plot.
class Probing {
 public:
  Probing(const ProbeOptions& command, const scene::ScenarioDesc& scenario,
          std::vector<double> times_s)
      : command_(command), scenario_(scenario), times_s_(std::move(times_s)) {}
  /// Errors: those of the finder, of the renderer and of the files.
  [[nodiscard]] Result<void> run();

 private:
  [[nodiscard]] Result<void> read_points(const ProbeFinder& finder);
  void plan(const ProbeFinder& finder);
  [[nodiscard]] Result<void> render();
  void read(const renderer::FrameView& view, const OfflineShot& shot,
            const renderer::SurfaceForcing& forcing, ProbeRow& row);
  void read_flux(const renderer::Renderer& renderer, ProbeRow& row);
  [[nodiscard]] std::string table(const ProbeForcing& forcing) const;
  [[nodiscard]] std::vector<Plot> plots() const;

  const ProbeOptions& command_;
  scene::ScenarioDesc scenario_;
  std::vector<double> times_s_;
  std::vector<ProbePoint> points_;
  std::vector<ProbeRow> rows_;  ///< by time, then by point
  std::vector<OfflineShot> shots_;
  std::vector<std::size_t> row_of_shot_;
  /// Sample of each point and the place that it was found for.
  std::vector<std::pair<std::optional<std::uint32_t>, glm::dvec3>> samples_;
  std::size_t hidden_ = 0;
};

Result<void> Probing::read_points(const ProbeFinder& finder) {
  for (const std::string& text : command_.at) {
    auto points = finder.read(text);
    if (!points) return tl::unexpected(std::move(points.error()).with_context("--at"));
    points_.insert(points_.end(), points->begin(), points->end());
  }
  samples_.resize(points_.size());
  return {};
}

/// Finds the surfaces, and plans a shot for each of them.
void Probing::plan(const ProbeFinder& finder) {
  const bool only_pixels = std::ranges::all_of(
      points_, [](const ProbePoint& point) { return point.kind == ProbePoint::Kind::pixel; });
  std::vector<bool> found(points_.size(), false);
  const std::vector<OfflineShot> sensor = sensor_shots(scenario_, times_s_);
  for (std::size_t t = 0; t < times_s_.size(); ++t) {
    for (std::size_t p = 0; p < points_.size(); ++p) {
      const ProbePoint& point = points_[p];
      ProbeRow row{times_s_[t], p};
      row.radiance_w_m2_sr.assign(scenario_.bands.size(), kNan);
      row.place = finder.place(point, sensor[t].sim_time_ns, sensor[t].sensor_pose);
      const bool pixel = point.kind == ProbePoint::Kind::pixel;
      found[p] = found[p] || row.place || pixel;
      OfflineShot shot = sensor[t];
      shot.window_px = {scenario_.sensor.width_px / 2, scenario_.sensor.height_px / 2, 1, 1};
      if (pixel) {
        shot.window_px = {point.x_px, point.y_px, 1, 1};
      } else if (row.place) {
        const double away_m = view_distance_m(*row.place, scenario_.sensor, shot.sensor_pose);
        shot.sensor_pose = view_of(*row.place, away_m, scenario_.sensor);
        // Bring the near plane closer where something stands close.
        constexpr double kNearFrac = 0.25;
        scenario_.sensor.near_m = std::min(scenario_.sensor.near_m, kNearFrac * away_m);
      }
      shot.jump = !only_pixels;
      if (pixel || row.place) {
        row_of_shot_.push_back(rows_.size());
        shots_.push_back(shot);
      }
      rows_.push_back(std::move(row));
    }
  }
  for (std::size_t p = 0; p < points_.size(); ++p) {
    if (found[p]) continue;
    warn(fmt::format("{}: no surface is within {} m at any of the times; its values are nan",
                     points_[p].name, reference::kProbeReachM));
  }
}

void Probing::read(const renderer::FrameView& view, const OfflineShot& shot,
                   const renderer::SurfaceForcing& forcing, ProbeRow& row) {
  const std::size_t px = std::size_t{shot.window_px.y_px} * view.width_px + shot.window_px.x_px;
  if (points_[row.point].kind != ProbePoint::Kind::pixel) {
    // The camera looks along the normal, so that the depth is the distance of the camera. A mesh
    // that was simplified for the picture may lie a little beside the one of the file.
    const double away_m = glm::distance(shot.sensor_pose.position_world_m, row.place->position_m);
    constexpr double kSlackFrac = 0.02;
    constexpr double kSlackM = 0.01;
    if (std::abs(static_cast<double>(view.depth_m[px]) - away_m) > kSlackM + kSlackFrac * away_m) {
      ++hidden_;
      return;
    }
  }
  for (std::size_t b = 0; b < scenario_.bands.size(); ++b) {
    row.radiance_w_m2_sr[b] = static_cast<double>(view.radiance_w_m2_sr[b][px]);
  }
  row.temperature_k = static_cast<double>(view.temperature_k[px]);
  if (std::isnan(row.temperature_k) || !row.place) return;
  row.sky_frac = static_cast<double>(view.sky_frac[px]);
  const double dni_w_m2 = glm::length(forcing.sun_w_m2);
  const auto sun_cosine = static_cast<double>(view.sun_cosine[px]);
  row.sun_w_m2 = dni_w_m2 * sun_cosine;
  const double cosine =
      dni_w_m2 > 0.0 ? glm::dot(forcing.sun_w_m2, row.place->normal) / dni_w_m2 : 0.0;
  constexpr double kGrazing = 1e-3;
  row.sun_frac = cosine > kGrazing ? std::min(1.0, sun_cosine / cosine) : 0.0;
}

/// Reads the flux of the sample nearest to the place.
void Probing::read_flux(const renderer::Renderer& renderer, ProbeRow& row) {
  if (std::isnan(row.temperature_k) || !row.place) return;
  auto& [sample, found_for_m] = samples_[row.point];
  constexpr double kSameM = 1e-6;
  if (!sample || glm::distance(found_for_m, row.place->position_m) > kSameM) {
    sample = renderer.nearest_sample({row.place->position_m, row.place->normal});
    found_for_m = row.place->position_m;
  }
  if (sample) row.flux_w_m2 = renderer.sample_reading(*sample).flux_w_m2;
}

Result<void> Probing::render() {
  if (shots_.empty()) return {};
  const auto forcing = ProbeForcing::create(scenario_, times_s_);
  if (!forcing) return tl::unexpected(forcing.error());
  renderer::OutputOptions output;
  output.temperature = output.depth = output.sun = output.sky = true;
  output.slots = 2;
  auto frames = OfflineFrames::create(scenario_, shots_, output, command_.gpu_index);
  if (!frames) return tl::unexpected(std::move(frames.error()));
  for (std::size_t s = 0; s < shots_.size(); ++s) {
    const auto view = (*frames)->next();
    if (!view) return tl::unexpected(view.error());
    ProbeRow& row = rows_[row_of_shot_[s]];
    read(**view, shots_[s], forcing->at(row_of_shot_[s] / points_.size()), row);
    read_flux((*frames)->renderer(), row);
  }
  if (hidden_ > 0) {
    warn(fmt::format("{} of {} values are nan: something too thin or too close hides the point",
                     hidden_, shots_.size()));
  }
  return {};
}

std::string utc_text(std::int64_t epoch_utc_ns, double time_s) {
  const auto seconds = static_cast<std::time_t>(
      std::floor(1e-9 * static_cast<double>(epoch_utc_ns) + std::round(time_s * 1e3) / 1e3));
  std::tm parts{};
  ::gmtime_r(&seconds, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts);
  return text.data();
}

/// A cell of a table: names with commas stand in quotes.
std::string cell(const std::string& text) {
  return text.find_first_of(",\"") == std::string::npos ? text : "\"" + text + "\"";
}

std::string Probing::table(const ProbeForcing& forcing) const {
  std::string out =
      "time_s,utc,point,object,x_m,y_m,z_m,nx,ny,nz,temperature_k,sun_frac,sun_w_m2,sky_frac,"
      "flux_w_m2";
  for (const scene::SpectralBand& band : scenario_.bands) {
    out += fmt::format(",radiance_{}_w_m2_sr", band.name);
  }
  out += ",sun_direct_w_m2,sky_diffuse_w_m2,sky_longwave_w_m2,air_k\n";
  for (std::size_t i = 0; i < rows_.size(); ++i) {
    const ProbeRow& row = rows_[i];
    out += fmt::format("{:.9g},{},{},", row.time_s, utc_text(scenario_.epoch_utc_ns, row.time_s),
                       cell(points_[row.point].name));
    if (row.place) {
      const glm::dvec3& at = row.place->position_m;
      const glm::dvec3& normal = row.place->normal;
      out += fmt::format("{},{:.9g},{:.9g},{:.9g},{:.6g},{:.6g},{:.6g},",
                         cell(scenario_.objects[row.place->object].name), at.x, at.y, at.z,
                         normal.x, normal.y, normal.z);
    } else {
      out += ",,,,,,,";
    }
    // Nine digits keep the float values of the frame.
    out += fmt::format("{:.9g},{:.6g},{:.6g},{:.6g},{:.6g}", row.temperature_k, row.sun_frac,
                       row.sun_w_m2, row.sky_frac, row.flux_w_m2);
    for (const double radiance : row.radiance_w_m2_sr) out += fmt::format(",{:.9g}", radiance);
    const renderer::SurfaceForcing& now = forcing.at(i / points_.size());
    out += fmt::format(",{:.6g},{:.6g},{:.6g},{:.6g}\n", glm::length(now.sun_w_m2),
                       now.diffuse_w_m2, now.longwave_w_m2, now.air_k);
  }
  return out;
}

std::vector<Plot> Probing::plots() const {
  std::vector<std::pair<std::string, std::function<double(const ProbeRow&)>>> quantities{
      {"surface temperature, K", [](const ProbeRow& row) { return row.temperature_k; }},
      {"direct sun on the face, W/m2", [](const ProbeRow& row) { return row.sun_w_m2; }},
      {"share of the sky that is seen", [](const ProbeRow& row) { return row.sky_frac; }},
      {"net flux into the solid, W/m2", [](const ProbeRow& row) { return row.flux_w_m2; }}};
  for (std::size_t b = 0; b < scenario_.bands.size(); ++b) {
    quantities.emplace_back(fmt::format("radiance in {}, W m-2 sr-1", scenario_.bands[b].name),
                            [b](const ProbeRow& row) { return row.radiance_w_m2_sr[b]; });
  }
  std::vector<Plot> out;
  for (const auto& [label, value] : quantities) {
    Plot plot;
    plot.title = label.substr(0, label.find(','));
    plot.x.label = "simulation time, h";
    plot.y.label = label;
    for (std::size_t p = 0; p < points_.size(); ++p) {
      PlotSeries series;
      series.label = points_[p].name;
      series.line = true;
      series.markers = times_s_.size() < 30;
      for (const ProbeRow& row : rows_) {
        if (row.point != p || !std::isfinite(value(row))) continue;
        series.points.push_back({row.time_s / 3600.0, value(row), ""});
      }
      plot.series.push_back(std::move(series));
    }
    out.push_back(std::move(plot));
  }
  return out;
}

Result<void> Probing::run() {
  const InterruptGuard interrupt;
  const auto finder = ProbeFinder::create(scenario_);
  if (!finder) return tl::unexpected(finder.error());
  if (auto read = read_points(*finder); !read) return read;
  plan(*finder);
  if (auto rendered = render(); !rendered) return rendered;
  const auto forcing = ProbeForcing::create(scenario_, times_s_);
  if (!forcing) return tl::unexpected(forcing.error());
  auto file = ReplacingFile::create(command_.out);
  if (!file) return tl::unexpected(std::move(file.error()));
  if (auto done = file->write(table(*forcing)); !done) return done;
  if (auto done = file->commit(); !done) return done;
  return command_.plot ? write_svg(*command_.plot, plots()) : Result<void>();
}

int run(const ProbeOptions& command) {
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  auto times_s = resolve_times(command.times, *scenario);
  if (!times_s) return fail_call(times_s.error());
  if (auto done = Probing(command, *scenario, std::move(*times_s)).run(); !done) {
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
