// SPDX-License-Identifier: Apache-2.0
#include "draw/triangle_cull.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <random>
#include <set>
#include <vector>

#include "emit/physics/constants.hpp"
#include "renderer/scene/sphere.hpp"

namespace emit::renderer {
namespace {

using Corners = std::array<std::uint32_t, 3>;

constexpr glm::uvec2 kSizePx{64, 48};

/// Matrix of a mesh that is turned and placed at `centre_m` in sensor axes: x right, y down, z
/// along the boresight.
glm::mat4 clip_from_mesh(const glm::dvec3& centre_m, double tan_half_h, double turn_rad) {
  glm::dmat4 clip_from_sensor(0.0);
  clip_from_sensor[0][0] = 1.0 / tan_half_h;
  clip_from_sensor[1][1] = static_cast<double>(kSizePx.x) / (kSizePx.y * tan_half_h);
  clip_from_sensor[3][2] = 0.1;  // depth, which no test reads
  clip_from_sensor[2][3] = 1.0;
  const glm::dmat4 sensor_from_mesh =
      glm::rotate(glm::translate(glm::dmat4(1.0), centre_m), turn_rad, glm::dvec3(0.6, 0.0, 0.8));
  return glm::mat4(clip_from_sensor * sensor_from_mesh);
}

/// Position of a corner in the image, pixels.
glm::dvec2 window_px(const glm::mat4& matrix, const glm::vec3& position_m) {
  const glm::dvec4 clip = glm::dmat4(matrix) * glm::dvec4(position_m, 1.0);
  return (0.5 * glm::dvec2(clip) / clip.w + 0.5) * glm::dvec2(kSizePx);
}

/// Twice the signed area of the triangle a, b, c. Front faces have less than 0.
double around_px2(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (c.x - a.x) * (b.y - a.y);
}

/// Visible parts of a triangle in double precision.
struct Shown {
  Shown(const std::array<glm::dvec2, 3>& px, bool single_sided) {
    const double area_px2 = around_px2(px[0], px[1], px[2]);
    const glm::dvec2 low = glm::min(px[0], glm::min(px[1], px[2]));
    const glm::dvec2 high = glm::max(px[0], glm::max(px[1], px[2]));
    back = single_sided && area_px2 > 0.0;
    for (int y = std::max(0, static_cast<int>(low.y) - 1); y <= static_cast<int>(high.y) + 1; ++y) {
      for (int x = std::max(0, static_cast<int>(low.x) - 1); x <= static_cast<int>(high.x) + 1;
           ++x) {
        const glm::dvec2 middle_px(x + 0.5, y + 0.5);
        if (x < 0 || x >= static_cast<int>(kSizePx.x) || y >= static_cast<int>(kSizePx.y)) continue;
        if (glm::all(glm::lessThanEqual(low, middle_px)) &&
            glm::all(glm::lessThanEqual(middle_px, high))) {
          columns.insert(x);
          rows.insert(y);
        }
        bool inside = area_px2 != 0.0;
        for (std::size_t k = 0; k < 3; ++k) {
          inside &= around_px2(px[k], px[(k + 1) % 3], middle_px) * area_px2 >= 0.0;
        }
        holds_middle |= inside;
      }
    }
  }
  bool back = false;
  bool holds_middle = false;
  std::set<int> columns;  ///< columns of pixels whose centres lie in the triangle's box
  std::set<int> rows;     ///< rows of pixels whose centres lie in the triangle's box
};

/// True when a triangle shows, either with its exact corners or with corners rounded to 1/256 pixel
/// as rasterisers do it.
bool may_show(const std::array<glm::dvec2, 3>& px, bool single_sided) {
  std::array<glm::dvec2, 3> rounded_px;
  for (std::size_t k = 0; k < 3; ++k) rounded_px[k] = glm::round(256.0 * px[k]) / 256.0;
  return std::ranges::any_of(std::array{px, rounded_px}, [&](const auto& corners_px) {
    const Shown shown(corners_px, single_sided);
    return shown.holds_middle && !shown.back;
  });
}

/// Result of culling all clusters under one matrix. With `apart` each cluster is a part of its own.
struct Culled {
  Culled(TriangleCull& cull, const scene::Mesh& mesh, const std::vector<scene::Cluster>& clusters,
         const glm::mat4& matrix, bool single_sided, bool apart = true) {
    cull.begin(kSizePx);
    for (std::uint32_t c = 0; c < clusters.size(); ++c) {
      EXPECT_TRUE(cull.take(clusters[c], c, matrix, single_sided));
      if (apart && !cull.close(c)) ADD_FAILURE() << "nothing in part " << c;
    }
    EXPECT_EQ(cull.close(0), !apart);
    cull.run();
    EXPECT_EQ(cull.parts().size(), apart ? clusters.size() : 1);
    std::uint32_t next = 0;
    for (std::uint32_t p = 0; p < cull.parts().size(); ++p) {
      const TriangleCull::Part& part = cull.parts()[p];
      EXPECT_EQ(part.range, p);
      EXPECT_EQ(part.first, next);  // parts follow each other without gaps
      next += part.count;
      for (std::uint32_t i = part.first; i < part.first + part.count; i += 3) {
        const auto left = cull.indices().subspan(i, 3);
        EXPECT_TRUE(kept.insert({left[0], left[1], left[2]}).second) << "drawn twice";
      }
    }
    EXPECT_EQ(cull.indices().size(), next);
    for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
      taken.push_back({mesh.indices[i], mesh.indices[i + 1], mesh.indices[i + 2]});
    }
  }
  std::vector<Corners> taken;
  std::set<Corners> kept;
};

class TriangleCullTest : public testing::Test {
 protected:
  TriangleCullTest() : clusters_(scene::cut_into_clusters(mesh_.positions_m, mesh_.indices)) {
    cull_.add(mesh_, clusters_, 0);
    cull_.finish();
  }
  scene::Mesh mesh_ = scene::sphere(60, false);
  std::vector<scene::Cluster> clusters_;
  TriangleCull cull_;
};

TEST_F(TriangleCullTest, WhatItLeavesOutHoldsNoPixelAndWhatItKeepsIsLittleMore) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  std::size_t taken = 0;
  std::size_t kept = 0;
  std::size_t kept_for_nothing = 0;
  for (int round = 0; round < 400; ++round) {
    const bool single_sided = round % 3 != 2;
    // Let triangles be 1 to 20 pixels large. Many reach over the edge of the image or lie far
    // beyond it.
    const double tan_half_h = 0.3 * std::pow(0.03, 0.5 + 0.5 * unit(random));
    const glm::dvec2 place(1.3 * unit(random), unit(random));
    const double distance_m = 5.0 + unit(random);
    const glm::dvec3 centre_m(distance_m * tan_half_h * place + 0.8 * glm::dvec2(place.y, place.x),
                              distance_m);
    const glm::mat4 matrix = clip_from_mesh(centre_m, tan_half_h, 3.0 * unit(random));
    const Culled culled(cull_, mesh_, clusters_, matrix, single_sided);
    for (const Corners& corners : culled.taken) {
      std::array<glm::dvec2, 3> px;
      for (std::size_t k = 0; k < 3; ++k) px[k] = window_px(matrix, mesh_.positions_m[corners[k]]);
      const Shown shown(px, single_sided);
      const bool stays = culled.kept.contains(corners);
      ++taken;
      kept += stays ? 1 : 0;
      ASSERT_TRUE(stays || !may_show(px, single_sided))
          << "round " << round << ": a front over a pixel's middle was left out";
      // Count kept triangles that only the margins keep.
      kept_for_nothing +=
          stays && (shown.back || (std::min(shown.columns.size(), shown.rows.size()) <= 2 &&
                                   !shown.holds_middle));
    }
  }
  EXPECT_GT(taken, 100000U);
  EXPECT_LT(kept, taken / 2);
  EXPECT_LT(kept_for_nothing, kept / 6);
}

TEST(TriangleCull, KeepsWhatShowsHoweverThinItIsOrFarOverTheRim) {
  // Stack triangles on a plane, 2 m wide, that faces the camera.
  std::mt19937 random(6);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  scene::Mesh mesh;
  constexpr std::uint32_t kPoints = 40;
  for (std::uint32_t a = 0; a < kPoints; ++a) {
    mesh.positions_m.emplace_back(unit(random), unit(random), 0.0F);
    for (std::uint32_t b = 0; b < a; ++b) {
      for (std::uint32_t c = 0; c < b; ++c) mesh.indices.insert(mesh.indices.end(), {a, b, c});
    }
  }
  const std::vector<scene::Cluster> clusters =
      scene::cut_into_clusters(mesh.positions_m, mesh.indices);
  TriangleCull cull;
  cull.add(mesh, clusters, 0);
  cull.finish();
  // Show the middle half of the plane, then all of it at a width of eight and of three pixels.
  for (const double tan_half_h : {0.125, 2.0, 6.0}) {
    for (const bool single_sided : {true, false}) {
      const glm::mat4 matrix = clip_from_mesh({0.1, 0.0, 4.0}, tan_half_h, 0.0);
      const Culled culled(cull, mesh, clusters, matrix, single_sided);
      std::size_t shown_count = 0;
      for (const Corners& corners : culled.taken) {
        std::array<glm::dvec2, 3> px;
        for (std::size_t k = 0; k < 3; ++k) px[k] = window_px(matrix, mesh.positions_m[corners[k]]);
        const Shown shown(px, single_sided);
        ASSERT_TRUE(culled.kept.contains(corners) || !may_show(px, single_sided));
        shown_count += !shown.back && shown.holds_middle ? 1U : 0U;
      }
      EXPECT_GT(shown_count, culled.taken.size() / 20) << tan_half_h;
      EXPECT_LT(culled.kept.size(), culled.taken.size()) << tan_half_h;
    }
  }
}

TEST(TriangleCull, KeepsSliversThatHaveNoAreaInSinglePrecision) {
  // Put needles through centres of pixels, a quarter of a metre wide, in a plane that faces the
  // camera.
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  scene::Mesh mesh;
  constexpr double kPixelM = 0.25;
  for (std::uint32_t i = 0; i < 3 * 12000; i += 3) {
    const glm::dvec2 middle_px(std::floor(60.0 * unit(random)) + 2.5,
                               std::floor(44.0 * unit(random)) + 2.5);
    const double way_rad = 2.0 * physics::kPi * unit(random);
    const glm::dvec2 along(std::cos(way_rad), std::sin(way_rad));
    const glm::dvec2 aside =
        glm::dvec2(-along.y, along.x) * std::pow(10.0, -3.0 - 3.0 * unit(random));
    const glm::dvec2 tip_px = middle_px + (0.2 + unit(random)) * along;
    const glm::dvec2 end_px = middle_px - (0.2 + unit(random)) * along;
    for (const glm::dvec2& at_px : {tip_px, end_px + aside, end_px - unit(random) * aside}) {
      mesh.positions_m.emplace_back(glm::vec2(kPixelM * (at_px - 0.5 * glm::dvec2(kSizePx))), 0.0F);
    }
    mesh.indices.insert(mesh.indices.end(), {i, i + 1, i + 2});
  }
  const std::vector<scene::Cluster> clusters =
      scene::cut_into_clusters(mesh.positions_m, mesh.indices);
  TriangleCull cull;
  cull.add(mesh, clusters, 0);
  cull.finish();
  const glm::mat4 matrix = clip_from_mesh({0.0, 0.0, 4.0}, 32.0 * kPixelM / 4.0, 0.0);
  const Culled culled(cull, mesh, clusters, matrix, false);
  std::size_t shown = 0;
  for (const Corners& corners : culled.taken) {
    std::array<glm::dvec2, 3> px;
    for (std::size_t k = 0; k < 3; ++k) px[k] = window_px(matrix, mesh.positions_m[corners[k]]);
    ASSERT_TRUE(culled.kept.contains(corners) || !may_show(px, false));
    shown += may_show(px, false) ? 1U : 0U;
  }
  EXPECT_GT(shown, 2000U);
}

TEST_F(TriangleCullTest, KeepsWholeWhatReachesBehindTheCamera) {
  const glm::mat4 inside = clip_from_mesh({0.0, 0.0, 0.0}, 1.0, 0.0);
  const Culled around(cull_, mesh_, clusters_, inside, false);
  std::size_t behind = 0;
  for (const Corners& corners : around.taken) {
    const bool is_behind = std::ranges::any_of(corners, [&](std::uint32_t v) {
      return (inside * glm::vec4(mesh_.positions_m[v], 1.0F)).w <= 0.0F;
    });
    behind += is_behind ? 1U : 0U;
    EXPECT_TRUE(!is_behind || around.kept.contains(corners));
  }
  EXPECT_GT(behind, around.taken.size() / 3);
}

TEST_F(TriangleCullTest, KeepsLargeTrianglesOfThePictureAndNoneBesideIt) {
  // Come so near that each triangle covers hundreds of pixels.
  const glm::mat4 matrix = clip_from_mesh({0.0, 0.0, 1.5}, 0.002, 0.0);
  const Culled near(cull_, mesh_, clusters_, matrix, true);
  EXPECT_GT(near.kept.size(), 0U);
  for (const Corners& corners : near.taken) {
    std::array<glm::dvec2, 3> px;
    for (std::size_t k = 0; k < 3; ++k) px[k] = window_px(matrix, mesh_.positions_m[corners[k]]);
    const Shown shown(px, true);
    EXPECT_TRUE(near.kept.contains(corners) || !may_show(px, true));
    EXPECT_TRUE(!near.kept.contains(corners) || !(shown.columns.empty() || shown.rows.empty()));
  }
  EXPECT_LT(near.kept.size(), near.taken.size() / 20);
}

TEST_F(TriangleCullTest, EveryPieceOfAPartHasSomeFromAllOfIt) {
  const glm::mat4 matrix = clip_from_mesh({0.0, 0.0, 40.0}, 0.04, 0.0);
  const Culled culled(cull_, mesh_, clusters_, matrix, false, false);
  const auto indices = cull_.indices();
  EXPECT_EQ(indices.size(), 3 * culled.kept.size());
  // Expect that each quarter of the drawn triangles reaches all quarters of the image.
  constexpr std::size_t kPieces = 4;
  for (std::size_t piece = 0; piece < kPieces; ++piece) {
    std::array<std::size_t, 4> in_quarter{};
    const std::size_t first = indices.size() / 3 * piece / kPieces * 3;
    const std::size_t last = indices.size() / 3 * (piece + 1) / kPieces * 3;
    for (std::size_t i = first; i < last; i += 3) {
      const glm::dvec2 px = window_px(matrix, mesh_.positions_m[indices[i]]);
      ++in_quarter[(px.x > 0.5 * kSizePx.x ? 1U : 0U) + (px.y > 0.5 * kSizePx.y ? 2U : 0U)];
    }
    for (const std::size_t count : in_quarter) EXPECT_GT(count, (last - first) / 3 / 12);
  }
}

TEST_F(TriangleCullTest, TakesNoMoreThanAFrameHasMemoryFor) {
  const glm::mat4 matrix = clip_from_mesh({0.0, 0.0, 40.0}, 0.3, 0.0);
  cull_.begin(kSizePx);
  std::size_t indices = 0;
  bool full = false;
  for (std::uint32_t i = 0; !full && i < 1'000'000; ++i) {
    const std::uint32_t c = i % static_cast<std::uint32_t>(clusters_.size());
    full = !cull_.take(clusters_[c], c, matrix, true);
    if (!full) indices += clusters_[c].index_count;
  }
  EXPECT_TRUE(full);
  EXPECT_GT(indices, TriangleCull::kMaxIndices - 3 * scene::kClusterTriangles);
  EXPECT_LE(indices, TriangleCull::kMaxIndices);
  EXPECT_TRUE(cull_.close(0));
  cull_.run();
  EXPECT_GT(cull_.indices().size(), 0U);
  EXPECT_LT(cull_.indices().size(), indices / 2);
}

}  // namespace
}  // namespace emit::renderer
