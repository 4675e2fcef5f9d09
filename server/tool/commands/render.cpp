// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "emit/renderer/renderer.hpp"
#include "emit/scene/trajectory.hpp"
#include "tool/commands/commands.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

double ms_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start)
      .count();
}

bool wants(const RenderCommand& command, const char* channel) {
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

}  // namespace

int run_render(const RenderCommand& command) {
  auto scenario = load_scenario_choice(command.input);
  if (!scenario) return fail_config(scenario.error());
  const auto band = find_band(*scenario, command.band);
  if (!band) return fail(kExitUsage, band.error().text);
  if (!std::isfinite(command.time_s) || std::abs(command.time_s) > 9e9) {
    return fail(kExitUsage, "--time-s: not a time");
  }

  // Surfaces need only be fine enough for this frame, unless their state is shared with others.
  scene::Trajectory& way = scenario->sensor.trajectory;
  const std::int64_t sim_time_ns = std::llround(command.time_s * 1e9);
  if (way.size() > 1 && scenario->thermal.state_file.empty()) {
    way = {{sim_time_ns, scene::trajectory_at(way, sim_time_ns).pose}};
  }

  renderer::OutputOptions output;
  output.temperature = wants(command, "temperature") || command.png.has_value();
  output.depth = wants(command, "depth");
  output.object = wants(command, "object");
  output.slots = 2;
  auto start = std::chrono::steady_clock::now();
  const auto created = renderer::Renderer::create(*scenario, {command.gpu_index, false}, output);
  if (!created) return fail(created.error());
  renderer::Renderer& renderer = **created;
  const double setup_ms = ms_since(start);
  for (const std::string& text : renderer.scene_stats().warnings) warn(text);

  start = std::chrono::steady_clock::now();
  renderer::FrameRequest request;
  request.frame_number = 1;
  request.sim_time_ns = sim_time_ns;
  request.thermal_time_ns = request.sim_time_ns;
  request.sensor_pose = renderer.scenario_sensor_pose_at(request.sim_time_ns);
  {
    ProgressBar progress("warm-up", 1000);
    const InterruptGuard interrupt;
    const auto warm = renderer.warm_up(request, [&progress](double done_frac) {
      progress.advance_to(static_cast<std::uint64_t>(1000.0 * done_frac));
      return !InterruptGuard::interrupted();
    });
    if (!warm) return fail(warm.error());
  }
  const double warm_up_ms = ms_since(start);
  start = std::chrono::steady_clock::now();
  const int slot = renderer.submit(request);
  if (slot < 0) return fail(kExitFailure, "the renderer has no free slot");
  const renderer::FrameView& view = renderer.collect(static_cast<renderer::SlotIndex>(slot));
  const double frame_ms = ms_since(start);
  if (view.device_failed) {
    return fail(kExitFailure, "the device reported an error: the frame is not written");
  }

  const scene::SpectralBand& shown = scenario->bands[*band];
  FramePlanes planes;
  planes.width_px = view.width_px;
  planes.height_px = view.height_px;
  planes.radiance_w_m2_sr = view.radiance_w_m2_sr[*band];
  planes.temperature_k = view.temperature_k;
  planes.depth_m = view.depth_m;
  planes.object_id = view.object_id;
  planes.metadata = {request.sim_time_ns, request.frame_number, view.sensor_pose,
                     shown.name,          shown.lo_um,          shown.hi_um,
                     "W m-2 sr-1",        response_of(shown)};
  if (command.png) {
    const ColorLimits limits{scenario->display.min_k, scenario->display.max_k};
    if (auto done = write_frame_png(*command.png, planes, limits); !done) return fail(done.error());
  }
  if (!wants(command, "temperature")) planes.temperature_k = {};
  if (auto done = write_frame_exr(command.out, planes); !done) return fail(done.error());

  fmt::print(
      text_stream(command.json),
      "{}: {}x{}, sim time {:.3f} s, band {}, {} triangles, setup {:.0f} ms, warm-up {:.0f} ms{}, "
      "frame {:.1f} ms, {}\n",
      command.out.string(), view.width_px, view.height_px, command.time_s, shown.name,
      renderer.scene_stats().triangles, setup_ms, warm_up_ms,
      renderer.scene_stats().samples > 0
          ? fmt::format(" ({} thermal samples, {:.0f} MiB)", renderer.scene_stats().samples,
                        static_cast<double>(renderer.scene_stats().sample_bytes) / (1 << 20))
          : std::string(),
      frame_ms, renderer.device_name());
  for (const std::string& text : renderer::warm_up_warnings(renderer.scene_stats())) warn(text);
  if (view.stats.nonfinite_px > 0) {
    warn(fmt::format("{} pixels were not finite and are written as 0", view.stats.nonfinite_px));
  }
  if (view.stats.clamped_px > 0) {
    warn(fmt::format("{} pixels lie outside a model's range", view.stats.clamped_px));
  }
  if (command.json) {
    Json json = Json::object();
    json.set("device", renderer.device_name()).set("scenario", scenario->name);
    json.set("sim_time_s", command.time_s).set("band", shown.name);
    json.set("width", view.width_px).set("height", view.height_px);
    json.set("triangles", renderer.scene_stats().triangles);
    json.set("setup_ms", setup_ms).set("warm_up_ms", warm_up_ms).set("frame_ms", frame_ms);
    json.set("samples", renderer.scene_stats().samples);
    json.set("sample_bytes", renderer.scene_stats().sample_bytes);
    json.set("nonfinite_px", view.stats.nonfinite_px);
    json.set("clamped_px", view.stats.clamped_px);
    json.set("radiance", plane_json(planes.radiance_w_m2_sr));
    if (!view.temperature_k.empty()) {
      const auto sky =
          std::ranges::count_if(view.temperature_k, [](float t) { return std::isnan(t); });
      json.set("surface_px", static_cast<std::int64_t>(view.temperature_k.size()) - sky);
      json.set("temperature", plane_json(view.temperature_k));
    }
    if (auto done = write_json(*command.json, json); !done) return fail(done.error());
  }
  renderer.release(static_cast<renderer::SlotIndex>(slot));
  return kExitOk;
}

}  // namespace emit::tool
