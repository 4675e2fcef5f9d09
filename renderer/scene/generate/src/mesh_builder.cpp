// SPDX-License-Identifier: Apache-2.0
#include "mesh_builder.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "emit/physics/check.hpp"
#include "emit/physics/constants.hpp"

namespace emit::scenegen {

std::uint32_t Scene::add_mesh(SceneMesh mesh) {
  meshes.push_back(std::move(mesh));
  return static_cast<std::uint32_t>(meshes.size() - 1);
}

void Scene::place(std::uint32_t mesh, const std::string& name, const glm::dvec3& position_m,
                  double yaw_rad) {
  nodes.push_back({name, mesh, position_m, yaw_rad});
}

MeshBuilder& MeshBuilder::material(const std::string& name, bool double_sided) {
  const auto found = std::find_if(mesh_.parts.begin(), mesh_.parts.end(), [&](const Part& p) {
    return p.material == name && p.double_sided == double_sided;
  });
  current_ = static_cast<std::size_t>(found - mesh_.parts.begin());
  if (found == mesh_.parts.end()) {
    mesh_.parts.push_back({name, double_sided, {}, {}, {}, {}});
  }
  return *this;
}

MeshBuilder& MeshBuilder::origin(const glm::dvec3& offset_m, double yaw_rad) {
  offset_m_ = offset_m;
  cos_yaw_ = std::cos(yaw_rad);
  sin_yaw_ = std::sin(yaw_rad);
  return *this;
}

Part& MeshBuilder::part() {
  return mesh_.parts[current_];
}

std::uint32_t MeshBuilder::vertex(const glm::dvec3& p, const glm::dvec3& n) {
  const auto turned = [this](const glm::dvec3& v) {
    return glm::dvec3(cos_yaw_ * v.x - sin_yaw_ * v.y, sin_yaw_ * v.x + cos_yaw_ * v.y, v.z);
  };
  Part& target = part();
  target.positions_m.emplace_back(offset_m_ + turned(p));
  target.normals.emplace_back(turned(n));
  return static_cast<std::uint32_t>(target.positions_m.size() - 1);
}

void MeshBuilder::triangle(std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  part().indices.insert(part().indices.end(), {a, b, c});
}

void MeshBuilder::polygon(const std::vector<glm::dvec3>& corners) {
  EMIT_CHECK_OP(corners.size(), >=, 3U);
  glm::dvec3 area(0.0);
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    area += glm::cross(corners[i] - corners[0], corners[i + 1] - corners[0]);
  }
  const glm::dvec3 normal = glm::normalize(area);
  std::vector<std::uint32_t> ring;
  for (const glm::dvec3& corner : corners) {
    ring.push_back(vertex(corner, normal));
  }
  for (std::size_t i = 1; i + 1 < ring.size(); ++i) {
    triangle(ring[0], ring[i], ring[i + 1]);
  }
}

void MeshBuilder::quad(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c,
                       const glm::dvec3& d) {
  polygon({a, b, c, d});
}

void MeshBuilder::foliage_card(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c,
                               const glm::dvec3& d) {
  EMIT_CHECK(part().double_sided);
  EMIT_CHECK_OP(part().uv.size(), ==, part().positions_m.size());
  quad(a, b, c, d);
  for (const glm::vec2 corner : {glm::vec2(0.0F, 1.0F), {1.0F, 1.0F}, {1.0F, 0.0F}, {0.0F, 0.0F}}) {
    part().uv.push_back(corner);
  }
}

void MeshBuilder::grid_quad(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c,
                            const glm::dvec3& d, std::uint32_t columns, std::uint32_t rows) {
  const glm::dvec3 normal = glm::normalize(glm::cross(b - a, d - a));
  std::vector<std::uint32_t> lattice;
  for (std::uint32_t row = 0; row <= rows; ++row) {
    const double v = static_cast<double>(row) / rows;
    for (std::uint32_t column = 0; column <= columns; ++column) {
      const double u = static_cast<double>(column) / columns;
      const glm::dvec3 lower = a + u * (b - a);
      const glm::dvec3 upper = d + u * (c - d);
      lattice.push_back(vertex(lower + v * (upper - lower), normal));
    }
  }
  for (std::uint32_t row = 0; row < rows; ++row) {
    for (std::uint32_t column = 0; column < columns; ++column) {
      const std::size_t i = std::size_t{row} * (columns + 1) + column;
      triangle(lattice[i], lattice[i + 1], lattice[i + columns + 2]);
      triangle(lattice[i], lattice[i + columns + 2], lattice[i + columns + 1]);
    }
  }
}

void MeshBuilder::box(const glm::dvec3& lo, const glm::dvec3& hi, std::uint32_t faces) {
  prism({{lo.x, lo.y}, {hi.x, lo.y}, {hi.x, hi.y}, {lo.x, hi.y}}, lo.z, hi.z, faces);
}

void MeshBuilder::prism(const std::vector<glm::dvec2>& outline, double z0_m, double z1_m,
                        std::uint32_t faces) {
  std::vector<glm::dvec3> top;
  std::vector<glm::dvec3> bottom;
  for (const glm::dvec2& p : outline) {
    top.emplace_back(p, z1_m);
    bottom.emplace_back(p, z0_m);
  }
  if ((faces & kSides) != 0) {
    for (std::size_t i = 0; i < outline.size(); ++i) {
      const std::size_t next = (i + 1) % outline.size();
      quad(bottom[i], bottom[next], top[next], top[i]);
    }
  }
  if ((faces & kTop) != 0) {
    polygon(top);
  }
  if ((faces & kBottom) != 0) {
    std::reverse(bottom.begin(), bottom.end());
    polygon(bottom);
  }
}

void MeshBuilder::profile(const std::vector<glm::dvec2>& outline_xz, double y0_m, double y1_m,
                          bool caps) {
  std::vector<glm::dvec3> near;
  std::vector<glm::dvec3> far;
  for (const glm::dvec2& p : outline_xz) {
    near.emplace_back(p.x, y0_m, p.y);
    far.emplace_back(p.x, y1_m, p.y);
  }
  for (std::size_t i = 0; i < near.size(); ++i) {
    const std::size_t next = (i + 1) % near.size();
    quad(near[next], near[i], far[i], far[next]);
  }
  if (caps) {
    polygon(near);
    std::reverse(far.begin(), far.end());
    polygon(far);
  }
}

void MeshBuilder::tube(const glm::dvec3& from, const glm::dvec3& to, double from_radius_m,
                       double to_radius_m, std::uint32_t sides, bool cap_from, bool cap_to) {
  EMIT_CHECK_OP(sides, >=, 3U);
  const glm::dvec3 axis = glm::normalize(to - from);
  const glm::dvec3 helper = std::abs(axis.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(1, 0, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(helper, axis));
  const glm::dvec3 v = glm::cross(axis, u);
  const double slope = (from_radius_m - to_radius_m) / glm::length(to - from);
  std::vector<glm::dvec3> direction;
  for (std::uint32_t i = 0; i < sides; ++i) {
    const double angle = 2.0 * physics::kPi * i / sides;
    direction.push_back(std::cos(angle) * u + std::sin(angle) * v);
  }
  std::vector<std::uint32_t> low;
  std::vector<std::uint32_t> high;
  for (const glm::dvec3& d : direction) {
    const glm::dvec3 normal = glm::normalize(d + slope * axis);
    low.push_back(vertex(from + from_radius_m * d, normal));
    high.push_back(vertex(to + to_radius_m * d, normal));
  }
  for (std::size_t i = 0; i < direction.size(); ++i) {
    const std::size_t next = (i + 1) % direction.size();
    if (from_radius_m > 0.0) {
      triangle(low[i], low[next], high[next]);
    }
    if (to_radius_m > 0.0) {
      triangle(low[i], high[next], high[i]);
    }
  }
  std::vector<glm::dvec3> ring;
  if (cap_from && from_radius_m > 0.0) {
    for (auto d = direction.rbegin(); d != direction.rend(); ++d) {
      ring.push_back(from + from_radius_m * *d);
    }
    polygon(ring);
  }
  ring.clear();
  if (cap_to && to_radius_m > 0.0) {
    for (const glm::dvec3& d : direction) {
      ring.push_back(to + to_radius_m * d);
    }
    polygon(ring);
  }
}

void MeshBuilder::lathe_x(const std::vector<glm::dvec2>& rings, const glm::dvec3& axis_point_m,
                          std::uint32_t sides, double scale_z) {
  EMIT_CHECK_OP(rings.size(), >=, 2U);
  EMIT_CHECK_OP(sides, >=, 3U);
  std::vector<std::vector<std::uint32_t>> lattice;
  for (std::size_t r = 0; r < rings.size(); ++r) {
    const glm::dvec2 before = rings[r == 0 ? 0 : r - 1];
    const glm::dvec2 after = rings[std::min(r + 1, rings.size() - 1)];
    const glm::dvec2 along = glm::normalize(after - before);
    std::vector<std::uint32_t> ring;
    for (std::uint32_t i = 0; i < sides; ++i) {
      const double angle = 2.0 * physics::kPi * i / sides;
      const double c = std::cos(angle);
      const double s = std::sin(angle);
      const glm::dvec3 normal =
          glm::normalize(glm::dvec3(-along.y, along.x * c, along.x * s / scale_z));
      ring.push_back(vertex(
          axis_point_m + glm::dvec3(rings[r].x, rings[r].y * c, rings[r].y * s * scale_z), normal));
    }
    lattice.push_back(std::move(ring));
  }
  for (std::size_t r = 0; r + 1 < lattice.size(); ++r) {
    for (std::uint32_t i = 0; i < sides; ++i) {
      const std::uint32_t next = (i + 1) % sides;
      if (rings[r].y > 0.0) {
        triangle(lattice[r][i], lattice[r][next], lattice[r + 1][next]);
      }
      if (rings[r + 1].y > 0.0) {
        triangle(lattice[r][i], lattice[r + 1][next], lattice[r + 1][i]);
      }
    }
  }
}

std::uint64_t triangle_count(const Scene& scene) {
  std::uint64_t count = 0;
  for (const SceneNode& node : scene.nodes) {
    for (const Part& part : scene.meshes[node.mesh].parts) {
      count += part.indices.size() / 3;
    }
  }
  return count;
}

}  // namespace emit::scenegen
