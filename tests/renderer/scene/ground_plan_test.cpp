// SPDX-License-Identifier: Apache-2.0
// Meshes of level ground against areas in closed form, and against the rules of one layer: no
// triangle lies on another, none lies face down, and no corner lies on the side of a neighbour.
#include "ground_plan.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <set>
#include <tuple>

namespace emit::scenegen {
namespace {

using GroundPoint = std::pair<float, float>;

/// Area of each material. Fails where the mesh is not one layer within a rectangle: triangles that
/// all face up, and whose sides all meet one other side unless they lie on the rim, cover each
/// place equally often; the sum of areas then says that this is once.
std::map<std::string, double> areas_of_one_layer(const SceneMesh& mesh, const glm::dvec2& low_m,
                                                 const glm::dvec2& high_m) {
  std::map<std::string, double> areas_m2;
  std::map<std::pair<GroundPoint, GroundPoint>, int> sides;
  double total_m2 = 0.0;
  for (const Part& part : mesh.parts) {
    for (const glm::vec3& normal : part.normals) EXPECT_EQ(normal, glm::vec3(0.0F, 0.0F, 1.0F));
    for (std::size_t i = 0; i < part.indices.size(); i += 3) {
      const auto at = [&](std::size_t k) { return part.positions_m[part.indices[i + k % 3]]; };
      const glm::dvec3 a(at(0));
      const glm::dvec3 b(at(1));
      const glm::dvec3 c(at(2));
      const double area_m2 = 0.5 * ((b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x));
      EXPECT_GT(area_m2, 0.0) << part.material << " at " << a.x << ", " << a.y;
      areas_m2[part.material] += area_m2;
      total_m2 += area_m2;
      for (std::size_t k = 0; k < 3; ++k) {
        EXPECT_EQ(at(k).z, 0.0F);
        ++sides[{GroundPoint(at(k).x, at(k).y), GroundPoint(at(k + 1).x, at(k + 1).y)}];
      }
    }
  }
  for (const auto& [side, count] : sides) {
    const auto& [from, to] = side;
    EXPECT_EQ(count, 1) << from.first << ", " << from.second;
    const bool on_rim =
        (from.first == to.first && (from.first == low_m.x || from.first == high_m.x)) ||
        (from.second == to.second && (from.second == low_m.y || from.second == high_m.y));
    EXPECT_EQ(sides.contains({to, from}), !on_rim) << from.first << ", " << from.second;
  }
  const double whole_m2 = (high_m.x - low_m.x) * (high_m.y - low_m.y);
  EXPECT_NEAR(total_m2, whole_m2, 1e-6 * whole_m2);
  return areas_m2;
}

TEST(GroundPlan, materials_have_the_areas_of_their_outlines) {
  GroundPlan plan;
  plan.rectangle(-50.0, -50.0, 50.0, 50.0, "grass");
  plan.rectangle(-40.0, -20.0, 40.0, 20.0, "asphalt");
  // Eight by four slabs of 5 m with joints of 1/16 m, a square that stands on its corner across the
  // edge of the asphalt, and a line of paint over slabs and asphalt.
  plan.slabs(-40.0, -10.0, 0.0, 10.0, 8, 4, 0.0625, "joint",
             [](int column, int row) { return (column + row) % 2 == 0 ? "new slab" : "old slab"; });
  plan.polygon({{20.0, 10.0}, {30.0, 20.0}, {20.0, 30.0}, {10.0, 20.0}}, "repair");
  plan.band({{-45.0, 7.0}, {10.0, 7.0}, {45.0, 7.0}}, 0.5, "paint");
  auto areas_m2 = areas_of_one_layer(plan.mesh("ground"), {-50.0, -50.0}, {50.0, 50.0});
  // The line crosses the eight slabs of one row, alternately new and old, and seven and two half
  // joints.
  const double slab_m2 = 4.9375 * 4.9375;
  const double under_line_m2 = 0.5 * 4.9375;
  EXPECT_NEAR(areas_m2["new slab"], 16 * slab_m2 - 4 * under_line_m2, 1e-6);
  EXPECT_NEAR(areas_m2["old slab"], 16 * slab_m2 - 4 * under_line_m2, 1e-6);
  EXPECT_NEAR(areas_m2["joint"], 800.0 - 32 * slab_m2 - 8 * 0.0625 * 0.5, 1e-6);
  EXPECT_NEAR(areas_m2["repair"], 200.0, 1e-6);
  EXPECT_NEAR(areas_m2["paint"], 90.0 * 0.5, 1e-6);
  EXPECT_NEAR(areas_m2["asphalt"], 3200.0 - 800.0 - 100.0 - 40.0 * 0.5, 1e-6);
  EXPECT_NEAR(areas_m2["grass"], 1e4 - 3200.0 - 100.0 - 10.0 * 0.5, 1e-6);
}

TEST(GroundPlan, rectangles_in_any_order_have_the_areas_of_a_count_of_cells) {
  std::mt19937 random(3);
  constexpr int kSideM = 24;
  constexpr const char* kNames[] = {"a", "b", "c", "d"};
  for (int trial = 0; trial < 30; ++trial) {
    GroundPlan plan;
    plan.rectangle(0.0, 0.0, kSideM, kSideM, kNames[0]);
    std::vector<const char*> cells(std::size_t{kSideM} * kSideM, kNames[0]);
    for (int i = 0; i < 40; ++i) {
      const auto ends = [&] {
        const int from = static_cast<int>(random() % (kSideM - 1));
        return std::pair(
            from, from + 1 + static_cast<int>(random() % static_cast<unsigned>(kSideM - from - 1)));
      };
      const auto [x0, x1] = ends();
      const auto [y0, y1] = ends();
      const char* material = kNames[random() % 4];
      plan.rectangle(x0, y0, x1, y1, material);
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) cells[static_cast<std::size_t>(y * kSideM + x)] = material;
      }
    }
    auto areas_m2 = areas_of_one_layer(plan.mesh("ground"), {0.0, 0.0}, {kSideM, kSideM});
    for (const char* name : kNames) {
      EXPECT_NEAR(areas_m2[name], static_cast<double>(std::ranges::count(cells, name)), 1e-6);
    }
  }
}

TEST(GroundPlan, outlines_that_cross_anywhere_make_one_layer) {
  std::mt19937 random(5);
  const auto between = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random()) / 4294967295.0;
  };
  for (int trial = 0; trial < 30; ++trial) {
    GroundPlan plan;
    plan.rectangle(-30.0, -30.0, 30.0, 30.0, "ground");
    for (int i = 0; i < 25; ++i) {
      std::vector<glm::dvec2> points = {{between(-20.0, 20.0), between(-20.0, 20.0)}};
      double heading = between(0.0, 6.3);
      for (int bend = 0; bend < 4; ++bend) {
        heading += between(-0.9, 0.9);
        points.push_back(points.back() +
                         between(0.2, 2.0) * glm::dvec2(std::cos(heading), std::sin(heading)));
      }
      plan.band(points, between(0.03, 0.9), i % 2 == 0 ? "even" : "odd");
    }
    const auto areas_m2 = areas_of_one_layer(plan.mesh("ground"), {-30.0, -30.0}, {30.0, 30.0});
    EXPECT_EQ(areas_m2.size(), 3U);
  }
}

}  // namespace
}  // namespace emit::scenegen
