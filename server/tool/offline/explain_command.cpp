// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/explain_command.hpp"

#include <fmt/format.h>

#include <sched.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "emit/physics/apparent_temperature.hpp"
#include "emit/renderer/devices.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/offline/equilibrium.hpp"
#include "tool/offline/explain_report.hpp"
#include "tool/offline/offline_frames.hpp"
#include "tool/offline/probe_points.hpp"
#include "tool/offline/probe_run.hpp"
#include "tool/offline/recorded_run.hpp"
#include "tool/report/html_page.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using physics::Result;

struct ExplainOptions {
  ScenarioChoice input;
  std::optional<double> time_s;
  std::optional<std::filesystem::path> run;
  std::optional<std::uint64_t> frame;
  std::string px;
  double hours = 24.0;
  bool background = false;
  std::optional<std::filesystem::path> json;
  std::optional<std::filesystem::path> html;
  int gpu_index = -1;
};

/// Lets every other program go first, now and in the threads that begin later.
void go_into_background() {
  constexpr int kNice = 19;
  ::setpriority(PRIO_PROCESS, 0, kNice);
  const sched_param none{};
  // The nice value remains if the kernel refuses the idle class.
  static_cast<void>(::sched_setscheduler(0, SCHED_IDLE, &none));
}

/// Renders the pixel and splits its radiance.
Result<void> explain_frame(scene::ScenarioDesc& scenario, const ProbeFinder& finder,
                           const ProbePoint& pixel, int gpu_index, Explanation& found,
                           std::optional<ProbePlace>& place) {
  std::vector<OfflineShot> shots = sensor_shots(scenario, std::span(&found.time_s, 1));
  shots[0].window_px = {pixel.x_px, pixel.y_px, 1, 1};
  place = finder.place(pixel, shots[0].sim_time_ns, shots[0].sensor_pose);
  renderer::OutputOptions output;
  output.temperature = output.depth = output.object = output.sun = output.sky = output.terms = true;
  output.coverage = scenario.sensor.small_target_px > 0.0;
  output.slots = 2;
  auto frames = OfflineFrames::create(scenario, shots, output, gpu_index);
  if (!frames) return tl::unexpected(std::move(frames.error()));
  const auto next = (*frames)->next();
  if (!next) return tl::unexpected(next.error());
  const renderer::FrameView& view = **next;
  const std::size_t i = std::size_t{pixel.y_px} * view.width_px + pixel.x_px;
  if (!view.coverage_frac.empty() && view.coverage_frac[i] > 0.0F) {
    // A pixel of a small target is a mean over many samples, so it is drawn again like all others.
    warn(
        "the pixel shows a small target, which is drawn with one sample per pixel here "
        "(sensor.small_target_px = 0)");
    scenario.sensor.small_target_px = 0.0;
    frames->reset();
    return explain_frame(scenario, finder, pixel, gpu_index, found, place);
  }
  if (std::isfinite(view.depth_m[i])) {
    ExplainedSurface surface;
    const scene::ObjectDesc& object =
        scenario.objects[static_cast<std::size_t>(view.object_id[i]) - 1];
    surface.object = object.name;
    surface.is_entity = object.entity_id != 0;
    surface.material_index = static_cast<std::size_t>(view.material[i]);
    surface.material = finder.material_name(surface.material_index);
    const glm::dvec3 ray = shots[0].sensor_pose.world_from_body *
                           pixel_direction_body(scenario.sensor, pixel.x_px, pixel.y_px);
    const glm::dvec3 boresight = shots[0].sensor_pose.world_from_body * glm::dvec3(1.0, 0.0, 0.0);
    surface.range_m = static_cast<double>(view.depth_m[i]) / glm::dot(ray, boresight);
    surface.position_m = shots[0].sensor_pose.position_world_m + surface.range_m * ray;
    if (place) {
      surface.normal = place->normal;
    } else {
      warn(
          "a ray finds no surface in the pixel: its reflected sky is that of an upright face, and "
          "it "
          "has no history");
    }
    surface.temperature_k = static_cast<double>(view.temperature_k[i]);
    surface.clutter_sd = static_cast<double>(view.clutter_sd[i]);
    surface.clutter_k = static_cast<double>(view.clutter_k[i]);
    surface.cloud_sun = static_cast<double>(view.clouds[i]);
    surface.sky_frac = static_cast<double>(view.sky_frac[i]);
    surface.sun_cosine = static_cast<double>(view.sun_cosine[i]);
    found.surface = surface;
  } else {
    found.cloud_frac = static_cast<double>(view.clouds[i]);
  }
  found.clouds = scenario.clouds.has_value();
  const std::vector<renderer::RadianceTerms> terms = (*frames)->renderer().radiance_terms(
      view, found.px, found.surface ? found.surface->normal.z : 1.0);
  for (std::size_t b = 0; b < scenario.bands.size(); ++b) {
    const float pixel_w_m2_sr = view.radiance_w_m2_sr[b][i];
    const physics::ApparentTemperature apparent(scene::spectral_band(scenario.bands[b]));
    found.bands.push_back({scenario.bands[b].name, static_cast<double>(pixel_w_m2_sr),
                           static_cast<double>(apparent.k(pixel_w_m2_sr)), terms[b]});
    constexpr double kSameFrac = 1e-4;
    if (std::abs(terms[b].sum_w_m2_sr() - static_cast<double>(pixel_w_m2_sr)) >
        kSameFrac * std::abs(static_cast<double>(pixel_w_m2_sr))) {
      warn(fmt::format("band '{}': the terms add up to {:.6g}, the pixel holds {:.6g} W m-2 sr-1",
                       scenario.bands[b].name, terms[b].sum_w_m2_sr(), pixel_w_m2_sr));
    }
  }
  return {};
}

/// Adds what the surface would take without memory to its history. An entity has the film of its
/// own flow, which only the renderer knows.
Result<void> add_equilibrium(const scene::ScenarioDesc& scenario, const ProbeFinder& finder,
                             Explanation& found) {
  const ProbeRun& run = *found.history;
  found.equilibrium_k.assign(run.rows().size(), std::numeric_limits<double>::quiet_NaN());
  if (!found.surface || found.surface->is_entity) return {};
  const auto model = Equilibrium::create(scenario, finder.materials());
  if (!model) return tl::unexpected(model.error());
  const auto forcing = ProbeForcing::create(scenario, run.times_s());
  if (!forcing) return tl::unexpected(forcing.error());
  for (std::size_t i = 0; i < run.rows().size(); ++i) {
    const ProbeRow& row = run.rows()[i];
    if (!row.place) continue;
    found.equilibrium_k[i] = model->at_k(found.surface->material_index, forcing->at(i),
                                         {row.place->normal, row.sun_w_m2, row.sky_frac});
  }
  return {};
}

/// Finds the instant that is asked for. A recorded run changes the scenario.
Result<double> instant_of(const ExplainOptions& command, scene::ScenarioDesc& scenario) {
  if (!command.run) {
    if (!command.time_s) {
      return physics::make_error(physics::ErrorCode::invalid_argument,
                                 "--time-s says which instant, or --run a recorded run");
    }
    if (auto time_ns = sim_time_ns("--time-s", command.time_s); !time_ns) {
      return tl::unexpected(std::move(time_ns.error()));
    }
    return *command.time_s;
  }
  const auto frame = follow_recording(*command.run, command.frame, scenario);
  if (!frame) return tl::unexpected(frame.error());
  for (const std::string& note : frame->notes) warn(note);
  return 1e-9 * static_cast<double>(frame->sim_time_ns);
}

Result<Explanation> explain(const ExplainOptions& command, scene::ScenarioDesc scenario) {
  const InterruptGuard interrupt;
  const int gpu_index = command.background ? renderer::kSoftwareDevice : command.gpu_index;
  const auto instant_s = instant_of(command, scenario);
  if (!instant_s) return tl::unexpected(instant_s.error());
  const double time_s = *instant_s;
  const auto finder = ProbeFinder::create(scenario);
  if (!finder) return tl::unexpected(finder.error());
  const auto points = finder->read("px:" + command.px);
  if (!points) return tl::unexpected(physics::Error(points.error()).with_context("--px"));
  const ProbePoint& pixel = points->front();
  Explanation found{scenario.name, scenario.epoch_utc_ns, time_s, {pixel.x_px, pixel.y_px}};
  std::optional<ProbePlace> place;
  if (auto done = explain_frame(scenario, *finder, pixel, gpu_index, found, place); !done) {
    return tl::unexpected(std::move(done.error()));
  }
  // Read the history of the place on its body, as far back as the surface has one.
  const double first_s = std::max(time_s - 3600.0 * command.hours,
                                  1e-9 * static_cast<double>(scenario.thermal.history_start_ns));
  if (!place || first_s >= time_s) return found;
  constexpr double kStepS = 600.0;
  constexpr double kMostSteps = 48.0;
  const auto steps = static_cast<int>(std::min(std::ceil((time_s - first_s) / kStepS), kMostSteps));
  std::vector<double> times_s;
  for (int i = 0; i <= steps; ++i) {
    times_s.push_back(std::lerp(first_s, time_s, double{1} * i / steps));
  }
  scenario.sensor.small_target_px = 0.0;  // the history is that of the place alone
  // The history is that of the mean material: what the clutter adds is known for this pixel alone.
  for (scene::Material& material : scenario.materials) material.clutter.reset();
  ProbeRun run(scenario, std::move(times_s),
               {finder->follow(*place, std::llround(1e9 * time_s), pixel.name)});
  // The frame has told what the scenario lacks, and this run begins where the history does.
  if (auto done = run.run(*finder, gpu_index, SceneWarnings::known); !done) {
    return tl::unexpected(std::move(done.error()));
  }
  // The history is seen along the normal. Beside an edge the two pictures differ.
  constexpr double kSameK = 0.5;
  const double last_k = run.rows().back().temperature_k;
  const double clutter_k = found.surface ? found.surface->clutter_k : 0.0;
  if (found.surface && !(std::abs(last_k + clutter_k - found.surface->temperature_k) <= kSameK)) {
    warn(fmt::format(
        "the pixel lies beside an edge: it shows {:.3f} K, its history ends at {:.3f} K",
        found.surface->temperature_k, last_k));
  }
  found.history = std::move(run);
  if (auto added = add_equilibrium(scenario, *finder, found); !added) {
    return tl::unexpected(std::move(added.error()));
  }
  return found;
}

int run(const ExplainOptions& command) {
  if (command.background) go_into_background();
  const auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  const auto found = explain(command, *scenario);
  if (!found) return fail_call(found.error());
  fmt::print(text_stream(command.json), "{}", explain_text(*found));
  if (command.json) {
    if (auto done = write_json(*command.json, explain_json(*found)); !done) {
      return fail(done.error());
    }
  }
  if (command.html) {
    if (auto done = write_html(*command.html, explain_page(*found)); !done) {
      return fail(done.error());
    }
  }
  return kExitOk;
}

void add_options(CommandLine& line, ExplainOptions& options) {
  add_scenario(line, options.input, "scenario");
  Option time = line.option("--time-s", options.time_s, "Simulation time").type_name("S");
  Option run = line.path("--run", options.run,
                         "Journal of a run of the scenario: its newest image is explained, with "
                         "the sensor, entities and weather that the host gave it")
                   .excludes(time);
  line.option("--frame", options.frame, "Number of another image of that run")
      .type_name("N")
      .needs(run);
  line.option("--px", options.px, "Pixel, from 0,0 at the top left").type_name("X,Y").required();
  line.option("--hours", options.hours,
              "Length of the surface's history, at most the scenario's thermal history; 0: none")
      .in_range(0.0, 240.0)
      .show_default();
  add_json(line, options.json);
  line.output_file("--html", options.html, "Page with the terms and the history");
  line.flag("--background", options.background,
            "Let all other programs go first, and leave the graphics processor to them: Mesa's "
            "software renderer draws, whatever --gpu says");
  add_gpu(line, options.gpu_index);
  line.footer(
      "The terms are emission, what the surface reflects of sky, neighbours (bodies, ground and "
      "surroundings) and sun, each behind the air, and the path: the air in between. In a pixel of "
      "the sky the path is the sky. They are computed anew from what the pixel shows, and add up "
      "to "
      "the pixel of emit render.\n"
      "equilibrium is the temperature that the surface would take without memory; it is given for "
      "scenery of the model foster that is no sheet.\n"
      "Example: emit explain block-on-road --time-s 12600 --px 320,256 --html pixel.html");
}

}  // namespace

void add_explain(CommandLine& tool) {
  tool.command<ExplainOptions>(
      {.name = "explain",
       .text = "Where a pixel's radiance comes from, and how its surface came to its temperature",
       .example = "emit explain block-on-road --time-s 12600 --px 320,256"},
      add_options, run);
}

}  // namespace emit::tool
