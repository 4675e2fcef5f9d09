// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "emit/renderer/renderer.hpp"
#include "emit/scene/trajectory.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct RenderOptions {
  ScenarioChoice input;
  double time_s = 0.0;
  std::filesystem::path out;
  std::optional<std::filesystem::path> png;
  std::optional<std::filesystem::path> json;
  std::vector<std::string> channels;  ///< empty: all of temperature, depth, object
  std::string band;                   ///< empty: the scenario's first
  int gpu_index = -1;
};

double ms_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

bool wants(const RenderOptions& command, const char* channel) {
  return command.channels.empty() || std::find(command.channels.begin(), command.channels.end(),
                                               channel) != command.channels.end();
}

Json plane_json(std::span<const float> plane) {
  double low = INFINITY;
  double high = -INFINITY;
  double sum = 0.0;
  std::uint64_t finite = 0;
  for (const float value : plane) {
    if (!std::isfinite(value)) continue;
    const double v = static_cast<double>(value);
    low = std::min(low, v);
    high = std::max(high, v);
    sum += v;
    ++finite;
  }
  Json json = Json::object();
  json.set("finite_px", finite).set("min", low).set("max", high);
  json.set("mean", finite > 0 ? sum / static_cast<double>(finite) : NAN);
  return json;
}

/// Milliseconds that the steps of a run took.
struct Times {
  double setup_ms = 0.0;
  double warm_up_ms = 0.0;
  double frame_ms = 0.0;
};

/// Surfaces need only be fine enough for this frame, unless their state is shared with others.
void keep_only_view_at(std::int64_t sim_time_ns, scene::ScenarioDesc& scenario) {
  scene::Trajectory& way = scenario.sensor.trajectory;
  if (way.size() > 1 && scenario.thermal.state_file.empty()) {
    way = {{sim_time_ns, scene::trajectory_at(way, sim_time_ns).pose}};
  }
}

renderer::OutputOptions output_options(const RenderOptions& command) {
  renderer::OutputOptions output;
  output.temperature = wants(command, "temperature") || command.png.has_value();
  output.depth = wants(command, "depth");
  output.object = wants(command, "object");
  output.slots = 2;
  return output;
}

/// Errors: those of Renderer::warm_up().
physics::Result<void> warm_up(renderer::Renderer& renderer, const renderer::FrameRequest& first) {
  ProgressBar progress("warm-up", 1000);
  const InterruptGuard interrupt;
  return renderer.warm_up(first, [&progress](double done_frac) {
    progress.advance_to(static_cast<std::uint64_t>(1000.0 * done_frac));
    return !InterruptGuard::interrupted();
  });
}

physics::Result<void> write_files(const RenderOptions& command, const scene::ScenarioDesc& scenario,
                                  std::size_t band, const renderer::FrameView& view) {
  const scene::SpectralBand& shown = scenario.bands[band];
  FramePlanes planes;
  planes.width_px = view.width_px;
  planes.height_px = view.height_px;
  planes.radiance_w_m2_sr = view.radiance_w_m2_sr[band];
  planes.temperature_k = view.temperature_k;
  planes.depth_m = view.depth_m;
  planes.object_id = view.object_id;
  planes.metadata = {view.sim_time_ns, view.frame_number, view.sensor_pose, shown.name,
                     shown.lo_um,      shown.hi_um,       "W m-2 sr-1",     response_of(shown)};
  if (command.png) {
    const ColorLimits limits{scenario.display.min_k, scenario.display.max_k};
    if (auto done = write_frame_png(*command.png, planes, limits); !done) return done;
  }
  if (!wants(command, "temperature")) planes.temperature_k = {};
  return write_frame_exr(command.out, planes);
}

void print_frame(const RenderOptions& command, const std::string& band,
                 const renderer::Renderer& renderer, const renderer::FrameView& view,
                 const Times& times) {
  const renderer::SceneStats& scene = renderer.scene_stats();
  fmt::print(
      text_stream(command.json),
      "{}: {}x{}, sim time {:.3f} s, band {}, {} triangles, setup {:.0f} ms, warm-up {:.0f} ms{}, "
      "frame {:.1f} ms, {}\n",
      command.out.string(), view.width_px, view.height_px, command.time_s, band, scene.triangles,
      times.setup_ms, times.warm_up_ms,
      scene.samples > 0 ? fmt::format(" ({} thermal samples, {:.0f} MiB)", scene.samples,
                                      static_cast<double>(scene.sample_bytes) / (1 << 20))
                        : std::string(),
      times.frame_ms, renderer.device_name());
  for (const std::string& text : renderer::warm_up_warnings(scene)) warn(text);
  if (view.stats.nonfinite_px > 0) {
    warn(fmt::format("{} pixels were not finite and are written as 0", view.stats.nonfinite_px));
  }
  if (view.stats.clamped_px > 0) {
    warn(fmt::format("{} pixels lie outside a model's range", view.stats.clamped_px));
  }
}

Json frame_json(const RenderOptions& command, const scene::ScenarioDesc& scenario, std::size_t band,
                const renderer::Renderer& renderer, const renderer::FrameView& view,
                const Times& times) {
  Json json = Json::object();
  json.set("device", renderer.device_name()).set("scenario", scenario.name);
  json.set("sim_time_s", command.time_s).set("band", scenario.bands[band].name);
  json.set("width", view.width_px).set("height", view.height_px);
  json.set("triangles", renderer.scene_stats().triangles);
  json.set("setup_ms", times.setup_ms).set("warm_up_ms", times.warm_up_ms);
  json.set("frame_ms", times.frame_ms);
  json.set("samples", renderer.scene_stats().samples);
  json.set("sample_bytes", renderer.scene_stats().sample_bytes);
  json.set("nonfinite_px", view.stats.nonfinite_px);
  json.set("clamped_px", view.stats.clamped_px);
  json.set("radiance", plane_json(view.radiance_w_m2_sr[band]));
  if (!view.temperature_k.empty()) {
    const auto sky =
        std::ranges::count_if(view.temperature_k, [](float t) { return std::isnan(t); });
    json.set("surface_px", static_cast<std::int64_t>(view.temperature_k.size()) - sky);
    json.set("temperature", plane_json(view.temperature_k));
  }
  return json;
}

int run(const RenderOptions& command) {
  auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  const auto band = find_band(*scenario, command.band);
  if (!band) return fail(kExitUsage, band.error().text);
  if (!std::isfinite(command.time_s) || std::abs(command.time_s) > 9e9) {
    return fail(kExitUsage, "--time-s: not a time");
  }
  renderer::FrameRequest request;
  request.frame_number = 1;
  request.sim_time_ns = std::llround(command.time_s * 1e9);
  request.thermal_time_ns = request.sim_time_ns;
  keep_only_view_at(request.sim_time_ns, *scenario);

  Times times;
  auto start = std::chrono::steady_clock::now();
  const auto created =
      renderer::Renderer::create(*scenario, {command.gpu_index, false}, output_options(command));
  if (!created) return fail(created.error());
  renderer::Renderer& renderer = **created;
  times.setup_ms = ms_since(start);
  for (const std::string& text : renderer.scene_stats().warnings) warn(text);

  start = std::chrono::steady_clock::now();
  request.sensor_pose = renderer.scenario_sensor_pose_at(request.sim_time_ns);
  if (auto warm = warm_up(renderer, request); !warm) return fail(warm.error());
  times.warm_up_ms = ms_since(start);
  start = std::chrono::steady_clock::now();
  const int slot = renderer.submit(request);
  if (slot < 0) return fail(kExitFailure, "the renderer has no free slot");
  const renderer::FrameView& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
  times.frame_ms = ms_since(start);
  if (view.device_failed) {
    return fail(kExitFailure, "the device reported an error: the frame is not written");
  }

  if (auto done = write_files(command, *scenario, *band, view); !done) return fail(done.error());
  print_frame(command, scenario->bands[*band].name, renderer, view, times);
  if (command.json) {
    const Json json = frame_json(command, *scenario, *band, renderer, view, times);
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  renderer.release(static_cast<renderer::SlotIndex>(slot));
  return kExitOk;
}

void add_options(CommandLine& line, RenderOptions& options) {
  add_scenario(line, options.input, "scenario");
  line.seconds("--time-s", options.time_s, "Simulated time since the scenario's epoch, s")
      .required();
  line.path("--out", options.out, "OpenEXR file to write").required();
  line.path("--png", options.png, "False-colour temperature as PNG");
  line.option("--channel", options.channels,
              "Channel beside radiance: temperature, depth, object; repeatable; default all")
      .repeatable()
      .one_of({"temperature", "depth", "object"});
  line.option("--band", options.band, "Band of the radiance channel; default: the first")
      .type_name("NAME");
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_render(CommandLine& tool) {
  tool.command<RenderOptions>(
      {.name = "render",
       .text = "Render one frame of a scenario offline",
       .example = "emit render block-on-road --time-s 41400 --out road.exr --png road.png"},
      add_options, run);
}

}  // namespace emit::tool
