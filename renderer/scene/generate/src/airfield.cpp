// SPDX-License-Identifier: Apache-2.0
#include "airfield.hpp"

#include <cmath>

#include "emit/physics/constants.hpp"
#include "random.hpp"

namespace emit::scenegen {
namespace {

void add_tree(MeshBuilder& builder, Random& random, double x, double y) {
  const double height = random.between(6.0, 14.0);
  const double radius = height * random.between(0.18, 0.28);
  const double trunk = 0.22 * height;
  builder.material("wood").tube({x, y, 0.0}, {x, y, trunk + 0.3}, 0.25, 0.2, 5, false, false);
  // A crown of three stacked truncated cones looks like a tree and costs 42 triangles.
  builder.material("foliage");
  const double turn = random.between(0.0, 2.0);
  builder.origin({x, y, 0.0}, turn);
  builder.tube({0, 0, trunk}, {0, 0, 0.55 * height}, 0.55 * radius, radius, 7, true, false);
  builder.tube({0, 0, 0.55 * height}, {0, 0, 0.85 * height}, radius, 0.6 * radius, 7, false, false);
  builder.tube({0, 0, 0.85 * height}, {0, 0, height}, 0.6 * radius, 0.0, 7, false, false);
  builder.origin({});
}

/// Adds a broad-leaved tree: two upright cards and a level one, which foliage cuts out.
void add_cut_out_tree(MeshBuilder& builder, Random& random, double x, double y) {
  const double height = random.between(9.0, 15.0);
  const double half = height * random.between(0.3, 0.38);
  const double bottom = 0.16 * height;
  builder.origin({x, y, 0.0}, random.between(0.0, physics::kPi));
  builder.material("wood").tube({0, 0, 0}, {0, 0, 0.45 * height}, 0.028 * height, 0.016 * height, 5,
                                false, false);
  builder.material("foliage", true);
  builder.foliage_card({-half, 0, bottom}, {half, 0, bottom}, {half, 0, height},
                       {-half, 0, height});
  builder.foliage_card({0, -half, bottom}, {0, half, bottom}, {0, half, height},
                       {0, -half, height});
  const double middle = 0.55 * height;
  const double level = 0.7 * half;  // a larger one would stand out of the crown as a brim
  builder.foliage_card({-level, -level, middle}, {level, -level, middle}, {level, level, middle},
                       {-level, level, middle});
  builder.origin({});
}

void add_fence(MeshBuilder& builder) {
  constexpr double kHalfM = 490.0;
  constexpr double kSpacingM = 10.0;
  builder.material("steel_sheet");
  const auto post = [&builder](double x, double y) {
    builder.tube({x, y, 0.0}, {x, y, 2.4}, 0.06, 0.06, 4, false, true);
  };
  for (double along = -kHalfM; along < kHalfM; along += kSpacingM) {
    post(along, -kHalfM);
    post(kHalfM, along);
    post(-along, kHalfM);
    post(-kHalfM, -along);
  }
  for (const double z : {0.3, 1.3, 2.3}) {
    const glm::dvec3 corners[] = {
        {-kHalfM, -kHalfM, z}, {kHalfM, -kHalfM, z}, {kHalfM, kHalfM, z}, {-kHalfM, kHalfM, z}};
    for (int side = 0; side < 4; ++side) {
      builder.tube(corners[side], corners[(side + 1) % 4], 0.03, 0.03, 4, false, false);
    }
  }
}

}  // namespace

void add_trees_and_fence(Scene& scene, std::uint32_t seed) {
  Random random(seed);
  MeshBuilder fence("fence");
  add_fence(fence);
  scene.place(scene.add_mesh(fence.take()), "fence");
  MeshBuilder trees("trees");
  for (int i = 0; i < 150; ++i) {  // a wood in the north
    add_tree(trees, random, random.between(-480.0, 480.0), random.between(300.0, 480.0));
  }
  for (int i = 0; i < 60; ++i) {  // an avenue outside the southern fence
    const double x = -590.0 + 20.0 * i + random.between(-3.0, 3.0);
    const double y = -520.0 + random.between(-6.0, 6.0);
    // The part that an approach from the south passes over has leaves and gaps.
    if (std::abs(x) < 330.0) {
      add_cut_out_tree(trees, random, x, y);
    } else {
      add_tree(trees, random, x, y);
    }
  }
  for (int i = 0; i < 44; ++i) {  // a line of trees along the fields in the north
    add_tree(trees, random, -620.0 + 28.0 * i + random.between(-9.0, 9.0),
             690.0 + random.between(-7.0, 7.0));
  }
  for (int i = 0; i < 24; ++i) {  // single trees between the buildings
    add_tree(trees, random, random.between(-460.0, -330.0), random.between(20.0, 180.0));
  }
  scene.place(scene.add_mesh(trees.take()), "trees");
}

}  // namespace emit::scenegen
