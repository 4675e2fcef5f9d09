// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>

#include "emit/scene/mesh.hpp"

namespace emit::scene {
namespace {

/// Unit cube around `centre_m`; `shared`: eight corners, else four per face as exporters write
/// them.
Mesh cube(const glm::vec3& centre_m, bool shared) {
  constexpr std::array<std::array<std::uint32_t, 4>, 6> kFaces = {
      {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4}, {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}}};
  const auto corner = [&centre_m](std::uint32_t i) {
    return centre_m + glm::vec3((i & 1U) != 0 ? 0.5F : -0.5F, (i & 2U) != 0 ? 0.5F : -0.5F,
                                (i & 4U) != 0 ? 0.5F : -0.5F);
  };
  Mesh mesh;
  if (shared) {
    for (std::uint32_t i = 0; i < 8; ++i) mesh.positions_m.push_back(corner(i));
  }
  for (const auto& face : kFaces) {
    std::array<std::uint32_t, 4> at = face;
    if (!shared) {
      for (std::uint32_t& index : at) {
        mesh.positions_m.push_back(corner(index));
        index = static_cast<std::uint32_t>(mesh.positions_m.size() - 1);
      }
    }
    for (const std::size_t k : {0U, 1U, 2U, 0U, 2U, 3U}) mesh.indices.push_back(at[k]);
  }
  mesh.normals.resize(mesh.positions_m.size(), glm::vec3(0.0F, 0.0F, 1.0F));
  mesh.submeshes.push_back({0, static_cast<std::uint32_t>(mesh.indices.size()), 0, false});
  for (const glm::vec3& p : mesh.positions_m) mesh.bounds.add(glm::dvec3(p));
  return mesh;
}

TEST(ClosedSurface, CubeIsClosedWhetherItsCornersAreSharedOrNot) {
  EXPECT_TRUE(is_closed_surface(cube(glm::vec3(0.0F), true)));
  EXPECT_TRUE(is_closed_surface(cube(glm::vec3(0.0F), false)));
}

TEST(ClosedSurface, FarFromTheOriginTheVolumeKeepsItsSign) {
  EXPECT_TRUE(is_closed_surface(cube(glm::vec3(100000.0F, -100000.0F, 50000.0F), true)));
}

TEST(ClosedSurface, NegativeZeroIsTheSamePlaceAsZero) {
  Mesh mesh = cube(glm::vec3(0.5F), false);
  for (std::size_t i = 0; i < mesh.positions_m.size(); i += 2) {
    if (mesh.positions_m[i].x == 0.0F) mesh.positions_m[i].x = -0.0F;
  }
  EXPECT_TRUE(is_closed_surface(mesh));
}

TEST(ClosedSurface, HoleMakesItOpen) {
  Mesh mesh = cube(glm::vec3(0.0F), true);
  mesh.indices.resize(mesh.indices.size() - 3);
  mesh.submeshes[0].index_count -= 3;
  EXPECT_FALSE(is_closed_surface(mesh));
}

TEST(ClosedSurface, OneTurnedTriangleMakesItOpen) {
  Mesh mesh = cube(glm::vec3(0.0F), true);
  std::swap(mesh.indices[0], mesh.indices[1]);
  EXPECT_FALSE(is_closed_surface(mesh));
}

TEST(ClosedSurface, InsideOutIsNotABody) {
  Mesh mesh = cube(glm::vec3(0.0F), true);
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    std::swap(mesh.indices[i + 1], mesh.indices[i + 2]);
  }
  EXPECT_FALSE(is_closed_surface(mesh));
}

TEST(ClosedSurface, TriangleDrawnTwiceMakesItOpen) {
  Mesh mesh = cube(glm::vec3(0.0F), true);
  for (const std::size_t k : {0U, 1U, 2U}) mesh.indices.push_back(mesh.indices[k]);
  mesh.submeshes[0].index_count += 3;
  EXPECT_FALSE(is_closed_surface(mesh));
}

TEST(ClosedSurface, SheetsAreNeverBodies) {
  Mesh mesh = cube(glm::vec3(0.0F), true);
  mesh.submeshes[0].double_sided = true;
  EXPECT_FALSE(is_closed_surface(mesh));
  EXPECT_FALSE(is_closed_surface(Mesh{}));
}

}  // namespace
}  // namespace emit::scene
