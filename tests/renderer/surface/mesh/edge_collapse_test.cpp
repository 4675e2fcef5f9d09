// SPDX-License-Identifier: Apache-2.0
#include "surface/mesh/edge_collapse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace emit::renderer {
namespace {

/// Makes a square sheet of cells of 1 m, in the xy plane.
struct Sheet {
  std::vector<glm::vec3> positions_m;
  std::vector<std::uint32_t> place;
  std::vector<std::uint32_t> indices;
  std::vector<float> value_k;

  explicit Sheet(std::uint32_t cells) {
    for (std::uint32_t y = 0; y <= cells; ++y) {
      for (std::uint32_t x = 0; x <= cells; ++x) {
        place.push_back(static_cast<std::uint32_t>(positions_m.size()));
        positions_m.emplace_back(x, y, 0.0F);
        value_k.push_back(0.0F);
      }
    }
    const auto vertex = [cells](std::uint32_t x, std::uint32_t y) { return y * (cells + 1) + x; };
    for (std::uint32_t y = 0; y < cells; ++y) {
      for (std::uint32_t x = 0; x < cells; ++x) {
        for (const std::uint32_t v : {vertex(x, y), vertex(x + 1, y), vertex(x + 1, y + 1),
                                      vertex(x, y), vertex(x + 1, y + 1), vertex(x, y + 1)}) {
          indices.push_back(v);
        }
      }
    }
  }
  [[nodiscard]] std::vector<std::uint32_t> collapsed(std::size_t triangles) const {
    CollapseInput input;
    input.positions_m = positions_m;
    input.place = place;
    input.indices = indices;
    input.values_k = {value_k};
    input.tolerance_k = 0.1F;
    return collapse_edges(input, triangles);
  }
};

float area_z_m2(const Sheet& sheet, const std::uint32_t* corner) {
  const glm::vec3 a = sheet.positions_m[corner[0]];
  return 0.5F * glm::cross(sheet.positions_m[corner[1]] - a, sheet.positions_m[corner[2]] - a).z;
}

/// Counts edges by how often triangles have them, in either direction.
std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges(
    const std::vector<std::uint32_t>& indices) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> out;
  for (std::size_t i = 0; i < indices.size(); ++i) {
    const std::size_t next = i % 3 == 2 ? i - 2 : i + 1;
    ++out[std::minmax(indices[i], indices[next])];
  }
  return out;
}

TEST(EdgeCollapse, covers_the_same_sheet_once_and_keeps_its_rim) {
  const Sheet sheet(12);
  const std::vector<std::uint32_t> indices = sheet.collapsed(60);
  EXPECT_LE(indices.size() / 3, 61U);
  float area_m2 = 0.0F;
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    const float part_m2 = area_z_m2(sheet, &indices[i]);
    EXPECT_GT(part_m2, 0.0F);  // none turned over
    area_m2 += part_m2;
  }
  EXPECT_NEAR(area_m2, 144.0F, 1e-3F);
  std::size_t rim = 0;
  for (const auto& [edge, count] : edges(indices)) {
    EXPECT_LE(count, 2);
    if (count == 1) ++rim;
  }
  EXPECT_EQ(rim, 48U);  // every cell's edge on the rim is still one
}

TEST(EdgeCollapse, keeps_triangles_where_values_bend) {
  Sheet sheet(20);
  for (std::size_t v = 0; v < sheet.value_k.size(); ++v) {
    // The values have a step across x = 10, as a shadow's edge has.
    sheet.value_k[v] = sheet.positions_m[v].x < 9.5F ? 0.0F : 5.0F;
  }
  const std::vector<std::uint32_t> indices = sheet.collapsed(250);
  ASSERT_LE(indices.size() / 3, 251U);
  std::size_t across = 0;
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    float low_k = 5.0F;
    float high_k = 0.0F;
    float left_m = 20.0F;
    float right_m = 0.0F;
    for (std::size_t k = 0; k < 3; ++k) {
      low_k = std::min(low_k, sheet.value_k[indices[i + k]]);
      high_k = std::max(high_k, sheet.value_k[indices[i + k]]);
      left_m = std::min(left_m, sheet.positions_m[indices[i + k]].x);
      right_m = std::max(right_m, sheet.positions_m[indices[i + k]].x);
    }
    if (low_k == high_k) continue;
    ++across;
    EXPECT_EQ(left_m, 9.0F);
    EXPECT_EQ(right_m, 10.0F);
  }
  EXPECT_GT(across, 0U);
}

TEST(EdgeCollapse, a_crease_stays_a_crease) {
  // The two sheets share a line of places but not of vertices.
  Sheet sheet(8);
  std::vector<std::uint32_t> copy(sheet.positions_m.size());
  for (std::uint32_t v = 0; v < copy.size(); ++v) copy[v] = v;
  const std::size_t before = sheet.positions_m.size();
  for (std::uint32_t v = 0; v < before; ++v) {
    if (sheet.positions_m[v].x != 4.0F) continue;
    copy[v] = static_cast<std::uint32_t>(sheet.positions_m.size());
    sheet.positions_m.push_back(sheet.positions_m[v]);
    sheet.place.push_back(v);
    sheet.value_k.push_back(3.0F);
  }
  for (std::size_t i = 0; i < sheet.indices.size(); i += 3) {
    float middle_m = 0.0F;
    for (std::size_t k = 0; k < 3; ++k)
      middle_m += sheet.positions_m[sheet.indices[i + k]].x / 3.0F;
    if (middle_m < 4.0F) continue;
    for (std::size_t k = 0; k < 3; ++k) sheet.indices[i + k] = copy[sheet.indices[i + k]];
  }
  const std::vector<std::uint32_t> indices = sheet.collapsed(20);
  std::set<std::uint32_t> on_crease;
  for (std::size_t i = 0; i < indices.size(); i += 3) {
    bool left = false;
    bool right = false;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t v = indices[i + k];
      left = left || sheet.positions_m[v].x < 4.0F;
      right = right || sheet.positions_m[v].x > 4.0F;
      if (sheet.positions_m[v].x == 4.0F) on_crease.insert(sheet.place[v]);
    }
    EXPECT_FALSE(left && right);  // no triangle lies across
    for (std::size_t k = 0; k < 3; ++k) {
      const bool copied = indices[i + k] >= before;
      if (copied) {
        EXPECT_TRUE(right);
      }
    }
  }
  EXPECT_LT(on_crease.size(), 9U);  // yet it has fewer places
  EXPECT_GE(on_crease.size(), 2U);
}

}  // namespace
}  // namespace emit::renderer
