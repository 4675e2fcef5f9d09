// SPDX-License-Identifier: Apache-2.0
#include "tool/offline/probe_run.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>

#include "emit/reference/nearest_surface.hpp"
#include "tool/support/console.hpp"

namespace emit::tool {
namespace {

using physics::Result;

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

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

}  // namespace

Result<ProbeForcing> ProbeForcing::create(const scene::ScenarioDesc& scenario,
                                          std::span<const double> times_s) {
  std::vector<std::int64_t> nodes_ns;
  for (const double time_s : times_s) nodes_ns.push_back(std::llround(1e9 * time_s));
  constexpr std::int64_t kSecondNs = 1'000'000'000;
  nodes_ns.push_back(nodes_ns.back() + kSecondNs);  // an interval begins at every instant
  auto intervals = renderer::surface_forcing(scenario, nodes_ns);
  if (!intervals) return tl::unexpected(std::move(intervals.error()));
  return ProbeForcing(std::move(*intervals));
}

ProbeRun::ProbeRun(const scene::ScenarioDesc& scenario, std::vector<double> times_s,
                   std::vector<ProbePoint> points)
    : scenario_(scenario),
      times_s_(std::move(times_s)),
      points_(std::move(points)),
      samples_(points_.size()) {}

Result<void> ProbeRun::run(const ProbeFinder& finder, int gpu_index, SceneWarnings warnings) {
  plan(finder);
  return render(gpu_index, warnings);
}

/// Finds the surfaces, and plans a shot for each of them.
void ProbeRun::plan(const ProbeFinder& finder) {
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

void ProbeRun::read(const renderer::FrameView& view, const OfflineShot& shot,
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
void ProbeRun::read_flux(const renderer::Renderer& renderer, ProbeRow& row) {
  if (std::isnan(row.temperature_k) || !row.place) return;
  auto& [sample, found_for_m] = samples_[row.point];
  constexpr double kSameM = 1e-6;
  if (!sample || glm::distance(found_for_m, row.place->position_m) > kSameM) {
    sample = renderer.nearest_sample({row.place->position_m, row.place->normal});
    found_for_m = row.place->position_m;
  }
  if (sample) row.flux_w_m2 = renderer.sample_reading(*sample).flux_w_m2;
}

Result<void> ProbeRun::render(int gpu_index, SceneWarnings warnings) {
  if (shots_.empty()) return {};
  const auto forcing = ProbeForcing::create(scenario_, times_s_);
  if (!forcing) return tl::unexpected(forcing.error());
  renderer::OutputOptions output;
  output.temperature = output.depth = output.sun = output.sky = true;
  output.slots = 2;
  auto frames = OfflineFrames::create(scenario_, shots_, output, gpu_index, warnings);
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

std::vector<Plot> ProbeRun::plots() const {
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

}  // namespace emit::tool
