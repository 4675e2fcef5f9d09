// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/converged_history.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "bench/accuracy/converged_model.hpp"
#include "bench/accuracy/converged_views.hpp"
#include "bench/accuracy/pixel_surface.hpp"
#include "emit/threads/parallel.hpp"

namespace emit::tool {
namespace {

using physics::Result;

/// Point to solve for.
struct Sample {
  ConvergedPixel result;
  PixelSurface surface;
};

Sample sample_pixel(const reference::SceneInstant& scene, const reference::SolveView& view,
                    std::uint32_t pixel) {
  Sample sample;
  sample.result.pixel = pixel;
  const std::uint32_t column = pixel % view.width_px;
  const std::uint32_t row = pixel / view.width_px;
  sample.surface = trace_pixel(scene, view, column, row);
  if (!sample.surface.surface) return sample;
  const double width_rad = pixel_rad(view);
  for (std::uint32_t y = row > 0 ? row - 1 : 0; y <= std::min(row + 1, view.height_px - 1); ++y) {
    for (std::uint32_t x = column > 0 ? column - 1 : 0;
         x <= std::min(column + 1, view.width_px - 1) && !sample.result.outline; ++x) {
      if (x == column && y == row) continue;
      sample.result.outline = is_outline(sample.surface, trace_pixel(scene, view, x, y), width_rad);
    }
  }
  return sample;
}

/// Returns the pixels in the order of the additive sequence of the plastic number, each once. Every
/// first part of them covers the image evenly.
std::vector<std::uint32_t> even_order(std::uint32_t width_px, std::uint32_t height_px) {
  constexpr double kStepX = 0.7548776662466927;
  constexpr double kStepY = 0.5698402909980532;
  const std::uint32_t pixels = width_px * height_px;
  std::vector<bool> taken(pixels, false);
  std::vector<std::uint32_t> order;
  order.reserve(pixels);
  double x = 0.5;
  double y = 0.5;
  for (std::uint64_t i = 0; i < 4ULL * pixels; ++i) {
    const auto column = std::min(static_cast<std::uint32_t>(x * width_px), width_px - 1);
    const auto row = std::min(static_cast<std::uint32_t>(y * height_px), height_px - 1);
    const std::uint32_t pixel = row * width_px + column;
    if (!taken[pixel]) order.push_back(pixel);
    taken[pixel] = true;
    x += kStepX;
    y += kStepY;
    x -= std::floor(x);
    y -= std::floor(y);
  }
  for (std::uint32_t pixel = 0; pixel < pixels; ++pixel) {
    if (!taken[pixel]) order.push_back(pixel);
  }
  return order;
}

/// Returns surface pixels until `wanted` of them lie away from outlines. The pixels near outlines
/// come along.
std::vector<Sample> choose_samples(const reference::SceneInstant& scene,
                                   const reference::SolveView& view, std::uint32_t wanted) {
  const std::vector<std::uint32_t> order = even_order(view.width_px, view.height_px);
  std::vector<Sample> chosen;
  std::uint32_t inner = 0;
  std::vector<Sample> part;
  for (std::size_t begin = 0; begin < order.size() && inner < wanted; begin += part.size()) {
    part.assign(std::min<std::size_t>(4096, order.size() - begin), {});
    threads::parallel_indices(std::size_t{0}, part.size(), [&](std::size_t i) {
      part[i] = sample_pixel(scene, view, order[begin + i]);
    });
    for (const Sample& sample : part) {
      if (!sample.surface.surface || inner == wanted) continue;
      if (!sample.result.outline) ++inner;
      chosen.push_back(sample);
    }
  }
  std::sort(chosen.begin(), chosen.end(),
            [](const Sample& a, const Sample& b) { return a.result.pixel < b.result.pixel; });
  return chosen;
}

}  // namespace

ConvergedHistory::ConvergedHistory(scene::ScenarioDesc scenario,
                                   std::vector<scene::Material> materials, reference::RayScene rays)
    : scenario_(std::move(scenario)), materials_(std::move(materials)), rays_(std::move(rays)) {}

Result<ConvergedHistory> ConvergedHistory::create(const scene::ScenarioDesc& scenario) {
  auto geometry = scene::load_scene(scenario);
  if (!geometry) return tl::unexpected(std::move(geometry.error()));
  auto rays = reference::RayScene::create(reference::ray_scene_desc(scenario, *geometry));
  if (!rays) return tl::unexpected(std::move(rays.error()));
  return ConvergedHistory(scenario, std::move(geometry->materials), std::move(*rays));
}

Result<std::vector<ConvergedPixel>> ConvergedHistory::picture(
    const reference::SolveView& view, const ConvergedOptions& options) const {
  if (view.sim_time_ns <= scenario_.thermal.history_start_ns || options.steps == 0 ||
      options.pixels == 0 || options.sun_rays == 0 || options.sky_rays == 0) {
    return physics::make_error(
        physics::ErrorCode::invalid_argument,
        "a converged history needs an instant after its start, and steps, pixels and rays");
  }
  std::vector<std::int64_t> weather_ns;
  for (const scene::WeatherSample& row : scenario_.weather) weather_ns.push_back(row.sim_time_ns);
  const ConvergedViews views(rays_, scenario_.thermal.history_start_ns, view.sim_time_ns,
                             weather_ns,
                             {options.steps, options.sun_rays, options.sky_rays,
                              scenario_.thermal.model == scene::ThermalModel::emit2014});
  const auto model = ConvergedModel::create(scenario_, materials_, views.nodes_ns());
  if (!model) return tl::unexpected(model.error());

  std::vector<Sample> samples = choose_samples(rays_.at(view.sim_time_ns), view, options.pixels);
  const std::size_t portion = std::max<std::size_t>(64, samples.size() / 100);
  for (std::size_t begin = 0; begin < samples.size(); begin += portion) {
    const std::size_t end = std::min(samples.size(), begin + portion);
    threads::parallel_ranges(tbb::blocked_range<std::size_t>(begin, end, 8), [&](const auto& part) {
      std::vector<PointView> seen(views.nodes_ns().size());
      for (std::size_t i = part.begin(); i != part.end(); ++i) {
        Sample& sample = samples[i];
        views.see(sample.surface, *model, seen);
        sample.result.temperature_k =
            static_cast<float>(model->temperature_k(sample.surface.material, seen));
      }
    });
    const double done_frac = static_cast<double>(end) / static_cast<double>(samples.size());
    if (options.progress && !options.progress(done_frac)) {
      return physics::make_error(physics::ErrorCode::io, "interrupted");
    }
  }
  std::vector<ConvergedPixel> out;
  out.reserve(samples.size());
  for (const Sample& sample : samples) out.push_back(sample.result);
  return out;
}

std::string ConvergedHistory::describe(const ConvergedOptions& options) const {
  const bool foster = scenario_.thermal.model == scene::ThermalModel::foster;
  return fmt::format(
      "{} with {} uniform history steps, {} rays over the sun's disc and {} over the {} sky",
      foster ? "foster" : "emit2014", options.steps, options.sun_rays, options.sky_rays,
      foster ? "cosine-weighted" : "full-sphere");
}

}  // namespace emit::tool
