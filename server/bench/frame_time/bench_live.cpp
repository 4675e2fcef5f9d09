// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bench/frame_time/frame_time_benches.hpp"
#include "emit/physics/weather.hpp"
#include "emit/scene/trajectory.hpp"
#include "emit/version.hpp"
#include "tool/command_line/common_options.hpp"
#include "tool/support/console.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/json.hpp"
#include "tool/support/progress.hpp"
#include "tool/support/renderer_thread.hpp"
#include "tool/support/scenario_input.hpp"
#include "tool/support/statistics.hpp"

namespace emit::tool {
namespace {

struct LiveOptions {
  std::optional<std::filesystem::path> json;
  std::string scene = "airfield";
  std::vector<std::string> set;
  double seconds = 60.0;  ///< of sim time
  double rate_hz = 50.0;  ///< of frames and host poses, in sim time
  double every_s = 2.0;   ///< between the images that are compared
  double finest_s = 1.0;  ///< thermal.first_step_s of the reference
  /// Period of the host's weather updates while a cloud passes. The script has the weather from the
  /// start. With 0 there is no cloud.
  double weather_every_s = 0.0;
  std::uint32_t width_px = 640;
  std::uint32_t height_px = 512;
  int gpu_index = -1;
};

using physics::Result;

enum Who : std::size_t { kScript, kHost, kReference, kCount };
constexpr std::array<const char*, kCount> kNames{"script", "host", "reference"};

/// Smallest change of a pixel's temperature since the start that separates it from pixels far from
/// anything that moves.
constexpr float kTouchedK = 0.05F;

/// Entity whose poses the host sends: it stands where its script would have it.
struct Driven {
  std::uint32_t entity_id = 0;
  scene::Trajectory script;
};

std::vector<Driven> take_scripts(scene::ScenarioDesc& scenario, std::int64_t start_ns) {
  std::vector<Driven> out;
  for (scene::ObjectDesc& object : scenario.objects) {
    if (object.entity_id == 0 || object.trajectory.size() < 2) continue;
    out.push_back({object.entity_id, object.trajectory});
    // The host knows the past of the entity and not its future.
    const scene::TrajectoryState now = scene::trajectory_at(object.trajectory, start_ns);
    std::erase_if(object.trajectory,
                  [&](const scene::Keyframe& key) { return key.sim_time_ns >= start_ns; });
    object.trajectory.push_back({start_ns, now.pose, now.on});
  }
  return out;
}

/// A scenario's clear sky, under which a cloud passes that leaves a fifth of the direct sun. The
/// cloud comes after a quarter of the time and goes after three quarters, in 5 s each.
class CloudySky {
 public:
  CloudySky(const scene::ScenarioDesc& scenario, std::int64_t start_ns, double seconds)
      : epoch_utc_ns_(scenario.epoch_utc_ns),
        place_{physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
               physics::Metres(scenario.place.height_m)},
        clear_(scenario.clear_sky),
        start_ns_(start_ns),
        seconds_(seconds) {}

  [[nodiscard]] scene::WeatherSample at(std::int64_t sim_time_ns) const {
    const std::int64_t utc_ns = epoch_utc_ns_ + sim_time_ns;
    const physics::Forcing clear = physics::forcing_from_clear_sky(
        clear_, place_, physics::sun_position(utc_ns, place_), utc_ns);
    constexpr double kEdgeS = 5.0;
    constexpr double kTakenFrac = 0.8;
    const double gone_s = 1e-9 * static_cast<double>(sim_time_ns - start_ns_);
    const double in_s = std::min(gone_s - 0.25 * seconds_, 0.75 * seconds_ - gone_s);
    const double left_frac = 1.0 - kTakenFrac * std::clamp(in_s / kEdgeS, 0.0, 1.0);
    scene::WeatherSample out;
    out.sim_time_ns = sim_time_ns;
    out.direct_normal_w_m2 = left_frac * clear.direct_normal_w_m2;
    out.diffuse_horizontal_w_m2 = clear.diffuse_horizontal_w_m2;
    out.longwave_down_w_m2 = clear.longwave_down_w_m2;
    out.air_k = clear.air_k;
    out.wind_m_s = clear.wind_m_s;
    return out;
  }
  /// Returns the weather from the first instant of the thermal history up to `end_ns`.
  [[nodiscard]] std::vector<scene::WeatherSample> table(const scene::ThermalOptions& thermal,
                                                        std::int64_t end_ns) const {
    constexpr std::int64_t kRowNs = 300'000'000'000;
    constexpr std::int64_t kFineNs = 1'000'000'000;
    std::vector<scene::WeatherSample> rows;
    for (std::int64_t at_ns = thermal.history_start_ns - thermal.spin_up_ns;
         at_ns < std::min(start_ns_, end_ns); at_ns += kRowNs) {
      rows.push_back(at(at_ns));
    }
    for (std::int64_t at_ns = start_ns_; at_ns <= end_ns; at_ns += kFineNs) {
      rows.push_back(at(at_ns));
    }
    return rows;
  }

 private:
  std::int64_t epoch_utc_ns_;
  physics::GeoPlace place_;
  physics::ClearSky clear_;
  std::int64_t start_ns_;
  double seconds_;
};

/// Differences of a renderer's images from the reference's, over all images.
struct Error {
  double sum_k2 = 0.0;
  std::uint64_t count = 0;
  std::vector<float> all_k;

  [[nodiscard]] double rms_k() const { return std::sqrt(sum_k2 / static_cast<double>(count)); }
  [[nodiscard]] double percentile_k(double frac) {
    if (all_k.empty()) return 0.0;
    const auto at =
        all_k.begin() + static_cast<std::ptrdiff_t>(frac * static_cast<double>(all_k.size() - 1));
    std::ranges::nth_element(all_k, at);
    return *at;
  }
};

struct Row {
  Samples frame_ms;
  Error error;  ///< over the pixels that have changed since the start
  double warm_up_s = 0.0;
};

class LiveBench {
 public:
  static Result<LiveBench> create(const LiveOptions& command) {
    const auto scenario_of = [&](bool reference) {
      std::vector<std::string> overrides{"thermal.method=\"cached\"", "thermal.model=\"foster\""};
      overrides.insert(overrides.end(), command.set.begin(), command.set.end());
      if (reference) {
        overrides.push_back(fmt::format("thermal.first_step_s={:#}", command.finest_s));
      }
      return load_scenario_choice({command.scene, overrides});
    };
    LiveBench out(command);
    for (const Who who : {kScript, kHost, kReference}) {
      auto scenario = scenario_of(who == kReference);
      if (!scenario) return tl::unexpected(std::move(scenario.error()));
      out.start_ns_ = observation_ns(*scenario);
      if (scenario->sensor.trajectory.empty()) {
        return physics::make_error(physics::ErrorCode::config,
                                   fmt::format("{}: the sensor has no trajectory", command.scene));
      }
      out.eye_ = scenario->sensor.trajectory.back().pose;
      if (who == kHost) out.driven_ = take_scripts(*scenario, out.start_ns_);
      if (command.weather_every_s > 0.0) {
        out.sky_.emplace(*scenario, out.start_ns_, command.seconds);
        const std::int64_t known_ns = who == kHost ? out.start_ns_ : out.end_ns();
        scenario->weather = out.sky_->table(scenario->thermal, known_ns);
      }
      scenario->sensor.width_px = command.width_px;
      scenario->sensor.height_px = command.height_px;
      // The camera stands still, so that what changes in a pixel is its temperature.
      scenario->sensor.trajectory = {{out.start_ns_, out.eye_}};
      auto renderer =
          RendererThread::create(*scenario, command.gpu_index, renderer::Ladder::none, true);
      if (!renderer) return tl::unexpected(std::move(renderer.error()));
      out.renderers_[who] = std::move(*renderer);
    }
    if (out.driven_.empty()) {
      return physics::make_error(physics::ErrorCode::config,
                                 fmt::format("{}: no entity moves", command.scene));
    }
    return out;
  }

  Result<void> run() {
    for (const Who who : {kScript, kHost, kReference}) {
      const auto seconds = renderers_[who]->warm_up(request(0));
      if (!seconds) return tl::unexpected(seconds.error());
      rows_[who].warm_up_s = *seconds;
    }
    const auto frames =
        static_cast<std::uint64_t>(std::llround(command_.seconds * command_.rate_hz));
    const auto every =
        static_cast<std::uint64_t>(std::max(1.0, std::round(command_.every_s * command_.rate_hz)));
    Progress progress("bench live", frames);
    for (std::uint64_t i = 0; i <= frames; ++i) {
      const bool compared = i % every == 0;
      tell(i);
      // The order alternates, so that drifts of the machine favour neither.
      const std::array<Who, 2> order =
          i % 2 == 0 ? std::array{kScript, kHost} : std::array{kHost, kScript};
      for (const Who who : order) {
        const auto frame = renderers_[who]->render(request(i), compared ? &shown_k_[who] : nullptr);
        if (!frame) return tl::unexpected(frame.error());
        if (i > 0) rows_[who].frame_ms.add(frame->frame_ms);
      }
      if (compared) {
        const auto frame = renderers_[kReference]->render(request(i), &shown_k_[kReference]);
        if (!frame) return tl::unexpected(frame.error());
        if (i == 0) {
          first_k_ = shown_k_;
        } else {
          compare();
        }
      }
      progress.advance_to(i);
    }
    return {};
  }

  [[nodiscard]] std::array<Row, kCount>& rows() noexcept { return rows_; }
  [[nodiscard]] std::size_t entities() const noexcept { return driven_.size(); }
  [[nodiscard]] const RendererThread& renderer(Who who) const noexcept { return *renderers_[who]; }

 private:
  explicit LiveBench(const LiveOptions& command) : command_(command) {}

  [[nodiscard]] renderer::FrameRequest request(std::uint64_t i) const {
    renderer::FrameRequest out;
    out.frame_number = i;
    out.sim_time_ns = time_ns(i);
    out.thermal_time_ns = out.sim_time_ns;
    out.sensor_pose = eye_;
    return out;
  }
  [[nodiscard]] std::int64_t time_ns(std::uint64_t i) const {
    return start_ns_ + std::llround(1e9 * static_cast<double>(i) / command_.rate_hz);
  }
  [[nodiscard]] std::int64_t end_ns() const {
    return start_ns_ + std::llround(1e9 * (command_.seconds + command_.weather_every_s));
  }
  void tell_weather(std::uint64_t i) {
    const auto period_ns = std::llround(1e9 * command_.weather_every_s);
    const std::int64_t now_ns = time_ns(i);
    if (now_ns < next_weather_ns_) return;
    next_weather_ns_ = now_ns + period_ns;
    // The update takes the middle of its period, because it applies until the next one.
    scene::WeatherSample sample = sky_->at(now_ns + period_ns / 2);
    sample.sim_time_ns = now_ns;
    renderers_[kHost]->apply_weather(sample);
  }
  void tell(std::uint64_t i) {
    if (sky_ && i > 0) tell_weather(i);
    updates_.clear();
    for (const Driven& entity : driven_) {
      const scene::TrajectoryState state = scene::trajectory_at(entity.script, time_ns(i));
      updates_.push_back({entity.entity_id, state.pose, state.on, false});
    }
    renderers_[kHost]->apply_entities(time_ns(i), updates_);
  }
  /// Compares the pixels that have changed in the reference since the start. The difference at the
  /// start is subtracted, because the meshes of the two differ.
  void compare() {
    for (const Who who : {kScript, kHost}) {
      for (std::size_t p = 0; p < shown_k_[who].size(); ++p) {
        const float was_k = first_k_[kReference][p];
        const float is_k = shown_k_[kReference][p];
        if (!(std::abs(is_k - was_k) > kTouchedK)) continue;
        const float off_k = std::abs((shown_k_[who][p] - first_k_[who][p]) - (is_k - was_k));
        if (!std::isfinite(off_k)) continue;
        Error& error = rows_[who].error;
        error.sum_k2 += static_cast<double>(off_k) * static_cast<double>(off_k);
        ++error.count;
        error.all_k.push_back(off_k);
      }
    }
  }

  LiveOptions command_;
  std::int64_t start_ns_ = 0;
  physics::Pose eye_;
  std::vector<Driven> driven_;
  std::vector<renderer::EntityUpdate> updates_;
  std::optional<CloudySky> sky_;  ///< weather_every_s > 0
  std::int64_t next_weather_ns_ = 0;
  std::array<std::unique_ptr<RendererThread>, kCount> renderers_;
  std::array<std::vector<float>, kCount> shown_k_;
  std::array<std::vector<float>, kCount> first_k_;
  std::array<Row, kCount> rows_;
};

int run(const LiveOptions& command) {
  const InterruptGuard interrupt;
  auto bench = LiveBench::create(command);
  if (!bench) return fail(bench.error());
  if (auto ran = bench->run(); !ran) return fail(ran.error());
  TextTable text(
      {"driven by", "median ms", "p99 ms", "worst ms", "p99 K", "RMS K", "pixels", "warm-up s"});
  Json results = Json::array();
  for (const Who who : {kScript, kHost}) {
    Row& row = bench->rows()[who];
    const double p99_k = row.error.percentile_k(0.99);
    const double rms_k = row.error.count > 0 ? row.error.rms_k() : 0.0;
    text.add({kNames[who], fmt::format("{:.2f}", row.frame_ms.median()),
              fmt::format("{:.2f}", row.frame_ms.percentile(0.99)),
              fmt::format("{:.2f}", row.frame_ms.max()), fmt::format("{:.3f}", p99_k),
              fmt::format("{:.3f}", rms_k), fmt::format("{}", row.error.count),
              fmt::format("{:.1f}", row.warm_up_s)});
    Json json = Json::object();
    json.set("driven_by", kNames[who]).set("scene", command.scene);
    json.set("frame_ms_median", row.frame_ms.median());
    json.set("frame_ms_p99", row.frame_ms.percentile(0.99)).set("frame_ms_max", row.frame_ms.max());
    json.set("frames", row.frame_ms.count()).set("sim_s", command.seconds);
    json.set("rate_hz", command.rate_hz).set("entities", bench->entities());
    json.set("weather_every_s", command.weather_every_s);
    json.set("error_p99_k", p99_k).set("error_rms_k", rms_k).set("pixels", row.error.count);
    json.set("width", command.width_px).set("height", command.height_px);
    json.set("samples", bench->renderer(who).stats().samples).set("warm_up_s", row.warm_up_s);
    results.push(std::move(json));
  }
  const std::string& device = bench->renderer(kHost).device();
  fmt::print(text_stream(command.json), "{}, commit {}, {}, {}x{}, {} entities\n{}", device,
             kCommit, command.scene, command.width_px, command.height_px, bench->entities(),
             text.to_string());
  if (command.json) {
    Json json = Json::object();
    json.set("device", device).set("commit", kCommit).set("suite", "live");
    json.set("results", std::move(results));
    if (auto written = write_json(*command.json, json); !written) return fail(written.error());
  }
  return kExitOk;
}

void add_options(CommandLine& line, LiveOptions& options) {
  line.option("--scene", options.scene, "Scenario whose entities move").show_default();
  add_set(line, options.set);
  line.option("--seconds", options.seconds, "Sim time, s").in_range(1.0, 86'400.0).show_default();
  line.option("--rate", options.rate_hz, "Frames and host poses per second of sim time")
      .in_range(0.1, 1000.0)
      .show_default();
  line.option("--every", options.every_s, "Sim time between pictures that are compared, s")
      .in_range(0.001, 3600.0)
      .show_default();
  line.option("--finest", options.finest_s, "thermal.first_step_s of the reference, s")
      .in_range(0.01, 3600.0)
      .show_default();
  line.option("--weather-every", options.weather_every_s,
              "A cloud passes, of which the script knows and the host tells that often, s; "
              "0: clear sky")
      .in_range(0.0, 3600.0)
      .show_default();
  add_image_size(line, options.width_px, options.height_px);
  add_gpu(line, options.gpu_index);
  add_json(line, options.json);
}

}  // namespace

void add_bench_live(CommandLine& bench) {
  bench.command<LiveOptions>(
      {.name = "live",
       .text =
           "The scenario's entities driven by its script and by a host that tells the same poses: "
           "frame times in turn, and temperatures beside those of the script in shorter intervals",
       .example = "emit bench live --seconds 60 --json live.json"},
      add_options, run);
}

}  // namespace emit::tool
