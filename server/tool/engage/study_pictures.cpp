// SPDX-License-Identifier: Apache-2.0
#include "tool/engage/study_pictures.hpp"

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <memory>

#include "emit/physics/sun.hpp"
#include "emit/reference/visibility.hpp"
#include "emit/scene/sheets.hpp"
#include "tool/support/interrupt.hpp"

namespace emit::tool {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

bool goes_on(double) {
  return !InterruptGuard::interrupted();
}

Result<StudyPicture> render_one(renderer::Renderer& renderer, std::size_t band,
                                const renderer::FrameRequest& request) {
  const int slot = renderer.submit(request);
  if (slot < 0) return make_error(ErrorCode::internal, "the renderer has no free slot");
  const auto index = static_cast<renderer::SlotIndex>(slot);
  const renderer::FrameView& view = renderer.collect(index);
  if (view.device_failed) return make_error(ErrorCode::gpu, "the device reported an error");
  StudyPicture out{view.width_px, view.height_px, {}};
  out.radiance_w_m2_sr.assign(view.radiance_w_m2_sr[band].begin(),
                              view.radiance_w_m2_sr[band].end());
  renderer.release(index);
  return out;
}

}  // namespace

Result<std::vector<StudyPicture>> render_pictures(scene::ScenarioDesc scenario, std::size_t band,
                                                  const physics::Pose& camera,
                                                  const std::vector<std::int64_t>& sim_times_ns) {
  scenario.sensor.trajectory = {{sim_times_ns.front(), camera}};
  renderer::OutputOptions output;
  output.slots = 2;
  auto renderer = renderer::Renderer::create(scenario, {-1, false}, output);
  if (!renderer) return tl::unexpected(renderer.error());
  std::vector<StudyPicture> out;
  for (std::size_t i = 0; i < sim_times_ns.size(); ++i) {
    renderer::FrameRequest request;
    request.frame_number = i + 1;
    request.sim_time_ns = request.thermal_time_ns = sim_times_ns[i];
    request.sensor_pose = camera;
    auto ready =
        i == 0 ? (*renderer)->warm_up(request, goes_on) : (*renderer)->carry_on(request, goes_on);
    if (!ready) return tl::unexpected(ready.error());
    auto picture = render_one(**renderer, band, request);
    if (!picture) return tl::unexpected(picture.error());
    out.push_back(std::move(*picture));
  }
  return out;
}

Result<StudyPicture> render_unshadowed(scene::ScenarioDesc scenario, std::size_t band,
                                       const physics::Pose& camera, std::int64_t sim_time_ns) {
  // The time before the history has weather and no shadows. A history that begins with the picture
  // leaves no other time.
  scenario.thermal.history_start_ns = sim_time_ns;
  // There are no edges of shadows for which surfaces would have to be fine.
  constexpr double kCoarseK = 50.0;
  scenario.thermal.tolerance_k = kCoarseK;
  auto pictures = render_pictures(std::move(scenario), band, camera, {sim_time_ns});
  if (!pictures) return tl::unexpected(pictures.error());
  return std::move(pictures->front());
}

Result<std::vector<double>> sun_shares(const scene::ScenarioDesc& scenario,
                                       const physics::Pose& camera, std::int64_t sim_time_ns) {
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(geometry.error());
  scene::adopt_sheets(*geometry);
  auto rays = reference::RayScene::create(reference::ray_scene_desc(scenario, *geometry));
  if (!rays) return tl::unexpected(rays.error());
  const reference::SceneInstant instant = rays->at(sim_time_ns);
  const physics::SunPosition sun = physics::sun_position(
      scenario.epoch_utc_ns + sim_time_ns,
      {physics::Radians(scenario.place.lat_rad), physics::Radians(scenario.place.lon_rad),
       physics::Metres(scenario.place.height_m)});

  const std::uint32_t width = scenario.sensor.width_px;
  const std::uint32_t height = scenario.sensor.height_px;
  const double focal_px = 0.5 * width / std::tan(0.5 * scenario.sensor.fov_h_rad);
  std::vector<double> out(static_cast<std::size_t>(width) * height, 1.0);
  std::vector<reference::SurfacePoint> points;
  std::vector<std::size_t> pixel_of_point;
  for (std::uint32_t row = 0; row < height; ++row) {
    for (std::uint32_t column = 0; column < width; ++column) {
      const glm::dvec3 body{focal_px, column + 0.5 - 0.5 * width, row + 0.5 - 0.5 * height};
      reference::Ray ray;
      ray.origin_world_m = camera.position_world_m;
      ray.direction = glm::normalize(camera.world_from_body * body);
      const auto hit = instant.first_hit(ray);
      if (!hit) continue;
      const glm::dvec3 normal = hit->front ? hit->geometric_normal : -hit->geometric_normal;
      points.push_back(
          {hit->position_world_m, normal, 1e-9 * (1.0 + glm::length(hit->position_world_m))});
      pixel_of_point.push_back(static_cast<std::size_t>(row) * width + column);
    }
  }
  std::vector<double> shares(points.size(), 0.0);
  if (sun.direction_enu.z > 0.0) {
    reference::SunQuery query;
    query.rays = 16;
    instant.sun_visible_frac(points, sun.direction_enu, query, false, shares);
  }
  for (std::size_t i = 0; i < points.size(); ++i) out[pixel_of_point[i]] = shares[i];
  return out;
}

Result<void> write_npy(const std::filesystem::path& file, const StudyPicture& picture) {
  // The header, with its 10 bytes of magic and length, is padded to a multiple of 64 bytes.
  std::string header =
      fmt::format("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, {}), }}",
                  picture.height_px, picture.width_px);
  constexpr std::size_t kPreludeBytes = 10;
  const std::size_t padded = (kPreludeBytes + header.size() + 1 + 63) / 64 * 64;
  header.resize(padded - kPreludeBytes - 1, ' ');
  header += '\n';
  std::ofstream stream(file, std::ios::binary);
  stream << "\x93NUMPY" << '\x01' << '\x00';
  stream << static_cast<char>(header.size() & 0xffU) << static_cast<char>(header.size() >> 8U);
  stream << header;
  stream.write(reinterpret_cast<const char*>(picture.radiance_w_m2_sr.data()),
               static_cast<std::streamsize>(4 * picture.radiance_w_m2_sr.size()));
  stream.flush();
  if (!stream)
    return make_error(ErrorCode::io, fmt::format("{}: cannot be written", file.string()));
  return {};
}

}  // namespace emit::tool
