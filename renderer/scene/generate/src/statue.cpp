// SPDX-License-Identifier: Apache-2.0
#include "statue.hpp"

#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "polygonise.hpp"
#include "statue_shape.hpp"

namespace emit::scenegen {
namespace {

/// Returns the surface with at least this number of triangles. Their number is proportional to the
/// inverse square of the cell edge, so a coarse trial gives the edge.
physics::Result<Surface> at_least(const StatueShape& shape, std::uint32_t min_triangles) {
  constexpr double kTrialCellM = 0.06;
  constexpr double kMarginFrac = 0.012;
  double cell_m = kTrialCellM;
  Surface surface = polygonise(*shape.distance, shape.min_m, shape.max_m, cell_m);
  for (int attempt = 0; attempt < 6; ++attempt) {
    const auto triangles = static_cast<double>(surface.indices.size()) / 3.0;
    const bool enough = triangles >= min_triangles;
    if (enough && triangles < 1.2 * min_triangles) {
      return surface;
    }
    cell_m *= std::sqrt(triangles / (min_triangles * (1.0 + kMarginFrac * (attempt + 1))));
    surface = polygonise(*shape.distance, shape.min_m, shape.max_m, cell_m);
  }
  return physics::make_error(physics::ErrorCode::internal,
                             fmt::format("statue: {} triangles not reached", min_triangles));
}

}  // namespace

physics::Result<Scene> statue_scene(const StatueOptions& options) {
  const StatueShape shape = statue_shape();
  const physics::Result<Surface> surface = at_least(shape, options.min_triangles);
  if (!surface) {
    return tl::unexpected(surface.error());
  }
  const std::vector<glm::dvec3> normals = smooth_normals(*surface);
  const double scale = options.height_m / shape.height_m;
  Part part;
  part.material = "stone";
  part.positions_m.reserve(normals.size());
  part.normals.reserve(normals.size());
  for (std::size_t i = 0; i < normals.size(); ++i) {
    part.positions_m.emplace_back(scale * surface->positions_m[i]);
    part.normals.emplace_back(normals[i]);
  }
  part.indices = surface->indices;

  Scene scene;
  if (options.plane_m > 0.0) {
    MeshBuilder plane("plane");
    const double half = 0.5 * options.plane_m;
    plane.material("asphalt").grid_quad({-half, -half, 0.0}, {half, -half, 0.0}, {half, half, 0.0},
                                        {-half, half, 0.0}, 8, 8);
    scene.place(scene.add_mesh(plane.take()), "plane");
  }
  SceneMesh statue;
  statue.name = "statue";
  statue.parts.push_back(std::move(part));
  scene.place(scene.add_mesh(std::move(statue)), "statue");
  return scene;
}

}  // namespace emit::scenegen
