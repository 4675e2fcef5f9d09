// SPDX-License-Identifier: Apache-2.0
#include "draw/cluster_view.hpp"

#include <gtest/gtest.h>

#include <array>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>
#include <random>
#include <vector>

#include "renderer/scene/sphere.hpp"

namespace emit::renderer {
namespace {

/// View and placement of a mesh.
struct Look {
  ViewVolume view;
  glm::dmat4 relworld_from_mesh{1.0};
};

/// Random view in any direction and a mesh somewhere in front of it. The axes of the sensor are x
/// right, y down, z along the boresight.
Look random_look(std::mt19937& random, bool mirrored) {
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  Look look;
  const glm::dvec3 z = glm::normalize(glm::dvec3(unit(random), unit(random), unit(random)) + 1e-3);
  const glm::dvec3 x = glm::normalize(glm::cross(z, glm::dvec3(0.3, unit(random), -0.8)));
  look.view.relworld_from_sensor = glm::dmat3(x, glm::cross(z, x), z);
  look.view.tan_half_h = 0.3;
  look.view.tan_half_v = 0.2;
  const glm::dvec3 place = 3.0 * z + glm::dvec3(unit(random), unit(random), unit(random));
  look.relworld_from_mesh = glm::translate(glm::dmat4(1.0), place);
  look.relworld_from_mesh = glm::rotate(look.relworld_from_mesh, 3.0 * unit(random), x);
  look.relworld_from_mesh =
      glm::scale(look.relworld_from_mesh, glm::dvec3(mirrored ? -0.7 : 0.7, 1.3, 1.0));
  return look;
}

/// True when a triangle faces the camera and a corner or its centre lies in the image.
bool visible(const Look& look, const std::array<glm::dvec3, 3>& relworld_m, bool double_sided) {
  const glm::dvec3 normal =
      glm::cross(relworld_m[1] - relworld_m[0], relworld_m[2] - relworld_m[0]);
  const bool mirrored = glm::determinant(glm::dmat3(look.relworld_from_mesh)) < 0.0;
  const double towards = -glm::dot(normal, relworld_m[0]) * (mirrored ? -1.0 : 1.0);
  if (!double_sided && !(towards > 0.0)) return false;
  std::vector<glm::dvec3> points(relworld_m.begin(), relworld_m.end());
  points.push_back((relworld_m[0] + relworld_m[1] + relworld_m[2]) / 3.0);
  for (const glm::dvec3& point_m : points) {
    const glm::dvec3 s = glm::transpose(look.view.relworld_from_sensor) * point_m;
    if (s.z > 0.0 && std::abs(s.x) < look.view.tan_half_h * s.z &&
        std::abs(s.y) < look.view.tan_half_v * s.z) {
      return true;
    }
  }
  return false;
}

TEST(ClusterView, leaves_out_nothing_that_shows_and_much_that_does_not) {
  scene::Mesh mesh = scene::sphere(60, false);
  const std::vector<scene::Cluster> clusters =
      scene::cut_into_clusters(mesh.positions_m, mesh.indices);
  std::mt19937 random(11);
  std::size_t shown = 0;
  std::size_t needed = 0;
  std::size_t all = 0;
  for (int round = 0; round < 60; ++round) {
    const bool double_sided = round % 4 == 3;
    const Look look = random_look(random, round % 3 == 2);
    const ClusterView view(look.view, look.relworld_from_mesh, {});
    for (const scene::Cluster& cluster : clusters) {
      const bool shows = view.shows(cluster, double_sided);
      bool any = false;
      for (std::uint32_t i = 0; i < cluster.index_count && !any; i += 3) {
        std::array<glm::dvec3, 3> corners_m{};
        for (std::uint32_t k = 0; k < 3; ++k) {
          const std::uint32_t v = mesh.indices[cluster.first_index + i + k];
          corners_m[k] = glm::dvec3(look.relworld_from_mesh *
                                    glm::dvec4(glm::dvec3(mesh.positions_m[v]), 1.0));
        }
        any = visible(look, corners_m, double_sided);
      }
      EXPECT_TRUE(shows || !any) << "round " << round;
      if (double_sided || round % 3 == 2) continue;
      ++all;
      shown += shows ? 1 : 0;
      needed += any ? 1 : 0;
    }
  }
  EXPECT_GT(needed, all / 20);
  EXPECT_LT(shown, needed + all / 4);
}

TEST(ClusterView, of_ground_at_a_flat_angle_shows_little_beyond_the_picture) {
  constexpr std::uint32_t kSide = 200;  // quads of a metre
  scene::Mesh mesh;
  for (std::uint32_t y = 0; y <= kSide; ++y) {
    for (std::uint32_t x = 0; x <= kSide; ++x) mesh.positions_m.emplace_back(x, y, 0.0F);
  }
  for (std::uint32_t y = 0; y < kSide; ++y) {
    for (std::uint32_t x = 0; x < kSide; ++x) {
      const std::uint32_t v = y * (kSide + 1) + x;
      for (const std::uint32_t i : {v, v + 1, v + kSide + 1, v + kSide + 1, v + 1, v + kSide + 2}) {
        mesh.indices.push_back(i);
      }
    }
  }
  const std::vector<scene::Cluster> clusters =
      scene::cut_into_clusters(mesh.positions_m, mesh.indices);
  // Look down by 6 to 16 degrees from 20 m above the centre, in every direction.
  std::size_t shown = 0;
  std::size_t needed = 0;
  for (int turn = 0; turn < 24; ++turn) {
    const double yaw_rad = 0.26 * turn;
    Look look;
    const glm::dvec3 x(std::cos(yaw_rad), -std::sin(yaw_rad), 0.0);
    const glm::dvec3 z =
        glm::normalize(glm::dvec3(std::sin(yaw_rad), std::cos(yaw_rad), -std::tan(0.19)));
    look.view.relworld_from_sensor = glm::dmat3(x, glm::cross(z, x), z);
    look.view.tan_half_h = 0.1;
    look.view.tan_half_v = 0.09;
    look.relworld_from_mesh = glm::translate(glm::dmat4(1.0), glm::dvec3(-100.0, -100.0, -20.0));
    const ClusterView view(look.view, look.relworld_from_mesh, {});
    for (const scene::Cluster& cluster : clusters) {
      bool any = false;
      for (std::uint32_t i = 0; i < cluster.index_count && !any; i += 3) {
        std::array<glm::dvec3, 3> corners_m{};
        for (std::uint32_t k = 0; k < 3; ++k) {
          const std::uint32_t v = mesh.indices[cluster.first_index + i + k];
          corners_m[k] = glm::dvec3(look.relworld_from_mesh *
                                    glm::dvec4(glm::dvec3(mesh.positions_m[v]), 1.0));
        }
        any = visible(look, corners_m, true);
      }
      const bool shows = view.shows(cluster, true);
      EXPECT_TRUE(shows || !any) << "turn " << turn;
      shown += shows ? 1 : 0;
      needed += any ? 1 : 0;
    }
  }
  EXPECT_GT(needed, 100U);
  EXPECT_LT(shown, needed + needed / 4) << needed;
}

}  // namespace
}  // namespace emit::renderer
