// SPDX-License-Identifier: Apache-2.0
#pragma once
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <random>
#include <utility>
#include <vector>

#include "emit/physics/constants.hpp"
#include "emit/reference/visibility.hpp"

/// Small scenes for the visibility tests.
namespace emit::test {

inline reference::RayScene make_scene(
    std::vector<reference::RayMesh> meshes, std::vector<reference::RayEntity> entities = {},
    reference::RayArithmetic arithmetic = reference::RayArithmetic::exact) {
  auto scene = reference::RayScene::create({std::move(meshes), std::move(entities)}, arithmetic);
  if (!scene) throw std::runtime_error(scene.error().text);
  return std::move(*scene);
}

/// Returns a box with its faces outwards.
inline reference::RayMesh box_mesh(const glm::dvec3& low, const glm::dvec3& high) {
  reference::RayMesh mesh;
  for (int i = 0; i < 8; ++i) {
    mesh.positions_m.emplace_back((i & 1) != 0 ? high.x : low.x, (i & 2) != 0 ? high.y : low.y,
                                  (i & 4) != 0 ? high.z : low.z);
  }
  mesh.indices = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                  2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  return mesh;
}

inline reference::RayMesh ground_mesh(double reach_m) {
  reference::RayMesh mesh;
  mesh.positions_m = {{-reach_m, -reach_m, 0.0},
                      {reach_m, -reach_m, 0.0},
                      {reach_m, reach_m, 0.0},
                      {-reach_m, reach_m, 0.0}};
  mesh.indices = {0, 1, 2, 0, 2, 3};
  return mesh;
}

/// Returns a closed mesh that is convex up to `ripple`, with long thin triangles at the poles.
inline reference::RayMesh sphere_mesh(double radius_m, std::uint32_t rings, std::uint32_t sectors,
                                      double ripple = 0.0) {
  reference::RayMesh mesh;
  mesh.positions_m.emplace_back(0.0, 0.0, radius_m);
  for (std::uint32_t r = 1; r < rings; ++r) {
    for (std::uint32_t s = 0; s < sectors; ++s) {
      const double polar = physics::kPi * r / rings;
      const double azimuth = 2.0 * physics::kPi * s / sectors;
      const double radius =
          radius_m * (1.0 + ripple * std::sin(9.0 * polar) * std::cos(7.0 * azimuth));
      mesh.positions_m.emplace_back(radius * std::sin(polar) * std::cos(azimuth),
                                    radius * std::sin(polar) * std::sin(azimuth),
                                    radius * std::cos(polar));
    }
  }
  mesh.positions_m.emplace_back(0.0, 0.0, -radius_m);
  const auto at = [&](std::uint32_t r, std::uint32_t s) {
    if (r == 0) return 0U;
    if (r == rings) return 1 + (rings - 1) * sectors;
    return 1 + (r - 1) * sectors + s % sectors;
  };
  for (std::uint32_t r = 0; r < rings; ++r) {
    for (std::uint32_t s = 0; s < sectors; ++s) {
      if (r > 0) mesh.indices.insert(mesh.indices.end(), {at(r, s), at(r + 1, s), at(r, s + 1)});
      if (r + 1 < rings) {
        mesh.indices.insert(mesh.indices.end(), {at(r, s + 1), at(r + 1, s), at(r + 1, s + 1)});
      }
    }
  }
  return mesh;
}

inline void move(reference::RayMesh& mesh, const glm::dvec3& by_m) {
  for (glm::dvec3& p : mesh.positions_m) p += by_m;
}

inline glm::dvec3 random_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  glm::dvec3 d{normal(random), normal(random), normal(random)};
  return glm::normalize(d);
}

inline glm::dvec3 sun_at(double azimuth_deg, double elevation_deg) {
  const double a = azimuth_deg * physics::kDegree;
  const double e = elevation_deg * physics::kDegree;
  return {std::cos(e) * std::sin(a), std::cos(e) * std::cos(a), std::sin(e)};
}

}  // namespace emit::test
