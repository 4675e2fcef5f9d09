// SPDX-License-Identifier: Apache-2.0
#include "tool/campaign/element_run.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <thread>

#include "app/scenario_identity.hpp"
#include "app/sha256.hpp"
#include "emit/config/load.hpp"
#include "emit/image/image_diff.hpp"
#include "emit/physics/constants.hpp"
#include "emit/physics/sun.hpp"
#include "emit/reference/solve.hpp"
#include "emit/renderer/surface_forcing.hpp"
#include "emit/scene/sheets.hpp"
#include "emit/version.hpp"
#include "tool/offline/offline_frames.hpp"
#include "tool/streams/stream_client.hpp"
#include "tool/support/daemon_process.hpp"
#include "tool/support/frame_files.hpp"
#include "tool/support/interrupt.hpp"
#include "tool/support/scenario_input.hpp"

namespace emit::tool {
namespace {

using Clock = std::chrono::steady_clock;
using physics::ErrorCode;
using physics::make_error;
using physics::Result;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

/// Picture of an element with the channels that are compared.
struct Picture {
  image::ExrImage image;
  double warm_up_s = 0.0;
  double frame_ms = 0.0;
  double seconds = 0.0;
  std::string device;
};

image::ExrImage image_of(std::uint32_t width_px, std::uint32_t height_px,
                         std::span<const float> radiance, std::span<const float> temperature,
                         std::span<const float> object) {
  image::ExrImage out;
  out.width_px = width_px;
  out.height_px = height_px;
  out.add(image::kRadianceChannel, radiance);
  out.add(image::kTemperatureChannel, temperature);
  out.add(image::kObjectChannel, object);
  return out;
}

Result<Picture> render_picture(const scene::ScenarioDesc& scenario, double time_s) {
  const auto start = Clock::now();
  renderer::OutputOptions output;
  output.temperature = output.object = true;
  output.slots = 2;
  auto frames =
      OfflineFrames::create(scenario, sensor_shots(scenario, std::span(&time_s, 1)), output, -1);
  if (!frames) return tl::unexpected(std::move(frames.error()));
  const auto view = (*frames)->next();
  if (!view) return tl::unexpected(view.error());
  Picture out;
  out.image = image_of((*view)->width_px, (*view)->height_px, (*view)->radiance_w_m2_sr[0],
                       (*view)->temperature_k, (*view)->object_id);
  out.warm_up_s = 1e-3 * (*frames)->warm_up_ms();
  out.frame_ms = (*frames)->frame_ms();
  out.device = (*frames)->renderer().device_name();
  out.seconds = seconds_since(start);
  return out;
}

Result<Picture> solve_picture(const scene::ScenarioDesc& scenario, double time_s,
                              const config::CampaignTruth& truth) {
  const auto start = Clock::now();
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  scene::adopt_sheets(*geometry);
  const OfflineShot shot = sensor_shots(scenario, std::span(&time_s, 1)).front();
  const reference::SolveView view{shot.sim_time_ns, shot.sensor_pose, scenario.sensor.width_px,
                                  scenario.sensor.height_px, scenario.sensor.fov_h_rad};
  reference::SolveOptions options;
  options.dimension = truth.dimension == "1"   ? reference::SolveDimension::one
                      : truth.dimension == "3" ? reference::SolveDimension::three
                                               : reference::SolveDimension::automatic;
  options.rays = truth.rays;
  options.refine = truth.refine;
  options.tolerance_k = truth.tolerance_k;
  options.pixels = truth.pixels;
  options.spin_up_s = 3600.0 * truth.spin_up_h;
  options.first_ns = shot.sim_time_ns;
  options.progress = [](double) { return !InterruptGuard::interrupted(); };
  const auto images = reference::solve(scenario, *geometry, std::span(&view, 1), options);
  if (!images) return tl::unexpected(images.error());
  if (InterruptGuard::interrupted()) return make_error(ErrorCode::internal, "interrupted");
  const reference::SolvedImage& solved = images->front();
  Picture out;
  out.image = image_of(solved.width_px, solved.height_px, solved.radiance_w_m2_sr[0],
                       solved.temperature_k, solved.object_id);
  out.seconds = seconds_since(start);
  return out;
}

/// Sun and weather at the instant of an element.
Result<void> add_weather(const scene::ScenarioDesc& scenario, double time_s, ResultRow& row) {
  constexpr std::int64_t kSecondNs = 1'000'000'000;
  const std::int64_t now_ns = std::llround(1e9 * time_s);
  const std::array<std::int64_t, 2> nodes_ns{now_ns, now_ns + kSecondNs};
  const auto forcing = renderer::surface_forcing(scenario, nodes_ns);
  if (!forcing) return tl::unexpected(forcing.error());
  const renderer::SurfaceForcing& now = forcing->front().begin;
  const physics::SunPosition sun = physics::sun_position(
      scenario.epoch_utc_ns + now_ns,
      {physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
       physics::Metres(scenario.place.height_m)});
  row.set("sun_elevation_deg", sun.elevation.value() / physics::kDegree);
  row.set("sun_direct_w_m2", glm::length(now.sun_w_m2));
  row.set("sky_diffuse_w_m2", now.diffuse_w_m2);
  row.set("sky_longwave_w_m2", now.longwave_w_m2);
  row.set("air_k", now.air_k);
  return {};
}

void add_surface(const Picture& picture, ResultRow& row) {
  double low = INFINITY;
  double high = -INFINITY;
  double sum = 0.0;
  std::uint64_t count = 0;
  for (const image::ExrChannel& channel : picture.image.channels) {
    if (channel.name != image::kTemperatureChannel) continue;
    for (const float value : channel.pixels) {
      if (!std::isfinite(value)) continue;
      low = std::min(low, static_cast<double>(value));
      high = std::max(high, static_cast<double>(value));
      sum += static_cast<double>(value);
      ++count;
    }
  }
  row.set("surface_px", std::to_string(count));
  row.set("surface_min_k", count > 0 ? low : NAN);
  row.set("surface_mean_k", count > 0 ? sum / static_cast<double>(count) : NAN);
  row.set("surface_max_k", count > 0 ? high : NAN);
}

/// Errors of the surface temperature and of the radiance in the first band.
Result<void> add_errors(const scene::ScenarioDesc& scenario, const Picture& picture,
                        const Picture& truth, ResultRow& row) {
  const ApparentTemperature table(scene::spectral_band(scenario.bands.front()));
  const auto diff = image::compare_images(
      picture.image, truth.image,
      [&table](double radiance_w_m2_sr) { return table.kelvin_per_radiance(radiance_w_m2_sr); });
  if (!diff) return tl::unexpected(diff.error());
  for (const image::ChannelDiff& channel : diff->channels) {
    if (channel.channel == image::kTemperatureChannel) {
      row.set("error_pixels", std::to_string(channel.absolute.pixels_compared));
      row.set("error_mean_k", channel.absolute.mean);
      row.set("error_rms_k", channel.absolute.rms);
      row.set("error_p99_k", channel.absolute.p99);
      row.set("error_max_k", channel.absolute.max_abs);
    } else if (channel.channel == image::kRadianceChannel) {
      row.set("radiance_error_rms_k", channel.kelvin_equivalent.rms);
      row.set("radiance_error_p99_k", channel.kelvin_equivalent.p99);
    }
  }
  return {};
}

/// Plays the scenario's own trajectories to a daemon at the campaign's rate.
class ElementStream {
 public:
  ElementStream(const config::CampaignStream& stream, const scene::ScenarioDesc& scenario,
                double time_s)
      : stream_(stream), scenario_(scenario), start_ns_(std::llround(1e9 * time_s)) {}

  /// Errors: those of the daemon, of the client and of the host.
  Result<void> run(const std::vector<std::string>& set, const std::filesystem::path& work,
                   ResultRow& row) {
    auto daemon = DaemonProcess::start(daemon_config(), set, work, std::chrono::hours(2));
    if (!daemon) return tl::unexpected(daemon.error());
    StreamClient::Options options;
    options.url = "tcp://" + daemon->control_address();
    auto client = StreamClient::start(options);
    if (!client) return tl::unexpected(client.error());
    if (auto played = play(*daemon); !played) return played;
    constexpr std::chrono::seconds kLast(60);
    const bool all = (*client)->wait_for_host_frame(stream_.frames, kLast);
    (*client)->stop();
    if (auto stopped = daemon->stop(std::chrono::seconds(30)); !stopped) return stopped;
    if (!all) {
      return make_error(ErrorCode::io,
                        fmt::format("of {} poses, {} frames came within {} s", stream_.frames,
                                    (*client)->report().frames(), kLast.count()));
    }
    const StreamReport& report = (*client)->report();
    const client::ReceiveCounters& counters = (*client)->counters();
    const auto share = [&](std::uint64_t count) {
      return static_cast<double>(count) / static_cast<double>(stream_.frames);
    };
    row.set("stream_frames", std::to_string(report.frames()));
    row.set("stream_late", std::to_string(counters.late));
    row.set("stream_late_frac", share(counters.late));
    row.set("stream_lost", std::to_string(counters.lost));
    row.set("stream_delay_p50_ms", report.pose_to_received_ms().median());
    row.set("stream_delay_p99_ms", report.pose_to_received_ms().percentile(0.99));
    row.set("stream_delay_max_ms", report.pose_to_received_ms().max());
    return {};
  }

 private:
  [[nodiscard]] config::DaemonConfig daemon_config() const {
    config::DaemonConfig daemon;
    daemon.scenario = scenario_.file;
    daemon.source.first_time_ns = start_ns_;
    daemon.pacing.mode = config::PacingMode::host_step;
    const double budget_ms = stream_.budget_ms > 0.0 ? stream_.budget_ms : 1e3 / stream_.rate_hz;
    daemon.pacing.budget_ns = std::llround(1e6 * budget_ms);
    daemon.host.udp = "127.0.0.1:0";
    daemon.control.tcp = "127.0.0.1:0";
    return daemon;
  }

  Result<void> play(DaemonProcess& daemon) {
    auto host = client::HostClient::connect("tcp://" + daemon.control_address());
    if (!host) return tl::unexpected(host.error());
    const auto frame = std::make_unique<protocol::HostFrameData>();
    const auto begin = Clock::now();
    for (std::uint64_t i = 0; i < stream_.frames; ++i) {
      std::this_thread::sleep_until(begin + std::chrono::nanoseconds(std::llround(
                                                static_cast<double>(i) * 1e9 / stream_.rate_hz)));
      if (InterruptGuard::interrupted()) return make_error(ErrorCode::internal, "interrupted");
      make_host_frame(scenario_, start_ns_, stream_.rate_hz, i, *frame);
      if (auto sent = (*host)->send(*frame); !sent) return sent;
      while (true) {
        const auto status = (*host)->receive_status(0);
        if (!status) return tl::unexpected(status.error());
        if (!*status) break;
        if (!(*status)->ok()) {
          return make_error(ErrorCode::protocol,
                            fmt::format("emitd refused a pose: {}", (*status)->text));
        }
      }
    }
    return daemon.check_alive();
  }

  const config::CampaignStream& stream_;
  const scene::ScenarioDesc& scenario_;
  std::int64_t start_ns_;
};

Result<scene::ScenarioDesc> load(const config::CampaignDesc& campaign,
                                 const std::vector<std::string>& overrides) {
  config::LoadOptions options;
  options.require_scene_files = false;
  auto scenario = config::load_scenario(campaign.scenario, overrides, options);
  if (!scenario) scenario.error().code = ErrorCode::config;
  return scenario;
}

/// Overrides of the truth: those of the element, then its own.
std::vector<std::string> truth_overrides(const config::CampaignDesc& campaign,
                                         const CampaignElement& element) {
  std::vector<std::string> out = element.overrides(campaign);
  out.insert(out.end(), campaign.truth.set.begin(), campaign.truth.set.end());
  return out;
}

}  // namespace

Result<scene::ScenarioDesc> element_scenario(const config::CampaignDesc& campaign,
                                             const CampaignElement& element) {
  return load(campaign, element.overrides(campaign));
}

Result<std::string> element_identity(const config::CampaignDesc& campaign,
                                     const CampaignElement& element) {
  server::Sha256 hash;
  const auto add = [&hash](const std::string& text) {
    hash.update(std::as_bytes(std::span(text.data(), text.size())));
  };
  add(fmt::format("{} {} {}\n", kVersion, kCommit, element.time_s));
  const config::CampaignTruth& truth = campaign.truth;
  const bool has_truth = truth.kind != config::CampaignTruthKind::none;
  for (const auto& overrides : {element.overrides(campaign), truth_overrides(campaign, element)}) {
    const auto scenario = load(campaign, overrides);
    if (!scenario) return tl::unexpected(scenario.error());
    const auto identity = server::identify_scenario(*scenario);
    if (!identity) return tl::unexpected(identity.error());
    add(identity->sha256);
  }
  if (has_truth) {
    add(fmt::format("truth {} {} {} {} {} {} {}\n", static_cast<int>(truth.kind), truth.dimension,
                    truth.rays, truth.pixels, truth.refine, truth.tolerance_k, truth.spin_up_h));
  }
  add(fmt::format("stream {} {} {}\n", campaign.stream.frames, campaign.stream.rate_hz,
                  campaign.stream.budget_ms));
  // A column carries the name of its key, so that other keys make another row.
  for (const auto& [key, value] : element.conditions) add(fmt::format("{}={}\n", key, value));
  return hash.finish();
}

Result<ResultRow> run_element(const config::CampaignDesc& campaign, const CampaignElement& element,
                              const std::filesystem::path& work) {
  const auto start = Clock::now();
  const auto scenario = element_scenario(campaign, element);
  if (!scenario) return tl::unexpected(scenario.error());
  ResultRow row;
  row.set("element", std::to_string(element.number));
  for (const auto& [key, value] : element.conditions) row.set(key, value);
  row.set("time_s", fmt::format("{}", element.time_s));
  if (auto added = add_weather(*scenario, element.time_s, row); !added) {
    return tl::unexpected(added.error());
  }
  const auto picture = render_picture(*scenario, element.time_s);
  if (!picture) return tl::unexpected(picture.error());
  add_surface(*picture, row);
  double truth_s = NAN;
  if (campaign.truth.kind != config::CampaignTruthKind::none) {
    const auto other = load(campaign, truth_overrides(campaign, element));
    if (!other) return tl::unexpected(other.error());
    const auto truth = campaign.truth.kind == config::CampaignTruthKind::solve
                           ? solve_picture(*other, element.time_s, campaign.truth)
                           : render_picture(*other, element.time_s);
    if (!truth) return tl::unexpected(physics::Error(truth.error()).with_context("truth"));
    if (auto added = add_errors(*scenario, *picture, *truth, row); !added) {
      return tl::unexpected(added.error());
    }
    truth_s = truth->seconds;
  }
  if (campaign.stream.frames > 0) {
    if (auto fits = check_entities_fit(*scenario); !fits) return tl::unexpected(fits.error());
    auto streamed = ElementStream(campaign.stream, *scenario, element.time_s)
                        .run(element.overrides(campaign), work, row);
    if (!streamed) return tl::unexpected(std::move(streamed.error()).with_context("stream"));
  }
  row.set("warm_up_s", picture->warm_up_s);
  row.set("frame_ms", picture->frame_ms);
  if (std::isfinite(truth_s)) row.set("truth_s", truth_s);
  row.set("seconds", seconds_since(start));
  row.set("device", picture->device);
  return row;
}

}  // namespace emit::tool
