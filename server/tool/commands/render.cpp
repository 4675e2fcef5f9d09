// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "agents/channel_table.hpp"
#include "emit/renderer/renderer.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/commands/commands.hpp"
#include "tool/offline/film.hpp"
#include "tool/offline/offline_frames.hpp"
#include "tool/offline/preview.hpp"
#include "tool/offline/time_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/output_check.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

struct RenderOptions {
  ScenarioChoice input;
  TimeChoice times;
  std::filesystem::path out;
  std::optional<std::filesystem::path> png;
  std::string png_of = "apparent";
  std::optional<std::filesystem::path> film;
  double film_rate_hz = 10.0;
  std::optional<std::filesystem::path> json;
  std::vector<std::string> channels;  ///< empty: temperature, depth, object
  std::vector<std::string> bands;     ///< empty: the scenario's first
  std::string output_of;              ///< [[channel]] whose frames are written; empty: the scene's
  std::string quality = "full";
  int gpu_index = -1;
};

/// Frames of one run: an image at every instant, which all bands take their radiance from.
struct Plan {
  std::vector<double> times_s;     ///< ascending
  std::vector<std::size_t> bands;  ///< indices into the scenario's bands
  FrameFileNames exr_names;
  std::optional<FrameFileNames> png_names;
  /// Channel whose frames are written in place of the scene's, the only one of its table.
  std::optional<server::ChannelTable> output;
};

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

/// Returns the channel that `emit render` shows as clients get it, alone in its table.
/// Errors: invalid_argument (no channel has that name, or it has a camera of its own); those of
/// server::make_channels().
physics::Result<server::ChannelTable> output_channel(const std::string& name,
                                                     const scene::ScenarioDesc& scenario) {
  scene::ScenarioDesc alone = scenario;
  std::erase_if(alone.channels, [&](const auto& channel) { return channel.name != name; });
  const auto fail = [](std::string text) {
    return physics::make_error(physics::ErrorCode::invalid_argument, std::move(text));
  };
  if (alone.channels.empty()) {
    std::string known;
    for (const scene::ChannelDesc& channel : scenario.channels) {
      known += (known.empty() ? "" : ", ") + channel.name;
    }
    return fail(
        fmt::format("--output-of: the scenario has no channel '{}' (it has: {})", name, known));
  }
  if (alone.channels.front().camera != scene::ChannelCamera{}) {
    return fail(
        fmt::format("--output-of: channel '{}' has a camera of its own, which only emitd "
                    "places",
                    name));
  }
  server::SourceInfo source;
  source.width_px = scenario.sensor.width_px;
  source.height_px = scenario.sensor.height_px;
  source.planes = scenario.bands.size();
  source.slots = 1;
  return server::make_channels(alone, source);
}

/// Errors: invalid_argument (a time that is none, a band or a channel that the scenario does not
/// have); those of output_channel().
physics::Result<Plan> make_plan(const RenderOptions& command, const scene::ScenarioDesc& scenario) {
  auto resolved = resolve_times(command.times, scenario);
  if (!resolved) return tl::unexpected(std::move(resolved.error()));
  const std::vector<double>& times_s = *resolved;
  std::vector<std::size_t> bands;
  const std::vector<std::string> first{""};
  for (const std::string& name : command.bands.empty() ? first : command.bands) {
    const auto band = find_band(scenario, name);
    if (!band) return tl::unexpected(band.error());
    if (std::ranges::find(bands, *band) == bands.end()) bands.push_back(*band);
  }
  std::optional<server::ChannelTable> output;
  if (!command.output_of.empty()) {
    if (!command.bands.empty() || !command.channels.empty()) {
      return physics::make_error(physics::ErrorCode::invalid_argument,
                                 "--output-of takes neither --band nor --channel: the channel has "
                                 "its band, and its frames have one quantity");
    }
    auto made = output_channel(command.output_of, scenario);
    if (!made) return tl::unexpected(std::move(made.error()));
    bands = {made->pictures.front().plane};
    output = std::move(*made);
  }
  const auto names = [&](const std::filesystem::path& pattern) {
    return FrameFileNames(pattern, times_s.size() > 1, bands.size() > 1);
  };
  Plan plan{times_s, bands, names(command.out), std::nullopt, std::move(output)};
  if (command.png) plan.png_names = names(*command.png);
  return plan;
}

/// Checks the names of the files before the scenario is read. Errors: those of check_image_name()
/// and Film::check(), naming the option.
physics::Result<void> check_names(const RenderOptions& command) {
  if (auto exr = check_image_name(command.out, ImageFormat::exr); !exr) {
    return tl::unexpected(std::move(exr.error()).with_context("--out"));
  }
  if (command.png) {
    if (auto png = check_image_name(*command.png, ImageFormat::png); !png) {
      return tl::unexpected(std::move(png.error()).with_context("--png"));
    }
  }
  if (command.film) {
    if (auto film = Film::check(*command.film); !film) {
      return tl::unexpected(std::move(film.error()).with_context("--film"));
    }
  }
  return {};
}

/// Errors: io, naming the option and the file that cannot be written.
physics::Result<void> check_outputs(const Plan& plan, const scene::ScenarioDesc& scenario) {
  for (const double time_s : plan.times_s) {
    for (const std::size_t band : plan.bands) {
      const std::string& name = scenario.bands[band].name;
      if (auto exr = check_output_file(plan.exr_names.file(time_s, name)); !exr) {
        return tl::unexpected(std::move(exr.error()).with_context("--out"));
      }
      if (!plan.png_names) continue;
      if (auto png = check_output_file(plan.png_names->file(time_s, name)); !png) {
        return tl::unexpected(std::move(png.error()).with_context("--png"));
      }
    }
  }
  return {};
}

renderer::OutputOptions output_options(const RenderOptions& command) {
  renderer::OutputOptions output;
  output.temperature =
      wants(command, "temperature") ||
      ((command.png || command.film) && png_quantity(command.png_of) == PngQuantity::temperature);
  output.depth = wants(command, "depth");
  output.object = wants(command, "object");
  output.coverage = std::ranges::find(command.channels, "coverage") != command.channels.end();
  output.slots = 2;
  return output;
}

/// One run: it renders the plan and writes files, lines and JSON.
class Rendering {
 public:
  Rendering(const RenderOptions& command, const scene::ScenarioDesc& scenario, Plan& plan)
      : command_(command), scenario_(scenario), plan_(plan), apparent_(scenario.bands.size()) {}
  /// Errors: those of the renderer; io.
  [[nodiscard]] physics::Result<void> run();

 private:
  [[nodiscard]] physics::Result<void> render(double time_s);
  [[nodiscard]] physics::Result<void> write_files(double time_s, std::size_t band,
                                                  const renderer::FrameView& view);
  void print_frame(double time_s, std::size_t band, const renderer::FrameView& view) const;
  void print_warnings(const renderer::FrameView& view) const;
  [[nodiscard]] Json run_json() const;
  [[nodiscard]] Json frame_json(double time_s, std::size_t band,
                                const renderer::FrameView& view) const;
  /// Puts the frame of the plan's channel in place of the scene's. Returns what it holds.
  [[nodiscard]] Json show_output(const renderer::FrameView& view, FramePlanes& planes);
  [[nodiscard]] physics::Result<void> write_pictures(double time_s, std::size_t band,
                                                     FramePlanes& planes);
  [[nodiscard]] physics::Result<void> write_json_file() const;

  const RenderOptions& command_;
  const scene::ScenarioDesc& scenario_;
  Plan& plan_;
  std::vector<std::optional<ApparentTemperature>> apparent_;  ///< of the bands that were shown
  std::unique_ptr<OfflineFrames> frames_;
  std::optional<Film> film_;
  std::vector<Json> json_frames_;
  Json json_output_;  ///< of the latest frame of the plan's channel
};

/// Writes the PNG and the picture of the film.
physics::Result<void> Rendering::write_pictures(double time_s, std::size_t band,
                                                FramePlanes& planes) {
  const bool filmed = film_ && band == plan_.bands.front();
  if (!plan_.png_names && !filmed) return {};
  const scene::SpectralBand& shown = scenario_.bands[band];
  const PngStyle style{scenario_.display.min_k, scenario_.display.max_k,
                       png_quantity(command_.png_of)};
  if (style.quantity == PngQuantity::apparent && !apparent_[band]) {
    apparent_[band].emplace(scene::spectral_band(shown));
  }
  planes.apparent = apparent_[band] ? &*apparent_[band] : nullptr;
  if (plan_.png_names) {
    const auto file = plan_.png_names->file(time_s, shown.name);
    if (auto done = write_frame_png(file, planes, style); !done) return done;
  }
  if (!filmed) return {};
  return write_frame_png(film_->next_picture(), planes, style);
}

Json Rendering::show_output(const renderer::FrameView& view, FramePlanes& planes) {
  server::Picture& picture = plan_.output->pictures.front();
  const server::Channel& channel = plan_.output->channels.front();
  const server::TakenPicture taken =
      server::take_picture(picture, view, 0, {{}, view.frame_number});
  const protocol::PixelQuantity quantity = channel.quantity;
  planes.width_px = channel.width_px;
  planes.height_px = channel.height_px;
  planes.radiance_w_m2_sr = {};
  planes.temperature_k = {};
  planes.depth_m = {};
  planes.object_id = {};
  planes.coverage_frac = {};
  plane_of(planes, quantity) = taken.pixels;
  planes.metadata.units = pixel_unit(quantity);
  planes.output_steps = channel.output_steps;
  if ((channel.output_steps & protocol::kOutputMoved) == 0) planes.window_px = picture.window_px;
  planes.sensor_width_px = view.width_px;
  planes.sensor_height_px = view.height_px;
  if (taken.clamped_px > 0) {
    warn(fmt::format("{} pixels of channel '{}' lie outside the range of its output",
                     taken.clamped_px, channel.name));
  }
  Json json = plane_json(taken.pixels);
  json.set("channel", channel.name).set("unit", planes.metadata.units);
  json.set("width", channel.width_px).set("height", channel.height_px);
  json.set("clamped_px", taken.clamped_px);
  return json;
}

physics::Result<void> Rendering::write_files(double time_s, std::size_t band,
                                             const renderer::FrameView& view) {
  const scene::SpectralBand& shown = scenario_.bands[band];
  FramePlanes planes;
  planes.width_px = view.width_px;
  planes.height_px = view.height_px;
  planes.radiance_w_m2_sr = view.radiance_w_m2_sr[band];
  planes.temperature_k = view.temperature_k;
  planes.depth_m = view.depth_m;
  planes.object_id = view.object_id;
  planes.coverage_frac = view.coverage_frac;
  planes.metadata = {
      view.sim_time_ns, view.frame_number, view.sensor_pose, shown.name,
      shown.lo_um,      shown.hi_um,       "W m-2 sr-1",     scene::spectral_band(shown).response,
      view.fov_h_rad};
  if (plan_.output) json_output_ = show_output(view, planes);
  if (auto done = write_pictures(time_s, band, planes); !done) return done;
  if (!wants(command_, "temperature")) planes.temperature_k = {};
  return write_frame_exr(plan_.exr_names.file(time_s, shown.name), planes);
}

void Rendering::print_frame(double time_s, std::size_t band,
                            const renderer::FrameView& view) const {
  const renderer::SceneStats& scene = frames_->renderer().scene_stats();
  const std::string& name = scenario_.bands[band].name;
  fmt::print(
      text_stream(command_.json),
      "{}: {}x{}, sim time {:.3f} s, band {}, {} triangles, setup {:.0f} ms, warm-up {:.0f} ms{}, "
      "frame {:.1f} ms, {}\n",
      plan_.exr_names.file(time_s, name).string(), view.width_px, view.height_px, time_s, name,
      scene.triangles, frames_->setup_ms(), frames_->warm_up_ms(),
      scene.samples > 0 ? fmt::format(" ({} thermal samples, {:.0f} MiB)", scene.samples,
                                      static_cast<double>(scene.sample_bytes) / (1 << 20))
                        : std::string(),
      frames_->frame_ms(), frames_->renderer().device_name());
}

void Rendering::print_warnings(const renderer::FrameView& view) const {
  const std::string frame =
      plan_.times_s.size() > 1
          ? fmt::format("sim time {:.3f} s: ", 1e-9 * static_cast<double>(view.sim_time_ns))
          : std::string();
  if (!view.depth_m.empty() &&
      std::ranges::all_of(view.depth_m, [](float depth) { return std::isinf(depth); })) {
    warn(fmt::format("{}the view shows nothing but sky", frame));
  }
  if (view.stats.nonfinite_px > 0) {
    warn(fmt::format("{}{} pixels were not finite and are written as 0", frame,
                     view.stats.nonfinite_px));
  }
  if (view.stats.clamped_px > 0) {
    warn(fmt::format("{}{} pixels lie outside a model's range", frame, view.stats.clamped_px));
  }
  if (view.stats.plain_targets > 0) {
    warn(
        fmt::format("{}{} small targets are too many for windows of their own and have one sample "
                    "per pixel",
                    frame, view.stats.plain_targets));
  }
  for (std::size_t i = 0; i < renderer::kCoarseReasons; ++i) {
    if (!view.stats.coarse[i]) continue;
    const auto reason = static_cast<renderer::CoarseReason>(i);
    warn(fmt::format("{}{}: {}", frame, renderer::name_of(reason), renderer::text_of(reason)));
  }
  for (std::size_t i = 0; i < renderer::kHeatLimits; ++i) {
    if (!view.stats.heat_limits[i]) continue;
    const auto limit = static_cast<renderer::HeatLimit>(i);
    const bool no_rain = limit == renderer::HeatLimit::rain_unknown &&
                         scenario_.thermal.model == scene::ThermalModel::emit2014;
    warn(fmt::format("{}{}: {}", frame, renderer::name_of(limit),
                     no_rain ? "it rained, and thermal.model \"emit2014\" has no rain"
                             : renderer::text_of(limit)));
  }
}

Json Rendering::run_json() const {
  const renderer::SceneStats& scene = frames_->renderer().scene_stats();
  Json json = Json::object();
  json.set("device", frames_->renderer().device_name()).set("scenario", scenario_.name);
  json.set("quality", command_.quality);
  json.set("triangles", scene.triangles);
  json.set("setup_ms", frames_->setup_ms()).set("warm_up_ms", frames_->warm_up_ms());
  json.set("samples", scene.samples).set("sample_bytes", scene.sample_bytes);
  return json;
}

Json Rendering::frame_json(double time_s, std::size_t band, const renderer::FrameView& view) const {
  Json json = Json::object();
  json.set("sim_time_s", time_s).set("band", scenario_.bands[band].name);
  json.set("width", view.width_px).set("height", view.height_px);
  json.set("frame_ms", frames_->frame_ms());
  json.set("nonfinite_px", view.stats.nonfinite_px);
  json.set("clamped_px", view.stats.clamped_px);
  json.set("plain_targets", view.stats.plain_targets);
  Json limits = Json::array();
  for (std::size_t i = 0; i < renderer::kHeatLimits; ++i) {
    if (!view.stats.heat_limits[i]) continue;
    limits.push(Json(std::string(renderer::name_of(static_cast<renderer::HeatLimit>(i)))));
  }
  json.set("heat_limits", std::move(limits));
  Json coarse = Json::array();
  for (std::size_t i = 0; i < renderer::kCoarseReasons; ++i) {
    if (!view.stats.coarse[i]) continue;
    coarse.push(Json(std::string(renderer::name_of(static_cast<renderer::CoarseReason>(i)))));
  }
  json.set("coarse", std::move(coarse));
  json.set("radiance", plane_json(view.radiance_w_m2_sr[band]));
  if (!view.temperature_k.empty()) {
    const auto sky =
        std::ranges::count_if(view.temperature_k, [](float t) { return std::isnan(t); });
    json.set("surface_px", static_cast<std::int64_t>(view.temperature_k.size()) - sky);
    json.set("temperature", plane_json(view.temperature_k));
  }
  return json;
}

/// One frame has its keys beside those of the run. `frames` has those of every frame.
physics::Result<void> Rendering::write_json_file() const {
  if (!command_.json) return {};
  Json json = run_json();
  if (json_frames_.size() == 1) json.merge(json_frames_.front());
  Json frames = Json::array();
  for (const Json& frame : json_frames_) frames.push(frame);
  json.set("frames", std::move(frames));
  return write_json(*command_.json, json);
}

physics::Result<void> Rendering::render(double time_s) {
  const auto rendered = frames_->next();
  if (!rendered) return tl::unexpected(rendered.error());
  const renderer::FrameView& view = **rendered;
  frames_->clear_bar();
  for (const std::size_t band : plan_.bands) {
    if (auto done = write_files(time_s, band, view); !done) return done;
    print_frame(time_s, band, view);
    Json json = frame_json(time_s, band, view);
    const std::string& name = scenario_.bands[band].name;
    json.set("file", plan_.exr_names.file(time_s, name).string());
    if (plan_.output) json.set("output", std::move(json_output_));
    json_frames_.push_back(std::move(json));
  }
  print_warnings(view);
  return {};
}

physics::Result<void> Rendering::run() {
  const InterruptGuard interrupt;
  if (command_.film) {
    film_.emplace(*command_.film, command_.film_rate_hz);
    if (auto begun = film_->begin(); !begun) return begun;
  }
  auto frames = OfflineFrames::create(scenario_, sensor_shots(scenario_, plan_.times_s),
                                      output_options(command_), command_.gpu_index);
  if (!frames) return tl::unexpected(std::move(frames.error()));
  frames_ = std::move(*frames);
  for (const double time_s : plan_.times_s) {
    if (auto rendered = render(time_s); !rendered) return rendered;
  }
  if (film_) {
    if (auto made = film_->finish(); !made) return made;
    fmt::print(text_stream(command_.json), "{}: {} pictures, {:g} a second\n",
               command_.film->string(), plan_.times_s.size(), command_.film_rate_hz);
  }
  return write_json_file();
}

int run(const RenderOptions& command) {
  if (auto named = check_names(command); !named) return fail_call(named.error());
  ScenarioChoice input = command.input;
  if (command.quality == "preview") set_preview(input.set);
  const auto scenario = load_scenario_choice(input);
  if (!scenario) return fail_config(scenario.error());
  auto plan = make_plan(command, *scenario);
  if (!plan) {
    return plan.error().code == physics::ErrorCode::invalid_argument
               ? fail(kExitUsage, plan.error().text)
               : fail_config(plan.error());
  }
  if (auto writable = check_outputs(*plan, *scenario); !writable) return fail(writable.error());
  if (command.quality == "preview") fmt::print(text_stream(command.json), kPreviewText);
  if (auto done = Rendering(command, *scenario, *plan).run(); !done) return fail(done.error());
  return kExitOk;
}

void add_options(CommandLine& line, RenderOptions& options) {
  add_scenario(line, options.input, "scenario");
  add_times(
      line, "emit render", options.times,
      "repeatable: all times are rendered after one warm-up, in ascending order. Surfaces are "
      "refined along the shadows of all of them, except those of entities. Of block-on-road "
      "99 % of the pixels lie within 0.9 K of a run of their own, RMS 0.35 K; single pixels "
      "along edges of shadows differ by more");
  line.path("--out", options.out,
            "OpenEXR file to write. {time} and {band} in the name stand for time and band of the "
            "frame; without them several times add _t<time>, and several bands add _<band>, before "
            "the extension")
      .required();
  line.path(
      "--png", options.png,
      "False-colour image as PNG, from display.min_k to display.max_k of the scenario; the name "
      "is made as that of --out");
  line.path("--film", options.film,
            "Film of the PNG pictures of the first band, in the order of the times: .webp "
            "(animated, lossless) or .mp4; needs the program ffmpeg");
  line.option("--film-rate-hz", options.film_rate_hz, "Pictures a second of the film")
      .in_range(0.1, 120.0)
      .show_default();
  add_png_of(line, options.png_of, true);
  line.option("--channel", options.channels,
              "Channel beside radiance: temperature, depth, object, coverage (share of small "
              "targets); repeatable; default the first three")
      .repeatable()
      .one_of({"temperature", "depth", "object", "coverage"});
  line.option("--band", options.bands,
              "Band of the radiance channel; repeatable: a file for each; default: the first")
      .repeatable()
      .type_name("NAME");
  line.option("--output-of", options.output_of,
              "[[channel]] of the scenario: files hold its frames as a client gets them, with "
              "window, optics, detector and every other step of its output")
      .type_name("NAME");
  line.option("--quality", options.quality,
              "preview renders an own scene in seconds. It sets keys of [thermal] to low cost and "
              "says what it leaves out; keys of --set count more")
      .one_of({"full", "preview"})
      .show_default();
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_render(CommandLine& tool) {
  tool.command<RenderOptions>(
      {.name = "render",
       .text = "Render frames of a scenario offline",
       .example = "emit render block-on-road --time-s 41400 --out road.exr --png road.png"},
      add_options, run);
}

}  // namespace emit::tool
