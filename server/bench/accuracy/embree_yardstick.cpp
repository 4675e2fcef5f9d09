// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/embree_yardstick.hpp"

#include <chrono>
#include <utility>

#include "bench/accuracy/pixel_surface.hpp"
#include "emit/physics/sun.hpp"
#include "emit/scene/mesh.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::tool {

using physics::Result;

EmbreeYardstick::EmbreeYardstick(scene::ScenarioDesc scenario, reference::RayScene rays,
                                 std::int64_t now_ns, std::vector<reference::SurfacePoint> points)
    : scenario_(std::move(scenario)),
      rays_(std::move(rays)),
      now_ns_(now_ns),
      points_(std::move(points)) {}

Result<EmbreeYardstick> EmbreeYardstick::create(const scene::ScenarioDesc& scenario,
                                                const reference::SolveView& view) {
  const auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(geometry.error());
  auto rays = reference::RayScene::create(reference::ray_scene_desc(scenario, *geometry),
                                          reference::RayArithmetic::fast);
  if (!rays) return tl::unexpected(std::move(rays.error()));
  const reference::SceneInstant now = rays->at(view.sim_time_ns);
  std::vector<PixelSurface> pixels(static_cast<std::size_t>(view.width_px) * view.height_px);
  threads::parallel_indices(std::uint32_t{0}, view.height_px, [&](std::uint32_t row) {
    for (std::uint32_t column = 0; column < view.width_px; ++column) {
      pixels[static_cast<std::size_t>(row) * view.width_px + column] =
          trace_pixel(now, view, column, row);
    }
  });
  std::vector<reference::SurfacePoint> points;
  for (const PixelSurface& pixel : pixels) {
    if (pixel.surface) points.push_back({pixel.position_m, pixel.normal, 0.0});
  }
  return EmbreeYardstick(scenario, std::move(*rays), view.sim_time_ns, std::move(points));
}

Samples EmbreeYardstick::step_ms(std::uint32_t steps) const {
  using Clock = std::chrono::steady_clock;
  const physics::GeoPlace place{physics::Radians(scenario_.place.lat_rad),
                                physics::Radians(scenario_.place.lon_rad),
                                physics::Metres(scenario_.place.height_m)};
  std::vector<std::uint8_t> blocked(points_.size());
  const std::int64_t start_ns = scenario_.thermal.history_start_ns;
  const double interval_ns = static_cast<double>(now_ns_ - start_ns) / steps;
  Samples out;
  bool warm = false;
  for (std::uint32_t i = 0; i < steps; ++i) {
    const std::int64_t at_ns = start_ns + static_cast<std::int64_t>(interval_ns * (i + 0.5));
    const physics::SunPosition sun = physics::sun_position(scenario_.epoch_utc_ns + at_ns, place);
    if (sun.elevation.value() <= 0.0) continue;
    const reference::SceneInstant instant = rays_.at(at_ns);
    if (!std::exchange(warm, true)) instant.occluded(points_, sun.direction_enu, blocked);
    const auto start = Clock::now();
    instant.occluded(points_, sun.direction_enu, blocked);
    out.add(std::chrono::duration<double, std::milli>(Clock::now() - start).count());
  }
  return out;
}

}  // namespace emit::tool
