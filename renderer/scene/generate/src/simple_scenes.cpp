// SPDX-License-Identifier: Apache-2.0
#include "simple_scenes.hpp"

#include <array>
#include <cmath>

namespace emit::scenegen {
namespace {

/// Adds a horizontal grid at z with lines at the given coordinates. Cells for which `leave_out` is
/// true stay open.
template <class Predicate>
void grid_plane(MeshBuilder& builder, const std::vector<double>& xs, const std::vector<double>& ys,
                double z, Predicate leave_out) {
  for (std::size_t j = 0; j + 1 < ys.size(); ++j) {
    for (std::size_t i = 0; i + 1 < xs.size(); ++i) {
      if (!leave_out(i, j)) {
        builder.quad({xs[i], ys[j], z}, {xs[i + 1], ys[j], z}, {xs[i + 1], ys[j + 1], z},
                     {xs[i], ys[j + 1], z});
      }
    }
  }
}

/// Adds a plane of half edge `p` around a box of half edge `h`, cut along its foot. No edge meets
/// another in a T.
void add_plane(Scene& scene, double h, double p) {
  MeshBuilder plane("plane");
  plane.material("asphalt");
  const std::vector<double> lines{-p, -h, h, p};
  const auto is_corner = [](std::size_t i, std::size_t j) { return i != 1 && j != 1; };
  grid_plane(plane, lines, lines, 0.0, is_corner);  // 10 triangles
  const double m = 0.5 * (h + p);
  for (const glm::dvec2 corner : {glm::dvec2(-m, -m), glm::dvec2(m, -m), glm::dvec2(m, m)}) {
    const double r = 0.5 * (p - h);  // 4 each: 12
    const std::array<glm::dvec3, 4> ring{glm::dvec3(corner.x - r, corner.y - r, 0.0),
                                         {corner.x + r, corner.y - r, 0.0},
                                         {corner.x + r, corner.y + r, 0.0},
                                         {corner.x - r, corner.y + r, 0.0}};
    for (std::size_t i = 0; i < 4; ++i) {
      plane.polygon({ring[i], ring[(i + 1) % 4], {corner, 0.0}});
    }
  }
  plane.polygon({{-m, p, 0.0}, {-p, p, 0.0}, {-p, h, 0.0}, {-h, h, 0.0}, {-h, p, 0.0}});  // 3
  scene.place(scene.add_mesh(plane.take()), "plane");
}

}  // namespace

Scene box_scene(const BoxOptions& options) {
  const double h = 0.5 * options.size_m;
  const double p = 0.5 * options.plane_m;
  Scene scene;
  // A closed box has an even number of triangles: 20 here, with sides fanned around their middles.
  // The plane has the other 25.
  if (p > 0.0) add_plane(scene, h, p);

  MeshBuilder box("box");
  box.material("concrete");
  const std::array<glm::dvec2, 4> foot{glm::dvec2(-h, -h), {h, -h}, {h, h}, {-h, h}};
  const glm::dvec3 up(0.0, 0.0, options.size_m);
  for (std::size_t side = 0; side < 4; ++side) {
    const glm::dvec3 a(foot[side], 0.0);
    const glm::dvec3 b(foot[(side + 1) % 4], 0.0);
    const glm::dvec3 middle = 0.5 * (a + b + up);
    box.polygon({a, b, middle});
    box.polygon({b, b + up, middle});
    box.polygon({b + up, a + up, middle});
    box.polygon({a + up, a, middle});
  }
  box.box({-h, -h, 0.0}, {h, h, options.size_m}, MeshBuilder::kTop | MeshBuilder::kBottom);
  scene.place(scene.add_mesh(box.take()), "box");
  return scene;
}

Scene block_on_road_scene(const BlockOnRoadOptions& options) {
  const glm::dvec3 half(0.5 * options.block_east_m, 0.5 * options.block_north_m, 0.0);
  const double road_x = 0.5 * options.road_east_m;
  const double road_y = 0.5 * options.road_north_m;
  const double wall = options.wall_thickness_m;
  const double height = options.block_up_m;
  Scene scene;
  MeshBuilder road("road");
  road.material("asphalt");
  std::vector<double> xs{-road_x, -half.x, half.x, road_x};
  std::vector<double> ys{-road_y, -half.y, half.y, road_y};
  if (wall > 0.0) {
    xs = {-road_x, -half.x, -half.x + wall, half.x - wall, half.x, road_x};
    ys = {-road_y, -half.y, -half.y + wall, half.y - wall, half.y, road_y};
  }
  // The grid is cut along every line of contact, so that no face reaches from under the block into
  // the open.
  grid_plane(road, xs, ys, 0.0, [](std::size_t, std::size_t) { return false; });
  scene.place(scene.add_mesh(road.take()), "road");

  const glm::dvec3 top(half.x, half.y, height);
  MeshBuilder block("block");
  block.material("concrete");
  if (wall == 0.0) {
    block.box(-half, top);
    scene.place(scene.add_mesh(block.take()), "block");
    return scene;
  }
  block.box(-half, top, MeshBuilder::kTop | MeshBuilder::kSides);
  const auto down = [&block](double x0, double y0, double x1, double y1) {
    block.quad({x0, y0, 0.0}, {x0, y1, 0.0}, {x1, y1, 0.0}, {x1, y0, 0.0});
  };
  const double inner_x = half.x - wall;
  const double inner_y = half.y - wall;
  for (std::size_t j = 1; j < 4; ++j) {
    for (std::size_t i = 1; i < 4; ++i) {
      if (i != 2 || j != 2) {
        down(xs[i], ys[j], xs[i + 1], ys[j + 1]);
      }
    }
  }
  scene.place(scene.add_mesh(block.take()), "block");

  MeshBuilder inner("block_inner");
  inner.material("concrete");
  const double ceiling = height - wall;
  inner.quad({-inner_x, -inner_y, ceiling}, {-inner_x, inner_y, ceiling},
             {inner_x, inner_y, ceiling}, {inner_x, -inner_y, ceiling});
  const std::array<glm::dvec2, 4> ring{
      glm::dvec2(-inner_x, -inner_y), {inner_x, -inner_y}, {inner_x, inner_y}, {-inner_x, inner_y}};
  for (std::size_t side = 0; side < 4; ++side) {
    const glm::dvec2 a = ring[side];
    const glm::dvec2 b = ring[(side + 1) % 4];
    inner.quad({b, 0.0}, {a, 0.0}, {a, ceiling}, {b, ceiling});
  }
  scene.place(scene.add_mesh(inner.take()), "block_inner");
  return scene;
}

Scene ribbed_scene(const RibbedOptions& options) {
  Scene scene;
  MeshBuilder builder("ribbed");
  builder.material("concrete");
  const double width = options.ribs * options.pitch_m;
  const double y = 0.5 * options.length_m;
  const double valley = options.pitch_m - options.rib_width_m;
  const double height = options.rib_height_m;
  const double base = -options.rib_height_m;  // the plate under the ribs
  const auto strip = [&](const glm::dvec2& a, const glm::dvec2& b) {
    builder.grid_quad({a.x, -y, a.y}, {b.x, -y, b.y}, {b.x, y, b.y}, {a.x, y, a.y}, 1, 8);
  };
  const double left_end = -0.5 * width;
  const double right_end = 0.5 * width;
  strip({left_end, base}, {left_end, 0.0});
  double x = left_end;
  for (std::uint32_t rib = 0; rib < options.ribs; ++rib) {
    const double rib_left = left_end + rib * options.pitch_m + 0.5 * valley;
    const double rib_right = rib_left + options.rib_width_m;
    strip({x, 0.0}, {rib_left, 0.0});
    strip({rib_left, 0.0}, {rib_left, height});
    strip({rib_left, height}, {rib_right, height});
    strip({rib_right, height}, {rib_right, 0.0});
    x = rib_right;
  }
  strip({x, 0.0}, {right_end, 0.0});
  strip({right_end, 0.0}, {right_end, base});
  strip({right_end, base}, {left_end, base});
  for (const double side : {-1.0, 1.0}) {
    const auto face = [&](double x0, double z0, double x1, double z1) {
      const double at = side * y;
      if (side < 0.0) {
        builder.quad({x0, at, z0}, {x1, at, z0}, {x1, at, z1}, {x0, at, z1});
      } else {
        builder.quad({x1, at, z0}, {x0, at, z0}, {x0, at, z1}, {x1, at, z1});
      }
    };
    face(left_end, base, right_end, 0.0);
    for (std::uint32_t rib = 0; rib < options.ribs; ++rib) {
      const double rib_left = left_end + rib * options.pitch_m + 0.5 * valley;
      face(rib_left, 0.0, rib_left + options.rib_width_m, height);
    }
  }
  scene.place(scene.add_mesh(builder.take()), "ribbed");
  return scene;
}

}  // namespace emit::scenegen
