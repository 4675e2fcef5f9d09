// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <optional>

#include "bench/accuracy/accuracy_benches.hpp"
#include "bench/accuracy/bench_rules.hpp"
#include "bench/accuracy/converged_history.hpp"
#include "bench/accuracy/embree_yardstick.hpp"
#include "bench/accuracy/error_figures.hpp"
#include "bench/accuracy/error_regions.hpp"
#include "emit/physics/sun.hpp"
#include "emit/reference/solve.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/renderer/renderer.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/scene/sheets.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/statistics.hpp"
#include "tool/support/svg_plot.hpp"

namespace emit::tool {
namespace {

struct ErrorOptions {
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> csv;
  std::optional<std::filesystem::path> plot;
  std::optional<std::filesystem::path> figures;
  std::vector<std::string> scenes;
  bool quick = false;
  std::uint32_t frames = 3;
  std::uint32_t width_px = 320;
  std::uint32_t height_px = 256;
  std::uint32_t rays = 256;
  double refine = 1.0;
  std::uint64_t pixels = 0;
  int gpu_index = -1;
};

using Clock = std::chrono::steady_clock;
using physics::Result;

/// Model that computes temperatures: the renderer by either method, or a ray tracer (Embree) that
/// starts anew for every frame, with one ray to the sun per pixel and step.
enum class Method : std::uint8_t { per_frame, cached, embree };

/// One point of the sweep.
struct Setting {
  Method method = Method::per_frame;
  scene::ThermalModel model = scene::ThermalModel::foster;
  scene::StepSpacing spacing = scene::StepSpacing::geometric;
  std::uint32_t steps = 27;
  std::uint32_t shadow_map_px = 1024;
  std::uint32_t blocker_taps = 8;
  std::uint32_t filter_taps = 32;
  std::uint32_t modes = 0;  ///< foster: 0 = those of the material
  double tolerance_k = 0.1;
  bool lateral = true;     ///< cached: conduction along the surface and across edges
  bool standard = false;   ///< the figures of every scene show this setting
  bool variation = false;  ///< the plots show the setting beside the curves
};

std::string_view name_of(scene::ThermalModel model) {
  return model == scene::ThermalModel::foster ? "foster" : "emit2014";
}
std::string_view name_of(Method method) {
  switch (method) {
    case Method::per_frame:
      return "per-frame";
    case Method::cached:
      return "cached";
    case Method::embree:
      break;
  }
  return "embree";
}
std::string_view name_of(scene::StepSpacing spacing) {
  return spacing == scene::StepSpacing::uniform ? "uniform" : "geometric";
}

/// Returns the settings of a scene whose reference has a number of dimensions. Settings of `cached`
/// have the physics of the reference: one dimension knows no conduction along surfaces. One setting
/// has it there too, and shows the difference of the models.
std::vector<Setting> sweep(bool quick, int dimension) {
  std::vector<Setting> settings;
  const bool three = dimension == 3;
  const auto cached = [&settings, three]() -> Setting& {
    Setting& setting = settings.emplace_back();
    setting.method = Method::cached;
    setting.lateral = three;
    return setting;
  };
  const std::vector<std::uint32_t> steps =
      quick ? std::vector<std::uint32_t>{9, 27} : std::vector<std::uint32_t>{9, 13, 27, 54, 90};
  for (const auto model : {scene::ThermalModel::emit2014, scene::ThermalModel::foster}) {
    for (const auto spacing : {scene::StepSpacing::uniform, scene::StepSpacing::geometric}) {
      for (const std::uint32_t count : steps) {
        Setting& setting = settings.emplace_back();
        setting.model = model;
        setting.spacing = spacing;
        setting.steps = count;
        setting.standard = spacing == scene::StepSpacing::geometric && count == 27;
      }
    }
  }
  cached().standard = true;
  Setting& other = cached();
  other.lateral = !three;
  other.variation = true;
  for (const auto model : {scene::ThermalModel::emit2014, scene::ThermalModel::foster}) {
    for (const std::uint32_t count : steps) {
      Setting& setting = settings.emplace_back();
      setting.method = Method::embree;
      setting.model = model;
      setting.spacing = scene::StepSpacing::uniform;
      setting.steps = count;
    }
  }
  if (quick) return settings;
  for (const std::uint32_t count : {13U, 54U, 90U}) cached().steps = count;
  for (const double tolerance_k : {1.0, 0.3, 0.03}) cached().tolerance_k = tolerance_k;
  // The settings below change one parameter at a time from foster, geometric, 27.
  for (const std::uint32_t map_px : {256U, 512U, 2048U, 4096U}) {
    settings.emplace_back().shadow_map_px = map_px;
  }
  for (const std::uint32_t taps : {4U, 16U, 64U}) {
    Setting& setting = settings.emplace_back();
    setting.filter_taps = taps;
    setting.blocker_taps = std::max(4U, taps / 4U);
  }
  for (const std::uint32_t modes : {2U, 3U, 4U}) settings.emplace_back().modes = modes;
  return settings;
}

struct Shot {
  std::vector<float> temperature_k;
  std::vector<float> radiance_w_m2_sr;  ///< empty for a ray tracer
  double frame_ms = 0.0;
  double warm_up_ms = 0.0;
  std::string device;  ///< empty: the CPU
};

Result<Shot> shoot(scene::ScenarioDesc scenario, const Setting& setting,
                   const reference::SolveView& view, const ErrorOptions& command) {
  scene::ThermalOptions& thermal = scenario.thermal;
  thermal.method = setting.method == Method::cached ? scene::ThermalMethod::cached
                                                    : scene::ThermalMethod::per_frame;
  thermal.model = setting.model;
  thermal.tolerance_k = setting.tolerance_k;
  thermal.lateral = setting.lateral;
  thermal.spacing = setting.spacing;
  thermal.steps = setting.steps;
  thermal.shadow_map_px = setting.shadow_map_px;
  thermal.blocker_taps = setting.blocker_taps;
  thermal.filter_taps = setting.filter_taps;
  thermal.foster_modes = setting.modes;
  renderer::OutputOptions output;
  output.slots = 2;
  output.temperature = true;
  const auto created = renderer::Renderer::create(scenario, {command.gpu_index, false}, output);
  if (!created) return tl::unexpected(created.error());
  renderer::Renderer& renderer = **created;
  Shot shot;
  shot.device = renderer.device_name();
  Samples times;
  for (std::uint32_t i = 0; i <= command.frames; ++i) {
    if (InterruptGuard::interrupted()) {
      return physics::make_error(physics::ErrorCode::io, "interrupted");
    }
    renderer::FrameRequest request;
    request.frame_number = i;
    request.sim_time_ns = view.sim_time_ns;
    request.thermal_time_ns = view.sim_time_ns;
    request.sensor_pose = view.sensor_pose;
    if (i == 0) {
      const auto start = Clock::now();
      const auto warm =
          renderer.warm_up(request, [](double) { return !InterruptGuard::interrupted(); });
      if (!warm) return tl::unexpected(warm.error());
      shot.warm_up_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    }
    const auto start = Clock::now();
    const int slot = renderer.submit(request);
    if (slot < 0) {
      return physics::make_error(physics::ErrorCode::internal, "the renderer has no free slot");
    }
    const auto& frame = renderer.collect(static_cast<renderer::SlotIndex>(slot));
    const double frame_ms = std::chrono::duration<double, std::milli>(Clock::now() - start).count();
    if (frame.device_failed) {
      return physics::make_error(physics::ErrorCode::gpu, "the device reported an error");
    }
    if (i > 0) times.add(frame_ms);
    shot.temperature_k.assign(frame.temperature_k.begin(), frame.temperature_k.end());
    shot.radiance_w_m2_sr.assign(frame.radiance_w_m2_sr[0].begin(),
                                 frame.radiance_w_m2_sr[0].end());
    renderer.release(static_cast<renderer::SlotIndex>(slot));
  }
  shot.frame_ms = times.median();
  return shot;
}

/// Renders with the ray tracer. The time covers the sun's rays alone, without sky and thermal
/// model.
Result<Shot> trace(scene::ScenarioDesc scenario, const Setting& setting,
                   const reference::SolveView& view) {
  scenario.thermal.model = setting.model;
  const auto yardstick = EmbreeYardstick::create(scenario, view);
  if (!yardstick) return tl::unexpected(yardstick.error());
  const auto history = ConvergedHistory::create(scenario);
  if (!history) return tl::unexpected(history.error());
  ConvergedOptions options;
  options.pixels = view.width_px * view.height_px;
  options.steps = setting.steps;
  options.sun_rays = 1;
  options.sky_rays = 256;
  options.progress = [](double) { return !InterruptGuard::interrupted(); };
  const auto pixels = history->picture(view, options);
  if (!pixels) return tl::unexpected(pixels.error());
  Shot shot;
  shot.temperature_k.assign(options.pixels, std::numeric_limits<float>::quiet_NaN());
  for (const ConvergedPixel& pixel : *pixels) {
    shot.temperature_k[pixel.pixel] = pixel.temperature_k;
  }
  const Samples step_ms = yardstick->step_ms(setting.steps);
  shot.frame_ms = std::accumulate(step_ms.values().begin(), step_ms.values().end(), 0.0);
  return shot;
}

/// Reference of one scene, with the class of every pixel.
struct Truth {
  reference::SolvedImage image;
  reference::SolveReport report;
  std::array<std::vector<std::uint8_t>, kRegions.size()> masks;
  double edge_m = 0.0;
  double solve_s = 0.0;
};

std::string describe(const reference::SolveReport& report, std::uint32_t rays) {
  const double shaded_h = report.spin_up_s / 3600.0;
  return report.dimension == 3
             ? fmt::format(
                   "3-D conduction, {} nodes, {} faces, {} rays per face, {:g} h of shaded "
                   "history before",
                   report.nodes, report.faces, rays, shaded_h)
             : fmt::format(
                   "1-D conduction behind every pixel, exchange once, {} rays, {:g} h of "
                   "shaded history before",
                   rays, shaded_h);
}

Result<Truth> solve_truth(const scene::ScenarioDesc& scenario, const reference::SolveView& view,
                          const ErrorOptions& command, const std::string& label) {
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(geometry.error());
  scene::adopt_sheets(*geometry);
  Truth truth;
  Progress progress("reference of " + label, kShareParts);
  reference::SolveOptions options;
  options.rays = command.rays;
  options.refine = command.refine;
  options.pixels = command.pixels;
  options.progress = share_of(progress);
  const auto start = Clock::now();
  auto images = reference::solve(scenario, *geometry, std::span(&view, 1), options, &truth.report);
  if (!images) return tl::unexpected(images.error());
  for (const std::string& note : truth.report.notes) warn(label + ": " + note);
  truth.solve_s = std::chrono::duration<double>(Clock::now() - start).count();
  truth.image = std::move(images->front());

  const auto rays = reference::RayScene::create(reference::ray_scene_desc(scenario, *geometry));
  if (!rays) return tl::unexpected(rays.error());
  const physics::SunPosition sun = physics::sun_position(
      scenario.epoch_utc_ns + view.sim_time_ns,
      {physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
       physics::Metres(scenario.place.height_m)});
  RegionOptions regions;
  // Only the three-dimensional reference has lateral conduction: its reach is a region of its own
  // there.
  if (truth.report.dimension == 3) {
    for (const scene::Material& material : geometry->materials) {
      if (!material.layers.empty()) {
        regions.edge_m = std::max(regions.edge_m, material.layers.front().thickness_m);
      }
    }
  }
  truth.edge_m = regions.edge_m;
  truth.masks = classify_pixels(rays->at(view.sim_time_ns), view, sun.direction_enu, regions);
  return truth;
}

/// One line of the result.
struct Row {
  std::string scene;
  Region region = Region::all;
  Setting setting;
  double frame_ms = 0.0;
  double warm_up_ms = 0.0;
  ErrorSummary kelvin;
  ErrorSummary fraction;
  bool same_model = true;  ///< false: the reference lacks physics that the setting has
  bool pareto = false;
};

/// Marks the rows for which no other setting of the same scene and region is both faster and more
/// accurate. A ray tracer is left out, because its time lacks a part, and so is a setting with
/// physics that the reference lacks.
void mark_pareto(std::vector<Row>& rows) {
  const auto counts = [](const Row& row) {
    return row.kelvin.pixels > 0 && row.same_model && row.setting.method != Method::embree;
  };
  for (Row& row : rows) {
    row.pareto = counts(row) && std::ranges::none_of(rows, [&](const Row& other) {
                   return other.scene == row.scene && other.region == row.region && counts(other) &&
                          other.frame_ms <= row.frame_ms && other.kelvin.rms <= row.kelvin.rms &&
                          (other.frame_ms < row.frame_ms || other.kelvin.rms < row.kelvin.rms);
                 });
  }
}

std::string taps_text(const Setting& setting) {
  return fmt::format("{}+{}", setting.blocker_taps, setting.filter_taps);
}

std::uint32_t modes_of(const Setting& setting) {
  return setting.model == scene::ThermalModel::emit2014 ? 2 : setting.modes;
}

Json row_json(const Row& row, const ErrorOptions& command, const std::string& reference) {
  const Setting& s = row.setting;
  Json json = Json::object();
  json.set("scene", row.scene).set("region", name_of(row.region)).set("method", name_of(s.method));
  json.set("model", name_of(s.model)).set("steps", s.steps).set("spacing", name_of(s.spacing));
  const bool cached = s.method == Method::cached;
  const bool maps = s.method == Method::per_frame;
  json.set("map_size", maps ? Json(s.shadow_map_px) : Json(nullptr));
  json.set("taps", maps ? Json(taps_text(s)) : Json(nullptr));
  json.set("occlusion", maps ? "screen-space" : "rays").set("lateral", cached && s.lateral);
  json.set("same_model", row.same_model);
  json.set("warm_up_ms", row.warm_up_ms);
  const std::uint32_t modes = modes_of(s);
  json.set("modes", modes == 0 ? Json("material") : Json(modes));
  json.set("tolerance_k",
           s.model == scene::ThermalModel::emit2014 ? Json(nullptr) : Json(s.tolerance_k));
  json.set("frame_ms_median", row.frame_ms);
  const bool known = row.kelvin.pixels > 0;
  const auto number = [known](double value) { return known ? Json(value) : Json(nullptr); };
  json.set("max_error_k", number(row.kelvin.max)).set("rms_error_k", number(row.kelvin.rms));
  json.set("p99_error_k", number(row.kelvin.p99)).set("mean_error_k", number(row.kelvin.mean));
  const auto share = [&](double value) {
    return row.fraction.pixels > 0 ? Json(value) : Json(nullptr);
  };
  json.set("max_error_frac", share(row.fraction.max));
  json.set("rms_error_frac", share(row.fraction.rms));
  json.set("p99_error_frac", share(row.fraction.p99)).set("pareto", row.pareto);
  json.set("reference", reference).set("pixels_compared", row.kelvin.pixels);
  json.set("not_finite_px", row.kelvin.not_finite);
  json.set("width", command.width_px).set("height", command.height_px);
  return json;
}

Result<void> write_csv(const std::filesystem::path& file, const std::vector<Row>& rows) {
  std::ofstream out(file, std::ios::binary);
  out << "scene,region,method,model,steps,spacing,map_size,taps,modes,tolerance_k,lateral,"
         "same_model,"
         "frame_ms_median,max_error_k,"
         "rms_error_k,p99_error_k,max_error_frac,rms_error_frac,p99_error_frac,pareto,pixels\n";
  for (const Row& row : rows) {
    const Setting& s = row.setting;
    out << fmt::format(
        "{},{},{},{},{},{},{},{},{},{:g},{},{},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},{:.4g},"
        "{:.4g},{},{}\n",
        row.scene, name_of(row.region), name_of(s.method), name_of(s.model), s.steps,
        name_of(s.spacing), s.shadow_map_px, taps_text(s), modes_of(s), s.tolerance_k,
        s.lateral ? 1 : 0, row.same_model ? 1 : 0, row.frame_ms, row.kelvin.max, row.kelvin.rms,
        row.kelvin.p99, row.fraction.max, row.fraction.rms, row.fraction.p99, row.pareto ? 1 : 0,
        row.kelvin.pixels);
  }
  out.flush();
  if (!out) {
    return physics::make_error(physics::ErrorCode::io,
                               fmt::format("{}: cannot be written", file.string()));
  }
  return {};
}

Plot plot_of(const std::string& scene, const std::vector<Row>& rows) {
  Plot plot;
  plot.title = scene + ": what an error costs";
  plot.x = {"time per frame, ms", PlotScale::logarithmic};
  plot.y = {"RMS error against the reference, K", PlotScale::logarithmic};
  const auto point = [](const Row& row) {
    const Setting& s = row.setting;
    return PlotPoint{
        row.frame_ms, row.kelvin.rms,
        fmt::format("{} {} {} steps {}, map {}, taps {}, tolerance {:g} K: RMS {:.3f} K, p99 "
                    "{:.3f} K, max {:.3f} K, {:.1f} ms",
                    name_of(s.method), name_of(s.model), s.steps, name_of(s.spacing),
                    s.shadow_map_px, taps_text(s), s.tolerance_k, row.kelvin.rms, row.kelvin.p99,
                    row.kelvin.max, row.frame_ms)};
  };
  std::map<std::string, PlotSeries> curves;
  PlotSeries variations{"one option changed", {}, false, true, false};
  PlotSeries front{"best for its time", {}, true, false, true};
  const Setting standard;
  for (const Row& row : rows) {
    if (row.scene != scene || row.region != Region::all || row.kelvin.pixels == 0) continue;
    const Setting& s = row.setting;
    if (row.pareto) front.points.push_back(point(row));
    if (s.shadow_map_px != standard.shadow_map_px || s.filter_taps != standard.filter_taps ||
        s.modes != standard.modes || s.variation) {
      variations.points.push_back(point(row));
      continue;
    }
    const std::string label =
        s.method == Method::cached ? std::string("cached foster")
        : s.method == Method::embree
            ? fmt::format("Embree anew, {}, sun's rays", name_of(s.model))
            : fmt::format("per-frame {}, {}", name_of(s.model), name_of(s.spacing));
    PlotSeries& curve = curves[label];
    curve.label = label;
    curve.line = true;
    curve.points.push_back(point(row));
  }
  std::ranges::sort(front.points, {}, &PlotPoint::x);
  plot.series.push_back(std::move(front));
  for (auto& [label, curve] : curves) plot.series.push_back(std::move(curve));
  if (!variations.points.empty()) plot.series.push_back(std::move(variations));
  return plot;
}

/// Settings that a scene refuses, for one reason.
struct LeftOut {
  std::string scene;
  std::string why;
  std::size_t settings = 0;
};

/// Results of the suite so far.
struct Findings {
  std::vector<Row> rows;
  std::vector<LeftOut> left_out;
  std::map<std::string, std::string> reference_text;  ///< by scene
  std::string device;
  TextTable references{{"scene", "reference", "pixels", "solve s", "edge band m"}};
};

/// Loads the shipped scenario with the changes of this suite. Errors: config.
Result<scene::ScenarioDesc> suite_scenario(const std::string& name, const ErrorOptions& command) {
  auto scenario = load_scenario_choice({name, {}});
  if (!scenario) return scenario;
  scenario->sensor.width_px = command.width_px;
  scenario->sensor.height_px = command.height_px;
  scenario->thermal.model = scene::ThermalModel::foster;
  // Begin with the reference, from the same profile of the ground: its slowest states last for
  // weeks, so that a day more before the history would show as an error of half a kelvin.
  scenario->thermal.spin_up_ns = std::max<std::int64_t>(
      scenario->thermal.spin_up_ns, std::llround(reference::SolveOptions{}.spin_up_s * 1e9));
  if (scenario->sensor.trajectory.empty()) {
    return physics::make_error(physics::ErrorCode::config,
                               fmt::format("{}: the sensor has no trajectory", name));
  }
  return scenario;
}

/// Adds one row per region.
void add_rows(const std::string& scene, const Setting& setting, const Shot& shot,
              const Truth& truth, std::vector<Row>& rows) {
  for (std::size_t r = 0; r < kRegions.size(); ++r) {
    Row row;
    row.scene = scene;
    row.region = kRegions[r];
    row.setting = setting;
    row.frame_ms = shot.frame_ms;
    row.warm_up_ms = shot.warm_up_ms;
    row.same_model =
        truth.report.dimension == 3 || setting.method != Method::cached || !setting.lateral;
    row.kelvin =
        summarize_error(shot.temperature_k, truth.image.temperature_k, truth.masks[r], false);
    if (!shot.radiance_w_m2_sr.empty()) {
      row.fraction = summarize_error(shot.radiance_w_m2_sr, truth.image.radiance_w_m2_sr[0],
                                     truth.masks[r], true);
    }
    rows.push_back(std::move(row));
  }
}

/// Takes the variation from place to place off all materials: the reference does not have it, so
/// that the comparison would show it as an error of every setting. Returns what the results say of
/// it, which is empty where no material varies.
std::string leave_out_clutter(const std::string& name, std::vector<scene::Material>& materials) {
  std::string varied;
  for (scene::Material& material : materials) {
    if (!material.clutter) continue;
    varied += (varied.empty() ? "" : ", ") + material.name;
    material.clutter.reset();
  }
  if (varied.empty()) return varied;
  warn(fmt::format("{}: [[clutter]] of {} is left out of reference and settings", name, varied));
  return ", without [[clutter]] in all models";
}

/// Notes that a scene refuses a setting, and warns once of each reason.
void leave_out(const std::string& scene, const std::string& why, Findings& findings) {
  const auto known = std::ranges::find_if(findings.left_out, [&](const LeftOut& other) {
    return other.scene == scene && other.why == why;
  });
  if (known != findings.left_out.end()) {
    ++known->settings;
    return;
  }
  findings.left_out.push_back({scene, why, 1});
  warn(fmt::format("{}: settings with it are left out: {}", scene, why));
}

/// Computes the reference of one scene and compares all settings with it.
Result<void> run_scene(const std::string& name, const ErrorOptions& command, Findings& findings) {
  auto scenario = suite_scenario(name, command);
  if (!scenario) return tl::unexpected(scenario.error());
  const std::string left_out = leave_out_clutter(name, scenario->materials);
  const std::int64_t now_ns = observation_ns(*scenario);
  const TrajectorySample sensor = sample_trajectory(scenario->sensor.trajectory, now_ns, now_ns);
  const reference::SolveView view{now_ns, sensor.pose, command.width_px, command.height_px,
                                  scenario->sensor.fov_h_rad};
  const auto truth = solve_truth(*scenario, view, command, name);
  if (!truth) return tl::unexpected(truth.error());
  const std::vector<Setting> settings = sweep(command.quick, truth->report.dimension);
  const std::string& reference = findings.reference_text[name] =
      describe(truth->report, command.rays) + left_out;
  findings.references.add({name, reference, fmt::format("{}", truth->image.solved_px),
                           fmt::format("{:.1f}", truth->solve_s),
                           fmt::format("{:.3f}", truth->edge_m)});

  Progress progress("settings of " + name, settings.size());
  std::uint64_t done = 0;
  const std::size_t rows_before = findings.rows.size();
  std::optional<physics::Error> refused;
  ErrorFigures figures(name, view, truth->image);
  for (const Setting& setting : settings) {
    const auto shot = setting.method == Method::embree ? trace(*scenario, setting, view)
                                                       : shoot(*scenario, setting, view, command);
    progress.advance_to(++done);
    if (!shot && shot.error().code == physics::ErrorCode::config) {
      leave_out(name, shot.error().text, findings);
      refused = shot.error();
      continue;
    }
    if (!shot) return tl::unexpected(shot.error());
    if (!shot->device.empty()) findings.device = shot->device;
    if (setting.standard) {
      figures.add(setting.method == Method::cached ? std::string(name_of(setting.method))
                                                   : std::string(name_of(setting.model)),
                  shot->temperature_k);
    }
    add_rows(name, setting, *shot, *truth, findings.rows);
  }
  // A scene that refuses every setting is wrong itself.
  if (refused && findings.rows.size() == rows_before) return tl::unexpected(std::move(*refused));
  return command.figures ? figures.write(*command.figures, scenario->display) : Result<void>();
}

TextTable table_of(const std::vector<Row>& rows) {
  TextTable table({"scene", "method", "model", "spacing", "steps", "map", "taps", "tol K",
                   "lateral", "ms", "rms K", "p99 K", "max K", "sunlit max", "core max",
                   "penumbra p99", "edges p99"});
  for (std::size_t i = 0; i + kRegions.size() <= rows.size(); i += kRegions.size()) {
    const Row& all = rows[i];
    const auto k = [](double value) { return fmt::format("{:.3f}", value); };
    const bool cached = all.setting.method == Method::cached;
    const bool maps = all.setting.method == Method::per_frame;
    table.add({all.scene, std::string(name_of(all.setting.method)),
               std::string(name_of(all.setting.model)), std::string(name_of(all.setting.spacing)),
               fmt::format("{}", all.setting.steps),
               maps ? fmt::format("{}", all.setting.shadow_map_px) : "-",
               maps ? taps_text(all.setting) : "-", fmt::format("{:g}", all.setting.tolerance_k),
               cached && all.setting.lateral ? "yes" : "no",
               fmt::format("{:.1f}{}", all.frame_ms,
                           all.pareto       ? " *"
                           : all.same_model ? "  "
                                            : " d"),
               k(all.kelvin.rms), k(all.kelvin.p99), k(all.kelvin.max), k(rows[i + 1].kelvin.max),
               k(rows[i + 2].kelvin.max), k(rows[i + 3].kelvin.p99), k(rows[i + 4].kelvin.p99)});
  }
  return table;
}

/// Writes the files that the command line asks for.
Result<void> write_files(const std::vector<std::string>& scenes, const ErrorOptions& command,
                         const Findings& findings) {
  if (command.csv) {
    if (auto written = write_csv(*command.csv, findings.rows); !written) return written;
  }
  if (command.plot) {
    std::vector<Plot> plots;
    for (const std::string& name : scenes) plots.push_back(plot_of(name, findings.rows));
    if (auto written = write_svg(*command.plot, plots); !written) return written;
  }
  if (!command.json) return {};
  Json results = Json::array();
  for (const Row& row : findings.rows) {
    results.push(row_json(row, command, findings.reference_text.at(row.scene)));
  }
  Json json = Json::object();
  Json left_out = Json::array();
  for (const LeftOut& each : findings.left_out) {
    Json entry = Json::object();
    entry.set("scene", each.scene).set("settings", each.settings).set("why", each.why);
    left_out.push(std::move(entry));
  }
  json.set("device", findings.device).set("commit", kCommit).set("suite", "error-vs-time");
  json.set("results", std::move(results)).set("left_out", std::move(left_out));
  return write_json(*command.json, json);
}

int run(const ErrorOptions& command) {
  const std::vector<std::string> scenes =
      command.scenes.empty()
          ? std::vector<std::string>{"block-on-road", "ribbed", "statue", "airfield"}
          : command.scenes;
  const InterruptGuard interrupt;
  Findings findings;
  for (const std::string& name : scenes) {
    if (auto ran = run_scene(name, command, findings); !ran) return fail(ran.error());
  }
  mark_pareto(findings.rows);
  fmt::print(text_stream(command.json),
             "{}, commit {}, {}x{}, * = none faster and better, d = with physics "
             "that the reference lacks\n{}{}",
             findings.device, kCommit, command.width_px, command.height_px,
             findings.references.to_string(), table_of(findings.rows).to_string());
  for (const LeftOut& each : findings.left_out) {
    fmt::print(text_stream(command.json), "{}: {} settings are left out: {}\n", each.scene,
               each.settings, each.why);
  }
  if (auto written = write_files(scenes, command, findings); !written) return fail(written.error());
  return kExitOk;
}

void add_options(CommandLine& line, ErrorOptions& options) {
  line.option("--scene", options.scenes,
              "Scenario; repeatable; default block-on-road, ribbed, statue, airfield")
      .repeatable();
  line.flag("--quick", options.quick, "Models, spacings and two step counts only");
  line.output_file("--csv", options.csv, "Write the results as CSV");
  line.output_file("--plot", options.plot, "Write the diagrams as SVG");
  line.output_folder("--figures", options.figures,
                     "Existing folder for pictures and profiles of reference and models",
                     CommandLine::OutputFolder::exists);
  line.option("--frames", options.frames, "Frames timed per setting").positive().show_default();
  add_image_size(line, options.width_px, options.height_px);
  line.option("--rays", options.rays, "Rays per face or pixel of the reference")
      .positive()
      .show_default();
  line.option("--refine", options.refine, "Refinement of the three-dimensional reference")
      .positive()
      .show_default();
  line.option("--pixels", options.pixels,
              "Surface pixels the reference solves (published figures: 20000 or more); 0: all")
      .show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_error(CommandLine& bench) {
  bench.command<ErrorOptions>(
      {.name = "error-vs-time",
       .text = "What every setting costs in time and in error against the reference solver",
       .example = "emit bench error-vs-time --json error.json --csv error.csv --plot error.svg"},
      add_options, run);
}

}  // namespace emit::tool
