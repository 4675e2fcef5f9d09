// SPDX-License-Identifier: Apache-2.0
#include "bench/accuracy/error_regions.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <unordered_map>

#include "bench/accuracy/pixel_surface.hpp"
#include "emit/physics/check.hpp"

namespace emit::tool {
namespace {

constexpr double kLitFrac = 0.999;
constexpr double kShadedFrac = 0.001;
/// Neighbouring normals farther apart than 30 degrees are a crease.
constexpr double kCreaseCos = 0.866;

/// Points gathered in cells as wide as the search radius: neighbours lie in 27 cells.
class NearPoints {
 public:
  NearPoints(const std::vector<glm::dvec3>& points_m, double radius_m)
      : points_m_(points_m), radius_m_(radius_m) {
    for (std::uint32_t i = 0; i < points_m.size(); ++i)
      cells_[key(points_m[i], 0, 0, 0)].push_back(i);
  }
  [[nodiscard]] bool any_near(const glm::dvec3& at_m) const {
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dz = -1; dz <= 1; ++dz) {
          const auto cell = cells_.find(key(at_m, dx, dy, dz));
          if (cell == cells_.end()) continue;
          for (const std::uint32_t i : cell->second) {
            if (glm::distance(points_m_[i], at_m) <= radius_m_) return true;
          }
        }
      }
    }
    return false;
  }

 private:
  [[nodiscard]] std::uint64_t key(const glm::dvec3& p, int dx, int dy, int dz) const {
    const auto part = [this](double value, int offset) {
      return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(value / radius_m_)) +
                                        offset) &
             0x1fffffU;
    };
    return part(p.x, dx) << 42U | part(p.y, dy) << 21U | part(p.z, dz);
  }
  const std::vector<glm::dvec3>& points_m_;
  double radius_m_;
  std::unordered_map<std::uint64_t, std::vector<std::uint32_t>> cells_;
};

std::vector<PixelSurface> trace(const reference::SceneInstant& scene,
                                const reference::SolveView& view) {
  std::vector<PixelSurface> pixels(static_cast<std::size_t>(view.width_px) * view.height_px);
  for (std::uint32_t row = 0; row < view.height_px; ++row) {
    for (std::uint32_t column = 0; column < view.width_px; ++column) {
      pixels[static_cast<std::size_t>(row) * view.width_px + column] =
          trace_pixel(scene, view, column, row);
    }
  }
  return pixels;
}

/// Returns true when an edge of an object, a foot or an outline runs between two neighbouring
/// pixels.
bool is_edge(const PixelSurface& a, const PixelSurface& b, double width_rad) {
  if (is_outline(a, b, width_rad)) return true;
  return a.surface && glm::dot(a.normal, b.normal) < kCreaseCos;
}

}  // namespace

std::string_view name_of(Region region) noexcept {
  switch (region) {
    case Region::all:
      return "all";
    case Region::sunlit:
      return "sunlit";
    case Region::core:
      return "core";
    case Region::penumbra:
      return "penumbra";
    case Region::edges:
      return "edges";
  }
  return "";
}

std::array<std::vector<std::uint8_t>, kRegions.size()> classify_pixels(
    const reference::SceneInstant& scene, const reference::SolveView& view,
    const glm::dvec3& to_sun, const RegionOptions& options) {
  const std::vector<PixelSurface> pixels = trace(scene, view);
  const double width_rad = pixel_rad(view);

  std::vector<reference::SurfacePoint> points;
  std::vector<std::size_t> pixel_of_point;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!pixels[i].surface) continue;
    points.push_back(
        {pixels[i].position_m, pixels[i].normal, 1e-9 * (1.0 + glm::length(pixels[i].position_m))});
    pixel_of_point.push_back(i);
  }
  std::vector<double> sun_frac(points.size(), 0.0);
  if (to_sun.z > 0.0) {
    reference::SunQuery query;
    query.rays = 64;
    scene.sun_visible_frac(points, to_sun, query, false, sun_frac);
  }

  std::vector<std::uint8_t> touches_edge(pixels.size(), 0);
  for (std::uint32_t row = 0; row < view.height_px; ++row) {
    for (std::uint32_t column = 0; column < view.width_px; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * view.width_px + column;
      for (const std::size_t step : {std::size_t{1}, std::size_t{view.width_px}}) {
        if (step == 1 ? column + 1 == view.width_px : row + 1 == view.height_px) continue;
        if (is_edge(pixels[i], pixels[i + step], width_rad)) {
          touches_edge[i] = touches_edge[i + step] = 1;
        }
      }
    }
  }
  std::vector<glm::dvec3> edge_m;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (touches_edge[i] != 0 && pixels[i].surface) edge_m.push_back(pixels[i].position_m);
  }
  // A shadow boundary also runs between a lit and a shaded pixel when the penumbra is narrower.
  std::vector<glm::dvec3> boundary_m;
  std::vector<double> sun_of_pixel(pixels.size(), -1.0);
  for (std::size_t k = 0; k < points.size(); ++k) sun_of_pixel[pixel_of_point[k]] = sun_frac[k];
  for (std::uint32_t row = 0; row < view.height_px; ++row) {
    for (std::uint32_t column = 0; column < view.width_px; ++column) {
      const std::size_t i = static_cast<std::size_t>(row) * view.width_px + column;
      if (!pixels[i].surface || touches_edge[i] != 0) continue;
      bool boundary = sun_of_pixel[i] > kShadedFrac && sun_of_pixel[i] < kLitFrac;
      if (column + 1 < view.width_px && pixels[i + 1].surface) {
        boundary = boundary || std::abs(sun_of_pixel[i] - sun_of_pixel[i + 1]) > 0.5;
      }
      if (row + 1 < view.height_px && pixels[i + view.width_px].surface) {
        boundary = boundary || std::abs(sun_of_pixel[i] - sun_of_pixel[i + view.width_px]) > 0.5;
      }
      if (boundary) boundary_m.push_back(pixels[i].position_m);
    }
  }
  const NearPoints edges(edge_m, std::max(options.edge_m, 1e-6));
  const NearPoints boundaries(boundary_m, std::max(options.shadow_boundary_m, 1e-6));

  std::array<std::vector<std::uint8_t>, kRegions.size()> masks;
  for (auto& mask : masks) mask.assign(pixels.size(), 0);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (!pixels[i].surface) continue;
    const auto set = [&masks, i](Region region) { masks[static_cast<std::size_t>(region)][i] = 1; };
    set(Region::all);
    const glm::dvec3& at_m = pixels[i].position_m;
    if (touches_edge[i] != 0 || (options.edge_m > 0.0 && edges.any_near(at_m))) {
      set(Region::edges);
    } else if (boundaries.any_near(at_m)) {
      set(Region::penumbra);
    } else {
      set(sun_of_pixel[i] > 0.5 ? Region::sunlit : Region::core);
    }
  }
  return masks;
}

ErrorSummary summarize_error(std::span<const float> picture, std::span<const float> truth,
                             std::span<const std::uint8_t> mask, bool relative) {
  EMIT_CHECK_OP(picture.size(), ==, truth.size());
  EMIT_CHECK_OP(mask.size(), ==, truth.size());
  ErrorSummary summary;
  std::vector<double> errors;
  double sum = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i) {
    if (mask[i] == 0 || !std::isfinite(truth[i])) continue;
    if (!std::isfinite(picture[i])) {
      ++summary.not_finite;
      continue;
    }
    double error = static_cast<double>(picture[i]) - static_cast<double>(truth[i]);
    if (relative) error /= static_cast<double>(truth[i]);
    sum += error;
    squares += error * error;
    errors.push_back(std::abs(error));
  }
  summary.pixels = errors.size();
  if (errors.empty()) return summary;
  const auto count = static_cast<double>(errors.size());
  summary.mean = sum / count;
  summary.rms = std::sqrt(squares / count);
  std::ranges::sort(errors);
  summary.max = errors.back();
  summary.p99 = errors[static_cast<std::size_t>(std::ceil(0.99 * count)) - 1];
  return summary;
}

}  // namespace emit::tool
