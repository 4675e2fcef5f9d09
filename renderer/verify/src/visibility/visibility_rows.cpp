// SPDX-License-Identifier: Apache-2.0
#include "visibility_rows.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <initializer_list>

#include "emit/physics/constants.hpp"

namespace emit::verify {
namespace {

using physics::ErrorCode;
using physics::make_error;
using physics::Result;

/// Number of corners of a circular disc. The polygon has the circle's area; the remaining error is
/// 2e-6 of it.
constexpr std::uint32_t kDiscSides = 1024;

void add_quad(VisibilityRow& row, const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c,
              const glm::dvec3& d) {
  const auto first = static_cast<std::uint32_t>(row.positions_m.size());
  row.positions_m.insert(row.positions_m.end(), {a, b, c, d});
  for (const std::uint32_t corner : {0U, 1U, 2U, 0U, 2U, 3U}) row.indices.push_back(first + corner);
}

void add_ground(VisibilityRow& row, double reach_m) {
  add_quad(row, {-reach_m, -reach_m, 0.0}, {reach_m, -reach_m, 0.0}, {reach_m, reach_m, 0.0},
           {-reach_m, reach_m, 0.0});
}

void add_box(VisibilityRow& row, const glm::dvec3& low, const glm::dvec3& high) {
  const auto at = [&](int x, int y, int z) {
    return glm::dvec3(x != 0 ? high.x : low.x, y != 0 ? high.y : low.y, z != 0 ? high.z : low.z);
  };
  add_quad(row, at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1));
  add_quad(row, at(0, 1, 0), at(1, 1, 0), at(1, 0, 0), at(0, 0, 0));
  add_quad(row, at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1));
  add_quad(row, at(1, 1, 0), at(0, 1, 0), at(0, 1, 1), at(1, 1, 1));
  add_quad(row, at(0, 1, 0), at(0, 0, 0), at(0, 0, 1), at(0, 1, 1));
  add_quad(row, at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1));
}

/// Adds a prism along y between -reach_m and reach_m. `outline` (x, z) is counter-clockwise seen
/// from -y.
void add_prism(VisibilityRow& row, double reach_m, std::initializer_list<glm::dvec2> outline) {
  const std::vector<glm::dvec2> corners(outline);
  const auto at = [&](std::size_t i, double y_m) {
    const glm::dvec2& p = corners[i % corners.size()];
    return glm::dvec3(p.x, y_m, p.y);
  };
  for (std::size_t i = 0; i < corners.size(); ++i) {
    add_quad(row, at(i, -reach_m), at(i, reach_m), at(i + 1, reach_m), at(i + 1, -reach_m));
  }
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    const auto first = static_cast<std::uint32_t>(row.positions_m.size());
    row.positions_m.insert(row.positions_m.end(),
                           {at(0, -reach_m), at(i, -reach_m), at(i + 1, -reach_m), at(0, reach_m),
                            at(i + 1, reach_m), at(i, reach_m)});
    for (std::uint32_t k = 0; k < 6; ++k) row.indices.push_back(first + k);
  }
}

/// Adds a wall along y whose near face is at x = near_m. It is as thick as high and extends away
/// from the point at the origin.
void add_wall(VisibilityRow& row, double near_m, double height_m, double reach_m) {
  const double far_m = near_m + std::copysign(height_m, near_m);
  add_box(row, {std::min(near_m, far_m), -reach_m, 0.0},
          {std::max(near_m, far_m), reach_m, height_m});
}

void add_disc(VisibilityRow& row, const glm::dvec3& centre_m, double radius_m) {
  const double step_rad = 2.0 * physics::kPi / kDiscSides;
  const double outer_m = radius_m * std::sqrt(step_rad / std::sin(step_rad));
  const auto first = static_cast<std::uint32_t>(row.positions_m.size());
  row.positions_m.push_back(centre_m);
  for (std::uint32_t i = 0; i < kDiscSides; ++i) {
    row.positions_m.push_back(
        centre_m + outer_m * glm::dvec3(std::cos(step_rad * i), std::sin(step_rad * i), 0.0));
    const std::uint32_t next = (i + 1) % kDiscSides;
    for (const std::uint32_t corner : {0U, 1 + i, 1 + next}) row.indices.push_back(first + corner);
  }
}

Result<void> need_positive(std::string_view kind, std::initializer_list<double> values) {
  std::size_t number = 0;
  for (const double value : values) {
    ++number;
    if (!(value > 0.0 && std::isfinite(value))) {
      return make_error(
          ErrorCode::invalid_argument,
          fmt::format("{}: parameter {} is {}, must be positive", kind, number, value));
    }
  }
  return {};
}

}  // namespace

Result<VisibilityRow> wall_shadow_row(double height_m, double elevation_rad, double distance_m) {
  if (auto ok = need_positive("wall-shadow", {height_m, elevation_rad, distance_m}); !ok) {
    return tl::unexpected(std::move(ok.error()));
  }
  VisibilityRow row;
  row.length_m = std::max(height_m, distance_m);
  const double reach_m = kInfiniteFactor * row.length_m;
  add_ground(row, reach_m);
  add_wall(row, -distance_m, height_m, reach_m);
  row.to_sun = {-std::cos(elevation_rad), 0.0, std::sin(elevation_rad)};
  return row;
}

VisibilityRow sun_disc_row(double delta_rad) {
  // The wall is as high as its distance.
  VisibilityRow row;
  add_ground(row, kInfiniteFactor);
  add_wall(row, -1.0, 1.0, kInfiniteFactor);
  const double elevation_rad = std::atan(1.0) + delta_rad;
  row.to_sun = {-std::cos(elevation_rad), 0.0, std::sin(elevation_rad)};
  return row;
}

Result<VisibilityRow> sky_view_row(std::string_view kind, const std::array<double, 7>& p) {
  VisibilityRow row;
  const auto checked = [&](std::initializer_list<double> values) {
    return need_positive(kind, values);
  };
  Result<void> ok;
  if (kind == "flat") {
    add_ground(row, kInfiniteFactor);
  } else if (kind == "wall") {  // H, D
    if (ok = checked({p[0], p[1]}); !ok) return tl::unexpected(std::move(ok.error()));
    row.length_m = std::max(p[0], p[1]);
    add_ground(row, kInfiniteFactor * row.length_m);
    add_wall(row, p[1], p[0], kInfiniteFactor * row.length_m);
  } else if (kind == "canyon") {  // H1, D1, H2, D2
    if (ok = checked({p[0], p[1], p[2], p[3]}); !ok) return tl::unexpected(std::move(ok.error()));
    row.length_m = std::max({p[0], p[1], p[2], p[3]});
    add_ground(row, kInfiniteFactor * row.length_m);
    add_wall(row, p[1], p[0], kInfiniteFactor * row.length_m);
    add_wall(row, -p[3], p[2], kInfiniteFactor * row.length_m);
  } else if (kind == "vgroove") {  // opening angle, face length L, distance s along the face
    if (ok = checked({p[0], p[1], p[2]}); !ok) return tl::unexpected(std::move(ok.error()));
    if (p[0] >= 180.0 || p[2] > p[1]) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("vgroove: opening {} deg must be below 180, point at {} on the "
                                    "face of {}",
                                    p[0], p[2], p[1]));
    }
    row.length_m = std::max(p[1], p[2]);
    row.sheets = true;
    const double reach_m = kInfiniteFactor * row.length_m;
    const double angle_rad = p[0] * physics::kDegree;
    // The point's face is level along +x from the apex at -s. The other face rises from the apex.
    const glm::dvec2 apex{-p[2], 0.0};
    const glm::dvec2 lip = apex + p[1] * glm::dvec2(std::cos(angle_rad), std::sin(angle_rad));
    add_quad(row, {apex.x, -reach_m, 0.0}, {p[1] - p[2], -reach_m, 0.0},
             {p[1] - p[2], reach_m, 0.0}, {apex.x, reach_m, 0.0});
    add_quad(row, {apex.x, -reach_m, 0.0}, {apex.x, reach_m, 0.0}, {lip.x, reach_m, lip.y},
             {lip.x, -reach_m, lip.y});
  } else if (kind == "disc") {  // height, radius, offset of the axis
    if (ok = checked({p[0], p[1]}); !ok) return tl::unexpected(std::move(ok.error()));
    row.length_m = std::max({p[0], p[1], std::abs(p[2])});
    add_ground(row, kInfiniteFactor * row.length_m);
    row.sheets = true;
    add_disc(row, {p[2], 0.0, p[0]}, p[1]);
  } else if (kind == "box") {  // W, Dp, H, px, py
    if (ok = checked({p[0], p[1], p[2]}); !ok) return tl::unexpected(std::move(ok.error()));
    row.length_m = std::max({p[0], p[1], p[2], std::abs(p[3]), std::abs(p[4])});
    add_ground(row, kInfiniteFactor * row.length_m);
    add_box(row, {-0.5 * p[0], -0.5 * p[1], 0.0}, {0.5 * p[0], 0.5 * p[1], p[2]});
    row.point_m = {p[3], p[4], 0.0};
  } else if (kind == "edge") {  // dihedral angle of the solid
    if (!(p[0] > 0.0 && p[0] < 180.0)) {
      return make_error(ErrorCode::invalid_argument,
                        fmt::format("edge: angle {} deg must lie between 0 and 180", p[0]));
    }
    const double half_rad = 0.5 * p[0] * physics::kDegree;
    const double reach_m = kInfiniteFactor;
    const glm::dvec2 side{reach_m * std::sin(half_rad), -reach_m * std::cos(half_rad)};
    add_prism(row, reach_m, {{0.0, 0.0}, {-side.x, side.y}, {0.0, -reach_m}, side});
    row.normal = glm::dvec3(0.0);
  } else if (kind == "cube_corner") {
    add_box(row, glm::dvec3(-1.0), glm::dvec3(0.0));
    row.normal = glm::dvec3(0.0);
    row.outward = glm::normalize(glm::dvec3(1.0));
  } else {
    return make_error(ErrorCode::invalid_argument,
                      fmt::format("unknown kind '{}'; there are flat, wall, canyon, vgroove, disc, "
                                  "box, edge, cube_corner",
                                  kind));
  }
  return row;
}

scene::SceneGeometry scene_geometry(const VisibilityRow& row) {
  scene::SceneGeometry geometry;
  scene::Mesh mesh;
  for (const glm::dvec3& p : row.positions_m) {
    mesh.positions_m.emplace_back(p);
    mesh.bounds.add(glm::dvec3(mesh.positions_m.back()));
  }
  mesh.normals.resize(mesh.positions_m.size(), glm::vec3(0.0F, 0.0F, 1.0F));
  for (std::size_t i = 0; i + 2 < row.indices.size(); i += 3) {
    // Corners are shared only within a plane.
    const glm::dvec3& a = row.positions_m[row.indices[i]];
    const glm::dvec3 normal = glm::normalize(glm::cross(row.positions_m[row.indices[i + 1]] - a,
                                                        row.positions_m[row.indices[i + 2]] - a));
    for (std::size_t k = 0; k < 3; ++k) mesh.normals[row.indices[i + k]] = glm::vec3(normal);
  }
  mesh.indices = row.indices;
  mesh.submeshes.push_back(
      {.index_count = static_cast<std::uint32_t>(row.indices.size()), .double_sided = row.sheets});
  scene::Instance instance;
  instance.world_bounds = mesh.bounds;
  geometry.static_bounds = geometry.bounds = mesh.bounds;
  geometry.triangles = row.indices.size() / 3;
  geometry.meshes.push_back(std::move(mesh));
  geometry.instances.push_back(instance);
  geometry.materials.emplace_back();
  return geometry;
}

}  // namespace emit::verify
